//! Model following in Rust with the crane that it simulates, on a machine that lags and rings.

use hydroboom_control::controller::AxisState;
use hydroboom_control::deviation::Watched;
use hydroboom_control::deviation_memory::DeviationMemory;
use hydroboom_control::model_following::{FollowingMemory, ModelFollowing};
use hydroboom_control::reference::profile::SetPoint;
use hydroboom_description::Description;
use hydroboom_model::stepping::published;
use hydroboom_model::{Crane, CraneState, Input};

/// What is wanted, and measured of the machine, in a period. For a while the machine is torn off to both sides, and the reference faster than the motor.
pub fn shown(k: usize) -> (SetPoint<f64>, Watched<f64>) {
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
    let reference = SetPoint { position, velocity: 0.03 * (1.5 * time).sin() + dashes };
    let ringing = (15.0 * time).sin();
    let torn = 0.03 * (40.0 * (time - 0.2).clamp(0.0, 0.3)).sin();
    let stroke = 0.0495 + 0.97 * moved + torn + 2e-4 * ringing;
    let motor_speed = 9.0 * (1.5 * time).sin() + 0.3 * ringing;
    (reference, Watched { stroke, load_pressure: 62e5 + 3e5 * ringing, motor_speed })
}

/// Model following and its simulated crane.
pub struct Steered {
    crane: Crane<f64, 3>,
    law: ModelFollowing<f64>,
    pub state: CraneState<f64, 3>,
    following: FollowingMemory<f64>,
    deviation: DeviationMemory<f64>,
    step: f64,
    pub motor: f64,
    /// By how much the machine was told otherwise at most, for being led to a reference \[rev/s\].
    pub steered: f64,
}

impl Steered {
    /// At rest.
    pub fn new(description: &Description) -> Self {
        let n = &description.numbers;
        let crane = description.crane::<3>().unwrap();
        let state = crane.at_rest(&description.start_over(n, n.motion_start)).unwrap();
        let law = hydroboom_design::model_following(description).unwrap();
        let mut new = Self {
            crane,
            law,
            state,
            following: FollowingMemory::default(),
            deviation: DeviationMemory::default(),
            step: n.simulation_period,
            motor: 0.0,
            steered: 0.0,
        };
        new.deviation = new.law.begin(&shown(0).1, &new.seen());
        new
    }

    /// What is seen of the simulated crane.
    pub fn seen(&self) -> AxisState<f64> {
        let o = self.crane.outputs(&self.state);
        let load_pressure = self.crane.cylinder.load_pressure(o.pressure_a, o.pressure_b);
        AxisState { stroke: o.stroke, velocity: o.velocity, load_pressure }
    }

    /// Motor speed of the machine in a period; that of the simulated crane is changed.
    pub fn period(&mut self, k: usize) -> f64 {
        let ((reference, machine), seen) = (shown(k), self.seen());
        let law = &self.law;
        self.motor = law.update(&mut self.following, &reference, &seen);
        let led = self.following.led(&reference, 1.0);
        let fed_back = law.feedback(&mut self.deviation.clone(), &machine, &seen, self.motor, 0.0);
        let speed = law.steer(&mut self.deviation, &machine, &seen, self.motor, &led);
        self.steered = self.steered.max((speed - fed_back).abs());
        speed
    }

    /// A step of the simulated crane.
    pub fn step(&mut self) {
        let input = Input { pump_speed: self.motor, holding_valve: 1.0 };
        published(&self.crane, &mut self.state, &input, self.step);
    }
}
