//! Batch simulation of several cranes, one in each SIMD lane.

use crate::PlantError;
use hydroboom_description::{BuildError, Description};
use hydroboom_math::Lanes;
use hydroboom_model::stepping::{Implicit, has_settled};
use hydroboom_model::{
    BoomState, CircuitState, Crane, CraneState, Input, Nodes, Outputs, SimulationError, Start,
};

/// Coordinates of the boom there is room for: ten segments on an elastic base.
const ROOM: usize = 11;

/// `W` cranes of the same structure and different parameters, simulated in SIMD lanes with the implicit scheme.
///
/// Each has the results of its own simulation, to the last bit. A `lane` is the index of a crane, 0 to `W` − 1; a
/// larger one panics.
pub struct SideBySide<const W: usize> {
    cranes: [Crane<f64, ROOM>; W],
    wide: Crane<Lanes<W>, ROOM>,
    stepper: Implicit<Lanes<W>>,
    state: CraneState<Lanes<W>, ROOM>,
    step: f64,
    count: u64,
    /// Cranes whose simulation failed, in their last state.
    stopped: [Option<SimulationError>; W],
}

impl<const W: usize> SideBySide<W> {
    /// Cranes in equilibrium, in steps of `step` \[s\]. `None` if their structure differs (friction law, number of
    /// segments, an effect that only some have), or if they have too many segments. Such cranes must be simulated one
    /// by one.
    ///
    /// # Errors
    ///
    /// [`PlantError::Build`] if a description gives no model, or no equilibrium at its start.
    pub fn new(
        descriptions: &[Description; W],
        starts: &[Start; W],
        step: f64,
    ) -> Result<Option<Self>, PlantError> {
        if descriptions.iter().any(|d| d.coordinates() > ROOM) {
            return Ok(None);
        }
        let mut cranes = Vec::with_capacity(W);
        let mut states = Vec::with_capacity(W);
        for (description, start) in descriptions.iter().zip(starts) {
            let crane = description.crane::<ROOM>()?;
            states.push(crane.at_rest(start).map_err(BuildError::from)?);
            cranes.push(crane);
        }
        let (Ok(cranes), Ok(states)) = (cranes.try_into(), states.try_into()) else {
            return Ok(None);
        };
        Ok(Self::begun(cranes, &states, step, 0))
    }

    fn begun(
        cranes: [Crane<f64, ROOM>; W],
        states: &[CraneState<f64, ROOM>; W],
        step: f64,
        count: u64,
    ) -> Option<Self> {
        let wide = together(&cranes)?;
        Some(Self {
            stepper: Implicit::new(&wide),
            wide,
            cranes,
            state: states_together(states),
            step,
            count,
            stopped: [None; W],
        })
    }

    /// Advances every crane by one step, each under its own input. A crane whose step has no solution or leaves the
    /// model's range of validity stops: see [`stopped`](Self::stopped).
    pub fn advance(&mut self, inputs: &[Input<f64>; W]) {
        let before = self.state;
        let input = Input {
            pump_speed: Lanes(inputs.map(|input| input.pump_speed)),
            holding_valve: Lanes(inputs.map(|input| input.holding_valve)),
        };
        let step = Lanes([self.step; W]);
        let left = self.stepper.step(&self.wide, &mut self.state, &input, step);
        let valid = self.wide.validity(&self.state).to_lanes();
        for lane in 0..W {
            if self.stopped[lane].is_none() {
                if has_settled(left.0[lane]) && valid[lane].check().is_ok() {
                    continue;
                }
                // alone it may take the step in parts
                let crane = &self.cranes[lane];
                let from = state_of(&before, lane);
                let time = self.count as f64 * self.step;
                let alone = Implicit::new(crane)
                    .settled(crane, &from, &inputs[lane], self.step)
                    .ok_or(SimulationError::Unsettled { time })
                    .and_then(|state| match crane.validity(&state).check() {
                        Ok(()) => Ok(state),
                        Err(reason) => Err(SimulationError::Invalid { time, reason }),
                    });
                match alone {
                    Ok(state) => {
                        put(&mut self.state, lane, &state);
                        continue;
                    }
                    Err(error) => self.stopped[lane] = Some(error),
                }
            }
            put(&mut self.state, lane, &state_of(&before, lane));
        }
        self.count += 1;
    }

    /// Error that has stopped a crane; `None` while it runs. A stopped crane keeps its last valid state.
    pub fn stopped(&self, lane: usize) -> Option<SimulationError> {
        self.stopped[lane]
    }

    /// Step size \[s\].
    pub fn step(&self) -> f64 {
        self.step
    }

    /// Outputs of each crane.
    pub fn outputs(&self) -> [Outputs<f64>; W] {
        let outputs = self.wide.outputs(&self.state);
        std::array::from_fn(|lane| outputs.map(|v| v.0[lane]))
    }

    /// Power losses of a crane under an input \[W\].
    pub fn losses(&self, lane: usize, input: &Input<f64>) -> f64 {
        self.cranes[lane].power(&state_of(&self.state, lane), input).losses()
    }

    /// Replaces the parameters of one crane by those of another description of the same structure, and its dissolved
    /// air, as a reduction of the transition pressure for each node \[Pa\].
    ///
    /// # Errors
    ///
    /// [`PlantError::Build`] if the description gives no model, [`PlantError::Make`] if it gives one of another
    /// structure; all cranes then stay as they were.
    pub fn set_parameters(
        &mut self,
        lane: usize,
        description: &Description,
        dissolved_air: Option<Nodes<f64>>,
    ) -> Result<(), PlantError> {
        let mut crane = description.crane::<ROOM>()?;
        crane.circuit.dissolved_air = dissolved_air;
        let before = std::mem::replace(&mut self.cranes[lane], crane);
        if !self.put_together() {
            self.cranes[lane] = before;
            return Err(PlantError::Make);
        }
        Ok(())
    }

    /// Sets for each crane the reduction of the oil's transition pressure by dissolved air \[Pa\]. False, without any
    /// change, if only some are given.
    pub fn set_dissolved_air(&mut self, shifts: [Option<Nodes<f64>>; W]) -> bool {
        if shifts.iter().any(|shift| shift.is_some() != shifts[0].is_some()) {
            return false;
        }
        for (crane, shift) in self.cranes.iter_mut().zip(shifts) {
            crane.circuit.dissolved_air = shift;
        }
        self.put_together()
    }

    /// Takes over the parameters of `cranes`; false, and nothing is taken, where they are no longer of
    /// the same make.
    fn put_together(&mut self) -> bool {
        let Some(wide) = together(&self.cranes) else { return false };
        self.wide = wide;
        self.stepper = Implicit::new(&self.wide);
        true
    }
}

/// The parameters of all cranes, lane by lane; none where they are not of the same make.
fn together<const W: usize>(cranes: &[Crane<f64, ROOM>; W]) -> Option<Crane<Lanes<W>, ROOM>> {
    let lists = cranes.each_ref().map(|crane| {
        let mut list = Vec::with_capacity(512);
        crane.map(&mut |value| list.push(value));
        list
    });
    // the structure without the numbers: laws, options, lengths
    let make = |crane: &Crane<f64, ROOM>| crane.map(&mut |_| ());
    let same = cranes.iter().all(|crane| make(crane) == make(&cranes[0]));
    let mut index = 0_usize..;
    same.then(|| {
        cranes[0].map(&mut |value| match index.next() {
            Some(i) => Lanes(lists.each_ref().map(|list| list[i])),
            None => Lanes([value; W]),
        })
    })
}

fn states_together<const W: usize>(
    states: &[CraneState<f64, ROOM>; W],
) -> CraneState<Lanes<W>, ROOM> {
    let mut wide = states[0].map(|value| Lanes([value; W]));
    for (lane, state) in states.iter().enumerate() {
        put(&mut wide, lane, state);
    }
    wide
}

fn put<const W: usize>(
    wide: &mut CraneState<Lanes<W>, ROOM>,
    lane: usize,
    state: &CraneState<f64, ROOM>,
) {
    for i in 0..ROOM {
        wide.boom.angle[i].0[lane] = state.boom.angle[i];
        wide.boom.angular_velocity[i].0[lane] = state.boom.angular_velocity[i];
    }
    wide.bristle.0[lane] = state.bristle;
    let nodes = state.circuit.nodes.to_array();
    let mut all = wide.circuit.nodes.to_array();
    for (entry, node) in all.iter_mut().zip(nodes) {
        entry.0[lane] = node;
    }
    wide.circuit.nodes = Nodes::from_array(all);
    wide.circuit.gas_volume.0[lane] = state.circuit.gas_volume;
}

fn state_of<const W: usize>(
    wide: &CraneState<Lanes<W>, ROOM>,
    lane: usize,
) -> CraneState<f64, ROOM> {
    CraneState {
        boom: BoomState {
            angle: wide.boom.angle.map(|v| v.0[lane]),
            angular_velocity: wide.boom.angular_velocity.map(|v| v.0[lane]),
        },
        bristle: wide.bristle.0[lane],
        circuit: CircuitState {
            nodes: wide.circuit.nodes.map(|v| v.0[lane]),
            gas_volume: wide.circuit.gas_volume.0[lane],
        },
    }
}
