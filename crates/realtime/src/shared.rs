//! Machine in another process through shared memory, read and written without a system call.

use crate::machine::{Incoming, Machine, Outgoing};
use crate::posix::effective_user;
use crate::slot::Slot;
use crate::trouble::Tampering;
use hydroboom_control::command::{AxisCommand, Command};
use hydroboom_control::measurement::{AxisMeasurement, AxisSignals, Measurement, Validity};
use hydroboom_control::supervision::limits::ValveState;
use memmap2::MmapMut;
use std::fs::OpenOptions;
use std::io;
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::Path;

/// Magic number of the shared memory. Its last digit counts the versions of the layout.
const MAGIC: u64 = 0x6879_6472_6f62_6f71;

/// Layout of the shared memory.
#[repr(C)]
struct Layout {
    magic: Slot<1>,
    /// Number, time and validity of the measurement, state of the valve, then the signals of its axis.
    measurement: Slot<11>,
    /// Number, then the command of its axis.
    command: Slot<3>,
    /// Number, then the fault or payload change ordered.
    tampering: Slot<3>,
}

/// Permissions of the file: read and write for its owner only.
const MODE: u32 = 0o600;
/// Permission bits of a file mode.
const PERMISSIONS: u32 = 0o777;

/// Refuses memory that another user owns, or that others may read or write.
fn check_owner(owner: u32, mode: u32) -> io::Result<()> {
    let user = effective_user();
    if owner != user {
        let why = format!(
            "it belongs to user {owner}, and this is user {user}: remove it, and start again"
        );
        return Err(io::Error::new(io::ErrorKind::PermissionDenied, why));
    }
    if mode & PERMISSIONS & !MODE != 0 {
        let permissions = mode & PERMISSIONS;
        let why = format!(
            "others have access to it (mode {permissions:04o}): allowed is {MODE:04o}; remove it, and start again"
        );
        return Err(io::Error::new(io::ErrorKind::PermissionDenied, why));
    }
    Ok(())
}

/// Memory shared by the executive and a machine's process.
pub struct Shared {
    map: MmapMut,
}

impl Shared {
    /// Creates the shared memory at a path, empty, with access for its owner only (mode 0600).
    ///
    /// # Errors
    ///
    /// Error of the operating system if the file exists already (`AlreadyExists`), or cannot be created or mapped.
    pub fn create(path: &Path) -> io::Result<Self> {
        // accessible to its owner only: a write to it moves the machine
        let mut options = OpenOptions::new();
        let file = options.read(true).write(true).create_new(true).mode(MODE).open(path)?;
        file.set_len(size_of::<Layout>() as u64)?;
        let shared = Self::map(&file)?;
        shared.layout().magic.publish([MAGIC]);
        Ok(shared)
    }

    /// Opens the shared memory that another process created.
    ///
    /// # Errors
    ///
    /// - `PermissionDenied` if another user owns the file, or others have access to it.
    /// - `InvalidData` if it is not such a memory: its length or its first word differs.
    /// - Another error of the operating system if it cannot be opened or mapped.
    pub fn open(path: &Path) -> io::Result<Self> {
        let file = OpenOptions::new().read(true).write(true).open(path)?;
        let metadata = file.metadata()?;
        check_owner(metadata.uid(), metadata.mode())?;
        if metadata.len() != size_of::<Layout>() as u64 {
            return Err(io::Error::new(io::ErrorKind::InvalidData, "not a machine's memory"));
        }
        let shared = Self::map(&file)?;
        match shared.layout().magic.read() {
            Some((_, [MAGIC])) => Ok(shared),
            _ => Err(io::Error::new(io::ErrorKind::InvalidData, "not a machine's memory")),
        }
    }

    fn map(file: &std::fs::File) -> io::Result<Self> {
        // SAFETY: the map is only used through `Layout`, whose words are all atomic. A write of another
        // process is therefore a change of atomics, and any bytes are valid. Truncation of the file is not
        // guarded against: only the two processes have its path.
        #[expect(unsafe_code, reason = "memory shared with another process")]
        let map = unsafe { MmapMut::map_mut(file)? };
        Ok(Self { map })
    }

    fn layout(&self) -> &Layout {
        // SAFETY: the map is page-aligned, as long as `Layout` (created or checked so), lives as long as
        // `self`, and `Layout` consists of atomics for which any bytes are valid.
        #[expect(unsafe_code, reason = "atomics in a shared map")]
        unsafe {
            &*self.map.as_ptr().cast::<Layout>()
        }
    }

    /// Newest command of the executive with its number, for the machine's process: motor speed \[rev/s\] and
    /// load-holding valve. None before the first one. Numbers are those of the other process, and may be NaN.
    pub fn command(&self) -> Option<(u64, Command)> {
        let (_, [sequence, speed, valve]) = self.layout().command.read()?;
        let (motor_speed, holding_valve) = (f64::from_bits(speed), f64::from_bits(valve));
        Some((sequence, Command { axes: [AxisCommand { motor_speed, holding_valve }] }))
    }

    /// Publishes a measurement to the executive, from the machine's process.
    pub fn show(&self, incoming: &Incoming) {
        let Measurement { number, time, axes: [axis] } = incoming.measurement;
        let [a, b, c, d, e, f, g] = axis.signals.to_array().map(f64::to_bits);
        let words =
            [number, time.to_bits(), validity_word(&axis.validity), valve_word(incoming.valve)];
        let [number, time, validity, valve] = words;
        self.layout().measurement.publish([number, time, validity, valve, a, b, c, d, e, f, g]);
    }

    /// Last ordered fault or payload change with its number, for the machine's process. None before the first one.
    pub fn tampering(&self) -> Option<(u64, Tampering)> {
        let (_, [number, kind, value]) = self.layout().tampering.read()?;
        Some((number, Tampering::from_words([kind, value])?))
    }

    /// Orders a fault or payload change, from the executive's process, with an increasing number.
    pub fn tamper(&self, number: u64, what: Tampering) {
        let [kind, value] = what.to_words();
        self.layout().tampering.publish([number, kind, value]);
    }
}

/// State of the valve as a word: 0 if it is not measured.
pub(crate) fn valve_word(valve: Option<ValveState>) -> u64 {
    match valve {
        None => 0,
        Some(ValveState::Shut) => 1,
        Some(ValveState::Open) => 2,
    }
}

/// State of the valve from its word; none for any other word.
pub(crate) fn valve_state(word: u64) -> Option<ValveState> {
    [ValveState::Shut, ValveState::Open].into_iter().find(|state| valve_word(Some(*state)) == word)
}

/// All validities in the order of their codes.
const VALIDITIES: [Validity; 4] =
    [Validity::Good, Validity::Absent, Validity::OutOfRange, Validity::Stale];

/// Validities of the signals as a word, two bits each, the first one lowest.
fn validity_word(of: &AxisSignals<Validity>) -> u64 {
    of.to_array().iter().rev().fold(0, |word, validity| (word << 2) | *validity as u64)
}

/// Validities from their word; every word is valid.
pub(crate) fn validity_of(word: u64) -> AxisSignals<Validity> {
    let [a, b, c, d] = VALIDITIES;
    AxisSignals::from_array(core::array::from_fn(|k| match (word >> (2 * k)) & 3 {
        0 => a,
        1 => b,
        2 => c,
        _ => d,
    }))
}

impl Machine for Shared {
    fn read(&mut self) -> Option<Incoming> {
        let (_, [number, time, validity, valve, values @ ..]) = self.layout().measurement.read()?;
        let signals = AxisSignals::from_array(values.map(f64::from_bits));
        let axis = AxisMeasurement { signals, validity: validity_of(validity) };
        let measurement = Measurement { number, time: f64::from_bits(time), axes: [axis] };
        Some(Incoming::new(measurement, valve_state(valve)))
    }

    fn write(&mut self, sequence: u64, outgoing: &Outgoing) {
        let [axis] = outgoing.command.axes;
        let [speed, valve] = axis.to_array().map(f64::to_bits);
        self.layout().command.publish([sequence, speed, valve]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shared_memory_is_accessible_to_its_owner_only() {
        let path = std::env::temp_dir().join(format!("hydroboom-owner-{}", std::process::id()));
        let _ = std::fs::remove_file(&path);
        let made = Shared::create(&path).unwrap();
        let mode = std::fs::metadata(&path).unwrap().mode();
        assert_eq!(mode & PERMISSIONS, 0o600);
        assert!(Shared::open(&path).is_ok());
        for open_to_others in [0o640, 0o602, 0o660] {
            let permissions = std::os::unix::fs::PermissionsExt::from_mode(open_to_others);
            std::fs::set_permissions(&path, permissions).unwrap();
            let refused = Shared::open(&path).err().map(|error| error.to_string());
            assert!(refused.is_some_and(|why| why.contains("0600")), "{open_to_others:o}");
        }
        std::fs::remove_file(&path).unwrap();
        drop(made);
        let user = effective_user();
        assert!(check_owner(user, 0o600).is_ok());
        assert!(check_owner(user + 1, 0o600).is_err());
    }

    #[test]
    fn validities_are_transferred_unchanged_to_the_other_process() {
        let [good, absent, out_of_range, stale] = VALIDITIES;
        let all = AxisSignals::from_array([stale, good, absent, out_of_range, good, stale, absent]);
        assert_eq!(validity_of(validity_word(&all)), all);
    }
}
