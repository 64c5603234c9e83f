//! A CiA 402 drive on the bus: its controlword and target in each cycle, and detection of its faults.

use crate::cia402::{CYCLIC_VELOCITY, DriveState, FAULT_RESET, status_bit};
use crate::fault::Fault;
use crate::table::DriveRow;

/// Longest time for which an enabled drive may fail to follow its target \[ns\]: it first opens its brake and switches
/// its mode. Estimate; brakes open within 0.2 s.
const FOLLOW_TIMEOUT: u64 = 500_000_000;
/// Cycles for which controlword bit 7 (fault reset) is sent.
const RESET_CYCLES: u32 = 10;

/// State that is requested of a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RequestedState {
    /// Operation enabled.
    Operation,
    /// Braking: an enabled drive stays enabled and brakes with torque, another one is not enabled.
    Braking,
    /// Switched off, without torque.
    Off,
}

/// State of a drive, from cycle to cycle.
#[derive(Clone, Debug)]
pub(crate) struct Drive {
    pub(crate) row: DriveRow,
    state: DriveState,
    statusword: u16,
    error: u16,
    has_open_stop_circuit: bool,
    /// Whether its stop circuit was opened while it was commanded on. Until the operator resets it, it is not
    /// enabled again; while it is enabled it stays so, with target zero.
    is_safely_stopped: bool,
    /// Whether the last controlword enabled it, or led there.
    is_commanded_on: bool,
    /// Whether it was enabled and commanded on: leaving operation by itself is then a fault.
    was_enabled: bool,
    /// Consecutive cycles in which it was enabled and did not follow its target.
    ignoring: u32,
    /// Largest number of such cycles.
    ignoring_max: u32,
    /// Cycles left in which the fault reset is sent.
    reset: u32,
}

impl Drive {
    /// A drive that is commanded once in each period \[ns\].
    pub(crate) fn new(row: DriveRow, period: u64) -> Self {
        Self {
            row,
            state: DriveState::NotReady,
            statusword: 0,
            error: 0,
            has_open_stop_circuit: false,
            is_safely_stopped: false,
            is_commanded_on: false,
            was_enabled: false,
            ignoring: 0,
            ignoring_max: FOLLOW_TIMEOUT.div_ceil(period.max(1)) as u32,
            reset: 0,
        }
    }

    /// Evaluates its inputs; returns a fault if it has one.
    pub(crate) fn evaluate(&mut self, inputs: &[u8]) -> Option<Fault> {
        let row = &self.row;
        let device = row.device as u16;
        self.statusword = row.statusword.read(inputs) as u16;
        self.error = row.error.map_or(0, |place| place.read(inputs) as u16);
        self.state = DriveState::of(self.statusword);
        self.has_open_stop_circuit = row.stop_circuit.is_some_and(|bits| bits.is_set(inputs));
        let is_enabled = self.is_enabled();
        let was_enabled = std::mem::replace(&mut self.was_enabled, is_enabled);
        if matches!(self.state, DriveState::Fault | DriveState::FaultReactionActive) {
            // a reset takes a few cycles
            if self.reset > 0 {
                return None;
            }
            return Some(Fault::Drive { device, code: self.error });
        }
        // with safe stop 1 the bits come before the drive has stopped and leaves operation enabled
        self.is_safely_stopped |=
            self.has_open_stop_circuit && (was_enabled || is_enabled && self.is_commanded_on);
        if self.is_safely_stopped && (is_enabled || was_enabled) {
            return Some(Fault::SafeTorqueOff { device });
        }
        let has_mode = self.row.mode_display.read(inputs) as u8 as i8 == CYCLIC_VELOCITY;
        let follows = status_bit::REMOTE | status_bit::FOLLOWS_TARGET;
        let obeys = has_mode && self.statusword & follows == follows;
        self.ignoring = if is_enabled && !obeys { self.ignoring + 1 } else { 0 };
        if self.ignoring > self.ignoring_max {
            return Some(Fault::TargetIgnored { device });
        }
        // it left operation enabled without a command to do so
        (was_enabled && !is_enabled).then_some(Fault::DriveDisabled { device })
    }

    /// Writes controlword, target and mode into its outputs; the target is zero until operation is enabled.
    pub(crate) fn command(&mut self, outputs: &mut [u8], requested: RequestedState, target: i64) {
        let may_operate = match requested {
            // to disable the drive would end the ramp of safe stop 1: it leaves operation enabled by itself
            _ if self.is_safely_stopped => self.is_enabled(),
            RequestedState::Operation => !self.has_open_stop_circuit,
            RequestedState::Braking => self.is_enabled(),
            RequestedState::Off => false,
        };
        // switching off on command is no fault
        self.is_commanded_on = may_operate;
        self.was_enabled &= may_operate;
        let mut word = self.state.controlword(may_operate);
        if self.reset > 0 {
            self.reset -= 1;
            word = if self.state == DriveState::Fault { FAULT_RESET } else { word };
        }
        self.row.controlword.write(outputs, u64::from(word));
        let follows = self.is_enabled() && !self.is_safely_stopped;
        let target = if follows { target } else { 0 };
        self.row.target.write(outputs, target as u64);
        if let Some(mode) = self.row.mode {
            mode.write(outputs, CYCLIC_VELOCITY as u64);
        }
    }

    /// Begins a fault reset, on the operator's request.
    pub(crate) fn reset(&mut self) {
        self.reset = RESET_CYCLES;
        self.ignoring = 0;
        self.is_safely_stopped = false;
    }

    pub(crate) fn is_enabled(&self) -> bool {
        self.state == DriveState::OperationEnabled
    }

    pub(crate) fn statusword(&self) -> u16 {
        self.statusword
    }

    /// Its error code (0x603F); 0 without a fault, or where the object is not mapped.
    pub(crate) fn error(&self) -> u16 {
        self.error
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::{BitCondition, Place};

    const PLACE: fn(usize, u8) -> Place = |bit, bits| Place { device: 3, bit, bits };

    const PERIOD: u64 = 1_000_000;
    /// Cycles for which a target may be ignored at that period.
    const IGNORED_MAX: u32 = 500;

    fn drive() -> Drive {
        let row = DriveRow {
            device: 3,
            axis: 0,
            controlword: PLACE(0, 16),
            target: PLACE(16, 32),
            mode: Some(PLACE(48, 8)),
            statusword: PLACE(0, 16),
            mode_display: PLACE(16, 8),
            error: None,
            stop_circuit: Some(BitCondition { place: PLACE(24, 8), mask: 8, value: 8 }),
        };
        Drive::new(row, PERIOD)
    }

    /// Inputs with a statusword and a mode, and a closed stop circuit.
    fn inputs(statusword: u16, mode: i8) -> [u8; 4] {
        let [low, high] = statusword.to_le_bytes();
        [low, high, mode as u8, 0]
    }

    /// Inputs with a statusword, mode 9 and an open stop circuit.
    fn opened(statusword: u16) -> [u8; 4] {
        let [low, high, mode, _] = inputs(statusword, 9);
        [low, high, mode, 8]
    }

    /// Controlword and target after a command of speed.
    fn commanded(drive: &mut Drive, requested: RequestedState) -> (u64, u64) {
        let mut outputs = [0; 7];
        drive.command(&mut outputs, requested, 700);
        (PLACE(0, 16).read(&outputs), PLACE(16, 32).read(&outputs))
    }

    /// A drive that is enabled and follows a speed.
    fn moving() -> Drive {
        let mut drive = drive();
        for statusword in [0x0233, 0x1237] {
            assert_eq!(drive.evaluate(&inputs(statusword, 9)), None);
            commanded(&mut drive, RequestedState::Operation);
        }
        drive
    }

    const SAFE_TORQUE_OFF: Option<Fault> = Some(Fault::SafeTorqueOff { device: 3 });

    #[test]
    fn an_open_stop_circuit_of_an_enabled_drive_is_a_fault_and_its_ramp_is_not_cut() {
        let mut drive = moving();
        // safe stop 1: the drive reports it, and stops before it removes the torque
        for requested in [RequestedState::Operation, RequestedState::Braking, RequestedState::Off] {
            assert_eq!(drive.evaluate(&opened(0x1237)), SAFE_TORQUE_OFF);
            assert_eq!(commanded(&mut drive, requested), (0x000f, 0), "{requested:?}");
        }
        // it left operation enabled by itself
        assert_eq!(drive.evaluate(&opened(0x0250)), SAFE_TORQUE_OFF);
        assert_eq!(commanded(&mut drive, RequestedState::Operation), (0x0006, 0));
        assert_eq!(drive.evaluate(&opened(0x0250)), None);
    }

    #[test]
    fn a_safely_stopped_drive_is_not_enabled_again_before_a_reset() {
        // with safe stop 1, and with safe torque off at once
        for first in [opened(0x1237), opened(0x0250)] {
            let mut drive = moving();
            assert_eq!(drive.evaluate(&first), SAFE_TORQUE_OFF);
            commanded(&mut drive, RequestedState::Operation);
            for statusword in [0x0250, 0x0231, 0x0231, 0x0231] {
                drive.evaluate(&inputs(statusword, 9));
                assert_eq!(commanded(&mut drive, RequestedState::Operation), (0x0006, 0));
            }
            drive.reset();
            assert_eq!(drive.evaluate(&inputs(0x0231, 9)), None);
            assert_eq!(commanded(&mut drive, RequestedState::Operation), (0x0007, 0));
        }
    }

    #[test]
    fn an_open_stop_circuit_of_a_drive_that_was_switched_off_is_no_fault() {
        let mut drive = moving();
        commanded(&mut drive, RequestedState::Off);
        for inputs in [opened(0x1237), opened(0x0231), inputs(0x0231, 9)] {
            assert_eq!(drive.evaluate(&inputs), None);
            assert_eq!(commanded(&mut drive, RequestedState::Off).0, 0x0006);
        }
        assert_eq!(commanded(&mut drive, RequestedState::Operation).0, 0x0007);
    }

    #[test]
    fn the_time_for_which_a_target_may_be_ignored_does_not_depend_on_the_period() {
        let row = drive().row;
        for (period, cycles) in [(250_000, 2000), (1_000_000, 500), (10_000_000, 50)] {
            let mut drive = Drive::new(row.clone(), period);
            assert!((0..cycles).all(|_| drive.evaluate(&inputs(0x0237, 9)).is_none()), "{period}");
            let fault = drive.evaluate(&inputs(0x0237, 9));
            assert_eq!(fault, Some(Fault::TargetIgnored { device: 3 }), "{period}");
        }
    }

    #[test]
    fn each_sign_of_an_ignored_target_of_an_enabled_drive_is_detected() {
        // enabled; remote (9) or following (12) missing; another mode
        for (word, mode) in [(0x1037, 9), (0x0237, 9), (0x1237, 8)] {
            let mut drive = drive();
            let found =
                (0..=IGNORED_MAX).map(|_| drive.evaluate(&inputs(word, mode))).collect::<Vec<_>>();
            let (last, before) = found.split_last().unwrap();
            assert!(before.iter().all(Option::is_none), "{word:#06x}");
            assert_eq!(*last, Some(Fault::TargetIgnored { device: 3 }), "{word:#06x}");
        }
        let mut drive = drive();
        assert!((0..2 * IGNORED_MAX).all(|_| drive.evaluate(&inputs(0x1237, 9)).is_none()));
    }

    #[test]
    fn the_target_is_zero_until_operation_is_enabled() {
        let mut outputs = [0; 7];
        for (word, is_enabled) in
            [(0x0250, false), (0x0231, false), (0x0233, false), (0x1237, true)]
        {
            let mut drive = drive();
            drive.evaluate(&inputs(word, 9));
            drive.command(&mut outputs, RequestedState::Operation, -5);
            let target = PLACE(16, 32).read(&outputs) as u32 as i32;
            assert_eq!(target, if is_enabled { -5 } else { 0 }, "{word:#06x}");
            assert_eq!(outputs[6], 9);
        }
    }

    #[test]
    fn switching_off_is_no_fault_and_brakes_an_enabled_drive_only() {
        let mut outputs = [0; 7];
        let mut drive = drive();
        drive.evaluate(&inputs(0x1237, 9));
        drive.command(&mut outputs, RequestedState::Braking, 0);
        assert_eq!(outputs[0], 0x0f, "it keeps its power");
        drive.command(&mut outputs, RequestedState::Off, 0);
        assert_eq!(drive.evaluate(&inputs(0x0231, 9)), None);
        drive.command(&mut outputs, RequestedState::Braking, 0);
        assert_eq!(outputs[0], 0x06, "it is not enabled anew");
        // switching off by itself is a fault
        drive.evaluate(&inputs(0x1237, 9));
        drive.command(&mut outputs, RequestedState::Operation, 0);
        assert_eq!(drive.evaluate(&inputs(0x0250, 9)), Some(Fault::DriveDisabled { device: 3 }));
    }
}
