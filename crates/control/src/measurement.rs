//! Measurement: input of a controller from a machine in a control period.

use hydroboom_math::{Real, record};

/// Number of axes of a machine; an axis is a cylinder with its pump.
pub const AXES: usize = 1;

record! {
    /// Measured signals of one axis, or a property of each of them. Pressures are gauge.
    pub struct AxisSignals<T> {
        /// Piston position
        #[unit = "m"]
        pub stroke: T,
        /// Gauge pressure on pump side A
        #[unit = "Pa"]
        pub pressure_pump_a: T,
        /// Gauge pressure on the piston side
        #[unit = "Pa"]
        pub pressure_a: T,
        /// Gauge pressure on the rod side
        #[unit = "Pa"]
        pub pressure_b: T,
        /// Gauge pressure on pump side B
        #[unit = "Pa"]
        pub pressure_pump_b: T,
        /// Gauge pressure in the accumulator
        #[unit = "Pa"]
        pub pressure_accumulator: T,
        /// Motor speed, from the drive's encoder
        #[unit = "rev/s"]
        pub motor_speed: T,
    }
}

impl<T: Real> AxisSignals<T> {
    /// Load pressure p_L = p_A − (A_r/A_p) p_B \[Pa\]. `area_ratio` is A_r/A_p \[1\].
    #[inline(always)]
    pub fn load_pressure(&self, area_ratio: T) -> T {
        self.pressure_a - area_ratio * self.pressure_b
    }
}

/// Validity of a measured signal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Validity {
    /// Valid: measured in this control period, up to the delay of the fieldbus.
    #[default]
    Good,
    /// Not measured, or NaN.
    Absent,
    /// Outside the sensor's range.
    OutOfRange,
    /// Older than the age up to which a controller may use it.
    Stale,
}

/// Measured signals of one axis with their validity.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AxisMeasurement {
    /// The signals, in SI units, speeds in rev/s.
    pub signals: AxisSignals<f64>,
    /// Validity of each signal.
    pub validity: AxisSignals<Validity>,
}

impl AxisMeasurement {
    /// Signals that are valid if they are finite, else absent.
    pub fn new(signals: AxisSignals<f64>) -> Self {
        let validity = signals.map(|value| match value.is_finite() {
            true => Validity::Good,
            false => Validity::Absent,
        });
        Self { signals, validity }
    }

    /// Signals with the validity reported by the machine. A signal that is absent or out of range becomes NaN, so
    /// that its value is not used.
    pub fn reported(signals: AxisSignals<f64>, validity: AxisSignals<Validity>) -> Self {
        let mut values = signals.to_array();
        for (value, validity) in values.iter_mut().zip(validity.to_array()) {
            if matches!(validity, Validity::Absent | Validity::OutOfRange) {
                *value = f64::NAN;
            }
        }
        Self { signals: AxisSignals::from_array(values), validity }
    }

    /// Marks valid signals outside their range as [`Validity::OutOfRange`].
    ///
    /// A range is (lowest, highest), both included, in the signal's unit. Any other validity stays, and so do the
    /// values.
    #[must_use]
    pub fn within(mut self, ranges: &AxisSignals<(f64, f64)>) -> Self {
        let (values, ranges) = (self.signals.to_array(), ranges.to_array());
        let mut validity = self.validity.to_array();
        for ((validity, value), (lowest, highest)) in validity.iter_mut().zip(values).zip(ranges) {
            if *validity == Validity::Good && !(lowest..=highest).contains(&value) {
                *validity = Validity::OutOfRange;
            }
        }
        self.validity = AxisSignals::from_array(validity);
        self
    }

    /// Marks valid signals as [`Validity::Stale`].
    #[must_use]
    pub fn stale(mut self) -> Self {
        self.validity = self.validity.map(|validity| match validity {
            Validity::Good => Validity::Stale,
            other => other,
        });
        self
    }
}

/// Measurement of all axes, sampled at one time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measurement {
    /// Sequence number, which increases by one per measurement; 0 before the first.
    pub number: u64,
    /// Sampling time by the machine's clock \[s\].
    pub time: f64,
    /// Measurement of each axis.
    pub axes: [AxisMeasurement; AXES],
}

impl Measurement {
    /// Measurement from signals, valid if they are finite, with sequence number and sampling time \[s\].
    pub fn new(number: u64, time: f64, signals: [AxisSignals<f64>; AXES]) -> Self {
        Self { number, time, axes: signals.map(AxisMeasurement::new) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nan_is_absent_and_an_impossible_value_is_out_of_range() {
        let signals = AxisSignals {
            stroke: 0.7,
            pressure_a: f64::NAN,
            motor_speed: 0.25,
            ..Default::default()
        };
        let ranges = AxisSignals::from_array([(0.0, 0.5); 7].map(|(a, b)| (a, b)));
        let measured = AxisMeasurement::new(signals).within(&ranges);
        assert_eq!(measured.validity.stroke, Validity::OutOfRange);
        assert_eq!(measured.validity.pressure_a, Validity::Absent);
        assert_eq!(measured.validity.motor_speed, Validity::Good);
        // a value that the machine marks as out of range stays so, and a stale one keeps its value
        let reported = AxisMeasurement::reported(signals, measured.validity);
        assert!(reported.signals.stroke.is_nan() && reported.signals.pressure_a.is_nan());
        let old = AxisMeasurement::reported(signals, measured.stale().validity).signals;
        assert_eq!(old.motor_speed, 0.25);
        // old signals do not become better by it
        let old = measured.stale().validity;
        assert_eq!((old.stroke, old.pressure_a), (Validity::OutOfRange, Validity::Absent));
        assert_eq!(old.motor_speed, Validity::Stale);
    }

    #[test]
    fn the_rod_side_pressure_is_weighted_by_its_area() {
        let signals = AxisSignals { pressure_a: 70e5, pressure_b: 4e5, ..Default::default() };
        assert_eq!(signals.load_pressure(0.5), 68e5);
    }
}
