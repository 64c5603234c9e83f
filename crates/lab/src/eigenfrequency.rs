//! Locked-valve oscillation test of section 5.2.2, compared with the linearised model.

use crate::linearise::{Mode, mode_shape, modes};
use crate::{LabError, paper, plant};
use hydroboom_description::{Description, millimetres};
use hydroboom_model::{Input, Scheme};
use serde::Serialize;

/// Eigenfrequency of the crane with locked cylinder at one piston position, by simulation and by linearisation.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// Piston position \[mm\].
    pub stroke_mm: f64,
    /// Frequency of the lowest mode from the simulated oscillation \[Hz\], f = n/Δt, with the crane's friction; none
    /// if it decays within two periods.
    pub oscillation_hz: Option<f64>,
    /// Frequency of the lowest mode from the simulated oscillation without friction \[Hz\]; none if it decays within
    /// two periods.
    pub frictionless_hz: Option<f64>,
    /// Lowest and highest piston-side pressure in the test without friction \[bar\].
    pub frictionless_bar: [f64; 2],
    /// Frequency of the lowest mode from the eigenvalues of the linearised crane without friction \[Hz\].
    pub linearised_hz: f64,
    /// Frequency from the eigenvalues with the friction at rest \[Hz\], whose slope acts as a stiff damper that nearly
    /// locks the piston.
    pub linearised_with_friction_hz: f64,
    /// Damping ratio of the linearised lowest mode without friction \[-\].
    pub damping_ratio: f64,
    /// All oscillatory modes of the linearised crane without friction, in order of increasing frequency.
    pub modes: Vec<ShapedMode>,
    /// Eigenfrequency simulated in the paper (Table 5) \[Hz\]; none for another crane or position.
    pub paper_simulated_hz: Option<f64>,
    /// Eigenfrequency measured in the paper (Table 5) \[Hz\]; none for another crane or position.
    pub paper_measured_hz: Option<f64>,
}

impl Row {
    /// The row without the paper's values, which apply to its own crane only.
    #[must_use]
    pub fn without_paper(self) -> Self {
        Self { paper_simulated_hz: None, paper_measured_hz: None, ..self }
    }
}

/// Oscillatory mode of the linearised crane with its mode shape.
#[derive(Clone, Debug, Serialize)]
pub struct ShapedMode {
    /// Eigenvalue, frequency and damping ratio.
    #[serde(flatten)]
    pub mode: Mode,
    /// Mode shape: angle of each segment relative to that of the outermost one \[-\], with its sign.
    pub angles: Vec<f64>,
    /// Amplitude of p_A per degree of the outermost segment's angle \[bar/deg\].
    pub pressure_a_bar_per_deg: f64,
}

/// Time series of a locked-valve oscillation test: pressure and height of the tip.
#[derive(Clone, Debug)]
pub struct Oscillation {
    /// Times \[s\].
    pub time: Vec<f64>,
    /// Pressure on the piston side \[Pa\].
    pub pressure_a: Vec<f64>,
    /// Height of the tip \[m\].
    pub tip_y: Vec<f64>,
}

/// Initial drop of the tip without friction \[m\]: small enough for a nearly constant bulk modulus, as
/// linearisation requires.
pub const SMALL_DROP: f64 = 0.2e-3;

/// Duration of the oscillation test \[s\].
const DURATION: f64 = 4.0;

/// Description of the crane without friction in the cylinder: Stribeck's law with viscous, Coulomb and breakaway
/// friction of zero.
///
/// # Errors
///
/// [`LabError::Description`] if the resulting machine is impossible; none for a valid description.
pub fn without_friction(description: &Description) -> Result<Description, LabError> {
    let mut frictionless = description.clone();
    frictionless.set("friction.law=stribeck")?;
    for key in ["viscous_ns_per_m", "coulomb_n", "stiction_n"] {
        frictionless.set(&format!("friction.{key}=0"))?;
    }
    Ok(frictionless)
}

/// Simulates the drop of the boom onto its cylinder with the load-holding valve shut (paper, section 5.2.2): 4 s, a
/// sample every millisecond. The piston is at `stroke` \[m\], and the tip falls from `drop` \[m\] above its rest.
///
/// # Errors
///
/// [`LabError::Plant`] if the crane has no state of rest at this piston position; [`LabError::Simulation`] if its
/// state leaves the model's range of validity.
pub fn oscillation(
    description: &Description,
    stroke: f64,
    drop: f64,
) -> Result<Oscillation, LabError> {
    let step = description.numbers.simulation_period;
    let mut crane = locked(description, stroke, step)?;
    let during = LabError::during;
    crane.lift(drop / description.numbers.boom_length).map_err(during("lifting the boom"))?;
    let input = Input { pump_speed: 0.0, holding_valve: 0.0 };
    let count = (1e-3 / step).round().max(1.0) as u32;
    let mut seen = Oscillation { time: Vec::new(), pressure_a: Vec::new(), tip_y: Vec::new() };
    while crane.time() < DURATION {
        let outputs = crane.outputs();
        seen.time.push(crane.time());
        seen.pressure_a.push(outputs.pressure_a);
        seen.tip_y.push(outputs.tip_y);
        crane.advance(&input, count).map_err(during("oscillation test"))?;
    }
    Ok(seen)
}

/// Crane at rest with its load held and the rod-side pressure of the oscillation test.
fn locked(
    description: &Description,
    stroke: f64,
    step: f64,
) -> Result<Box<dyn crate::Plant>, LabError> {
    let mut start = description.start(stroke);
    start.rod_side_pressure = description.numbers.oscillation_rod_side;
    start.preload = 0.0;
    Ok(plant(description, &start, Scheme::Published, step)?)
}

/// Frequency of an oscillation \[Hz\], n/Δt between its first and last upward crossing of the mean (paper, section
/// 5.2.2). The mean is that of the whole periods in between. Times are in seconds, values in any unit.
///
/// # Errors
///
/// [`LabError::NoOscillation`] if there are fewer than three crossings, as with empty or NaN values.
pub fn frequency(time: &[f64], values: &[f64]) -> Result<f64, LabError> {
    let mut mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
    let mut crossings = Vec::new();
    // fixed-point iteration: the mean over whole periods depends on the crossings
    for _ in 0..5 {
        crossings = upward_crossings(time, values, mean);
        let (Some(first), Some(last)) = (crossings.first(), crossings.last()) else { break };
        let inside: Vec<f64> = time
            .iter()
            .zip(values)
            .filter(|(t, _)| (*first..*last).contains(*t))
            .map(|(_, v)| *v)
            .collect();
        if inside.is_empty() {
            break;
        }
        mean = inside.iter().sum::<f64>() / inside.len() as f64;
    }
    match (crossings.first(), crossings.last()) {
        (Some(first), Some(last)) if crossings.len() >= 3 => {
            Ok((crossings.len() - 1) as f64 / (last - first))
        }
        _ => Err(LabError::NoOscillation(
            "fewer than two whole periods of oscillation can be seen".into(),
        )),
    }
}

fn upward_crossings(time: &[f64], values: &[f64], level: f64) -> Vec<f64> {
    let pairs = time.windows(2).zip(values.windows(2));
    pairs
        .filter(|(_, v)| v[0] < level && v[1] >= level)
        .map(|(t, v)| t[0] + (t[1] - t[0]) * (level - v[0]) / (v[1] - v[0]))
        .collect()
}

/// Frequency \[Hz\] of the lowest mode in an oscillation of several modes. A moving average over one period of the
/// `second` mode \[Hz\] removes that mode and preserves the crossings of the lowest one; none leaves out the average.
/// Times \[s\] must be equidistant.
///
/// # Errors
///
/// See [`frequency`].
pub fn lowest_mode_frequency(
    time: &[f64],
    values: &[f64],
    second: Option<f64>,
) -> Result<f64, LabError> {
    let period = time.windows(2).next().map_or(f64::INFINITY, |pair| pair[1] - pair[0]);
    let half = second.map_or(0, |second| (0.5 / (second * period)).round() as usize);
    let means: Vec<f64> = values
        .windows(2 * half + 1)
        .map(|window| window.iter().sum::<f64>() / window.len() as f64)
        .collect();
    frequency(time.get(half..half + means.len()).unwrap_or_default(), &means)
}

/// Lowest oscillatory mode of the linearised crane with locked cylinder at a piston position \[m\].
///
/// # Errors
///
/// [`LabError::NoOscillation`] if there is no oscillatory mode; otherwise see [`locked_modes`].
pub fn locked_mode(description: &Description, stroke: f64) -> Result<Mode, LabError> {
    lowest(&locked_modes(description, stroke)?)
}

/// Slowest of the modes.
fn lowest(modes: &[ShapedMode]) -> Result<Mode, LabError> {
    modes
        .first()
        .map(|shaped| shaped.mode)
        .ok_or_else(|| LabError::NoOscillation("the linearised crane does not oscillate".into()))
}

/// All oscillatory modes of the linearised crane with locked cylinder at a piston position \[m\], in order of
/// increasing frequency. Modes below 0.1 Hz or with a damping ratio of 0.9 or more do not count.
///
/// # Errors
///
/// [`LabError::Plant`] if the crane has no state of rest there; [`LabError::Design`] if its eigenvalues or mode shapes
/// cannot be computed.
pub fn locked_modes(description: &Description, stroke: f64) -> Result<Vec<ShapedMode>, LabError> {
    let crane = locked(description, stroke, description.numbers.simulation_period)?;
    let input = Input { pump_speed: 0.0, holding_valve: 0.0 };
    let (a, _) = crane.jacobian(&input);
    let states = crane.state_names();
    let angles = states.iter().filter(|name| name.starts_with("angle_")).count();
    let pressure_a = states.iter().position(|name| name == "pressure_a_pa");
    let swinging = |mode: &Mode| mode.frequency_hz > 0.1 && mode.damping_ratio < 0.9;
    modes(&a)?
        .into_iter()
        .filter(swinging)
        .map(|mode| {
            let shape = mode_shape(&a, &mode, description.segment_shares.len() - 1)?;
            let signed = |k: usize| shape[k].norm() * if shape[k].re < 0.0 { -1.0 } else { 1.0 };
            Ok(ShapedMode {
                mode,
                angles: (0..angles).map(signed).collect(),
                pressure_a_bar_per_deg: pressure_a.map_or(0.0, signed) * 1e-5 * 1f64.to_radians(),
            })
        })
        .collect()
}

/// Locked-valve oscillation test at one piston position \[m\], with the linearised model.
///
/// # Errors
///
/// See [`locked_mode`] for the linearisation and [`oscillation`] for the simulation.
pub fn row(description: &Description, stroke: f64) -> Result<Row, LabError> {
    let frictionless = without_friction(description)?;
    let drop = description.numbers.oscillation_drop;
    let modes = locked_modes(&frictionless, stroke)?;
    let mode = lowest(&modes)?;
    let second = modes.get(1).map(|shaped| shaped.mode.frequency_hz);
    let measured = |seen: &Oscillation| lowest_mode_frequency(&seen.time, &seen.tip_y, second).ok();
    let with = oscillation(description, stroke, drop)?;
    let without = oscillation(&frictionless, stroke, SMALL_DROP)?;
    let pressures = || without.pressure_a.iter().map(|pressure| pressure * 1e-5);
    let index = paper::EIGEN_STROKE_MM.iter().position(|x| (x - stroke * 1e3).abs() < 1e-6);
    Ok(Row {
        stroke_mm: millimetres(stroke),
        oscillation_hz: measured(&with),
        frictionless_hz: measured(&without),
        frictionless_bar: [
            pressures().fold(f64::INFINITY, f64::min),
            pressures().fold(f64::NEG_INFINITY, f64::max),
        ],
        linearised_hz: mode.frequency_hz,
        linearised_with_friction_hz: locked_mode(description, stroke)?.frequency_hz,
        damping_ratio: mode.damping_ratio,
        modes,
        paper_simulated_hz: index.map(|i| paper::EIGEN_SIMULATED_HZ[i]),
        paper_measured_hz: index.map(|i| paper::EIGEN_MEASURED_HZ[i]),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A slow mode of 1 mm with a fast one of a fifth of it, which adds crossings of the mean.
    #[test]
    fn the_lowest_mode_is_found_despite_a_faster_one() {
        use std::f64::consts::TAU;
        let time: Vec<f64> = (0..4000).map(|k| f64::from(k) * 1e-3).collect();
        let slow = |t: f64| (TAU * 4.6 * t).sin() * (-0.3 * t).exp();
        let values: Vec<f64> =
            time.iter().map(|t| slow(*t) + 0.2 * (TAU * 76.0 * t + 0.3).sin()).collect();
        assert!(frequency(&time, &values).unwrap() > 6.0);
        let found = lowest_mode_frequency(&time, &values, Some(76.0)).unwrap();
        assert!((found / 4.6 - 1.0).abs() < 5e-3, "{found} Hz");
        // shorter than a period of the fast mode
        assert!(lowest_mode_frequency(&time[..9], &values[..9], Some(76.0)).is_err());
    }

    /// With soft and stiff oil, light and heavy load, and a load beyond the boom, the frequency is that of
    /// the linearised mode.
    #[test]
    fn the_oscillation_is_that_of_the_linearised_mode() {
        for (set, stroke) in [
            ("cylinder.piston_mm=100", 0.1),
            ("payload.mass_kg=60", 0.1),
            ("payload.mass_kg=60", 0.4),
            ("payload.x_mm=9000", 0.25),
        ] {
            let mut crane = Description::uia_single_boom().unwrap();
            crane.set(set).unwrap();
            let row = row(&crane, stroke).unwrap();
            let error = row.frictionless_hz.unwrap() / row.linearised_hz - 1.0;
            assert!(error.abs() < 0.02, "{set}: {error}");
        }
    }
}
