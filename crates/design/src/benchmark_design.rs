//! Gains of the benchmark controller for a crane: M-constrained integral gain optimisation, robust over payload range
//! and stroke.
//!
//! ```text
//! maximise K_i  subject to  |1 + L(iω)| ≥ 1/M_s  for all frequencies, payloads of the range, and piston positions,
//!                           K_i ≤ K_p²           (the position loop by itself is damped by 0.5 at least),
//!                           k_f τ/A_p ≤ largest droop
//! L = ((K_p + K_i/s) A_p/K_VP G_x + k_f/K_VP τs/(τs + 1) G_p) · drive and fieldbus
//! ```
//!
//! The integrated error after a step of an unknown flow (leakage) is in proportion to 1/K_i; M_s is the largest
//! sensitivity, the reciprocal of the modulus margin. It bounds both classical margins: gain margin ≥ M_s/(M_s − 1),
//! phase margin ≥ 2 arcsin(1/(2 M_s)). Source: K. J. Åström, H. Panagopoulos, T. Hägglund, Design of PI controllers
//! based on non-convex optimization, Automatica 34(5), 1998, doi:10.1016/S0005-1098(98)00011-9. Pressure feedback and
//! its high-pass are found in the same search: K_i is the largest over all four. Pressure feedback lets the piston
//! droop by k_f τ/A_p under a load pressure that lasts, until the integral makes it good; that is limited, for it
//! costs tracking.
//!
//! All payloads of the range and all positions are infinitely many constraints. They are met by an exchange
//! method: gains are found for some payloads and positions, then the worst of all others is searched with
//! these gains. It is one more constraint of the next search, until it keeps the distance. Source: J. W.
//! Blankenship, J. E. Falk, Infinitely constrained optimization problems, Journal of Optimization Theory
//! and Applications 19(2), 1976, doi:10.1007/BF00934096.

mod search;
mod worst_margins;

pub use worst_margins::{WorstMargins, worst_margins};

use crate::DesignError;
use hydroboom_description::Description;
use search::{Case, Search, cases};
use serde::Serialize;
use worst_margins::worst;

/// Payloads and positions that are added to those of the search.
const EXCHANGES: u32 = 12;
/// The search keeps a distance that is larger by this factor, so that exchange ends.
const SLACK: f64 = 1.005;

/// Gains of the benchmark controller, in the units of the crane file's section `controller`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Gains {
    /// Proportional gain K_p \[1/s\].
    pub proportional_per_s: f64,
    /// Integral gain K_i \[1/s²\].
    pub integral_per_s2: f64,
    /// Pressure feedback k_f \[m³/(s Pa)\].
    pub pressure_feedback_m3_per_spa: f64,
    /// Time constant τ of the pressure feedback's high-pass \[s\].
    pub high_pass_s: f64,
}

impl Gains {
    /// Gains of a description.
    pub fn of(description: &Description) -> Self {
        let n = &description.numbers;
        Self {
            proportional_per_s: n.proportional,
            integral_per_s2: n.integral,
            pressure_feedback_m3_per_spa: n.pressure_feedback,
            high_pass_s: n.high_pass_time,
        }
    }

    /// Copy of a description with these gains.
    pub fn put(&self, description: &Description) -> Description {
        let mut changed = description.clone();
        let n = &mut changed.numbers;
        n.proportional = self.proportional_per_s;
        n.integral = self.integral_per_s2;
        n.pressure_feedback = self.pressure_feedback_m3_per_spa;
        n.high_pass_time = self.high_pass_s;
        changed
    }

    /// Keys of the crane file with these gains, each in the key's unit.
    pub fn keys(&self) -> [(&'static str, f64); 4] {
        [
            ("controller.proportional_per_s", self.proportional_per_s),
            ("controller.integral_per_s2", self.integral_per_s2),
            ("controller.pressure_feedback_m3_per_spa", self.pressure_feedback_m3_per_spa),
            ("controller.high_pass_s", self.high_pass_s),
        ]
    }

    /// Rounded to the digits of a crane file.
    fn rounded(&self) -> Self {
        let four = |value: f64| format!("{value:.3e}").parse().unwrap_or(value);
        Self {
            proportional_per_s: four(self.proportional_per_s),
            integral_per_s2: four(self.integral_per_s2),
            pressure_feedback_m3_per_spa: four(self.pressure_feedback_m3_per_spa),
            high_pass_s: four(self.high_pass_s),
        }
    }
}

/// Designed gains of the benchmark controller, and their worst-case margins.
#[derive(Clone, Debug, Serialize)]
pub struct BenchmarkDesign {
    /// Designed gains.
    pub gains: Gains,
    /// Largest allowed peak of the sensitivity function, M_s \[1\].
    pub sensitivity_peak: f64,
    /// Range of payloads of the design \[kg\]: smallest, largest.
    pub payload_kg: [f64; 2],
    /// Worst-case margins over this range and the stroke.
    pub worst: WorstMargins,
}

/// Payload range of a crane file \[kg\]: smallest, largest; its default spread, 0 to 1.2 times the
/// payload, if the file states no range.
pub fn payload_range(description: &Description) -> [f64; 2] {
    let own = description.numbers.payload;
    description.range("payload.mass_kg").map_or([own; 2], |range| [range.low, range.high])
}

/// Designs the gains of the benchmark controller for a range of payloads \[kg\], smallest and largest, by the method
/// of the [module](self).
///
/// # Errors
///
/// [`DesignError::NoGains`] if no gains keep the required margins, and [`DesignError::NotConverged`] if the search for
/// worst cases does not converge. Any other [`DesignError`] if the crane cannot be linearised with one of the
/// payloads.
pub fn benchmark_design(
    description: &Description,
    payload: [f64; 2],
) -> Result<BenchmarkDesign, DesignError> {
    let sensitivity_peak = description.numbers.benchmark_sensitivity_peak;
    let [low_kg, high_kg] = payload;
    let mut search =
        Search::new(description, cases(description, payload)?, SLACK / sensitivity_peak)?;
    for _ in 0..=EXCHANGES {
        let Some(gains) = search.largest().map(|gains| gains.rounded()) else {
            return Err(DesignError::NoGains { sensitivity_peak, low_kg, high_kg });
        };
        let (worst, at_hz) = worst(&gains.put(description), payload)?;
        if worst.stable && worst.sensitivity_peak <= sensitivity_peak {
            return Ok(BenchmarkDesign { gains, sensitivity_peak, payload_kg: payload, worst });
        }
        let case = Case::new(description, worst.payload_kg, worst.stroke_mm * 1e-3, &[at_hz])?;
        search.cases.push(case);
    }
    Err(DesignError::NotConverged { exchanges: EXCHANGES, low_kg, high_kg })
}

#[cfg(test)]
mod tests {
    use super::search::{LEAST_DAMPING, largest_integral};
    use super::*;
    use crate::design_report::benchmark_loop;
    use crate::{LinearisedPlant, margins};

    /// The paper tuned its benchmark on its crane. The design method gives nearly the same gains.
    #[test]
    fn designed_gains_of_the_papers_crane_are_near_the_papers_gains() {
        let paper = Description::uia_single_boom().unwrap();
        let own = worst_margins(&paper, [307.0; 2]).unwrap();
        assert!(own.stable && (1.6..1.9).contains(&own.sensitivity_peak), "{own:?}");
        // which are unstable with an empty hook
        let light = worst_margins(&paper, [0.0, 370.0]).unwrap();
        assert!(!light.stable && light.sensitivity_peak.is_infinite(), "{light:?}");
        let design = benchmark_design(&paper, [307.0; 2]).unwrap();
        let (found, printed) = (design.gains, Gains::of(&paper));
        let ratio = found.proportional_per_s / printed.proportional_per_s;
        assert!((0.7..1.4).contains(&ratio), "{found:?}");
        let ratio = found.integral_per_s2 / printed.integral_per_s2;
        assert!((0.7..1.6).contains(&ratio), "{found:?}");
        let ratio = found.pressure_feedback_m3_per_spa / printed.pressure_feedback_m3_per_spa;
        assert!((0.3..2.0).contains(&ratio), "{found:?}");
    }

    /// The stated margins hold for an unusual crane too, at payloads and positions that are not among those
    /// of the search. Between these, soft oil makes the sensitivity larger than at the ends of the range.
    /// More integral gain violates the margins, or the damping that limits it.
    #[test]
    fn gains_meet_the_margins_over_the_payload_range_without_reserve() {
        for (set, payload) in [
            ("payload.mass_kg=60", [20.0, 90.0]),
            ("cylinder.piston_mm=100", [250.0, 370.0]),
            ("payload.x_mm=9000", [307.0; 2]),
        ] {
            let mut crane = Description::uia_single_boom().unwrap();
            crane.set(set).unwrap();
            let design = benchmark_design(&crane, payload).unwrap();
            let peak = design.worst.sensitivity_peak;
            assert!(design.worst.stable && peak <= 1.7, "{set}: {design:?}");
            let tuned = design.gains.put(&crane);
            for k in 0..40 {
                let share = |step: f64| (f64::from(k) * step + 0.237).fract();
                let mut loaded = tuned.clone();
                loaded.numbers.payload = payload[0] + share(0.618) * (payload[1] - payload[0]);
                let position = (0.05 + 0.9 * share(0.755)) * crane.numbers.stroke;
                let plant = LinearisedPlant::new(&loaded, position).unwrap();
                let of = margins(&plant, &benchmark_loop(&tuned)).unwrap();
                let place = format!("{set}: {} kg at {position} m", loaded.numbers.payload);
                assert!(of.is_stable() && 1.0 / of.modulus_margin <= peak, "{place}: {of:?}");
                // bounds of both other margins by a largest sensitivity of 1.7
                assert!(of.phase_deg > 34.2 && of.gain > 2.42, "{place}: {of:?}");
            }
            // the search is done to some hundredths
            let gains = design.gains;
            let more = 1.1 * gains.integral_per_s2;
            let beyond = Gains { integral_per_s2: more, ..gains };
            let worst = worst_margins(&beyond.put(&crane), payload).unwrap();
            let is_damped = more <= largest_integral(gains.proportional_per_s);
            assert!(!(is_damped && worst.sensitivity_peak <= 1.7), "{set}: {worst:?}");
        }
    }

    /// Gains that meet the margins for all payloads meet them for some: a smaller range allows at least
    /// as much integral gain.
    #[test]
    fn a_smaller_payload_range_allows_no_lower_integral_gain() {
        let mut crane = Description::uia_single_boom().unwrap();
        crane.set("payload.mass_kg=60").unwrap();
        let of = |range| benchmark_design(&crane, range).unwrap().gains.integral_per_s2;
        let (some, one) = (of([40.0, 80.0]), of([60.0; 2]));
        assert!(one > 0.98 * some, "{one} and {some}");
    }

    /// On cranes whose margins would allow more integral gain, the position loop itself stays damped.
    #[test]
    fn the_integral_gain_leaves_the_position_loop_damped() {
        for set in ["payload.mass_kg=60", "payload.mass_kg=307"] {
            let mut crane = Description::uia_single_boom().unwrap();
            crane.set(set).unwrap();
            let gains = benchmark_design(&crane, [crane.numbers.payload; 2]).unwrap().gains;
            let damping = 0.5 * gains.proportional_per_s / gains.integral_per_s2.sqrt();
            assert!(damping >= 0.999 * LEAST_DAMPING, "{set}: {gains:?}");
        }
    }

    #[test]
    fn margins_that_no_gains_meet_are_refused() {
        let mut paper = Description::uia_single_boom().unwrap();
        paper.set("benchmark_design.sensitivity_peak=1.1").unwrap();
        // seconds of delay
        paper.numbers.tuning.estimator_drive_lag = 10.0;
        let refused = benchmark_design(&paper, [0.0, 370.0]);
        assert!(matches!(refused, Err(DesignError::NoGains { .. })), "{refused:?}");
    }
}
