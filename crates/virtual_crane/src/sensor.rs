//! Sensor model: bandwidth, offset, noise, range and resolution.

use crate::lag::Lag;
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

/// Properties of a sensor, all in the unit of the measured quantity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SensorData {
    /// Constant offset.
    pub error: f64,
    /// RMS noise.
    pub noise: f64,
    /// Resolution (quantisation step); zero for none.
    pub resolution: f64,
    /// Smallest and largest value of the measuring range.
    pub range: [f64; 2],
}

/// A sensor with its state.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sensor {
    data: SensorData,
    lag: Lag,
}

impl Sensor {
    /// A sensor with a bandwidth \[Hz\] (zero for no lag), updated in steps of `step` \[s\], in steady state at
    /// `value`.
    pub(crate) fn new(data: SensorData, bandwidth: f64, step: f64, value: f64) -> Self {
        let time_constant = match bandwidth > 0.0 {
            true => 1.0 / (std::f64::consts::TAU * bandwidth),
            false => 0.0,
        };
        Self { data, lag: Lag::new(time_constant, step, value) }
    }

    /// Updates the lag with the quantity's value after a step.
    pub(crate) fn follow(&mut self, value: f64) {
        self.lag.advance(value);
    }

    /// Current reading.
    pub(crate) fn sample(&self, random: &mut impl Rng) -> f64 {
        let d = &self.data;
        let mut value = self.lag.output() + d.error;
        if d.noise > 0.0 {
            let deviate: f64 = StandardNormal.sample(random);
            value += d.noise * deviate;
        }
        let value = value.clamp(d.range[0], d.range[1]);
        match d.resolution > 0.0 {
            true => (value / d.resolution).round() * d.resolution,
            false => value,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_pcg::Pcg64Mcg;

    const EVERYTHING: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];

    #[test]
    fn noise_has_the_stated_size_and_no_bias() {
        let data = SensorData { error: 0.3, noise: 0.05, resolution: 0.0, range: EVERYTHING };
        let sensor = Sensor::new(data, 0.0, 1e-3, 7.0);
        let mut random = Pcg64Mcg::seed_from_u64(1);
        let count = 40_000;
        let errors: Vec<f64> = (0..count).map(|_| sensor.sample(&mut random) - 7.3).collect();
        let mean = errors.iter().sum::<f64>() / f64::from(count);
        let rms = (errors.iter().map(|e| e * e).sum::<f64>() / f64::from(count)).sqrt();
        // five standard deviations of the mean and RMS of this number of samples
        assert!(mean.abs() < 5.0 * 0.05 / 200.0, "{mean}");
        assert!((rms / 0.05 - 1.0).abs() < 5.0 / (2.0 * 40_000.0_f64).sqrt(), "{rms}");
        // white noise: successive errors are uncorrelated
        let products: f64 = errors.windows(2).map(|pair| pair[0] * pair[1]).sum();
        assert!((products / f64::from(count)).abs() < 5.0 * 0.05 * 0.05 / 200.0);
    }

    #[test]
    fn readings_stay_in_range_and_on_the_grid() {
        let data = SensorData { error: 0.0, noise: 1.0, resolution: 0.25, range: [0.0, 10.0] };
        let sensor = Sensor::new(data, 0.0, 1e-3, 9.5);
        let mut random = Pcg64Mcg::seed_from_u64(2);
        for _ in 0..1000 {
            let value = sensor.sample(&mut random);
            assert!((0.0..=10.0).contains(&value));
            assert_eq!((value * 4.0).fract(), 0.0);
        }
    }

    #[test]
    fn a_perfect_sensor_reads_the_quantity_itself() {
        let data = SensorData { error: 0.0, noise: 0.0, resolution: 0.0, range: EVERYTHING };
        let mut sensor = Sensor::new(data, 0.0, 1e-3, 0.0);
        sensor.follow(0.123_456_789);
        assert_eq!(sensor.sample(&mut Pcg64Mcg::seed_from_u64(3)), 0.123_456_789);
    }
}
