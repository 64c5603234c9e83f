//! Gains of the benchmark controller for a crane: M-constrained integral gain optimisation, robust over payload range and stroke.
//!
//! ```text
//! maximise K_i  subject to  |1 + L(iω)| ≥ 1/M_s  for all frequencies, payloads of the range, and piston positions,
//!                           K_i ≤ K_p²           (the position loop by itself is damped by 0.5 at least),   k_f τ/A_p ≤ largest droop
//! L = ((K_p + K_i/s) A_p/K_VP G_x + k_f/K_VP τs/(τs + 1) G_p) · drive and fieldbus
//! ```
//!
//! The integrated error after a step of an unknown flow (leakage) is in proportion to 1/K_i; M_s is the largest sensitivity, the reciprocal of the modulus
//! margin. It bounds both classical margins: gain margin ≥ M_s/(M_s − 1), phase margin ≥ 2 arcsin(1/(2 M_s)). Source: K. J. Åström,
//! H. Panagopoulos, T. Hägglund, Design of PI controllers based on non-convex optimization, Automatica 34(5), 1998,
//! doi:10.1016/S0005-1098(98)00011-9. Pressure feedback and its high-pass are found in the same search: K_i is the largest over all four. Pressure feedback
//! lets the piston droop by k_f τ/A_p under a load pressure that lasts, until the integral makes it good; that is limited, for it costs tracking.

use crate::design_report::benchmark_loop;
use crate::stability::POSITIONS;
use crate::{DesignError, LinearisedPlant, Loop, Margins, margins};
use hydroboom_description::Description;
use nalgebra::Complex;
use serde::Serialize;
use std::f64::consts::{PI, TAU};

// numbers of the search; what it has to keep stands in the crane file's section `benchmark_design`

/// Payloads that are looked at between the ends of the range, the ends included.
const PAYLOADS: u32 = 5;
/// Lowest and highest frequency of the search \[Hz\], and points between them.
const FREQUENCIES: [f64; 2] = [0.02, 200.0];
const POINTS: u32 = 800;
/// Growth rate of the line along which the search counts turns \[1/s\]: resonances are as broad there as the points lie apart, so that none is stepped over. What grows
/// more slowly is found when the gains are judged, by [`unstable_poles`](crate::margins).
const LINE_OF_SEARCH: f64 = 0.25;
/// The largest sensitivity may be exceeded by this factor where gains are judged between the points of the search.
const SLACK: f64 = 1.01;
/// What a search between the points of the grid may miss of the modulus margin is made good for so many times, by this factor on the distance each.
const TIGHTENINGS: u32 = 4;
const TIGHTENING: f64 = 1.05;
/// Least damping ratio of the position loop by itself, s² + K_p s + K_i around a piston that integrates its speed: K_i is at most (K_p/(2 ζ))², which is K_p² for 0.5.
/// With more integral action than that the loop oscillates slowly, whatever its margins are.
const LEAST_DAMPING: f64 = 0.5;
/// Steps of the first grid: of the pressure feedback, of the high-pass, of the proportional gain.
const FEEDBACKS: u32 = 14;
const HIGH_PASSES: u32 = 6;
const PROPORTIONALS: u32 = 14;
/// Decades of pressure feedback, from the lowest on, counted from the feedback that damps the load mode as much as it is damped by itself.
const FEEDBACK_DECADES: f64 = 3.5;
const LOWEST_FEEDBACK_DECADE: f64 = -0.5;
/// Decades of the proportional gain, below the largest: so many times the slowest load mode's angular frequency, beyond which no proportional loop around it is stable.
const PROPORTIONAL_DECADES: f64 = 2.5;
const LARGEST_PROPORTIONAL: f64 = 5.0;
/// Halvings of the interval of an integral gain.
const HALVINGS: u32 = 14;
/// Factors by which the best gains are changed afterwards, one after the other.
const REFINEMENTS: [f64; 5] = [1.3, 1.15, 1.07, 1.03, 1.015];

/// Gains of the benchmark controller, in the units of the crane file's section `controller`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Gains {
    /// Proportional gain K_p \[1/s\].
    pub proportional_per_s: f64,
    /// Integral gain K_i \[1/s²\].
    pub integral_per_s2: f64,
    /// Pressure feedback k_f \[m³/(s Pa)\].
    pub pressure_feedback_m3_per_spa: f64,
    /// Time constant of its high-pass τ \[s\].
    pub high_pass_s: f64,
}

impl Gains {
    /// Those of a description.
    pub fn of(description: &Description) -> Self {
        let n = &description.numbers;
        Self {
            proportional_per_s: n.proportional,
            integral_per_s2: n.integral,
            pressure_feedback_m3_per_spa: n.pressure_feedback,
            high_pass_s: n.high_pass_time,
        }
    }

    /// A description with these gains.
    pub fn put(&self, description: &Description) -> Description {
        let mut changed = description.clone();
        let n = &mut changed.numbers;
        n.proportional = self.proportional_per_s;
        n.integral = self.integral_per_s2;
        n.pressure_feedback = self.pressure_feedback_m3_per_spa;
        n.high_pass_time = self.high_pass_s;
        changed
    }

    /// Keys of the crane file with their values.
    pub fn keys(&self) -> [(&'static str, f64); 4] {
        [
            ("controller.proportional_per_s", self.proportional_per_s),
            ("controller.integral_per_s2", self.integral_per_s2),
            ("controller.pressure_feedback_m3_per_spa", self.pressure_feedback_m3_per_spa),
            ("controller.high_pass_s", self.high_pass_s),
        ]
    }

    /// With so many digits as a crane file is written with.
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

/// Gains that were found, and what they come to.
#[derive(Clone, Debug, Serialize)]
pub struct BenchmarkDesign {
    /// The gains.
    pub gains: Gains,
    /// Largest sensitivity that was allowed.
    pub sensitivity_peak: f64,
    /// Payloads that they are robust over.
    pub payload_kg: [f64; 2],
    /// The least of each margin over payloads and positions.
    pub worst: WorstMargins,
}

/// The least of each margin over payloads and positions.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct WorstMargins {
    /// Whether the loop is stable with all of them.
    pub stable: bool,
    /// Largest sensitivity, M_s.
    pub sensitivity_peak: f64,
    /// Phase margin.
    pub phase_deg: f64,
    /// Gain margin.
    pub gain: f64,
    /// Payload at which the sensitivity is largest.
    pub payload_kg: f64,
    /// Piston position at which it is.
    pub stroke_mm: f64,
}

/// What a loop is made of at one s: position and load pressure with all that is around, per unit of gain.
struct Sample {
    s: Complex<f64>,
    position: Complex<f64>,
    pressure: Complex<f64>,
}

impl Sample {
    /// 1 + L.
    fn difference(&self, gains: &Gains) -> Complex<f64> {
        let pi = gains.integral_per_s2 / self.s + gains.proportional_per_s;
        let damping = high_pass(self.s, gains.high_pass_s) * gains.pressure_feedback_m3_per_spa;
        pi * self.position + damping * self.pressure + 1.0
    }
}

/// One payload at one piston position, gains left out.
struct Case {
    payload: f64,
    crane: LinearisedPlant,
    /// Along the imaginary axis, on which distances from −1 are.
    axis: Vec<Sample>,
    /// Along the line of growth, beyond which poles are counted.
    growth: Vec<Sample>,
}

impl Case {
    fn new(description: &Description, payload: f64, stroke: f64) -> Result<Self, DesignError> {
        let mut loaded = description.clone();
        loaded.numbers.payload = payload;
        let crane = LinearisedPlant::new(&loaded, stroke)?;
        let unit = |gains: &Gains| benchmark_loop(&gains.put(description));
        // by gains of one each: position by K_p, and pressure with its high-pass taken off again
        let none = Gains {
            proportional_per_s: 0.0,
            integral_per_s2: 0.0,
            pressure_feedback_m3_per_spa: 0.0,
            high_pass_s: 1.0,
        };
        let position = unit(&Gains { proportional_per_s: 1.0, ..none });
        let pressure = unit(&Gains { pressure_feedback_m3_per_spa: 1.0, ..none });
        let at = |s: Complex<f64>| {
            let responses = crane.responses_at(s)?;
            let (x, p) = (position.gain_at(&responses, s), pressure.gain_at(&responses, s));
            Ok::<_, DesignError>(Sample { s, position: x, pressure: p / high_pass(s, 1.0) })
        };
        let [low, high] = FREQUENCIES;
        let omega = |k: u32| TAU * low * (high / low).powf(f64::from(k) / f64::from(POINTS));
        let along = |growth: f64| {
            (0..=POINTS).map(|k| at(Complex::new(growth, omega(k)))).collect::<Result<Vec<_>, _>>()
        };
        let (axis, mut growth) = (along(0.0)?, vec![at(Complex::from(LINE_OF_SEARCH))?]);
        growth.extend(along(LINE_OF_SEARCH)?);
        Ok(Self { payload, axis, growth, crane })
    }

    /// Whether the loop keeps a distance from −1 at all frequencies, and is stable: 1 + L does not turn about zero along the line.
    fn keeps(&self, gains: &Gains, distance: f64) -> bool {
        let far = |sample: &Sample| sample.difference(gains).norm_sqr() >= distance * distance;
        if !self.axis.iter().all(far) {
            return false;
        }
        let line: Vec<Complex<f64>> = self.growth.iter().map(|s| s.difference(gains)).collect();
        let turned: f64 = line.windows(2).map(|pair| (pair[1] / pair[0]).arg()).sum();
        (turned / PI).round() >= 0.0
    }
}

fn high_pass(s: Complex<f64>, time: f64) -> Complex<f64> {
    s * time / (s * time + 1.0)
}

/// Payloads \[kg\] and piston positions \[m\] of a description that gains have to do with.
fn cases(description: &Description, payload: [f64; 2]) -> Result<Vec<Case>, DesignError> {
    let [low, high] = payload;
    let count = if high > low { PAYLOADS } else { 1 };
    let at = |k: u32| low + (high - low) * f64::from(k) / f64::from(count.max(2) - 1);
    let payloads = (0..count).map(at);
    let strokes = POSITIONS.map(|share| share * description.numbers.stroke);
    payloads
        .flat_map(|payload| strokes.map(|stroke| Case::new(description, payload, stroke)))
        .collect()
}

/// The payload range of a crane file \[kg\]; its payload alone where there is none.
pub fn payload_range(description: &Description) -> [f64; 2] {
    let own = description.numbers.payload;
    description.range("payload.mass_kg").map_or([own; 2], |range| [range.low, range.high])
}

/// Gains of the benchmark controller for payloads between two \[kg\].
///
/// # Errors
///
/// [`DesignError`] when the crane cannot be linearised with one of the payloads, or no gains keep the distance that is asked for.
pub fn benchmark_design(
    description: &Description,
    payload: [f64; 2],
) -> Result<BenchmarkDesign, DesignError> {
    let n = &description.numbers;
    let cases = cases(description, payload)?;
    let sensitivity_peak = n.benchmark_sensitivity_peak;
    let mut distance = 1.0 / sensitivity_peak;
    for _ in 0..TIGHTENINGS {
        let Some(gains) = Search::new(description, &cases, distance)?.largest() else { break };
        let gains = gains.rounded();
        let worst = worst(&gains.put(description), &cases)?;
        // a search on a grid may step over a resonance
        if worst.stable && worst.sensitivity_peak <= SLACK * sensitivity_peak {
            return Ok(BenchmarkDesign { gains, sensitivity_peak, payload_kg: payload, worst });
        }
        distance *= TIGHTENING;
    }
    let [low_kg, high_kg] = payload;
    Err(DesignError::NoGains { sensitivity_peak, low_kg, high_kg })
}

/// The least margins of a description's own gains over payloads between two \[kg\] and the stroke.
///
/// # Errors
///
/// [`DesignError`] when the crane cannot be linearised with one of them.
pub fn worst_margins(
    description: &Description,
    payload: [f64; 2],
) -> Result<WorstMargins, DesignError> {
    worst(description, &cases(description, payload)?)
}

fn worst(description: &Description, cases: &[Case]) -> Result<WorstMargins, DesignError> {
    let around: Loop = benchmark_loop(description);
    let mut worst = WorstMargins {
        stable: true,
        sensitivity_peak: 0.0,
        phase_deg: 180.0,
        gain: f64::INFINITY,
        payload_kg: f64::NAN,
        stroke_mm: f64::NAN,
    };
    for case in cases {
        let of: Margins = margins(&case.crane, &around)?;
        let peak = if of.is_stable() { 1.0 / of.modulus_margin } else { f64::INFINITY };
        worst.stable &= of.is_stable();
        worst.phase_deg = worst.phase_deg.min(of.phase_deg);
        worst.gain = worst.gain.min(of.gain);
        if peak > worst.sensitivity_peak {
            worst.sensitivity_peak = peak;
            (worst.payload_kg, worst.stroke_mm) = (case.payload, case.crane.stroke * 1e3);
        }
    }
    Ok(worst)
}

/// Search for the largest integral gain over the four gains, by their logarithms.
struct Search<'a> {
    cases: &'a [Case],
    /// Least distance from −1.
    distance: f64,
    /// Pressure feedback that damps the load mode as much as it is damped by itself \[m³/(s Pa)\].
    unit: f64,
    /// Angular frequency of the slowest load mode \[rad/s\].
    slowest: f64,
    longest_high_pass: f64,
    /// Largest volume that pressure feedback gives up for a lasting Pascal, k_f τ \[m³/Pa\].
    largest_droop: f64,
}

impl<'a> Search<'a> {
    fn new(
        description: &Description,
        cases: &'a [Case],
        distance: f64,
    ) -> Result<Self, DesignError> {
        let mut slowest = f64::INFINITY;
        let mut unit: f64 = f64::INFINITY;
        for case in cases {
            let omega = TAU * case.crane.load_mode()?.frequency_hz;
            slowest = slowest.min(omega);
            let near = |sample: &&Sample| (sample.s.im / omega).ln().abs();
            let peak = case.axis.iter().min_by(|a, b| near(a).total_cmp(&near(b)));
            if let Some(peak) = peak {
                unit = unit.min(1.0 / peak.pressure.norm());
            }
        }
        let n = &description.numbers;
        let longest_high_pass = n.benchmark_longest_high_pass;
        let largest_droop = n.benchmark_largest_droop * description.cylinder().piston_area;
        Ok(Self { cases, distance, unit, slowest, longest_high_pass, largest_droop })
    }

    fn keeps(&self, gains: &Gains) -> bool {
        self.cases.iter().all(|case| case.keeps(gains, self.distance))
    }

    /// The largest integral gain beside the others; none where they do not keep the distance without one.
    fn integral(&self, gains: &Gains) -> Option<Gains> {
        let with = |integral_per_s2: f64| Gains { integral_per_s2, ..*gains };
        let damped = Gains { proportional_per_s: 0.0, ..with(0.0) };
        if gains.pressure_feedback_m3_per_spa * gains.high_pass_s > self.largest_droop {
            return None;
        }
        if !(self.keeps(&damped) && self.keeps(&with(0.0))) {
            return None;
        }
        let most = (0.5 * gains.proportional_per_s / LEAST_DAMPING).powi(2);
        let (mut low, mut high) = (0.0, most);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            if self.keeps(&with(middle)) { low = middle } else { high = middle }
        }
        (low > 0.0).then(|| with(low))
    }

    /// The gains of the largest integral gain.
    fn largest(&self) -> Option<Gains> {
        let mut best: Option<Gains> = None;
        let better = |found: Option<Gains>, best: &mut Option<Gains>| {
            let Some(found) = found else { return false };
            let is_better = best.is_none_or(|b| found.integral_per_s2 > b.integral_per_s2);
            *best = if is_better { Some(found) } else { *best };
            is_better
        };
        let shortest = (1.0 / self.slowest).min(self.longest_high_pass);
        for t in 0..HIGH_PASSES {
            let share = f64::from(t) / f64::from(HIGH_PASSES - 1);
            let high_pass_s = shortest * (self.longest_high_pass / shortest).powf(share);
            for f in 0..FEEDBACKS {
                let share = f64::from(f) / f64::from(FEEDBACKS - 1);
                let decades = LOWEST_FEEDBACK_DECADE + FEEDBACK_DECADES * share;
                let pressure_feedback_m3_per_spa = self.unit * 10_f64.powf(decades);
                for p in 0..PROPORTIONALS {
                    let share = f64::from(p) / f64::from(PROPORTIONALS - 1) - 1.0;
                    let proportional_per_s = LARGEST_PROPORTIONAL
                        * self.slowest
                        * 10_f64.powf(PROPORTIONAL_DECADES * share);
                    let gains = Gains {
                        proportional_per_s,
                        integral_per_s2: 0.0,
                        pressure_feedback_m3_per_spa,
                        high_pass_s,
                    };
                    better(self.integral(&gains), &mut best);
                }
            }
        }
        for factor in REFINEMENTS {
            let mut goes_on = best.is_some();
            while let Some(now) = best.filter(|_| goes_on) {
                goes_on = false;
                for factor in [factor, 1.0 / factor] {
                    let longest = self.longest_high_pass;
                    let tried = [
                        Gains { proportional_per_s: now.proportional_per_s * factor, ..now },
                        Gains {
                            pressure_feedback_m3_per_spa: now.pressure_feedback_m3_per_spa * factor,
                            ..now
                        },
                        Gains { high_pass_s: (now.high_pass_s * factor).min(longest), ..now },
                        Gains {
                            proportional_per_s: now.proportional_per_s * factor,
                            pressure_feedback_m3_per_spa: now.pressure_feedback_m3_per_spa * factor,
                            ..now
                        },
                    ];
                    for gains in tried {
                        goes_on |= better(self.integral(&gains), &mut best);
                    }
                }
            }
        }
        best
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The paper tuned its benchmark on its crane. The method comes to about the same: no other controller than the paper's.
    #[test]
    fn the_method_gives_the_papers_crane_about_the_papers_gains() {
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

    /// Margins as stated, at every payload and position, for an odd crane too; more integral gain would break them.
    #[test]
    fn gains_keep_the_stated_margins_over_the_payload_range_and_no_more() {
        for (set, payload) in [
            ("payload.mass_kg=200", [0.0, 240.0]),
            ("cylinder.piston_mm=100", [250.0, 370.0]),
            ("payload.x_mm=9000", [307.0; 2]),
        ] {
            let mut crane = Description::uia_single_boom().unwrap();
            crane.set(set).unwrap();
            let design = benchmark_design(&crane, payload).unwrap();
            let peak = design.worst.sensitivity_peak;
            assert!(design.worst.stable && peak <= 1.01 * 1.7, "{set}: {design:?}");
            // what a largest sensitivity of 1.7 says of both other margins
            assert!(design.worst.phase_deg > 33.0 && design.worst.gain > 2.35, "{set}: {design:?}");
            let more =
                Gains { integral_per_s2: 1.2 * design.gains.integral_per_s2, ..design.gains };
            let beyond = worst_margins(&more.put(&crane), payload).unwrap();
            assert!(beyond.sensitivity_peak > peak, "{set}: {beyond:?}");
        }
    }

    /// Of cranes whose margins would allow more: the position loop by itself stays damped.
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
    fn what_no_gains_keep_is_refused() {
        let mut paper = Description::uia_single_boom().unwrap();
        paper.set("benchmark_design.sensitivity_peak=1.1").unwrap();
        // seconds of delay
        paper.numbers.tuning.estimator_drive_lag = 10.0;
        let refused = benchmark_design(&paper, [0.0, 370.0]);
        assert!(matches!(refused, Err(DesignError::NoGains { .. })), "{refused:?}");
    }
}
