//! Reads a table from the text of its file, or of a crane file, and checks it.

use super::problem::Problems;
use super::{BusSettings, DeviceRow, Table, TableError, device, drive, schema, signal};

impl Table {
    /// Reads a table from the text of a file.
    ///
    /// # Errors
    ///
    /// [`TableError`] with file, line and key of each problem, what was read and what is allowed.
    pub fn parse(file: &str, text: &str) -> Result<Self, TableError> {
        let problems = Problems::new(file, text, &[]);
        let read: schema::File = toml::from_str(text).map_err(|error| problems.syntax(&error))?;
        Self::checked(&read, problems)
    }

    /// Reads the table `[machine.ethercat]` from the text of a crane file; none where it has none.
    ///
    /// # Errors
    ///
    /// As of [`parse`](Self::parse).
    pub fn parse_in_crane_file(file: &str, text: &str) -> Result<Option<Self>, TableError> {
        let problems = Problems::new(file, text, &["machine", "ethercat"]);
        let read: schema::CraneFile =
            toml::from_str(text).map_err(|error| problems.syntax(&error))?;
        let table = read.machine.and_then(|machine| machine.ethercat);
        table.map(|read| Self::checked(&read, problems)).transpose()
    }

    /// The table that was read, if it has no problem.
    fn checked(read: &schema::File, problems: Problems<'_>) -> Result<Self, TableError> {
        let mut problems = problems;
        let bus = bus_settings(&read.bus, &mut problems);
        let devices: Vec<DeviceRow> = read
            .device
            .iter()
            .enumerate()
            .map(|(position, row)| device::row(position, row, read, &bus, &mut problems))
            .collect();
        device::check_sizes(&devices, &mut problems);
        let measured = signal::measured(read, &devices, &mut problems);
        let commanded = signal::commanded(read, &devices, &mut problems);
        let drives = drive::rows(read, &devices, &commanded, &mut problems);
        problems.into_result(Self { bus, devices, measured, commanded, drives })
    }
}

/// Cycle and limits, from microseconds and milliseconds to nanoseconds.
fn bus_settings(bus: &schema::Bus, problems: &mut Problems<'_>) -> BusSettings {
    let mut check = |name: &'static str, value: u32, low: u32, high: u32| {
        if !(low..=high).contains(&value) {
            problems.refuse(&["bus".into(), name.into()], value, &format!("{low} to {high}"));
        }
    };
    check("period_us", bus.period_us, 250, 10_000);
    check("exchanges", bus.exchanges, 1, 2);
    let period = bus.period_us.max(2);
    check("exchange_us", bus.exchange_us, 1, period - 1);
    if bus.exchanges == 2 {
        let first = bus.exchange_us.saturating_add(1).min(period - 1);
        check("send_us", bus.send_us, first, period - 1);
    }
    check("window_cycles", bus.window_cycles, 1, 100_000);
    check("lost_frames_max", bus.lost_frames_max, 0, bus.window_cycles.max(1) - 1);
    check("brake_ms", bus.brake_ms, 0, 10_000);
    BusSettings {
        period: 1000 * u64::from(bus.period_us),
        exchanges: bus.exchanges,
        exchange: 1000 * u64::from(bus.exchange_us),
        send: 1000 * u64::from(bus.send_us),
        lost_max: bus.lost_frames_max,
        window: bus.window_cycles,
        brake: 1_000_000 * u64::from(bus.brake_ms),
    }
}
