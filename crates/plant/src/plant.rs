//! Interface of a simulated crane, independent of the number of its segments.

use hydroboom_description::{BuildError, Description, millimetres};
use hydroboom_math::Dual;
use hydroboom_model::energy::{Energy, Power};
use hydroboom_model::{
    CraneRates, CraneState, Flows, Input, Invalid, Nodes, Outputs, Scheme, Simulation,
    SimulationError, Start, StepLimit,
};
use nalgebra::DMatrix;
use thiserror::Error;

/// Reason why a crane cannot be simulated.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum PlantError {
    /// The description gives no model, or the model has no equilibrium.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// The step does not suit the scheme, or the state is not valid.
    #[error("starting the simulation: {0}{remedy}", remedy = remedy(.0))]
    Simulation(SimulationError),
    /// Piston position outside the stroke.
    #[error("the piston's stroke is 0 to {longest_mm} mm, not {asked_mm} mm")]
    Stroke {
        /// Requested piston position \[mm\].
        asked_mm: f64,
        /// Stroke length of the cylinder \[mm\].
        longest_mm: f64,
    },
    /// Cranes that are simulated side by side differ in structure, not only in numbers.
    #[error(
        "cranes that are simulated side by side have the same friction law, number of segments and \
         effects"
    )]
    Make,
}

/// Keys to check where a crane cannot start, for a message; empty where the error names its cause.
fn remedy(error: &SimulationError) -> &'static str {
    match error {
        SimulationError::Invalid { reason: Invalid::Bending, .. } => {
            ": it is too weak for the load; check boom.second_moment_cm4, boom.youngs_modulus_gpa and payload.mass_kg"
        }
        _ => "",
    }
}

/// Simulated crane, independent of the number of its segments.
pub trait Plant: Send + Sync {
    /// Independent copy in the same state.
    fn copied(&self) -> Box<dyn Plant>;
    /// Advances by `count` steps under a constant input.
    ///
    /// # Errors
    ///
    /// [`SimulationError::Input`] if the input is not finite. [`SimulationError::Unsettled`] or
    /// [`SimulationError::Step`] if the scheme cannot take a step. [`SimulationError::Invalid`] if the state leaves
    /// the model's range of validity. The state then stays that before the call.
    fn advance(&mut self, input: &Input<f64>, count: u32) -> Result<(), SimulationError>;
    /// Time since the start \[s\].
    fn time(&self) -> f64;
    /// Step size \[s\].
    fn step(&self) -> f64;
    /// Largest number of substeps per step so far, taken to stay below the scheme's step limit.
    fn substeps(&self) -> u32;
    /// Outputs (positions, gauge pressures, forces) at the present state.
    fn outputs(&self) -> Outputs<f64>;
    /// Load pressure p_L \[Pa\].
    fn load_pressure(&self) -> f64;
    /// Area ratio A_r/A_p \[1\]: weight of the rod side's pressure in the load pressure.
    fn rod_side_ratio(&self) -> f64;
    /// Volume flows of the circuit under an input \[m³/s\].
    fn flows(&self, input: &Input<f64>) -> Flows<f64>;
    /// Stored energy, by form \[J\].
    fn energy(&self) -> Energy<f64>;
    /// Power balance under an input \[W\].
    fn power(&self, input: &Input<f64>) -> Power<f64>;
    /// Step limit of the published scheme at the present state.
    fn step_limit(&self) -> StepLimit;
    /// Positions of bearing, joints and tip \[m\], right of and above the bearing.
    fn boom_line(&self) -> Vec<[f64; 2]>;
    /// Position of the cylinder's mount on the boom \[m\], right of and above the bearing.
    fn mount(&self) -> [f64; 2];
    /// Replaces the parameters by those of another description with the same number of segments; the state stays.
    ///
    /// # Errors
    ///
    /// [`PlantError::Build`] if the description gives no model of this size; the parameters then stay as they were.
    fn set_parameters(&mut self, description: &Description) -> Result<(), PlantError>;
    /// Sets the reduction of the oil's transition pressure by dissolved air, for each node \[Pa\].
    fn set_dissolved_air(&mut self, shift: Nodes<f64>);
    /// Lifts the whole boom by an angle \[rad\], counter-clockwise, with the oil in both chambers locked in. It then
    /// drops onto the cylinder.
    ///
    /// # Errors
    ///
    /// [`SimulationError::Invalid`] if the lifted state is outside the model's range of validity; the state then
    /// stays.
    fn lift(&mut self, angle: f64) -> Result<(), SimulationError>;
    /// Names of the state vector's entries, each ending with its SI unit, as `angle_1_rad`.
    fn state_names(&self) -> Vec<String>;
    /// Jacobians of the state derivatives, in SI units per second: by the state (square, a row per derivative), and by
    /// the pump speed \[rev/s\] (one column). Both have the order of [`state_names`](Plant::state_names).
    fn jacobian(&self, input: &Input<f64>) -> (DMatrix<f64>, DMatrix<f64>);
    /// Jacobian of the outputs by the state in SI units: a row per output, a column per state.
    fn output_jacobian(&self) -> DMatrix<f64>;
    /// State vector in SI units, in the order of [`state_names`](Plant::state_names).
    fn state_vector(&self) -> Vec<f64>;
}

/// Crane of a description in equilibrium at `start`, to be simulated in steps of `step` \[s\].
///
/// # Errors
///
/// [`PlantError::Stroke`] if the piston position is NaN or outside the stroke. [`PlantError::Build`] if the
/// description gives no model or no equilibrium. [`PlantError::Simulation`] if the step does not suit the scheme, or
/// the state of rest is not valid.
pub fn plant(
    description: &Description,
    start: &Start,
    scheme: Scheme,
    step: f64,
) -> Result<Box<dyn Plant>, PlantError> {
    let longest = description.numbers.stroke;
    if !(0.0..=longest).contains(&start.stroke) {
        let [asked_mm, longest_mm] = [start.stroke, longest].map(millimetres);
        return Err(PlantError::Stroke { asked_mm, longest_mm });
    }
    match description.coordinates() {
        3 if description.segment_shares.len() == 3 => sized::<3>(description, start, scheme, step),
        0..=10 => sized::<10>(description, start, scheme, step),
        11 => sized::<11>(description, start, scheme, step),
        _ => sized::<{ hydroboom_model::MAX_SEGMENTS + 1 }>(description, start, scheme, step),
    }
}

fn sized<const N: usize>(
    description: &Description,
    start: &Start,
    scheme: Scheme,
    step: f64,
) -> Result<Box<dyn Plant>, PlantError> {
    let crane = description.crane::<N>()?;
    let state = crane.at_rest(start).map_err(BuildError::from)?;
    let simulation = Simulation::new(crane, state, scheme, step).map_err(PlantError::Simulation)?;
    Ok(Box::new(simulation))
}

/// State vector of a boom with `n` coordinates, 2 n + 7 entries: angles \[rad\], angular velocities \[rad/s\], bristle
/// deflection \[m\], node pressures \[Pa\], gas volume \[m³\]. An `n` above `N` panics.
pub fn flatten<T: Copy, const N: usize>(state: &CraneState<T, N>, n: usize) -> Vec<T> {
    let mut flat = state.boom.angle[..n].to_vec();
    flat.extend_from_slice(&state.boom.angular_velocity[..n]);
    flat.push(state.bristle);
    flat.extend_from_slice(&state.circuit.nodes.to_array());
    flat.push(state.circuit.gas_volume);
    flat
}

/// State from a state vector as of [`flatten`]; entries beyond `n` coordinates are those of `like`. A vector of fewer
/// than 2 n + 7 entries panics.
pub fn unflatten<T: Copy, const N: usize>(
    like: &CraneState<T, N>,
    flat: &[T],
    n: usize,
) -> CraneState<T, N> {
    let mut state = *like;
    state.boom.angle[..n].copy_from_slice(&flat[..n]);
    state.boom.angular_velocity[..n].copy_from_slice(&flat[n..2 * n]);
    state.bristle = flat[2 * n];
    state.circuit.nodes = Nodes::from_array(std::array::from_fn(|i| flat[2 * n + 1 + i]));
    state.circuit.gas_volume = flat[2 * n + 6];
    state
}

fn flatten_rates<T: Copy, const N: usize>(
    state: &CraneState<T, N>,
    rates: &CraneRates<T, N>,
    n: usize,
) -> Vec<T> {
    let mut flat = state.boom.angular_velocity[..n].to_vec();
    flat.extend_from_slice(&rates.angular_acceleration[..n]);
    flat.push(rates.bristle);
    flat.extend_from_slice(&rates.circuit.nodes.to_array());
    flat.push(rates.circuit.gas_volume);
    flat
}

impl<const N: usize> Plant for Simulation<N> {
    fn copied(&self) -> Box<dyn Plant> {
        Box::new(self.clone())
    }
    fn advance(&mut self, input: &Input<f64>, count: u32) -> Result<(), SimulationError> {
        Simulation::advance(self, input, count)
    }
    fn time(&self) -> f64 {
        Simulation::time(self)
    }
    fn step(&self) -> f64 {
        Simulation::step(self)
    }
    fn substeps(&self) -> u32 {
        Simulation::substeps(self)
    }
    fn outputs(&self) -> Outputs<f64> {
        self.crane().outputs(self.state())
    }
    fn load_pressure(&self) -> f64 {
        let p = self.crane().circuit.pressures(&self.state().circuit);
        self.crane().cylinder.load_pressure(p.a, p.b)
    }
    fn rod_side_ratio(&self) -> f64 {
        self.crane().cylinder.area_ratio()
    }
    fn flows(&self, input: &Input<f64>) -> Flows<f64> {
        self.crane().flows(self.state(), input)
    }
    fn energy(&self) -> Energy<f64> {
        self.crane().energy(self.state())
    }
    fn power(&self, input: &Input<f64>) -> Power<f64> {
        self.crane().power(self.state(), input)
    }
    fn step_limit(&self) -> StepLimit {
        Simulation::step_limit(self)
    }

    fn boom_line(&self) -> Vec<[f64; 2]> {
        let boom = &self.crane().boom;
        let pose = boom.pose(&self.state().boom.angle);
        let joints = (0..boom.len()).map(|i| boom.joint_position(&pose, i));
        std::iter::once([0.0, 0.0]).chain(joints).collect()
    }

    fn mount(&self) -> [f64; 2] {
        let boom = &self.crane().boom;
        boom.mount_position(&boom.pose(&self.state().boom.angle))
    }

    fn set_parameters(&mut self, description: &Description) -> Result<(), PlantError> {
        self.set_crane(description.crane::<N>()?);
        Ok(())
    }

    fn set_dissolved_air(&mut self, shift: Nodes<f64>) {
        let mut crane = *self.crane();
        crane.circuit.dissolved_air = Some(shift);
        self.set_crane(crane);
    }

    fn lift(&mut self, angle: f64) -> Result<(), SimulationError> {
        let state = self.crane().lifted(self.state(), angle);
        self.set_state(state)
    }

    fn state_names(&self) -> Vec<String> {
        let boom = &self.crane().boom;
        let bodies = (0..boom.coordinates()).map(|i| match i < boom.len() {
            true => (i + 1).to_string(),
            false => "base".into(),
        });
        let angles = bodies.clone().map(|i| format!("angle_{i}_rad"));
        let velocities = bodies.map(|i| format!("angular_velocity_{i}_rad_s"));
        let nodes = Nodes::NAMES.map(|name| format!("pressure_{name}_pa"));
        angles
            .chain(velocities)
            .chain(["bristle_m".to_string()])
            .chain(nodes)
            .chain(["gas_volume_m3".to_string()])
            .collect()
    }

    fn jacobian(&self, input: &Input<f64>) -> (DMatrix<f64>, DMatrix<f64>) {
        type D = Dual<f64, 1>;
        let n = self.crane().boom.coordinates();
        let crane = self.crane().map(&mut D::constant);
        let state = self.state().map(D::constant);
        let input = input.map(D::constant);
        let flat = flatten(&state, n);
        let size = flat.len();
        let mut a = DMatrix::zeros(size, size);
        let mut b = DMatrix::zeros(size, 1);
        for column in 0..=size {
            let mut varied = flat.clone();
            let mut varied_input = input;
            match varied.get_mut(column) {
                Some(entry) => entry.slope[0] = 1.0,
                None => varied_input.pump_speed.slope[0] = 1.0,
            }
            let x = unflatten(&state, &varied, n);
            let rates = flatten_rates(&x, &crane.derivative(&x, &varied_input), n);
            for (row, rate) in rates.iter().enumerate() {
                match column < size {
                    true => a[(row, column)] = rate.slope[0],
                    false => b[(row, 0)] = rate.slope[0],
                }
            }
        }
        (a, b)
    }

    fn output_jacobian(&self) -> DMatrix<f64> {
        type D = Dual<f64, 1>;
        let n = self.crane().boom.coordinates();
        let crane = self.crane().map(&mut D::constant);
        let state = self.state().map(D::constant);
        let flat = flatten(&state, n);
        let mut c = DMatrix::zeros(Outputs::NAMES.len(), flat.len());
        for column in 0..flat.len() {
            let mut varied = flat.clone();
            varied[column] = D { value: varied[column].value, slope: [1.0] };
            let outputs = crane.outputs(&unflatten(&state, &varied, n)).to_array();
            for (row, output) in outputs.iter().enumerate() {
                c[(row, column)] = output.slope[0];
            }
        }
        c
    }

    fn state_vector(&self) -> Vec<f64> {
        flatten(self.state(), self.crane().boom.coordinates())
    }
}
