//! State estimator with prediction over the delays: Kalman filter and identified drive lag.
//!
//! A measurement is some cycles old, and a command arrives some cycles later. The filter runs at the time
//! of the measurement. Its state is predicted over both delays with the commands that are on their way
//! (state prediction over the dead time; Z. Artstein, IEEE Trans. Automatic Control 27 (1982) 869).

use super::drive_identification::{DriveIdentification, DriveLag};
use super::extended_kalman_filter::{EstimatorInput, EstimatorState, ExtendedKalmanFilter};
use super::reduced_model::MachineState;
use crate::memory::Memory;
use hydroboom_math::{Real, record};

/// Largest delay of a measurement, and of a command \[control periods\].
pub const LARGEST_DELAY: usize = 20;
/// Commands that are kept: those on their way, and the one that drove the motor in the period that was measured last.
const COMMANDS: usize = 2 * LARGEST_DELAY + 1;

/// State estimator: Kalman filter, identified drive lag and prediction over the delays. Its state is a
/// [`StateEstimatorState`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StateEstimator<T> {
    /// Extended Kalman filter.
    pub filter: ExtendedKalmanFilter<T>,
    /// Identification of the drive's lag.
    pub drive: DriveIdentification<T>,
    /// Prior lag coefficient g of the drive \[1\].
    pub drive_coefficient: T,
    /// Largest change of motor speed in a control period \[rev/s\].
    pub slew: T,
    /// Share of [`slew`](Self::slew) up to which the drive's lag is identified \[1\].
    pub free_slew: T,
    /// Delay of a measurement \[control periods\], at most [`LARGEST_DELAY`].
    pub measurement_delay_cycles: usize,
    /// Delay of a command \[control periods\], at most [`LARGEST_DELAY`].
    pub command_delay_cycles: usize,
}

record! {
    /// State of the machine predicted to the arrival of the command.
    pub struct PredictedState<T> {
        /// Position of the load in the piston's travel
        #[unit = "m"]
        pub position: T,
        /// Velocity of the load in the piston's travel
        #[unit = "m/s"]
        pub velocity: T,
        /// Load pressure
        #[unit = "Pa"]
        pub load_pressure: T,
        /// Motor speed
        #[unit = "rev/s"]
        pub motor_speed: T,
    }
}

/// State of the state estimator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StateEstimatorState<T> {
    /// State of the extended Kalman filter.
    pub filter: EstimatorState<T>,
    /// Identified lag of the drive.
    pub drive: DriveLag<T>,
    /// Commands \[rev/s\], newest first.
    commands: [T; COMMANDS],
    /// Motor speed that was read last \[rev/s\].
    motor_speed: T,
    /// Part of the piston-side pressure that balances the rod side, (A_r/A_p) p_B \[Pa\].
    pub rod_side_term: T,
}

impl<T: Copy> Memory<T> for StateEstimatorState<T> {
    fn visited(self, visit: &mut impl FnMut(&'static str, T) -> T) -> Self {
        Self {
            filter: self.filter.visited(visit),
            drive: self.drive.map(|v| visit("drive_lag", v)),
            commands: self.commands.map(|v| visit("commands", v)),
            motor_speed: visit("motor_speed_read_before", self.motor_speed),
            rod_side_term: visit("rod_side_term", self.rod_side_term),
        }
    }
}

impl<T: Real> StateEstimatorState<T> {
    /// Element-wise selection: `yes` where `mask` holds, else `no`.
    #[must_use]
    pub fn select(mask: T::Mask, yes: &Self, no: &Self) -> Self {
        let pick = |yes: T, no: T| T::select(mask, yes, no);
        Self {
            filter: EstimatorState::select(mask, &yes.filter, &no.filter),
            drive: DriveLag {
                coefficient: pick(yes.drive.coefficient, no.drive.coefficient),
                variance: pick(yes.drive.variance, no.drive.variance),
            },
            commands: core::array::from_fn(|k| pick(yes.commands[k], no.commands[k])),
            motor_speed: pick(yes.motor_speed, no.motor_speed),
            rod_side_term: pick(yes.rod_side_term, no.rod_side_term),
        }
    }

    /// Commanded motor speeds of the last 41 control periods \[rev/s\], newest first: both delays at their largest,
    /// and one.
    pub fn commands(&self) -> &[T] {
        &self.commands
    }

    /// Replaces the commanded motor speeds of the last control periods \[rev/s\], newest first, and the last measured
    /// motor speed \[rev/s\].
    ///
    /// Of more than 41 commands the oldest are ignored; fewer leave the older ones as they are.
    #[must_use]
    pub fn with_commands(mut self, commands: &[T], motor_speed: T) -> Self {
        for (kept, command) in self.commands.iter_mut().zip(commands) {
            *kept = *command;
        }
        self.motor_speed = motor_speed;
        self
    }
}

impl<T: Real> StateEstimator<T> {
    /// Converts every setting to another number type by `f`.
    pub fn map<U: Real>(&self, f: impl Fn(T) -> U + Copy) -> StateEstimator<U> {
        StateEstimator {
            filter: self.filter.map(f),
            drive: self.drive.map(f),
            drive_coefficient: f(self.drive_coefficient),
            slew: f(self.slew),
            free_slew: f(self.free_slew),
            measurement_delay_cycles: self.measurement_delay_cycles,
            command_delay_cycles: self.command_delay_cycles,
        }
    }

    /// Replaces the delays of a measurement and of a command \[control periods\]; each counts as [`LARGEST_DELAY`] at
    /// most.
    #[must_use]
    pub fn with_delays(mut self, measurement: usize, command: usize) -> Self {
        (self.measurement_delay_cycles, self.command_delay_cycles) = (measurement, command);
        self
    }

    /// Delay from sampling to actuation \[control periods\].
    pub fn total_delay(&self) -> usize {
        self.measurement_delay_cycles.min(LARGEST_DELAY)
            + self.command_delay_cycles.min(LARGEST_DELAY)
    }

    /// Initial state of a machine at rest; `measured` has the motor speed \[rev/s\] as measured.
    pub fn start(&self, measured: &EstimatorInput<T>) -> StateEstimatorState<T> {
        StateEstimatorState {
            filter: self.filter.start(measured),
            drive: self.drive.start(self.drive_coefficient),
            commands: [measured.motor_speed; COMMANDS],
            motor_speed: measured.motor_speed,
            rod_side_term: measured.rod_side_term,
        }
    }

    /// One control period. `measured` has the motor speed \[rev/s\] as measured; `command` \[rev/s\] was sent in the
    /// period before.
    pub fn update(
        &self,
        state: &mut StateEstimatorState<T>,
        measured: &EstimatorInput<T>,
        command: T,
    ) {
        let never = T::one().lt(T::zero());
        self.update_frozen(state, measured, command, never);
    }

    /// One control period as [`update`](Self::update), but without estimation of unknown flow, transition pressure
    /// and drive lag where `is_frozen` holds.
    pub fn update_frozen(
        &self,
        state: &mut StateEstimatorState<T>,
        measured: &EstimatorInput<T>,
        command: T,
        is_frozen: T::Mask,
    ) {
        state.commands.copy_within(..COMMANDS - 1, 1);
        state.commands[0] = command;
        let speed = measured.motor_speed;
        let mean = T::lit(0.5) * (state.motor_speed + speed);
        // the lag is not observable from a motor at its torque or slew limit
        let is_free = (speed - state.motor_speed).abs().lt(self.free_slew * self.slew);
        let is_informative =
            is_free & self.filter.innovation_test.is_consistent(state.filter.mean_nis) & !is_frozen;
        let driven = state.commands[self.total_delay()];
        let period = self.filter.period;
        self.drive.update(
            &mut state.drive,
            driven,
            state.motor_speed,
            speed,
            period,
            is_informative,
        );
        let measured_mean = EstimatorInput { motor_speed: mean, ..*measured };
        self.filter.update_frozen(&mut state.filter, &measured_mean, is_frozen);
        state.motor_speed = speed;
        state.rod_side_term = measured.rod_side_term;
    }

    /// One control period with the load-holding valves shut; the identified drive lag stays.
    pub fn hold(&self, state: &mut StateEstimatorState<T>, measured: &EstimatorInput<T>) {
        self.filter.hold(&mut state.filter, measured);
        state.commands = [measured.motor_speed; COMMANDS];
        state.motor_speed = measured.motor_speed;
        state.rod_side_term = measured.rod_side_term;
    }

    /// Predicted motor speed of the next measurement \[rev/s\], a substitute for one that is missing.
    pub fn predicted_speed(&self, state: &StateEstimatorState<T>) -> T {
        // the command that drives the motor in the period that is to be measured, one newer than the last
        let newer = self.total_delay().saturating_sub(1);
        state.drive.next(state.motor_speed, state.commands[newer], self.slew)
    }

    /// State predicted to the time at which a command that is sent now arrives.
    pub fn predict(&self, state: &StateEstimatorState<T>) -> PredictedState<T> {
        let (mut z, mut speed) = (state.filter.estimate, state.motor_speed);
        for cycle in (0..self.total_delay()).rev() {
            let next = state.drive.next(speed, state.commands[cycle], self.slew);
            let mean = T::lit(0.5) * (speed + next);
            z = self.filter.model.step(&z, mean, state.rod_side_term, self.filter.period);
            speed = next;
        }
        let MachineState { position, velocity, load_pressure, .. } = z;
        PredictedState { position, velocity, load_pressure, motor_speed: speed }
    }

    /// Delay until a command that is sent now arrives \[s\].
    pub fn command_delay(&self) -> T {
        self.filter.period * T::lit(self.command_delay_cycles as f64)
    }
}
