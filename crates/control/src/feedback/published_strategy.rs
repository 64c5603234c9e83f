//! The four published strategies as one controller. Feedforward is by velocity (1) or by the simulated
//! crane's motor speed. It acts alone (tests 1 and 2 of section 5.3) or with the feedback of the benchmark
//! controller (figures 5 and 15).
//!
//! The simulated crane follows the reference under a benchmark controller of its own (figure 13); its motor speed is
//! the feedforward.

use crate::command::Command;
use crate::controller::{AxisState, Controller, ControllerStatus, SimulatedState};
use crate::feedback::benchmark::{Benchmark, BenchmarkInput, BenchmarkMemory};
use crate::measurement::Measurement;
use crate::reference::preview::Preview;
use crate::reference::profile::SetPoint;
use crate::strategy::Strategy;

/// One of the four published strategies on one axis. The strategy may change from one control period to the next.
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
    /// None before the first state of the simulated crane.
    memory: Option<BenchmarkMemory<f64>>,
    motor_speed: f64,
}

impl PublishedStrategy {
    /// Controller with the benchmark's `law`. `area_ratio` is A_r/A_p \[1\] of the cylinder.
    ///
    /// [`Strategy::ScheduledLqr`] is none of the published strategies; here it acts as
    /// [`Strategy::BenchmarkClosedLoop`].
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

    /// Present strategy.
    pub fn strategy(&self) -> Strategy {
        self.strategy
    }

    /// Changes to another strategy, with bumpless transfer of its feedback from the last commanded motor speed
    /// \[rev/s\].
    pub fn change_to(&mut self, strategy: Strategy, motor_speed: f64) {
        self.strategy = strategy;
        self.takes_over_at = Some(motor_speed);
    }

    /// Starts a strategy at a set point at which the machine rests with a motor speed \[rev/s\], with bumpless
    /// transfer.
    pub fn start_at(
        &mut self,
        strategy: Strategy,
        measurement: &Measurement,
        set_point: &SetPoint<f64>,
        speed: f64,
    ) {
        self.strategy = strategy;
        self.forget_measurements(measurement);
        let input = self.input(measurement);
        self.law.take_over(&mut self.memory, set_point, &input, 0.0, speed);
    }

    /// Restarts the feedback from a measurement, after a time in which it was not in use.
    pub fn forget_measurements(&mut self, measurement: &Measurement) {
        self.memory = self.law.start(&self.input(measurement));
        self.takes_over_at = None;
    }

    /// Restarts the controller of the simulated crane at its state of rest; `None`: at the next state.
    pub fn start_simulated(&mut self, state: Option<&AxisState<f64>>) {
        let memory = state.map(|state| self.law.start(&BenchmarkInput::of_simulated(state)));
        self.simulated = SimulatedLoop { memory, motor_speed: 0.0 };
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
        self.start_simulated(None);
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
        let leads = self.strategy.simulates() || self.simulated.memory.is_some();
        ControllerStatus {
            simulated_motor_speeds: leads.then_some([self.simulated.motor_speed]),
            is_closed_loop: self.strategy.measures(),
            ..ControllerStatus::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::actuator_limits::ActuatorLimits;
    use crate::feedback::filter::HighPass;
    use crate::measurement::AxisSignals;

    fn controller(strategy: Strategy) -> PublishedStrategy {
        let law = Benchmark {
            proportional: 4.5,
            integral: 14.45,
            pressure_feedback: 4.77e-11,
            high_pass: HighPass::new(1.04, 1e-3),
            revolutions_per_metre: 313.05,
            displacement: 10.6e-6,
            limits: ActuatorLimits { speed: 50.0, slew: 500.0 },
            period: 1e-3,
        };
        PublishedStrategy::new(strategy, law, 0.7)
    }

    fn measured(stroke: f64) -> Measurement {
        let signals = AxisSignals { stroke, pressure_a: 68e5, ..AxisSignals::default() };
        Measurement::new(1, 0.0, [signals])
    }

    fn moving() -> Preview<f64> {
        Preview::new(1e-3, |t| SetPoint { position: 0.2 + 0.05 * t, velocity: 0.05 })
    }

    fn simulated(stroke: f64) -> SimulatedState {
        SimulatedState { axes: [AxisState { stroke, velocity: 0.05, load_pressure: 66e5 }] }
    }

    #[test]
    fn open_loop_depends_on_no_measurement() {
        for strategy in [Strategy::VelocityFeedforward, Strategy::SimulationFeedforwardOpenLoop] {
            let commands = [0.1, 0.3].map(|stroke| {
                let mut controller = controller(strategy);
                controller.start(&measured(0.2), 0);
                controller.update(&measured(stroke), &moving(), Some(&simulated(0.19)))
            });
            assert_eq!(commands[0], commands[1]);
            assert!(commands[0].axes[0].motor_speed > 0.0);
        }
    }

    #[test]
    fn the_feedforward_is_the_motor_speed_of_the_simulated_crane() {
        let mut controller = controller(Strategy::SimulationFeedforwardOpenLoop);
        controller.start(&measured(0.2), 0);
        for k in 0..20 {
            let command = controller.update(&measured(0.2), &moving(), Some(&simulated(0.19)));
            let speeds = controller.status().simulated_motor_speeds;
            assert_eq!(speeds, Some([command.axes[0].motor_speed]));
            // its motor has a slew rate
            assert!(command.axes[0].motor_speed <= 0.5 * f64::from(k + 1) + 1e-12);
        }
    }

    #[test]
    fn feedback_starts_at_the_last_commanded_speed() {
        let mut controller = controller(Strategy::VelocityFeedforward);
        controller.start(&measured(0.2), 0);
        let closed = Strategy::SimulationFeedforwardClosedLoop;
        controller.change_to(closed, 12.5);
        let command = controller.update(&measured(0.21), &moving(), Some(&simulated(0.19)));
        assert!((command.axes[0].motor_speed - 12.5).abs() < 1e-9, "{command:?}");
        assert!(controller.status().is_closed_loop);
    }
}
