//! Servo drive by CiA 402 in cyclic synchronous velocity (mode 9), with a motor behind it.

use super::{DriveState, VelocityUnit, add_identity, add_process_data};
use crate::al_status_code::AlStatusCode;
use crate::application::Application;
use crate::controller::DistributedClock;
use crate::device::{Device, Settings};
use crate::mailbox::Emergency;
use crate::object_dictionary::{Abort, Key, Mapping, ObjectAccess, ObjectDictionary};

/// Mode of operation (0x6060): cyclic synchronous velocity.
const CYCLIC_VELOCITY: i64 = 9;
/// Error code (0x603F) of a process-data watchdog or another loss of communication.
const COMMUNICATION_FAULT: u16 = 0x7500;
/// Controlword (CiA 402).
const CONTROLWORD: Key = (0x6040, 0);
/// Statusword.
const STATUSWORD: Key = (0x6041, 0);
/// Error code.
const ERROR_CODE: Key = (0x603f, 0);
/// Modes of operation.
const MODE: Key = (0x6060, 0);
/// Modes of operation display.
const MODE_DISPLAY: Key = (0x6061, 0);
/// Position actual value \[increments\].
const POSITION: Key = (0x6064, 0);
/// Velocity actual value \[velocity unit\].
const VELOCITY: Key = (0x606c, 0);
/// Target velocity \[velocity unit\].
const TARGET: Key = (0x60ff, 0);
/// Digital inputs.
const DIGITAL_INPUTS: Key = (0x60fd, 0);
/// Bit 3 of 0x60FD: interlock, here safe torque off.
const INTERLOCK: i64 = 0x08;

/// Motor with its load, behind a servo drive. Speeds and angles are positive in the drive's positive direction.
pub trait Motor {
    /// Commands a speed \[rev/s\] with torque on; `None` switches the torque off.
    fn command(&mut self, speed: Option<f64>);
    /// Advances the motor to the time `now` \[ns\].
    fn advance(&mut self, now: u64);
    /// Motor speed \[rev/s\].
    fn speed(&self) -> f64;
    /// Motor angle since power-on \[rev\].
    fn angle(&self) -> f64;
}

/// Ideal motor: it has the commanded speed at once, and stands still without torque.
#[derive(Clone, Copy, Debug, Default)]
pub struct IdealMotor {
    /// Motor speed \[rev/s\].
    speed: f64,
    /// Motor angle since power-on \[rev\].
    angle: f64,
    /// Time to which it was advanced \[ns\].
    now: u64,
}

impl Motor for IdealMotor {
    fn command(&mut self, speed: Option<f64>) {
        self.speed = speed.unwrap_or(0.0);
    }

    fn advance(&mut self, now: u64) {
        self.angle += self.speed * now.saturating_sub(self.now) as f64 * 1e-9;
        self.now = now;
    }

    fn speed(&self) -> f64 {
        self.speed
    }

    fn angle(&self) -> f64 {
        self.angle
    }
}

/// Settings of a drive, in addition to those of its device.
#[derive(Clone, Debug, PartialEq)]
pub struct DriveSettings {
    /// Unit of the velocities 0x60FF and 0x606C.
    pub unit: VelocityUnit,
    /// Position increments per revolution in 0x6064.
    pub increments: u32,
    /// Deceleration of a quick stop and of a fault reaction \[rev/s²\], positive.
    pub deceleration: f64,
    /// Whether the process data mapping is fixed and padded to even addresses; else it can be changed in PREOP.
    pub is_mapping_fixed: bool,
}

/// Application of a servo drive in cyclic synchronous velocity (CiA 402, IEC 61800-7-201): objects 0x6040, 0x6041,
/// 0x603F, 0x6060, 0x6061, 0x6064, 0x606C, 0x60FF, 0x60FD, and reactions by its own ramp.
pub struct ServoDrive {
    /// Unit, resolution, deceleration and mapping.
    settings: DriveSettings,
    /// Motor behind the drive.
    motor: Box<dyn Motor>,
    /// State of the drive's state machine.
    state: DriveState,
    /// Controlword that was received last.
    controlword: u16,
    /// Error code (0x603F); 0 without a fault.
    error: u16,
    /// Whether safe torque off is requested.
    has_safe_torque_off: bool,
    /// When the torque is removed after that request \[ns\]; none without one.
    torque_off_at: Option<u64>,
    /// Set point while the drive stops by itself \[rev/s\].
    ramp_speed: f64,
    /// Time to which it was advanced \[ns\].
    now: u64,
    /// Emergency message that is still to be sent.
    pending_emergency: Option<Emergency>,
}

impl std::fmt::Debug for ServoDrive {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ServoDrive").field("state", &self.state).finish_non_exhaustive()
    }
}

/// Outputs after power-on as index, subindex, bits: controlword, target velocity, mode of operation.
const OUTPUTS: [(u16, u8, u8); 3] = [(0x6040, 0, 16), (0x60ff, 0, 32), (0x6060, 0, 8)];
/// Inputs after power-on: statusword, position, velocity, mode of operation, error code, digital inputs.
const INPUTS: [(u16, u8, u8); 6] = [
    (0x6041, 0, 16),
    (0x6064, 0, 32),
    (0x606c, 0, 32),
    (0x6061, 0, 8),
    (0x603f, 0, 16),
    (0x60fd, 0, 32),
];

impl ServoDrive {
    /// Servo drive device with this motor.
    pub fn device(
        settings: Settings,
        drive: DriveSettings,
        clock: DistributedClock,
        motor: Box<dyn Motor>,
    ) -> Device {
        let mut dictionary = ObjectDictionary::default();
        add_identity(&mut dictionary, &settings, 0x0002_0192);
        Self::add_objects(&mut dictionary, &drive, settings.synchronisation.has_sync0);
        let application = Self {
            settings: drive,
            motor,
            state: DriveState::SwitchOnDisabled,
            controlword: 0,
            error: 0,
            has_safe_torque_off: false,
            torque_off_at: None,
            ramp_speed: 0.0,
            now: 0,
            pending_emergency: None,
        };
        Device::new(settings, clock, dictionary, Box::new(application))
    }

    /// Adds the objects of the drive, and those of synchronisation where it has SYNC0.
    fn add_objects(dictionary: &mut ObjectDictionary, drive: &DriveSettings, has_sync0: bool) {
        use Mapping::{Inputs, None as Unmapped, Outputs};
        use ObjectAccess::{ReadOnly, ReadWrite, ReadWriteInPreOp};
        let with_gaps = |entries: &[(u16, u8, u8)]| -> Vec<(u16, u8, u8)> {
            let mut all = Vec::new();
            for entry in entries {
                all.push(*entry);
                // a gap after a byte, so that the next begins at an even address
                if drive.is_mapping_fixed && entry.2 == 8 {
                    all.push((0, 0, 8));
                }
            }
            all
        };
        let access = if drive.is_mapping_fixed { ReadOnly } else { ReadWriteInPreOp };
        add_process_data(dictionary, [0x1c12, 0x1600], &with_gaps(&OUTPUTS), access);
        add_process_data(dictionary, [0x1c13, 0x1a00], &with_gaps(&INPUTS), access);
        let mut add = |key, bytes: &[u8], access, mapping| {
            dictionary.add(key, bytes, access, mapping);
        };
        add(CONTROLWORD, &[0; 2], ReadWrite, Outputs);
        add(TARGET, &[0; 4], ReadWrite, Outputs);
        add(MODE, &[0], ReadWrite, Outputs);
        add(STATUSWORD, &[0; 2], ReadOnly, Inputs);
        add(POSITION, &[0; 4], ReadOnly, Inputs);
        add(VELOCITY, &[0; 4], ReadOnly, Inputs);
        add(MODE_DISPLAY, &[0], ReadOnly, Inputs);
        add(ERROR_CODE, &[0; 2], ReadOnly, Inputs);
        add(DIGITAL_INPUTS, &[0; 4], ReadOnly, Inputs);
        // modes that it has: bit 8 is cyclic synchronous velocity
        add((0x6502, 0), &0x0100_u32.to_le_bytes(), ReadOnly, Unmapped);
        // reactions: quick stop by its ramp (2), fault by the same ramp (2), lost connection as a fault (1)
        add((0x605a, 0), &2_i16.to_le_bytes(), ReadWrite, Unmapped);
        add((0x605e, 0), &2_i16.to_le_bytes(), ReadWrite, Unmapped);
        add((0x6007, 0), &1_i16.to_le_bytes(), ReadWrite, Unmapped);
        // interpolation time: 1 ms
        add((0x60c2, 0), &[2], ReadOnly, Unmapped);
        add((0x60c2, 1), &[1], ReadWrite, Unmapped);
        add((0x60c2, 2), &[(-3_i8) as u8], ReadWrite, Unmapped);
        if has_sync0 {
            for index in [0x1c32, 0x1c33] {
                add((index, 1), &0_u16.to_le_bytes(), ReadWriteInPreOp, Unmapped);
                add((index, 2), &0_u32.to_le_bytes(), ReadWriteInPreOp, Unmapped);
            }
        }
        add(INJECTED_FAULT, &[0; 2], ReadOnly, Unmapped);
        add(SAFE_TORQUE_OFF, &[0], ReadOnly, Unmapped);
        add(SAFE_STOP_TIME, &[0; 2], ReadOnly, Unmapped);
        drive.unit.describe(dictionary);
    }

    /// Enters fault reaction active, or fault without torque, with a code in 0x603F and an emergency message. The
    /// first code is kept.
    fn fault(&mut self, code: u16) {
        if self.error == 0 {
            self.error = code;
            self.pending_emergency = Some(Emergency { code, register: 0x01 });
        }
        self.ramp_speed = self.motor.speed();
        self.state = match self.state.has_torque() {
            true => DriveState::FaultReactionActive,
            false => DriveState::Fault,
        };
    }

    /// Whether the torque is removed by safe torque off.
    fn is_torque_off(&self) -> bool {
        self.torque_off_at.is_some_and(|at| at <= self.now)
    }

    /// Commanded motor speed \[rev/s\]: the target velocity in mode 9, else 0, or the ramp of a stop. `None` without
    /// torque.
    fn set_point(&self, dictionary: &ObjectDictionary) -> Option<f64> {
        match self.state {
            DriveState::OperationEnabled if dictionary.signed(MODE_DISPLAY) == CYCLIC_VELOCITY => {
                Some(dictionary.signed(TARGET) as f64 * self.settings.unit.rev_per_s())
            }
            DriveState::OperationEnabled => Some(0.0),
            DriveState::QuickStopActive | DriveState::FaultReactionActive => Some(self.ramp_speed),
            _ => None,
        }
    }

    /// Statusword 0x6041: state, bit 9 (remote), bit 12 (follows its target).
    fn statusword(&self) -> i64 {
        // remote, and bit 12 where it follows its set point
        let follows = if self.state == DriveState::OperationEnabled { 0x1000 } else { 0 };
        i64::from(self.state.status_bits() | 0x0200 | follows)
    }
}

/// Object by which a test injects a fault, by writing its code; not for use on the bus.
pub const INJECTED_FAULT: Key = (0x2f00, 1);
/// Object by which a test requests safe torque off: 1 while it is requested; not for use on the bus.
pub const SAFE_TORQUE_OFF: Key = (0x2f00, 2);
/// Object by which a test sets safe stop 1 (SS1-t, IEC 61800-5-2): time from the request of safe torque off, which the
/// digital inputs show, until the torque is removed \[ms\]; 0 for safe torque off at once. Not for use on the bus.
pub const SAFE_STOP_TIME: Key = (0x2f00, 3);

impl Application for ServoDrive {
    fn advance(&mut self, dictionary: &mut ObjectDictionary, now: u64) {
        let elapsed = now.saturating_sub(self.now) as f64 * 1e-9;
        self.motor.advance(now);
        self.now = now;
        let injected = dictionary.unsigned(INJECTED_FAULT) as u16;
        if injected != 0 && self.error == 0 {
            self.fault(injected);
        }
        self.has_safe_torque_off = dictionary.unsigned(SAFE_TORQUE_OFF) != 0;
        let delay = 1_000_000 * dictionary.unsigned(SAFE_STOP_TIME);
        self.torque_off_at =
            self.has_safe_torque_off.then(|| self.torque_off_at.unwrap_or(now + delay));
        if self.is_torque_off() && self.state != DriveState::Fault {
            self.state = DriveState::SwitchOnDisabled;
        }
        if matches!(self.state, DriveState::QuickStopActive | DriveState::FaultReactionActive) {
            let step = self.settings.deceleration * elapsed;
            self.ramp_speed = self.ramp_speed.signum() * (self.ramp_speed.abs() - step).max(0.0);
            if self.ramp_speed == 0.0 {
                self.state = match self.state {
                    DriveState::FaultReactionActive => DriveState::Fault,
                    _ => DriveState::SwitchOnDisabled,
                };
            }
        }
        self.motor.command(self.set_point(dictionary));
    }

    fn outputs(&mut self, dictionary: &mut ObjectDictionary, _now: u64) {
        let word = dictionary.unsigned(CONTROLWORD) as u16;
        let next = self.state.by_controlword(word, self.controlword);
        if self.state == DriveState::Fault && next == DriveState::SwitchOnDisabled {
            self.error = 0;
            dictionary.set_number(INJECTED_FAULT, 0);
        }
        if next == DriveState::QuickStopActive && self.state != next {
            self.ramp_speed = self.motor.speed();
        }
        self.state = if self.is_torque_off() { DriveState::SwitchOnDisabled } else { next };
        self.controlword = word;
        if dictionary.signed(MODE) == CYCLIC_VELOCITY {
            dictionary.set_number(MODE_DISPLAY, CYCLIC_VELOCITY);
        }
        self.motor.command(self.set_point(dictionary));
    }

    fn inputs(&mut self, dictionary: &mut ObjectDictionary, _now: u64) {
        dictionary.set_number(STATUSWORD, self.statusword());
        dictionary.set_number(ERROR_CODE, i64::from(self.error));
        let increments = (self.motor.angle() * f64::from(self.settings.increments)).round();
        dictionary.set_number(POSITION, increments as i64);
        let speed = (self.motor.speed() / self.settings.unit.rev_per_s()).round();
        dictionary.set_number(VELOCITY, speed as i64);
        let interlock = if self.has_safe_torque_off { INTERLOCK } else { 0 };
        dictionary.set_number(DIGITAL_INPUTS, interlock);
    }

    fn outputs_are_lost(
        &mut self,
        dictionary: &mut ObjectDictionary,
        _now: u64,
        why: Option<AlStatusCode>,
    ) {
        if why.is_some() && dictionary.signed((0x6007, 0)) != 0 {
            self.fault(COMMUNICATION_FAULT);
        } else if self.state.has_torque() {
            self.ramp_speed = self.motor.speed();
            self.state = DriveState::QuickStopActive;
        }
        self.motor.command(self.set_point(dictionary));
    }

    fn written(&mut self, dictionary: &ObjectDictionary, key: Key) -> Result<(), Abort> {
        match key {
            MODE if !matches!(dictionary.signed(MODE), 0 | CYCLIC_VELOCITY) => {
                Err(Abort::ValueRange)
            }
            (0x1c32 | 0x1c33, 1) if !matches!(dictionary.unsigned(key), 0..=3) => {
                Err(Abort::ValueRange)
            }
            _ => Ok(()),
        }
    }

    fn emergency(&mut self) -> Option<Emergency> {
        self.pending_emergency.take()
    }
}
