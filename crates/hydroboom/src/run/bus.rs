//! A machine on EtherCAT: its table, its start, and its report.

use super::attachment::Attached;
use super::bus_log::BusLog;
use crate::crane_file::{CraneFile, text as text_of};
use crate::output;
use hydroboom_description::Description;
use hydroboom_fieldbus::bus_task::{BusReport, BusThread, Started};
use hydroboom_fieldbus::check::DeviceFacts;
use hydroboom_fieldbus::machine::MachineState;
use hydroboom_fieldbus::raw_socket::RawSocket;
use hydroboom_fieldbus::start_up::InitialState;
use hydroboom_fieldbus::table::Table;
use hydroboom_realtime::executive::Placement;
use miette::{IntoDiagnostic, Result, miette};
use serde_json::{Value, json};
use std::path::Path;

/// Periods of table and model are the same to this \[s\].
const SAME_PERIOD: f64 = 1e-9;

/// The table of a file, or that of the crane file, for a model's control period.
pub fn table(file: Option<&Path>, crane: &CraneFile, model: &Description) -> Result<Table> {
    let (name, table) = read_table(file, crane, "--bus FILE")?;
    let (bus, control) = (1e-9 * table.bus.period as f64, model.numbers.control_period);
    if (bus - control).abs() > SAME_PERIOD {
        return Err(miette!(
            help = "the bus, SYNC0 and control have one period: write the same into both",
            "{name}: bus.period_us is {} us, and the model's control.control_period_ms is {} ms",
            1e6 * bus,
            1e3 * control
        ));
    }
    Ok(table)
}

/// The table of a file that an option names, or that of the crane file; and the name of the file.
pub fn read_table(file: Option<&Path>, crane: &CraneFile, option: &str) -> Result<(String, Table)> {
    if let Some(file) = file {
        let name = file.display().to_string();
        let table = Table::parse(&name, &text_of(file)?).into_diagnostic()?;
        return Ok((name, table));
    }
    let name = crane.path().map_or("the crane".into(), |path| path.display().to_string());
    let table = Table::parse_in_crane_file(&name, &crane.text()?).into_diagnostic()?;
    let table = table.ok_or_else(|| {
        miette!(
            help = format!(
                "name its file with {option}, or write it into the crane file; \
                 docs/reference/ethercat-table.md has a complete one"
            ),
            "{name}: there is no table [machine.ethercat], so that the devices on the bus are not known"
        )
    })?;
    Ok((name, table))
}

/// Opens a network interface for the bus.
pub fn open(interface: &str) -> Result<RawSocket> {
    RawSocket::open(interface).into_diagnostic()
}

/// Starts the bus at an open interface in a state of its devices; returns it with its log. Refused if `demand` refuses the devices' identities.
pub fn start(
    interface: &str,
    table: Table,
    socket: RawSocket,
    state: InitialState,
    demand: impl FnOnce(&Table, &[DeviceFacts]) -> Result<()>,
) -> Result<(Attached, BusLog)> {
    let delay = table.bus.delay();
    let about = table.clone();
    let core = Placement::default().control_core;
    let started = BusThread::start(state, table, socket, core).into_diagnostic()?;
    let Started { thread, machine, facts, records } = started;
    let names: Vec<&str> = facts.iter().map(|device| device.name.as_str()).collect();
    output::note(&format!(
        "ethercat:{interface}: {} devices in {} ({}); from sampling to actuation {delay} {}",
        names.len(),
        match state {
            InitialState::SafeOp => "SAFEOP",
            InitialState::Op => "OP",
        },
        names.join(", "),
        if delay == 1 { "period" } else { "periods" }
    ));
    if let MachineState::Fault(fault) = machine.state() {
        let sentence = thread.end().and_then(|report| report.fault).map(|(_, sentence)| sentence);
        return Err(miette!(
            "the machine has a fault ({}): {}",
            fault.name(),
            sentence.unwrap_or_default()
        ));
    }
    // refused, the thread ends the bus when it is dropped
    demand(&about, &facts)?;
    Ok((Attached::OnFieldbus(thread, Box::new(machine)), BusLog::new(about, records)))
}

/// Reported quantiles of a distribution.
const SHARES: [f64; 4] = [0.001, 0.01, 0.5, 0.99];

/// For machines.
pub fn json(report: &BusReport) -> Value {
    let BusReport { counters, working_counter, times, delay, fault, remarks, .. } = report;
    let us = |histogram: &hydroboom_fieldbus::statistics::Histogram| {
        let shares = SHARES.map(|share| 1e-3 * histogram.value_at_quantile(share) as f64);
        json!({ "p0.1": shares[0], "p1": shares[1], "p50": shares[2], "p99": shares[3] })
    };
    json!({
        "cycles": counters.cycles, "exchanges": counters.exchanges, "lost": counters.lost,
        "wrong_working_counter": counters.low, "working_counter": working_counter,
        "unexpected": counters.unexpected, "without_command": counters.without_command,
        "late_outputs": counters.late_outputs, "late_begins": counters.late_begins,
        "records_lost": counters.records_lost, "warnings": counters.warnings, "limits": counters.limits,
        "margin_to_sync0_us": us(&times.margin), "round_trip_us": us(&times.round_trip),
        "delay_cycles": delay.map(|delay| delay.total),
        "fault": fault.as_ref().map(|(fault, sentence)| json!({ "name": fault.name(), "sentence": sentence })),
        "remarks": remarks,
    })
}

/// For people.
pub fn text(report: &BusReport) -> String {
    let BusReport { counters, working_counter, times, delay, fault, remarks, .. } = report;
    let mut said = format!(
        "Bus: {} cycles, {} frames, {} lost, {} with another working counter than {working_counter}",
        counters.cycles, counters.exchanges, counters.lost, counters.low
    );
    let others = [
        ("frames came that nobody waited for", counters.unexpected),
        ("cycles without a new command", counters.without_command),
        ("outputs came after their SYNC0", counters.late_outputs),
        ("frames were sent more than half a period late", counters.late_begins),
        ("cycles were lost for the log", counters.records_lost),
        ("cycles with a warning of a drive", counters.warnings),
        ("cycles with a limit of a drive", counters.limits),
    ];
    for (what, count) in others.iter().filter(|(_, count)| *count > 0) {
        said += &format!(", {count} {what}");
    }
    let us = |histogram: &hydroboom_fieldbus::statistics::Histogram| {
        SHARES.map(|share| format!("{:.0}", 1e-3 * histogram.value_at_quantile(share) as f64))
    };
    let ([a, b, c, d], [e, f, g, h]) = (us(&times.margin), us(&times.round_trip));
    said += &format!(
        "\nOutputs are there before their SYNC0 by {a} / {b} / {c} / {d} us (0.1, 1, 50, 99 % of cycles), frames \
         take {e} / {f} / {g} / {h} us"
    );
    if let Some(delay) = delay {
        said += &format!("; from sampling to actuation {:.2} cycles", delay.total);
    }
    if let Some((fault, sentence)) = fault {
        said += &format!("\nBus fault {}: {sentence}", fault.name());
    }
    remarks.iter().for_each(|remark| said += &format!("\n{remark}"));
    said
}
