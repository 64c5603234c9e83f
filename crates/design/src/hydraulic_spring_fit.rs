//! The crane at a piston position as a mass on a hydraulic spring, fitted to its exact linearisation.

use crate::{DesignError, LinearisedPlant};
use nalgebra::{Complex, DMatrix, DVector};
use std::f64::consts::TAU;

/// Frequencies at which responses are matched, over the natural frequency of the load on the oil.
const FREQUENCIES: [f64; 8] = [0.1, 0.2, 0.35, 0.5, 0.7, 0.85, 1.15, 1.3];

/// Lowest and highest natural frequency that is guessed \[Hz\], and guesses; the fit's is near a guess within this
/// factor.
const GUESSES: [f64; 2] = [0.05, 25.0];
const GUESSED: u32 = 25;
const NEAR: f64 = 1.5;

/// Mass on a hydraulic spring, linearised in piston position x, velocity v, load pressure p and motor speed n:
/// `v' = a_x x + a_v v + a_p p`, `p' = c_x x + c_v v + c_p p + b n`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HydraulicSpring {
    /// Acceleration per position, a_x \[1/s²\].
    pub acceleration_by_position: f64,
    /// Acceleration per velocity, a_v \[1/s\].
    pub acceleration_by_velocity: f64,
    /// Acceleration per load pressure, a_p \[m/(s² Pa)\].
    pub acceleration_by_pressure: f64,
    /// Pressure rate per position, c_x \[Pa/(s m)\].
    pub pressure_by_position: f64,
    /// Pressure rate per velocity, c_v \[Pa/m\].
    pub pressure_by_velocity: f64,
    /// Pressure rate per load pressure, c_p \[1/s\].
    pub pressure_by_pressure: f64,
    /// Pressure rate per motor speed, b \[Pa/rev\].
    pub pressure_by_speed: f64,
}

impl HydraulicSpring {
    /// Natural angular frequency of the mass on the oil's spring, √(−a_p c_v) \[rad/s\]. NaN if a_p and c_v have the
    /// same sign.
    pub fn natural_frequency(&self) -> f64 {
        (-self.acceleration_by_pressure * self.pressure_by_velocity).sqrt()
    }
}

/// Load at the end of an elastic boom: in the piston's travel it is at x − γ p.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ElasticLoad {
    /// Acceleration of the load per load pressure, a_p, in the piston's travel \[m/(s² Pa)\].
    pub acceleration_by_pressure: f64,
    /// Compliance of the boom, γ \[m/Pa\].
    pub compliance: f64,
}

impl ElasticLoad {
    /// Natural angular frequency of the load on oil and boom in series, (−1/(a_p c_v) + γ/a_p)^(−1/2) \[rad/s\]: the
    /// squares of their periods add up. c_v is that of the `spring`.
    pub fn natural_frequency(&self, spring: &HydraulicSpring) -> f64 {
        let on_oil = -1.0 / (self.acceleration_by_pressure * spring.pressure_by_velocity);
        (on_oil + self.compliance / self.acceleration_by_pressure).powf(-0.5)
    }
}

/// Fits hydraulic spring and elastic load to a crane, by least squares over its exact frequency responses to the
/// motor speed.
///
/// `s v = a_x x + a_v v + a_p p` holds for the hydraulic spring with a rigid boom; the elastic load has another a_p
/// and a term `γ s² p`. A fitted γ that is not positive stands for a rigid boom.
///
/// The frequencies of the fit belong to the natural frequency, which is its result, so it starts from a guess. The
/// first guess is the crane's load mode. If soft oil overdamps that mode, the oscillation found is the boom's.
///
/// # Errors
///
/// [`DesignError::NoMode`] if no hydraulic spring fits the crane's responses, or they are not finite.
pub fn hydraulic_spring(
    crane: &LinearisedPlant,
) -> Result<(HydraulicSpring, ElasticLoad), DesignError> {
    let [low, high] = GUESSES;
    let guesses =
        (0..GUESSED).map(|k| low * (high / low).powf(f64::from(k) / f64::from(GUESSED - 1)));
    let slowest = crane.slowest_mode().map(|mode| mode.frequency_hz);
    for guess in slowest.into_iter().chain(guesses) {
        if let Some((spring, load)) = fitted(crane, guess)?
            && is_near(load.natural_frequency(&spring), TAU * guess)
        {
            return Ok((spring, load));
        }
    }
    Err(crane.none("no mass on a hydraulic spring has its response"))
}

/// Whether natural frequencies are those of one mode.
pub(crate) fn is_near(one: f64, other: f64) -> bool {
    (1.0 / NEAR..NEAR).contains(&(one / other))
}

/// The fit about a natural frequency \[Hz\]; none where it is no mass on a spring that the pump drives.
fn fitted(
    crane: &LinearisedPlant,
    natural_frequency: f64,
) -> Result<Option<(HydraulicSpring, ElasticLoad)>, DesignError> {
    let rows = 2 * FREQUENCIES.len();
    let (mut rigid, mut acceleration) = (DMatrix::zeros(rows, 3), DVector::zeros(rows));
    let mut elastic = DMatrix::zeros(rows, 4);
    let (mut oil, mut pressure_rate) = (DMatrix::zeros(rows, 4), DVector::zeros(rows));
    for (k, share) in FREQUENCIES.into_iter().enumerate() {
        let frequency = share * natural_frequency;
        let s = Complex::new(0.0, TAU * frequency);
        let responses = crane.responses(frequency)?;
        let (x, v, p) = (responses.position, responses.velocity, responses.pressure);
        // each frequency has the same weight, for any magnitude of the responses
        let (sv, sp) = (1.0 / (s * v).norm(), 1.0 / (s * p).norm());
        for (part, i) in [2 * k, 2 * k + 1].into_iter().enumerate() {
            let of = |z: Complex<f64>| if part == 0 { z.re } else { z.im };
            for (column, z) in [x, v, p].into_iter().enumerate() {
                rigid[(i, column)] = of(z) * sv;
                elastic[(i, column)] = of(z) * sv;
                oil[(i, column)] = of(z) * sp;
            }
            elastic[(i, 3)] = of(s * s * p) * sv;
            oil[(i, 3)] = if part == 0 { sp } else { 0.0 };
            acceleration[i] = of(s * v) * sv;
            pressure_rate[i] = of(s * p) * sp;
        }
    }
    let elastic = solved(elastic, &acceleration);
    let rigid = solved(rigid, &acceleration);
    let (Some(elastic), Some(rigid), Some(oil)) = (elastic, rigid, solved(oil, &pressure_rate))
    else {
        return Ok(None);
    };
    let ([_, _, acceleration_by_pressure, compliance], [a_x, a_v, a_p]) = (elastic, rigid);
    let [c_x, c_v, c_p, b] = oil;
    let is_finite = [a_x, a_v, a_p, c_x, c_v, c_p, b].into_iter().all(f64::is_finite);
    if !(is_finite && a_p > 0.0 && b > 0.0 && c_v < 0.0) {
        return Ok(None);
    }
    let spring = HydraulicSpring {
        acceleration_by_position: a_x,
        acceleration_by_velocity: a_v,
        acceleration_by_pressure: a_p,
        pressure_by_position: c_x,
        pressure_by_velocity: c_v,
        pressure_by_pressure: c_p,
        pressure_by_speed: b,
    };
    let load = match compliance > 0.0 && acceleration_by_pressure > 0.0 {
        true => ElasticLoad { acceleration_by_pressure, compliance },
        false => ElasticLoad { acceleration_by_pressure: a_p, compliance: 0.0 },
    };
    Ok(Some((spring, load)))
}

/// Least squares with columns of like size.
fn solved<const N: usize>(mut left: DMatrix<f64>, right: &DVector<f64>) -> Option<[f64; N]> {
    let scale: Vec<f64> = left.column_iter().map(|c| c.norm().max(f64::MIN_POSITIVE)).collect();
    for (mut column, scale) in left.column_iter_mut().zip(&scale) {
        column /= *scale;
    }
    let found = left.svd(true, true).solve(right, 1e-12).ok()?;
    Some(std::array::from_fn(|k| found[k] / scale[k]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use hydroboom_description::Description;

    /// With the piston at rest the load oscillates on the compliance of the boom. Oil and boom are
    /// springs in series: the squares of their periods add up to that of the linearised crane.
    #[test]
    fn oil_and_boom_are_springs_in_series() {
        let description = Description::uia_single_boom().unwrap();
        let crane = LinearisedPlant::new(&description, 0.2).unwrap();
        let (spring, load) = hydraulic_spring(&crane).unwrap();
        let both = load.natural_frequency(&spring) / TAU;
        let exact = crane.load_mode().unwrap().frequency_hz;
        assert!((both / exact - 1.0).abs() < 0.02, "{both} Hz for {exact} Hz");
    }

    /// Viscous friction that prevents any oscillation of the load on its oil does not change mass and
    /// spring.
    #[test]
    fn the_spring_of_an_overdamped_load_is_fitted_too() {
        let mut crane = Description::uia_single_boom().unwrap();
        let of = |crane: &Description| LinearisedPlant::new(crane, 0.25).unwrap();
        let (spring, load) = hydraulic_spring(&of(&crane)).unwrap();
        crane.numbers.viscous *= 300.0;
        assert!(of(&crane).load_mode().is_err());
        let (damped, damped_load) = hydraulic_spring(&of(&crane)).unwrap();
        let (with, without) =
            (damped_load.natural_frequency(&damped), load.natural_frequency(&spring));
        assert!((with / without - 1.0).abs() < 0.05, "{with} and {without} rad/s");
        let frequency = TAU * of(&crane).load_frequency().unwrap();
        assert!((frequency / without - 1.0).abs() < 0.05, "{frequency} and {without} rad/s");
    }

    /// Friction laws with the same slope during sliding give the same coefficients.
    #[test]
    fn sliding_bristles_do_not_change_the_spring() {
        let [one, other] = ["stribeck", "lugre"].map(|law| {
            let mut crane = Description::uia_single_boom().unwrap();
            crane.set(&format!("friction.law={law}")).unwrap();
            hydraulic_spring(&LinearisedPlant::new(&crane, 0.25).unwrap()).unwrap()
        });
        assert_eq!(one, other);
    }
}
