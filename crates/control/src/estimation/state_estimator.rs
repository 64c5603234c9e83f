//! The machine's state when a command arrives: Kalman filter, identified drive lag, and prediction over the known delays.
//!
//! A measurement is some cycles old, and a command arrives some cycles later. The filter runs at the time
//! of the measurement. Its state is predicted over both delays with the commands that are on their way
//! (state prediction over the dead time; Z. Artstein, IEEE Trans. Automatic Control 27 (1982) 869).

use super::drive_identification::{DriveIdentification, DriveLag};
use super::extended_kalman_filter::{EstimatorInput, EstimatorState, ExtendedKalmanFilter};
use super::reduced_model::MachineState;
use crate::memory::Memory;
use hydroboom_math::{Real, record};

/// Largest delay of measurement or command \[cycles\].
pub const LARGEST_DELAY: usize = 20;
/// Commands that are kept: those on their way, and the one that drove the motor in the period that was measured last.
const COMMANDS: usize = 2 * LARGEST_DELAY + 1;

/// Settings of the estimator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StateEstimator<T> {
    /// The filter.
    pub filter: ExtendedKalmanFilter<T>,
    /// Identification of the drive.
    pub drive: DriveIdentification<T>,
    /// Share of the way to its command that the motor is thought to go in a period before anything is measured \[1\].
    pub drive_coefficient: T,
    /// Change of motor speed \[rev/s\] in a period at the slew limit.
    pub slew: T,
    /// Share of that up to which the drive's lag is identified \[1\].
    pub free_slew: T,
    /// Delay of a measurement \[cycles\].
    pub measurement_delay_cycles: usize,
    /// Delay of a command \[cycles\].
    pub command_delay_cycles: usize,
}

record! {
    /// The machine's state at the time a command arrives.
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

/// State of the estimator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StateEstimatorState<T> {
    /// The filter's.
    pub filter: EstimatorState<T>,
    /// The drive.
    pub drive: DriveLag<T>,
    /// Commands \[rev/s\], newest first.
    commands: [T; COMMANDS],
    /// Motor speed that was read last \[rev/s\].
    motor_speed: T,
    /// Piston-side pressure beyond the load pressure \[Pa\].
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
    /// `yes` where `mask` holds, `no` elsewhere.
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

    /// The commands that are on their way \[rev/s\], newest first; more than the delays need are kept.
    pub fn commands(&self) -> &[T] {
        &self.commands
    }

    /// The same with other commands on their way \[rev/s\], newest first, and another motor speed that was read last \[rev/s\].
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
    /// The same estimator over another number.
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

    /// The same with other delays of a measurement and of a command \[cycles\].
    #[must_use]
    pub fn with_delays(mut self, measurement: usize, command: usize) -> Self {
        (self.measurement_delay_cycles, self.command_delay_cycles) = (measurement, command);
        self
    }

    /// From sampling to actuation \[cycles\].
    pub fn total_delay(&self) -> usize {
        self.measurement_delay_cycles.min(LARGEST_DELAY)
            + self.command_delay_cycles.min(LARGEST_DELAY)
    }

    /// At rest beside a machine. `measured` has the measured motor speed.
    pub fn start(&self, measured: &EstimatorInput<T>) -> StateEstimatorState<T> {
        StateEstimatorState {
            filter: self.filter.start(measured),
            drive: self.drive.start(self.drive_coefficient),
            commands: [measured.motor_speed; COMMANDS],
            motor_speed: measured.motor_speed,
            rod_side_term: measured.rod_side_term,
        }
    }

    /// A control period: `measured` has the measured motor speed; `command` \[rev/s\] was sent in the
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

    /// The same, with unknown flow, transition pressure and drive lag as they are where `is_frozen` holds.
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

    /// A control period in which valves hold the load. The identified drive stays.
    pub fn hold(&self, state: &mut StateEstimatorState<T>, measured: &EstimatorInput<T>) {
        self.filter.hold(&mut state.filter, measured);
        state.commands = [measured.motor_speed; COMMANDS];
        state.motor_speed = measured.motor_speed;
        state.rod_side_term = measured.rod_side_term;
    }

    /// Motor speed \[rev/s\] that is to be read next, where it is not read.
    pub fn predicted_speed(&self, state: &StateEstimatorState<T>) -> T {
        // the command that drives the motor in the period that is to be measured, one newer than the last
        let newer = self.total_delay().saturating_sub(1);
        state.drive.next(state.motor_speed, state.commands[newer], self.slew)
    }

    /// The state when the command arrives that is sent now.
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

    /// Time from now until a command arrives that is sent now \[s\].
    pub fn command_delay(&self) -> T {
        self.filter.period * T::lit(self.command_delay_cycles as f64)
    }
}
