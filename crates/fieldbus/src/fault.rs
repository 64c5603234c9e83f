//! Faults of the bus and of its devices, and the limit up to which single lost frames are tolerated.

use crate::al_status_code::{Explanation, explanation};
use crate::cia402::error_text;
use crate::table::Table;

/// Fault that stops the machine: drives brake with torque, then are switched off. None resets itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// More cycles with a lost or late frame in the window than the table allows.
    FramesLost,
    /// More cycles in the window than the table allows had a frame with another working counter than the expected one.
    WorkingCounter,
    /// A device does not answer any more.
    DeviceSilent {
        /// Its position in the line, from 0.
        device: u16,
    },
    /// A device left OP (or SAFEOP) without a request, or did not reach OP.
    StateDropped {
        /// Its position in the line, from 0.
        device: u16,
        /// AL status code (0x0134); 0 where it could not be read.
        code: u16,
    },
    /// A drive has a fault.
    Drive {
        /// Position of the device in the line, from 0.
        device: u16,
        /// Error code (0x603F), 0 where the drive does not show it.
        code: u16,
    },
    /// The stop circuit of an enabled drive was opened: safe torque off, at once or after safe stop 1. It is no fault
    /// of the drive.
    SafeTorqueOff {
        /// Position of the device in the line, from 0.
        device: u16,
    },
    /// A drive switched itself off without saying why.
    DriveDisabled {
        /// Position of the device in the line, from 0.
        device: u16,
    },
    /// A drive is enabled and does not follow its target: statusword bits 9 or 12, or another mode than 9.
    TargetIgnored {
        /// Position of the device in the line, from 0.
        device: u16,
    },
    /// No new command came for two periods, or a command was NaN or infinite.
    CommandsStopped,
}

impl Fault {
    /// Name in logs and messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::FramesLost => "frames-lost",
            Self::WorkingCounter => "working-counter",
            Self::DeviceSilent { .. } => "device-silent",
            Self::StateDropped { .. } => "state-dropped",
            Self::Drive { .. } => "drive-fault",
            Self::SafeTorqueOff { .. } => "safe-torque-off",
            Self::DriveDisabled { .. } => "drive-disabled",
            Self::TargetIgnored { .. } => "target-ignored",
            Self::CommandsStopped => "commands-stopped",
        }
    }

    /// Number in logs and for the supervisor, 1 to 9 by the kind of fault.
    pub fn code(self) -> u16 {
        (Self::to_word(Some(self)) >> 32) as u16
    }

    /// Sentence of what happened and what to do.
    pub(crate) fn sentence(self, table: &Table) -> String {
        let name = |device: u16| match table.devices.get(usize::from(device)) {
            Some(row) => format!("{} (position {device})", row.name),
            None => format!("device {device}"),
        };
        match self {
            Self::FramesLost => "too many frames were lost: check cables, plugs and the load of this \
            computer".into(),
            Self::WorkingCounter => {
                "too many frames came back with a wrong working counter: a device did not process its \
                data; check its cable and supply".into()
            }
            Self::DeviceSilent { device } => {
                format!("{} does not answer: check the cable in front of it and its supply, then \
                start the bus again", name(device))
            }
            Self::StateDropped { device, code } => {
                let Explanation { cause, advice, .. } = explanation(code);
                format!("{} left OP (or SAFEOP) without a request, or did not reach OP: {cause} (AL status code \
                0x{code:04X}); {advice}, then start the bus again", name(device))
            }
            Self::Drive { device, code } => {
                let why = match (code, error_text(code)) {
                    (0, _) => "it shows no error code".into(),
                    (_, Some(text)) => format!("{text} (error code 0x{code:04X})"),
                    (_, None) => format!("error code 0x{code:04X}, see its manual"),
                };
                format!("{} has a fault: {why}; remove the cause, then start the bus again", name(device))
            }
            Self::SafeTorqueOff { device } => {
                format!("safe torque off (STO) of {} is active: close the emergency-stop circuit, reset, then \
                start the bus again", name(device))
            }
            Self::DriveDisabled { device } => {
                format!("{} switched itself off without a fault: check its enable inputs and power \
                supply", name(device))
            }
            Self::TargetIgnored { device } => {
                format!("{} is enabled and does not follow its target: check local control \
                (statusword bit 9) and mode (0x6061)", name(device))
            }
            Self::CommandsStopped => "no valid command came for two periods, or a command was not a finite \
            number: the control task stopped or was delayed, or it computed no number".into(),
        }
    }

    /// As one word, for hand-over between tasks: code in bits 0 to 15, device in 16 to 31, kind above; 0 is none.
    pub(crate) fn to_word(fault: Option<Self>) -> u64 {
        let word = |kind: u64, device: u16, code: u16| {
            kind << 32 | u64::from(device) << 16 | u64::from(code)
        };
        match fault {
            None => 0,
            Some(Self::FramesLost) => word(1, 0, 0),
            Some(Self::WorkingCounter) => word(2, 0, 0),
            Some(Self::DeviceSilent { device }) => word(3, device, 0),
            Some(Self::StateDropped { device, code }) => word(4, device, code),
            Some(Self::Drive { device, code }) => word(5, device, code),
            Some(Self::SafeTorqueOff { device }) => word(6, device, 0),
            Some(Self::DriveDisabled { device }) => word(7, device, 0),
            Some(Self::TargetIgnored { device }) => word(8, device, 0),
            Some(Self::CommandsStopped) => word(9, 0, 0),
        }
    }

    /// Decodes a word; none for an unknown kind.
    pub(crate) fn of_word(word: u64) -> Option<Self> {
        let (device, code) = ((word >> 16) as u16, word as u16);
        Some(match word >> 32 {
            1 => Self::FramesLost,
            2 => Self::WorkingCounter,
            3 => Self::DeviceSilent { device },
            4 => Self::StateDropped { device, code },
            5 => Self::Drive { device, code },
            6 => Self::SafeTorqueOff { device },
            7 => Self::DriveDisabled { device },
            8 => Self::TargetIgnored { device },
            9 => Self::CommandsStopped,
            _ => return None,
        })
    }
}

/// Cycles with a loss in a sliding window: more of them than a limit are a fault.
#[derive(Clone, Debug)]
pub(crate) struct LossWindow {
    /// Largest number of cycles with a loss.
    limit: u32,
    /// Whether each cycle of the window had a loss; a ring.
    losses: Vec<bool>,
    /// Index of the newest cycle.
    newest: usize,
    /// Cycles with a loss in the window.
    count: u32,
}

impl LossWindow {
    /// A window of `cycles` cycles, at least one, without losses.
    pub(crate) fn new(limit: u32, cycles: u32) -> Self {
        Self { limit, losses: vec![false; cycles.max(1) as usize], newest: 0, count: 0 }
    }

    /// Adds a cycle; returns whether the losses now exceed the limit.
    pub(crate) fn record(&mut self, is_lost: bool) -> bool {
        self.newest = (self.newest + 1) % self.losses.len();
        let before = std::mem::replace(&mut self.losses[self.newest], is_lost);
        self.count = self.count + u32::from(is_lost) - u32::from(before);
        self.count > self.limit
    }

    /// Whether a loss in the next cycle would exceed the limit; the oldest cycle will have left the window by then.
    pub(crate) fn is_at_limit(&self) -> bool {
        let oldest = self.losses[(self.newest + 1) % self.losses.len()];
        self.count - u32::from(oldest) >= self.limit
    }

    /// Forgets all losses.
    pub(crate) fn clear(&mut self) {
        self.losses.fill(false);
        self.count = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lost_frames_count_until_the_window_has_passed() {
        let mut window = LossWindow::new(2, 10);
        let mut at =
            |lost: &[usize], end: usize| (0..end).any(|k| window.record(lost.contains(&k)));
        assert!(at(&[0, 4, 9], 10), "three in ten");
        let mut window = LossWindow::new(2, 10);
        assert!(!(0..100).any(|k| window.record(k % 5 == 0)), "two in any ten");
        // the prediction for the next cycle is right
        let mut window = LossWindow::new(2, 10);
        for k in 0..100 {
            let (is_at_limit, mut next) = (window.is_at_limit(), window.clone());
            assert_eq!(next.record(true), is_at_limit, "{k}");
            window.record(k % 5 == 0);
        }
    }

    #[test]
    fn a_fault_is_unchanged_by_its_encoding_in_a_word() {
        let all = (1..10_u64).map(|kind| Fault::of_word(kind << 32 | 3 << 16 | 0x1b));
        for fault in all {
            let fault = fault.unwrap();
            let word = Fault::to_word(Some(fault));
            assert_eq!(Fault::of_word(word), Some(fault));
            assert!(!fault.name().is_empty());
        }
        assert_eq!((Fault::of_word(0), Fault::of_word(10 << 32)), (None, None));
    }
}
