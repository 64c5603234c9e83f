//! Rust's controllers with the crane that they simulate, on a machine that lags and rings.

use hydroboom_control::{
    BenchmarkMemory, DeviationMemory, FollowingMemory, Measured, ModelFollowing, Reference, Seen,
    Watched,
};
use hydroboom_description::Description;
use hydroboom_model::stepping::published;
use hydroboom_model::{Crane, CraneState, Input};

/// What is wanted, and measured of the machine, in a period. For a while the machine is torn off to both sides, and the reference faster than the motor.
pub fn shown(k: usize) -> (Reference<f64>, Watched<f64>) {
    let time = 1e-3 * k as f64;
    let moved = 0.02 * (1.0 - (1.5 * time).cos());
    let (fast, dash) = (0.35, |begun: f64| (time - begun).clamp(0.0, 0.15));
    let dashed = fast * (dash(0.2) - dash(0.35));
    let dashes = match time {
        t if (0.2..0.35).contains(&t) => fast,
        t if (0.35..0.5).contains(&t) => -fast,
        _ => 0.0,
    };
    let position = 0.05 + moved + dashed;
    let reference = Reference { position, velocity: 0.03 * (1.5 * time).sin() + dashes };
    let ringing = (15.0 * time).sin();
    let torn = 0.03 * (40.0 * (time - 0.2).clamp(0.0, 0.3)).sin();
    let stroke = 0.0495 + 0.97 * moved + torn + 2e-4 * ringing;
    let motor_speed = 9.0 * (1.5 * time).sin() + 0.3 * ringing;
    (reference, Watched { stroke, load_pressure: 62e5 + 3e5 * ringing, motor_speed })
}

/// A controller and its simulated crane.
pub struct Steered {
    description: Description,
    crane: Crane<f64, 3>,
    law: Option<ModelFollowing<f64>>,
    pub state: CraneState<f64, 3>,
    simulated: BenchmarkMemory<f64>,
    following: FollowingMemory<f64>,
    memory: BenchmarkMemory<f64>,
    deviation: DeviationMemory<f64>,
    pub motor: f64,
    /// By how much the machine was told otherwise at most, for being led to a reference \[rev/s\].
    pub steered: f64,
}

impl Steered {
    /// At rest; model following, or the published controller.
    pub fn new(description: &Description, follows: bool) -> Self {
        let n = &description.numbers;
        let crane = description.crane::<3>().unwrap();
        let state = crane.at_rest(&description.start_over(n, n.motion_start)).unwrap();
        let law = follows.then(|| hydroboom_design::model_following(description).unwrap());
        let (benchmark, machine) = (description.benchmark(), shown(0).1);
        let mut new = Self {
            description: description.clone(),
            crane,
            law,
            state,
            simulated: BenchmarkMemory::default(),
            following: FollowingMemory::default(),
            memory: benchmark.start(&of(&machine)),
            deviation: DeviationMemory::default(),
            motor: 0.0,
            steered: 0.0,
        };
        let seen = new.seen();
        new.simulated = benchmark.start(&seen.measured());
        if let Some(law) = &new.law {
            new.deviation = law.begin(&machine, &seen);
        }
        new
    }

    /// What is seen of the simulated crane.
    pub fn seen(&self) -> Seen<f64> {
        let o = self.crane.outputs(&self.state);
        let load_pressure = self.crane.cylinder.load_pressure(o.pressure_a, o.pressure_b);
        Seen { stroke: o.stroke, velocity: o.velocity, load_pressure }
    }

    /// Motor speed of the machine in a period; that of the simulated crane is changed.
    pub fn period(&mut self, k: usize) -> f64 {
        let ((reference, machine), seen) = (shown(k), self.seen());
        let benchmark = self.description.benchmark();
        match &self.law {
            Some(law) => {
                self.motor = law.update(&mut self.following, &reference, &seen);
                let led = self.following.led(&reference, 1.0);
                let fed_back =
                    law.feedback(&mut self.deviation.clone(), &machine, &seen, self.motor, 0.0);
                let speed = law.steer(&mut self.deviation, &machine, &seen, self.motor, &led);
                self.steered = self.steered.max((speed - fed_back).abs());
                speed
            }
            None => {
                let own = benchmark.velocity_feedforward(&reference);
                let (memory, seen) = (&mut self.simulated, seen.measured());
                let asked = benchmark.update(memory, &reference, &seen, own);
                self.motor = benchmark.limits.follow(self.motor, asked, benchmark.period);
                benchmark.update(&mut self.memory, &reference, &of(&machine), self.motor)
            }
        }
    }

    /// A step of the simulated crane.
    pub fn step(&mut self) {
        let input = Input { pump_speed: self.motor, holding_valve: 1.0 };
        published(&self.crane, &mut self.state, &input, self.description.numbers.simulation_period);
    }
}

fn of(machine: &Watched<f64>) -> Measured<f64> {
    Measured { stroke: machine.stroke, load_pressure: machine.load_pressure }
}
