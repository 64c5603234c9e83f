//! Execution time of the model's integration step on this computer.

use crate::LabError;
use hydroboom_description::{BuildError, Description};
use hydroboom_math::{Lanes, simd};
use hydroboom_model::stepping::{Implicit, published};
use hydroboom_model::{Crane, CraneState, Input};
use serde::Serialize;
use std::hint::black_box;
use std::time::Instant;

/// Simulations per call in the vectorised measurement.
const LANES: usize = 8;

/// Execution times of integration steps on this computer.
#[derive(Clone, Debug, Serialize)]
pub struct Timing {
    /// One step of 50 us of the coupled published model with three segments, f64, one core \[ns\].
    pub step_ns: f64,
    /// Execution time of a step of 50 us of the published model with several cranes vectorised, per crane \[ns\].
    pub lanes_step_ns: f64,
    /// Name of the vector instruction set that was selected at run time.
    pub instruction_set: &'static str,
    /// Execution time of an implicit step for several numbers of boom segments.
    pub segments: Vec<SegmentTiming>,
}

/// Execution time of an integration step for a number of boom segments.
#[derive(Clone, Debug, Serialize)]
pub struct SegmentTiming {
    /// Number of boom segments.
    pub n: usize,
    /// Execution time of one implicit step of 50 us \[ns\].
    pub step_ns: f64,
}

/// Minimum over several trials \[ns per call\], which excludes the load by other programs.
fn best_ns(calls: usize, mut trial: impl FnMut(usize)) -> f64 {
    trial(calls / 10 + 1);
    (0..7)
        .map(|_| {
            let clock = Instant::now();
            trial(calls);
            clock.elapsed().as_secs_f64() * 1e9 / calls as f64
        })
        .fold(f64::INFINITY, f64::min)
}

/// Measures the execution times on one core, in the ordinary load of the computer.
///
/// # Errors
///
/// [`LabError::Build`] if no model can be built from the crane file, or it has no state of rest at mid-stroke.
pub fn timing(description: &Description) -> Result<Timing, LabError> {
    let three = description.divided(3);
    let (crane, start) = at_rest::<3>(&three)?;
    let input = Input { pump_speed: 10.0, holding_valve: 1.0 };
    let step = 50e-6;

    let step_ns = best_ns(40_000, |calls| {
        // a single simulation cannot be vectorised: the instructions of the default build are used
        black_box(steps(&crane, start, &input, step, calls));
    });
    let wide = crane.map(&mut |v| Lanes([v; LANES]));
    let wide_input = input.map(|v| Lanes([v; LANES]));
    let lanes_ns = best_ns(20_000, |calls| {
        let mut state = start.map(|v| Lanes([v; LANES]));
        simd::run(Wide { crane: &wide, state: &mut state, input: &wide_input, step, calls });
        black_box(&state);
    });
    let mut segments = Vec::new();
    for n in [3, 5, 10, 20, 50] {
        let divided = description.divided(n);
        let step_ns = match n {
            3 => implicit_ns::<3>(&divided)?,
            5 | 10 => implicit_ns::<10>(&divided)?,
            _ => implicit_ns::<50>(&divided)?,
        };
        segments.push(SegmentTiming { n, step_ns });
    }
    Ok(Timing {
        step_ns,
        lanes_step_ns: lanes_ns / LANES as f64,
        instruction_set: simd::chosen(),
        segments,
    })
}

/// Many steps under one input, as in a simulation.
#[inline(never)]
fn steps(
    crane: &Crane<f64, 3>,
    mut state: CraneState<f64, 3>,
    input: &Input<f64>,
    step: f64,
    calls: usize,
) -> CraneState<f64, 3> {
    for _ in 0..calls {
        published(crane, &mut state, black_box(input), step);
    }
    state
}

struct Wide<'a> {
    crane: &'a Crane<Lanes<LANES>, 3>,
    state: &'a mut CraneState<Lanes<LANES>, 3>,
    input: &'a Input<Lanes<LANES>>,
    step: f64,
    calls: usize,
}

impl simd::Kernel for Wide<'_> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        for _ in 0..self.calls {
            published(self.crane, self.state, black_box(self.input), Lanes([self.step; LANES]));
        }
    }
}

fn at_rest<const N: usize>(
    description: &Description,
) -> Result<(Crane<f64, N>, CraneState<f64, N>), LabError> {
    let crane = description.crane::<N>()?;
    let start = description.start(0.5 * description.numbers.stroke);
    let state = crane.at_rest(&start).map_err(BuildError::from)?;
    Ok((crane, state))
}

fn implicit_ns<const N: usize>(description: &Description) -> Result<f64, LabError> {
    let (crane, start) = at_rest::<N>(description)?;
    let scheme = Implicit::new(&crane);
    let input = Input { pump_speed: 10.0, holding_valve: 1.0 };
    Ok(best_ns(2_000, |calls| {
        let mut state = start;
        for _ in 0..calls {
            scheme.step(&crane, &mut state, black_box(&input), 50e-6);
        }
        black_box(&state);
    }))
}
