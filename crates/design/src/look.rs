//! A design looked at before anything moves: poles, margins, a step.

use crate::linear::{Mode, modes};
use crate::linear_feedback::LinearFeedback;
use crate::{DesignError, Lifting, Loop, Margins, margins};
use hydroboom_control::controller::AxisState;
use hydroboom_control::model_following::ModelFollowing;
use hydroboom_control::oil_spring::Gains;
use hydroboom_control::reference::profile::SetPoint;
use hydroboom_description::Description;
use hydroboom_model::{Input, Scheme};
use hydroboom_plant::plant;
use nalgebra::DMatrix;
use serde::Serialize;

/// A design at a piston position.
#[derive(Clone, Debug, Serialize)]
pub struct Look {
    /// Piston position.
    pub stroke_mm: f64,
    /// The mode in which boom and load ring on the oil.
    pub rings: Mode,
    /// Poles of the simulated crane under state feedback, slowest first: those that were placed and all others.
    pub poles: Vec<Mode>,
    /// Of the loop of state feedback.
    pub state_feedback: Margins,
    /// Of the loop from the machine in model following, were the machine like the model.
    pub machine: Margins,
    /// Of the benchmark's loop.
    pub benchmark: Margins,
}

/// Both loops from the machine: in model following, and the benchmark's.
pub fn machine_loops(
    law: &ModelFollowing<f64>,
    description: &Description,
    stroke: f64,
) -> [Loop; 2] {
    let delay = law.lead + 0.5 * law.period;
    let with = law.reckons_at_rest(stroke);
    let feedback = Box::new(LinearFeedback::new(&law.deviation, &with, law.period));
    let (controller, high_pass) = (description.benchmark(), description.numbers.high_pass_time);
    [Loop::Machine { feedback, delay }, Loop::Benchmark { controller, high_pass, delay }]
}

/// A law at a piston position \[m\] of the crane that it was designed for.
///
/// # Errors
///
/// [`DesignError`] when the crane cannot be linearised there.
pub fn look(
    law: &ModelFollowing<f64>,
    description: &Description,
    stroke: f64,
) -> Result<Look, DesignError> {
    let crane = Lifting::new(description, stroke)?;
    let gains = law.gains_at_rest(stroke);
    let [machine, benchmark] = machine_loops(law, description, stroke);
    let state = Loop::of_state(law, stroke);
    Ok(Look {
        stroke_mm: stroke * 1e3,
        rings: *crane.ringing()?,
        poles: closed(&crane, &gains)?,
        state_feedback: margins(&crane, &state)?,
        machine: margins(&crane, &machine)?,
        benchmark: margins(&crane, &benchmark)?,
    })
}

/// Poles of the whole linearised crane under state feedback, bending and all; poles at zero, of what nothing drives, left out.
fn closed(crane: &Lifting, gains: &Gains<f64>) -> Result<Vec<Mode>, DesignError> {
    let n = crane.a.nrows();
    let [position, velocity, pressure] = &crane.outputs;
    let mut all = DMatrix::zeros(n + 1, n + 1);
    for j in 0..n {
        let fed_back = gains.position * position[j]
            + gains.velocity * velocity[j]
            + gains.pressure * pressure[j];
        for i in 0..n {
            all[(i, j)] = crane.a[(i, j)] - crane.b[(i, 0)] * fed_back;
        }
        all[(n, j)] = position[j];
    }
    for i in 0..n {
        all[(i, n)] = -crane.b[(i, 0)] * gains.integral;
    }
    let mut poles = modes(&all)?;
    poles.retain(|pole| pole.real.hypot(pole.imaginary) > 0.05);
    Ok(poles)
}

/// The simulated crane after a step of its reference: time \[s\], position from where it was \[m\], motor speed \[rev/s\].
///
/// # Errors
///
/// [`DesignError`] when the crane cannot be simulated.
pub fn step_response(
    law: &ModelFollowing<f64>,
    description: &Description,
    stroke: f64,
    height: f64,
    duration: f64,
) -> Result<Vec<[f64; 3]>, DesignError> {
    let step = description.numbers.simulation_period;
    let mut crane = plant(description, &description.start(stroke), Scheme::Published, step)?;
    let per_period = (law.period / step).round() as u32;
    let mut memory = law.start();
    let mut response = Vec::new();
    for k in 0..(duration / law.period).round() as u32 {
        let time = f64::from(k) * law.period;
        let outputs = crane.outputs();
        let seen = AxisState {
            stroke: outputs.stroke,
            velocity: outputs.velocity,
            load_pressure: crane.load_pressure(),
        };
        // a rest before, in which the pump takes over the leakage
        let position = if time < REST { stroke } else { stroke + height };
        let reference = SetPoint { position, velocity: 0.0 };
        let pump_speed = law.update(&mut memory, &reference, &seen);
        response.push([time - REST, outputs.stroke - stroke, pump_speed]);
        crane
            .advance(&Input { pump_speed, holding_valve: 1.0 }, per_period)
            .map_err(DesignError::Simulation)?;
    }
    Ok(response)
}

/// Rest before a step \[s\].
const REST: f64 = 1.0;
