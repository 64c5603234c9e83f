//! Eigenfrequency of the crane with locked cylinder, generic over the number type.

use crate::case::SEGMENTS;
use crate::error::SensitivityError;
use hydroboom_description::schema::Numbers;
use hydroboom_description::{BuildError, Description};
use hydroboom_identify::{Number, Stepper};
use hydroboom_model::{CraneState, Input};

/// Duration of the oscillation test \[s\].
const DURATION: f64 = 3.0;
/// Sampling interval of p_A \[s\].
const INTERVAL: f64 = 1e-3;
/// Piston position of the test as a share of the stroke \[1\].
const POSITION: f64 = 0.5;

/// Conditions of the [`eigenfrequency`] in words, and its difference from that of `hydroboom eigen`.
pub(crate) fn conditions(description: &Description) -> String {
    let n = &description.numbers;
    format!(
        "Load-holding valve shut at mid-stroke, {:.0} mm; rod side at {:.1} bar (oscillation.rod_side_bar); tip \
         dropped by {:.1} mm (oscillation.drop_mm);\nwith friction; upward crossings of p_A's mean within \
         {DURATION:.0} s. A higher mode of the boom in p_A can add crossings: then the value is too high.\n\
         `hydroboom eigen` averages the second mode out: compare the value there, or drop the tip by less.",
        POSITION * n.stroke * 1e3,
        n.oscillation_rod_side * 1e-5,
        n.oscillation_drop * 1e3,
    )
}

/// Eigenfrequency \[Hz\] at mid-stroke: the boom is dropped onto its locked cylinder, and f = n/Δt is measured between
/// upward crossings of p_A's mean (section 5.2.2). Crossings by higher modes of the boom are counted, too.
///
/// The derivative of a crossing's time is t' = -p'/(dp/dt). Linear interpolation between two samples in dual numbers
/// gives exactly this derivative.
pub(crate) fn eigenfrequency<T: Number>(
    description: &Description,
    numbers: &Numbers<T>,
) -> Result<T, SensitivityError> {
    let crane = description.crane_over::<T, SEGMENTS>(numbers)?;
    let mut start = description.start_over(numbers, T::lit(POSITION) * numbers.stroke);
    start.rod_side_pressure = numbers.oscillation_rod_side;
    start.preload = T::zero();
    let rest: CraneState<T, SEGMENTS> = T::rest(&crane, &start).map_err(BuildError::from)?;
    let mut state = crane.lifted(&rest, numbers.oscillation_drop / numbers.boom_length);
    let input = Input { pump_speed: T::zero(), holding_valve: T::zero() };
    let stepper = Stepper::new(&crane);
    let mut pressure = Vec::new();
    for k in 0..(DURATION / INTERVAL) as usize {
        pressure.push(crane.circuit.pressures(&state.circuit).a);
        state = stepper.moved(&crane, &state, &input, INTERVAL, 2).ok_or_else(|| {
            SensitivityError::Broken { what: "oscillation test".into(), time: k as f64 * INTERVAL }
        })?;
    }
    frequency(&pressure).ok_or(SensitivityError::Silent)
}

/// n/Δt between the first and the last upward crossing of the mean; the mean is taken over these whole periods.
fn frequency<T: Number>(values: &[T]) -> Option<T> {
    let mean_of = |part: &[T]| {
        part.iter().fold(T::zero(), |sum, v| sum + *v) / T::lit(part.len().max(1) as f64)
    };
    let mut mean = mean_of(values);
    let mut found: Option<T> = None;
    // fixed-point iteration: the mean depends on the crossings, and these on the mean
    for _ in 0..5 {
        let level = mean.plain();
        let places: Vec<usize> = (1..values.len())
            .filter(|k| values[k - 1].plain() < level && values[*k].plain() >= level)
            .collect();
        if places.len() < 3 {
            return found;
        }
        let (first, last) = (places[0], places[places.len() - 1]);
        mean = mean_of(&values[first..last]);
        let time = |k: usize| {
            let (before, after) = (values[k - 1], values[k]);
            T::lit((k - 1) as f64) + (mean - before) / (after - before)
        };
        let periods = T::lit((places.len() - 1) as f64);
        found = Some(periods / ((time(last) - time(first)) * T::lit(INTERVAL)));
    }
    found
}
