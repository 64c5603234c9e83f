//! The four published strategies as one controller: feedforward by velocity (1) or by the simulated crane's motor speed, alone
//! (tests 1 and 2 of section 5.3) or with the feedback of the benchmark controller (figures 5 and 15).
//!
//! The simulated crane follows the reference under a benchmark controller of its own (figure 13); its motor speed is the
//! feedforward.

use crate::command::Command;
use crate::controller::{AxisState, Controller, ControllerStatus, SimulatedState};
use crate::feedback::benchmark::{Benchmark, BenchmarkInput, BenchmarkMemory};
use crate::measurement::Measurement;
use crate::reference::preview::Preview;
use crate::reference::profile::SetPoint;
use crate::strategy::Strategy;

/// A published strategy at work on one axis. The strategy may be changed from one control period to the next.
#[derive(Clone, Copy, Debug)]
pub struct PublishedStrategy {
    strategy: Strategy,
    law: Benchmark<f64>,
    /// Rod-side area over piston area.
    area_ratio: f64,
    memory: BenchmarkMemory<f64>,
    /// Motor speed \[rev/s\] at which feedback takes over in the next update.
    takes_over_at: Option<f64>,
    simulated: SimulatedLoop,
}

/// The benchmark controller around the simulated crane.
#[derive(Clone, Copy, Debug, Default)]
struct SimulatedLoop {
    /// None until the simulated crane was seen for the first time.
    memory: Option<BenchmarkMemory<f64>>,
    motor_speed: f64,
}

impl PublishedStrategy {
    /// A controller with the benchmark's `law` on a cylinder of a ratio of rod-side to piston area.
    pub fn new(strategy: Strategy, law: Benchmark<f64>, area_ratio: f64) -> Self {
        Self {
            strategy,
            law,
            area_ratio,
            memory: BenchmarkMemory::default(),
            takes_over_at: None,
            simulated: SimulatedLoop::default(),
        }
    }

    /// The strategy.
    pub fn strategy(&self) -> Strategy {
        self.strategy
    }

    /// Changes to another strategy. Its feedback takes over at the motor speed \[rev/s\] that was commanded last.
    pub fn change_to(&mut self, strategy: Strategy, motor_speed: f64) {
        self.strategy = strategy;
        self.takes_over_at = Some(motor_speed);
    }

    /// Begins at a set point at which the machine rests with its motor at a speed \[rev/s\], without a bump.
    pub fn start_at(&mut self, measurement: &Measurement, set_point: &SetPoint<f64>, speed: f64) {
        self.forget_measurements(measurement);
        let input = self.input(measurement);
        self.law.take_over(&mut self.memory, set_point, &input, 0.0, speed);
    }

    /// Begins feedback anew, after it has not been in use.
    pub fn forget_measurements(&mut self, measurement: &Measurement) {
        self.memory = self.law.start(&self.input(measurement));
        self.takes_over_at = None;
    }

    /// Begins with the simulated crane anew: it was set to a state of rest.
    pub fn forget_simulated(&mut self) {
        self.simulated = SimulatedLoop::default();
    }

    /// Leads the simulated crane from its `state` on, that something else has led at a motor speed \[rev/s\], without a bump.
    pub fn take_over_simulated(
        &mut self,
        set_point: &SetPoint<f64>,
        state: &AxisState<f64>,
        motor_speed: f64,
    ) {
        let input = BenchmarkInput::of_simulated(state);
        let mut memory = self.law.start(&input);
        let feedforward = self.law.velocity_feedforward(set_point);
        self.law.take_over(&mut memory, set_point, &input, feedforward, motor_speed);
        self.simulated = SimulatedLoop { memory: Some(memory), motor_speed };
    }

    fn input(&self, measurement: &Measurement) -> BenchmarkInput<f64> {
        BenchmarkInput::of(&measurement.axes[0].signals, self.area_ratio)
    }
}

impl SimulatedLoop {
    /// Motor speed \[rev/s\] of the simulated crane for the coming period.
    fn update(
        &mut self,
        law: &Benchmark<f64>,
        set_point: &SetPoint<f64>,
        state: &AxisState<f64>,
    ) -> f64 {
        let input = BenchmarkInput::of_simulated(state);
        let memory = self.memory.get_or_insert_with(|| law.start(&input));
        let feedforward = law.velocity_feedforward(set_point);
        let wanted = law.update(memory, set_point, &input, feedforward);
        self.motor_speed = law.limits.follow(self.motor_speed, wanted, law.period);
        self.motor_speed
    }
}

impl Controller for PublishedStrategy {
    fn start(&mut self, measurement: &Measurement, _delay_cycles: u32) {
        self.forget_measurements(measurement);
        self.forget_simulated();
    }

    fn update(
        &mut self,
        measurement: &Measurement,
        preview: &Preview<f64>,
        simulated: Option<&SimulatedState>,
    ) -> Command {
        let set_point = preview.now();
        if let Some(simulated) = simulated {
            self.simulated.update(&self.law, &set_point, &simulated.axes[0]);
        }
        let feedforward = match self.strategy.simulates() {
            true => self.simulated.motor_speed,
            false => self.law.velocity_feedforward(&set_point),
        };
        let takes_over_at = self.takes_over_at.take();
        if !self.strategy.measures() {
            return Command::released([feedforward]);
        }
        let input = self.input(measurement);
        let (law, memory) = (&self.law, &mut self.memory);
        if let Some(speed) = takes_over_at {
            law.take_over(memory, &set_point, &input, feedforward, speed);
        }
        Command::released([law.update(memory, &set_point, &input, feedforward)])
    }

    fn status(&self) -> ControllerStatus {
        let simulated = self.strategy.simulates().then_some([self.simulated.motor_speed]);
        ControllerStatus {
            simulated_motor_speeds: simulated,
            is_closed_loop: self.strategy.measures(),
        }
    }
}
