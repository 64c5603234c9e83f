//! Unstable poles of a closed loop, by the argument principle.

use crate::{DesignError, LinearisedPlant, Loop};
use nalgebra::Complex;
use std::f64::consts::{PI, TAU};

/// Growth rate below which a mode is not counted \[1/s\]: it doubles in 35 s, and grows by less than half in the paper's motion of 18 s.
///
/// The low-pressure side, linearised with its check valves shut, drifts off by itself until they open: at 0.05 1/s with an ideal accumulator, which the open loop has too and so is not counted;
/// at 0.005 to 0.008 1/s with the virtual crane's. Integrators of position and controller lie at zero, numerically up to
/// 0.001 1/s. Between those two groups of poles is most room about 0.02 1/s.
pub(crate) const SLOWEST_GROWTH: f64 = 0.02;

/// Highest frequency that is looked at \[Hz\], and points below it to begin with; resonances of the crane get their own.
const HIGHEST: f64 = 400.0;
const POINTS: u32 = 800;
/// Places about a resonance that are looked at, in half widths at half power.
const ABOUT_RESONANCE: [f64; 5] = [-3.0, -1.0, 0.0, 1.0, 3.0];

/// Where the loop turns by more between two points \[rad\], one more is looked at between them, so many times at most.
const TURN: f64 = 0.5;
const HALVINGS: u32 = 40;

/// Modes that grow in the closed loop, less those that grow without it: the low-pressure side, linearised with its check valves shut,
/// drifts off by itself until they open.
///
/// Along a line of slow growth, 1 + L turns about zero once for every mode of the closed loop beyond the line, and back once for every
/// mode of the open loop.
///
/// # Errors
///
/// [`DesignError`] when the crane's responses are not finite there.
pub(crate) fn unstable_poles(crane: &LinearisedPlant, around: &Loop) -> Result<u32, DesignError> {
    let at = |frequency: f64| {
        let s = Complex::new(SLOWEST_GROWTH, TAU * frequency);
        Ok::<_, DesignError>(around.gain_at(&crane.responses_at(s)?, s) + 1.0)
    };
    let mut turned = 0.0;
    let mut last = (0.0, at(0.0)?);
    for frequency in frequencies(crane) {
        let next = (frequency, at(frequency)?);
        turned += turn(&at, last, next, HALVINGS)?;
        last = next;
    }
    if !turned.is_finite() {
        return Err(crane.none("the loop's gain is not finite"));
    }
    // the mirrored half of the line turns as far again
    Ok((-turned / PI).round().max(0.0) as u32)
}

/// Frequencies that are looked at \[Hz\], in their order, above zero.
fn frequencies(crane: &LinearisedPlant) -> Vec<f64> {
    // evenly over the frequency's root: modes of boom and oil lie low
    let even = (1..=POINTS).map(|k| HIGHEST * (f64::from(k) / f64::from(POINTS)).powi(2));
    let resonances = crane.modes.iter().flat_map(|mode| {
        let (zeta, natural) = (mode.damping_ratio, mode.frequency_hz);
        let damped = natural * (1.0 - zeta * zeta).max(0.0).sqrt();
        let half_width = SLOWEST_GROWTH / TAU + (zeta * natural).abs();
        ABOUT_RESONANCE.map(|place| damped + place * half_width)
    });
    let mut all: Vec<f64> = even.chain(resonances).filter(|f| *f > 0.0 && *f <= HIGHEST).collect();
    all.sort_unstable_by(f64::total_cmp);
    all.dedup();
    all
}

/// By how much 1 + L turns between two frequencies \[rad\].
fn turn(
    at: &impl Fn(f64) -> Result<Complex<f64>, DesignError>,
    from: (f64, Complex<f64>),
    to: (f64, Complex<f64>),
    halvings: u32,
) -> Result<f64, DesignError> {
    let turned = (to.1 / from.1).arg();
    if !(turned.abs() >= TURN && halvings > 0) {
        return Ok(turned);
    }
    let frequency = 0.5 * (from.0 + to.0);
    let between = (frequency, at(frequency)?);
    Ok(turn(at, from, between, halvings - 1)? + turn(at, between, to, halvings - 1)?)
}
