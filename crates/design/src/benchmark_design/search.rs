//! Search for the gains of the benchmark controller with the largest integral gain that keeps a distance from −1.

use super::Gains;
use crate::design_report::benchmark_loop;
use crate::stability::POSITIONS;
use crate::unstable_poles::about_resonances;
use crate::{DesignError, LinearisedPlant};
use hydroboom_description::Description;
use nalgebra::Complex;
use std::cell::Cell;
use std::f64::consts::{PI, TAU};

// numbers of the search; what it has to keep stands in the crane file's section `benchmark_design`

/// Payloads that the search begins with; the ends of the range are among them.
const PAYLOADS: u32 = 5;
/// Lowest and highest frequency of the search \[Hz\], and points between them.
const FREQUENCIES: [f64; 2] = [0.02, 200.0];
const POINTS: u32 = 800;
/// Growth rate of the line along which the search counts turns \[1/s\]: resonances are as broad there as the points
/// lie apart, so that none is stepped over. What grows more slowly is found when the gains are judged, by
/// [`unstable_poles`](crate::margins).
const LINE_OF_SEARCH: f64 = 0.25;
/// Least damping ratio of the position loop by itself, s² + K_p s + K_i around a piston that integrates its speed: K_i
/// is at most (K_p/(2 ζ))², which is K_p² for 0.5. With more integral action than that the loop oscillates slowly,
/// whatever its margins are.
pub(super) const LEAST_DAMPING: f64 = 0.5;
/// Steps of the first grid: of the pressure feedback, of the high-pass, of the proportional gain.
const FEEDBACKS: u32 = 22;
const HIGH_PASSES: u32 = 10;
const PROPORTIONALS: u32 = 41;
/// Decades of pressure feedback, from the lowest on, counted from the feedback that damps the load mode as much as it
/// is damped by itself.
const FEEDBACK_DECADES: f64 = 3.5;
const LOWEST_FEEDBACK_DECADE: f64 = -0.5;
/// Decades of the proportional gain, below the largest: so many times the slowest load mode's angular frequency,
/// beyond which no proportional loop around it is stable.
const PROPORTIONAL_DECADES: f64 = 2.5;
const LARGEST_PROPORTIONAL: f64 = 5.0;
/// Halvings of the interval of an integral gain.
const HALVINGS: u32 = 14;
/// Factors by which the best gains are changed afterwards, one after the other.
const REFINEMENTS: [f64; 6] = [1.5, 1.2, 1.1, 1.04, 1.015, 1.005];

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
pub(super) struct Case {
    crane: LinearisedPlant,
    /// Along the imaginary axis, on which distances from −1 are.
    axis: Vec<Sample>,
    /// Along the line of growth, beyond which poles are counted.
    growth: Vec<Sample>,
    /// Poles beyond that line without feedback.
    open_loop: f64,
}

impl Case {
    /// With points at some frequencies \[Hz\] besides.
    pub(super) fn new(
        description: &Description,
        payload: f64,
        stroke: f64,
        besides: &[f64],
    ) -> Result<Self, DesignError> {
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
        let mut axis = along(0.0)?;
        let resonances = about_resonances(&crane, 0.0).filter(|f| (low..=high).contains(f));
        for frequency in resonances.chain(besides.iter().copied()) {
            axis.push(at(Complex::new(0.0, TAU * frequency))?);
        }
        let mut growth = vec![at(Complex::from(LINE_OF_SEARCH))?];
        growth.extend(along(LINE_OF_SEARCH)?);
        let open_loop = f64::from(crane.growing_poles(LINE_OF_SEARCH));
        Ok(Self { axis, growth, open_loop, crane })
    }

    /// Whether the loop keeps a distance from −1 at all frequencies, and is stable: as often as it has poles beyond
    /// the line without feedback, 1 + L turns about zero along it.
    fn keeps(&self, gains: &Gains, distance: f64) -> bool {
        let far = |sample: &Sample| sample.difference(gains).norm_sqr() >= distance * distance;
        if !self.axis.iter().all(far) {
            return false;
        }
        let line: Vec<Complex<f64>> = self.growth.iter().map(|s| s.difference(gains)).collect();
        let turned: f64 = line.windows(2).map(|pair| (pair[1] / pair[0]).arg()).sum();
        self.open_loop == (turned / PI).round()
    }
}

fn high_pass(s: Complex<f64>, time: f64) -> Complex<f64> {
    s * time / (s * time + 1.0)
}

/// Payloads \[kg\] and piston positions \[m\] of a description that gains have to do with.
pub(super) fn cases(
    description: &Description,
    payload: [f64; 2],
) -> Result<Vec<Case>, DesignError> {
    let [low, high] = payload;
    let count = if high > low { PAYLOADS } else { 1 };
    let at = |k: u32| low + (high - low) * f64::from(k) / f64::from(count.max(2) - 1);
    let payloads = (0..count).map(at);
    let strokes = POSITIONS.map(|share| share * description.numbers.stroke);
    payloads
        .flat_map(|payload| strokes.map(|stroke| Case::new(description, payload, stroke, &[])))
        .collect()
}

/// Search for the largest integral gain over the four gains, by their logarithms.
pub(super) struct Search {
    /// What gains have to keep a distance with; more cases lower the integral gain that goes with others.
    pub(super) cases: Vec<Case>,
    /// The one that failed last.
    failed: Cell<usize>,
    /// Least distance from −1.
    distance: f64,
    longest_high_pass: f64,
    /// Largest volume that pressure feedback gives up for a lasting Pascal, k_f τ \[m³/Pa\].
    largest_droop: f64,
    /// The first grid; integral gains are upper bounds of what goes with the others.
    grid: Vec<Gains>,
}

impl Search {
    pub(super) fn new(
        description: &Description,
        cases: Vec<Case>,
        distance: f64,
    ) -> Result<Self, DesignError> {
        // angular frequency of the slowest load mode [rad/s], and pressure feedback that damps one as much as it is
        // damped by itself [m³/(s Pa)]
        let mut slowest = f64::INFINITY;
        let mut unit: f64 = f64::INFINITY;
        for case in &cases {
            let omega = TAU * case.crane.load_frequency()?;
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
        let grid = grid(slowest, unit, longest_high_pass);
        let failed = Cell::new(0);
        Ok(Self { cases, failed, distance, longest_high_pass, largest_droop, grid })
    }

    fn keeps(&self, gains: &Gains) -> bool {
        // what failed last fails first
        let first = self.failed.get();
        let fails = |case: &Case| !case.keeps(gains, self.distance);
        if self.cases.get(first).is_some_and(fails) {
            return false;
        }
        let failed = self.cases.iter().enumerate().position(|(k, case)| k != first && fails(case));
        self.failed.set(failed.unwrap_or(first));
        failed.is_none()
    }

    /// The largest integral gain beside the others, where it is larger than another; otherwise an upper bound of it,
    /// zero where they do not keep the distance without one.
    fn integral(&self, gains: &Gains, other: f64) -> Result<Gains, f64> {
        let with = |integral_per_s2: f64| Gains { integral_per_s2, ..*gains };
        if gains.pressure_feedback_m3_per_spa * gains.high_pass_s > self.largest_droop {
            return Err(0.0);
        }
        let most = largest_integral(gains.proportional_per_s);
        if most <= other {
            return Err(most);
        }
        let damped = Gains { proportional_per_s: 0.0, ..with(0.0) };
        if !(self.keeps(&damped) && self.keeps(&with(0.0))) {
            return Err(0.0);
        }
        if !self.keeps(&with(other)) {
            return Err(other);
        }
        let (mut low, mut high) = (other, most);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            if self.keeps(&with(middle)) { low = middle } else { high = middle }
        }
        if low > other { Ok(with(low)) } else { Err(high) }
    }

    /// The gains of the largest integral gain that is found: on the grid, then by a compass search about its best.
    pub(super) fn largest(&mut self) -> Option<Gains> {
        let mut best: Option<Gains> = None;
        let reached = |best: &Option<Gains>| best.map_or(0.0, |best| best.integral_per_s2);
        let mut grid = std::mem::take(&mut self.grid);
        grid.sort_by(|a, b| b.integral_per_s2.total_cmp(&a.integral_per_s2));
        for gains in &mut grid {
            if gains.integral_per_s2 <= reached(&best) {
                break;
            }
            gains.integral_per_s2 = match self.integral(gains, reached(&best)) {
                Ok(found) => best.insert(found).integral_per_s2,
                Err(bound) => gains.integral_per_s2.min(bound),
            };
        }
        grid.retain(|gains| gains.integral_per_s2 > 0.0);
        self.grid = grid;
        for factor in REFINEMENTS {
            let mut goes_on = best.is_some();
            while let Some(now) = best.filter(|_| goes_on) {
                goes_on = false;
                for direction in 1..27 {
                    // a step back, none, or one on, of each of three
                    let step = |place: i32| factor.powi((direction / place + 1) % 3 - 1);
                    let tried = Gains {
                        proportional_per_s: now.proportional_per_s * step(1),
                        pressure_feedback_m3_per_spa: now.pressure_feedback_m3_per_spa * step(3),
                        high_pass_s: (now.high_pass_s * step(9)).min(self.longest_high_pass),
                        ..now
                    };
                    if let Ok(found) = self.integral(&tried, reached(&best)) {
                        best = Some(found);
                        goes_on = true;
                    }
                }
            }
        }
        best
    }
}

/// Largest integral gain \[1/s²\] with which the position loop by itself is damped.
pub(super) fn largest_integral(proportional_per_s: f64) -> f64 {
    (0.5 * proportional_per_s / LEAST_DAMPING).powi(2)
}

/// Gains to begin with, each with the largest integral gain that may go with it.
fn grid(slowest: f64, unit: f64, longest_high_pass: f64) -> Vec<Gains> {
    let shares = |count: u32| (0..count).map(move |k| f64::from(k) / f64::from(count - 1));
    let shortest = (1.0 / slowest).min(longest_high_pass);
    let mut grid = Vec::new();
    for high_pass in shares(HIGH_PASSES) {
        for feedback in shares(FEEDBACKS) {
            let decades = LOWEST_FEEDBACK_DECADE + FEEDBACK_DECADES * feedback;
            for proportional in shares(PROPORTIONALS) {
                let below = PROPORTIONAL_DECADES * (proportional - 1.0);
                let proportional_per_s = LARGEST_PROPORTIONAL * slowest * 10_f64.powf(below);
                grid.push(Gains {
                    proportional_per_s,
                    integral_per_s2: largest_integral(proportional_per_s),
                    pressure_feedback_m3_per_spa: unit * 10_f64.powf(decades),
                    high_pass_s: shortest * (longest_high_pass / shortest).powf(high_pass),
                });
            }
        }
    }
    grid
}
