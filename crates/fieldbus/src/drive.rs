//! A CiA 402 drive on the bus: its controlword and target in each cycle, and detection of its faults.

use crate::cia402::{CYCLIC_VELOCITY, DriveState, FAULT_RESET, status_bit};
use crate::fault::Fault;
use crate::table::DriveRow;

/// Cycles for which an enabled drive may fail to follow its target: it first opens its brake and switches its mode.
/// Estimate; brakes open within 0.2 s.
const MAY_IGNORE: u32 = 500;
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
    /// Whether it was enabled and not commanded off: leaving operation by itself is then a fault.
    was_enabled: bool,
    /// Consecutive cycles in which it was enabled and did not follow its target.
    ignoring: u32,
    /// Cycles left in which the fault reset is sent.
    reset: u32,
}

impl Drive {
    pub(crate) fn new(row: DriveRow) -> Self {
        Self {
            row,
            state: DriveState::NotReady,
            statusword: 0,
            error: 0,
            has_open_stop_circuit: false,
            was_enabled: false,
            ignoring: 0,
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
        let was_enabled =
            std::mem::replace(&mut self.was_enabled, self.state == DriveState::OperationEnabled);
        if matches!(self.state, DriveState::Fault | DriveState::FaultReactionActive) {
            // a reset takes a few cycles
            if self.reset > 0 {
                return None;
            }
            return Some(Fault::Drive { device, code: self.error });
        }
        let has_mode = row.mode_display.read(inputs) as u8 as i8 == CYCLIC_VELOCITY;
        let follows = status_bit::REMOTE | status_bit::FOLLOWS_TARGET;
        let obeys = has_mode && self.statusword & follows == follows;
        self.ignoring = if self.was_enabled && !obeys { self.ignoring + 1 } else { 0 };
        if self.ignoring > MAY_IGNORE {
            return Some(Fault::TargetIgnored { device });
        }
        // it left operation enabled without a command to do so
        match was_enabled && !self.was_enabled {
            true if self.has_open_stop_circuit => Some(Fault::SafeTorqueOff { device }),
            true => Some(Fault::DriveDisabled { device }),
            false => None,
        }
    }

    /// Writes controlword, target and mode into its outputs; the target is zero until operation is enabled.
    pub(crate) fn command(&mut self, outputs: &mut [u8], requested: RequestedState, target: i64) {
        let may_operate = match requested {
            RequestedState::Operation => !self.has_open_stop_circuit,
            RequestedState::Braking => self.is_enabled(),
            RequestedState::Off => false,
        };
        // switching off on command is no fault
        self.was_enabled &= may_operate;
        let mut word = self.state.controlword(may_operate);
        if self.reset > 0 {
            self.reset -= 1;
            word = if self.state == DriveState::Fault { FAULT_RESET } else { word };
        }
        self.row.controlword.write(outputs, u64::from(word));
        let target = if self.is_enabled() { target } else { 0 };
        self.row.target.write(outputs, target as u64);
        if let Some(mode) = self.row.mode {
            mode.write(outputs, CYCLIC_VELOCITY as u64);
        }
    }

    /// Begins a fault reset, on a person's request.
    pub(crate) fn reset(&mut self) {
        self.reset = RESET_CYCLES;
        self.ignoring = 0;
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
    use crate::table::Place;

    const PLACE: fn(usize, u8) -> Place = |bit, bits| Place { device: 3, bit, bits };

    fn drive() -> Drive {
        Drive::new(DriveRow {
            device: 3,
            axis: 0,
            controlword: PLACE(0, 16),
            target: PLACE(16, 32),
            mode: Some(PLACE(48, 8)),
            statusword: PLACE(0, 16),
            mode_display: PLACE(16, 8),
            error: None,
            stop_circuit: None,
        })
    }

    /// Inputs with a statusword and a mode.
    fn inputs(statusword: u16, mode: i8) -> [u8; 3] {
        let [low, high] = statusword.to_le_bytes();
        [low, high, mode as u8]
    }

    #[test]
    fn each_sign_of_an_ignored_target_of_an_enabled_drive_is_detected() {
        // enabled; remote (9) or following (12) missing; another mode
        for (word, mode) in [(0x1037, 9), (0x0237, 9), (0x1237, 8)] {
            let mut drive = drive();
            let found =
                (0..=MAY_IGNORE).map(|_| drive.evaluate(&inputs(word, mode))).collect::<Vec<_>>();
            let (last, before) = found.split_last().unwrap();
            assert!(before.iter().all(Option::is_none), "{word:#06x}");
            assert_eq!(*last, Some(Fault::TargetIgnored { device: 3 }), "{word:#06x}");
        }
        let mut drive = drive();
        assert!((0..2 * MAY_IGNORE).all(|_| drive.evaluate(&inputs(0x1237, 9)).is_none()));
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
