//! Unstable poles of a closed loop, by the Nyquist criterion.

use crate::{DesignError, LinearisedPlant, Loop};
use nalgebra::Complex;
use std::f64::consts::{PI, TAU};

/// Growth rate below which a mode is not counted \[1/s\]: it doubles in 35 s, and grows by less than half in the
/// paper's motion of 18 s.
///
/// Integrators of position, of low pressures whose check valves are shut, and of the controller lie at zero,
/// numerically up to 0.001 1/s.
pub(crate) const SLOWEST_GROWTH: f64 = 0.02;

/// Highest frequency of the contour \[Hz\], and initial number of points below it. At most half the
/// sampling frequency of a sampled controller, above which its response is mirrored. Resonances of the
/// crane get their own.
const HIGHEST: f64 = 400.0;
const POINTS: u32 = 800;
/// Grid points about a resonance, in half widths at half power.
const ABOUT_RESONANCE: [f64; 5] = [-3.0, -1.0, 0.0, 1.0, 3.0];

/// Largest turn of the loop between two points \[rad\], beyond which the interval is bisected, and the
/// largest number of bisections.
const TURN: f64 = 0.5;
const HALVINGS: u32 = 40;
/// Share of half a turn by which the contour may miss a whole number of half turns. Beyond it the loop's
/// gain has not rolled off at the contour's end, and its turns do not count poles.
const OPEN_CONTOUR: f64 = 0.25;

/// Poles of a closed loop that grow faster than 0.02 1/s.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct GrowingPoles {
    /// Those of the closed loop, Z.
    pub closed_loop: u32,
    /// Those of crane and controller without feedback, P.
    pub open_loop: u32,
}

/// Unstable poles of the closed loop, by the Nyquist criterion Z = N + P. N is the number of net clockwise
/// turns of 1 + L about zero along the line of slowest growth. P is the number of poles of crane and
/// controller beyond that line.
///
/// # Errors
///
/// [`DesignError`] when the crane's responses are not finite there, or the turns are no count of poles.
pub(crate) fn growing_poles(
    crane: &LinearisedPlant,
    around: &Loop,
) -> Result<GrowingPoles, DesignError> {
    let at = |frequency: f64| {
        let s = Complex::new(SLOWEST_GROWTH, TAU * frequency);
        Ok::<_, DesignError>(around.gain_at(&crane.responses_at(s)?, s) + 1.0)
    };
    let mut turned = 0.0;
    let mut last = (0.0, at(0.0)?);
    for frequency in frequencies(crane, around.highest_frequency().min(HIGHEST)) {
        let next = (frequency, at(frequency)?);
        turned += turn(&at, last, next, HALVINGS)?;
        last = next;
    }
    if !turned.is_finite() {
        return Err(crane.none("the loop's gain is not finite"));
    }
    let open_loop = crane.growing_poles(SLOWEST_GROWTH) + around.growing_poles(SLOWEST_GROWTH)?;
    // the mirrored half of the line turns as far again
    let encirclements = -turned / PI;
    let more = encirclements.round();
    let closed_loop = u32::try_from(i64::from(open_loop) + more as i64);
    match closed_loop {
        Ok(closed_loop) if (encirclements - more).abs() < OPEN_CONTOUR => {
            Ok(GrowingPoles { closed_loop, open_loop })
        }
        _ => Err(crane.none(&format!(
            "the loop encircles -1 {encirclements:.2} times with {open_loop} growing poles in open loop, which is no count of poles"
        ))),
    }
}

/// Frequencies of the contour \[Hz\], in their order, above zero and up to the highest.
fn frequencies(crane: &LinearisedPlant, highest: f64) -> Vec<f64> {
    // evenly over the frequency's root: modes of boom and oil lie low
    let even = (1..=POINTS).map(|k| highest * (f64::from(k) / f64::from(POINTS)).powi(2));
    let resonances = about_resonances(crane, SLOWEST_GROWTH);
    let mut all: Vec<f64> = even.chain(resonances).filter(|f| *f > 0.0 && *f <= highest).collect();
    all.sort_unstable_by(f64::total_cmp);
    all.dedup();
    all
}

/// Frequencies \[Hz\] about the resonances of a crane, as close as these are broad along a line of growth \[1/s\].
pub(crate) fn about_resonances(
    crane: &LinearisedPlant,
    growth: f64,
) -> impl Iterator<Item = f64> + '_ {
    crane.modes.iter().flat_map(move |mode| {
        let half_width = (growth - mode.real).abs() / TAU;
        ABOUT_RESONANCE.map(|place| mode.frequency_hz + place * half_width)
    })
}

/// Angle by which 1 + L turns between two frequencies \[rad\].
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Actuation;
    use crate::linear::modes;
    use hydroboom_control::feedback::benchmark::Benchmark;
    use hydroboom_description::Description;
    use nalgebra::DMatrix;

    /// An integrator whose loop has its crossover above the end of the contour: the Nyquist curve is
    /// not closed there.
    #[test]
    fn a_loop_with_gain_at_the_end_of_the_contour_gives_no_pole_count() {
        let row = vec![1.0];
        let (a, b) = (DMatrix::zeros(1, 1), DMatrix::from_element(1, 1, 1.0));
        let rows = [row.clone(), row.clone(), row];
        let crane = LinearisedPlant::of(0.1, a, b, rows).unwrap();
        let around = |gain: f64| Loop::Benchmark {
            controller: Benchmark {
                proportional: gain,
                integral: 0.0,
                pressure_feedback: 0.0,
                revolutions_per_metre: 1.0,
                ..Description::uia_single_boom().unwrap().benchmark()
            },
            high_pass: 1.0,
            actuation: Actuation { delay: 0.0, drive: [0.0; 2], sensor_lag: 0.0 },
        };
        let crossover = TAU * HIGHEST;
        let stable = GrowingPoles { closed_loop: 0, open_loop: 0 };
        assert_eq!(growing_poles(&crane, &around(0.1 * crossover)).unwrap(), stable);
        let error = growing_poles(&crane, &around(10.0 * crossover)).unwrap_err().to_string();
        assert!(error.contains("is no count of poles"), "{error}");
    }

    /// Two oscillators at 1 and 2 Hz. Feedback damps the first and destabilises the second: without
    /// feedback the first is unstable, with it the second. The difference in the number of unstable
    /// poles between open and closed loop is zero.
    #[test]
    fn a_stabilised_mode_does_not_cancel_a_destabilised_one() {
        let (first, second, damping) = (TAU, 2.0 * TAU, 0.2);
        #[rustfmt::skip]
        let a = DMatrix::from_row_slice(4, 4, &[
            0.0, 1.0, 0.0, 0.0,
            -first * first, damping, 0.0, 0.0,
            0.0, 0.0, 0.0, 1.0,
            0.0, 0.0, -second * second, -damping,
        ]);
        let b = DMatrix::from_column_slice(4, 1, &[0.0, 1.0, 0.0, 1.0]);
        let row = vec![0.0, 1.0, 0.0, -1.0];
        let crane =
            LinearisedPlant::of(0.1, a.clone(), b.clone(), [row.clone(), row.clone(), row.clone()]);
        let crane = crane.unwrap();
        for (gain, closed_loop) in [(0.05, 2), (0.2, 0), (1.0, 2), (-0.5, 2), (0.0, 2)] {
            let controller = Benchmark {
                proportional: gain,
                integral: 0.0,
                pressure_feedback: 0.0,
                revolutions_per_metre: 1.0,
                ..Description::uia_single_boom().unwrap().benchmark()
            };
            let actuation = Actuation { delay: 0.0, drive: [0.0; 2], sensor_lag: 0.0 };
            let around = Loop::Benchmark { controller, high_pass: 1.0, actuation };
            let found = growing_poles(&crane, &around).unwrap();
            assert_eq!(found, GrowingPoles { closed_loop, open_loop: 2 }, "{gain}");
            // by eigenvalues of the closed loop, which has no delay here
            let closed = &a - &b * gain * DMatrix::from_row_slice(1, 4, &row);
            let growing = modes(&closed).unwrap();
            let growing = growing.iter().filter(|mode| mode.real > SLOWEST_GROWTH).count();
            assert_eq!(2 * growing, closed_loop as usize, "{gain}");
        }
    }
}
