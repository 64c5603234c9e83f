//! Selection of the strategy in a control period: fallback to the benchmark, change without a bump, command.

use super::{ControlTask, Fallback, Period};
use crate::simulation_task::Simulated;
use hydroboom_control::controller::Controller;
use hydroboom_control::feedback::benchmark::BenchmarkInput;
use hydroboom_control::feedback::scheduled_lqr_controller::ScheduledLqrController;
use hydroboom_control::reference::profile::SetPoint;
use hydroboom_control::strategy::Strategy;

/// Largest position difference between simulation and machine, as a share of the tracking limit. Beyond it
/// the benchmark controller takes over. First under feedback, then in open loop.
const DRIFT: f64 = 2.0 / 3.0;
const OPEN_LOOP_DRIFT: f64 = 0.5;
/// Time constant with which the tracking limit decreases after a switch from open loop to feedback \[s\].
const RECOVERY: f64 = 2.0;
/// Largest delay of the simulation \[steps\]. It is more than the simulation has to catch up after the
/// longest delay that the control task tolerates.
const BEHIND: f64 = 500.0;
/// Decay time constant of the offset that keeps the command continuous at a change of strategy \[s\].
const BUMP: f64 = 0.3;
/// Time for which a synchronised simulation must agree with the machine before its strategy is resumed
/// \[s\].
const TRUSTED: f64 = 0.5;

impl ControlTask {
    /// Requested strategy. During the approach to the start of a course an open-loop strategy is replaced
    /// by the benchmark controller.
    pub(super) fn asked(&self, now: &Period) -> Strategy {
        match self.course_time < 0.0 && !now.strategy.estimates() {
            true => Strategy::BenchmarkClosedLoop,
            false => now.strategy,
        }
    }

    /// Motor speed of the scheduled LQR \[rev/s\]; none under another strategy.
    fn estimated_command(&mut self, strategy: Strategy, reference: &SetPoint<f64>) -> Option<f64> {
        let takes_over = strategy != self.strategy;
        let controller = self.scheduled_lqr.as_mut().filter(|_| strategy.estimates())?;
        let mut preview = self.preview;
        preview.shift(self.start_offset);
        if takes_over {
            controller.take_over(reference.position);
        }
        let [command] = controller.update(&self.measurement, &preview, None).axes;
        Some(command.motor_speed)
    }

    /// Computes the motor speed of the active strategy.
    pub(super) fn control(
        &mut self,
        reference: &SetPoint<f64>,
        measured: &BenchmarkInput<f64>,
        now: &Period,
    ) {
        self.follow_simulation(now);
        let asked = self.asked(now);
        self.judge_fallback(asked, measured, now);
        let mut strategy = match self.fallback.is_some() {
            true => Strategy::BenchmarkClosedLoop,
            false => asked,
        };
        let estimated = self.estimated_command(strategy, reference);
        if estimated.is_some_and(|speed| !speed.is_finite()) {
            self.fallback = Some(Fallback::Command);
            strategy = Strategy::BenchmarkClosedLoop;
        }
        let estimated = estimated.filter(|speed| speed.is_finite());
        if let (None, Some(controller)) = (estimated, &mut self.scheduled_lqr) {
            controller.hand_over();
        }
        let changes = strategy != self.strategy;
        if changes && self.strategy.estimates() && strategy.measures() {
            // the published strategies had no measurements while the scheduled LQR was active
            self.published.forget_measurements(&self.measurement);
        }
        if changes && !strategy.estimates() {
            self.published.change_to(strategy, self.wanted);
        }
        // the simulated crane follows the course under every strategy, so that any strategy can be selected
        // later
        let simulated = now.simulated.filter(|s| !s.failed).map(|s| s.state);
        let mut preview = self.preview;
        preview.shift(self.start_offset);
        let measurement = self.judged();
        let published = self.published.update(&measurement, &preview, simulated.as_ref());
        if let (Some(_), Some([speed])) =
            (simulated, self.published.status().simulated_motor_speeds)
        {
            self.simulated_motor = speed;
        }
        let asked = estimated.unwrap_or(published.axes[0].motor_speed);
        if changes {
            self.offset = self.wanted - asked;
            self.strategy = strategy;
        }
        self.wanted = asked + self.offset;
        self.offset *= 1.0 - self.benchmark.period / BUMP;
        // after a change from open loop the tracking limit decreases slowly while feedback removes the
        // error
        self.tracking = match strategy.measures() {
            true => {
                self.tracking
                    + (self.closed_loop_tracking - self.tracking) * self.benchmark.period / RECOVERY
            }
            false => self.open_loop_tracking,
        };
    }

    /// Synchronises with the simulation, and counts the steps by which it is delayed.
    fn follow_simulation(&mut self, now: &Period) {
        if let Some(simulated) = now.simulated.filter(|s| s.epoch != self.epoch) {
            // the simulation was synchronised with the machine at rest
            self.epoch = simulated.epoch;
            self.steps = simulated.steps;
            self.published.start_simulated(Some(simulated.axis()));
            (self.simulated_motor, self.behind, self.trusted) = (0.0, 0.0, 0.0);
        }
        if let Some(simulated) = now.simulated {
            let taken = simulated.steps.saturating_sub(self.steps) as f64;
            self.behind = (self.behind + self.steps_due - taken).max(0.0);
            self.steps = simulated.steps;
        }
    }

    /// Decides on the fallback to the benchmark controller, and on the return to the requested strategy.
    fn judge_fallback(&mut self, asked: Strategy, measured: &BenchmarkInput<f64>, now: &Period) {
        // a strategy that uses the simulation needs one that runs, is on time and agrees with the machine
        let most = match asked.measures() {
            true => DRIFT * self.closed_loop_tracking,
            false => OPEN_LOOP_DRIFT * self.open_loop_tracking,
        };
        let alive = self.behind < BEHIND;
        let near = |s: Simulated| (s.axis().stroke - measured.stroke).abs() <= most;
        let is_true = alive && now.simulated.is_some_and(|s| !s.failed && near(s));
        let estimator = asked.estimates().then_some(self.scheduled_lqr.as_ref());
        let estimator = estimator.map(|c| c.map(ScheduledLqrController::is_valid));
        // a diverged estimator is initialised again at the next release; a non-finite command is not
        // retried in motion
        self.fallback = match (self.fallback, estimator) {
            (Some(Fallback::Estimator), _) | (_, Some(Some(false))) => Some(Fallback::Estimator),
            (Some(Fallback::Command), _) => Some(Fallback::Command),
            (_, Some(None)) => Some(Fallback::NoDesign),
            _ if asked.simulates() && !is_true => Some(Fallback::Simulation),
            (Some(Fallback::NoDesign), _) => None,
            (before, _) => before,
        };
        let drifted = self.fallback == Some(Fallback::Simulation);
        self.trusted = if is_true && drifted { self.trusted + self.benchmark.period } else { 0.0 };
        // the strategy is resumed only after a synchronisation of the simulation with the machine
        if drifted && self.trusted >= TRUSTED && self.epoch != self.fallen_at {
            self.fallback = None;
        }
        if self.fallback != Some(Fallback::Simulation) {
            self.fallen_at = self.epoch;
        }
    }
}
