//! Why an EtherCAT bus does not run: findings of devices, cables and network card, and the facts behind them.

use crate::crane_file::CraneFile;
use crate::output;
use crate::run::bus::{open, read_table};
use hydroboom_fieldbus::diagnosis::{
    Diagnosis, Finding, HostFacts, LineDevice, Listening, Percentiles, SetUp, Severity,
    diagnose_in_real_time,
};
use hydroboom_realtime::executive::Placement;
use miette::{Result, miette};
use serde_json::{Value, json};
use std::path::Path;

/// Examines the devices at an interface and prints what was found; an error where something prevents operation.
pub fn examine(
    interface: &str,
    table: Option<&Path>,
    crane: &CraneFile,
    is_json: bool,
) -> Result<()> {
    let (_, table) = read_table(table, crane, "--table FILE")?;
    let socket = open(interface)?;
    let host = HostFacts::read(interface);
    let core = Placement::default().control_core;
    let diagnosis =
        diagnose_in_real_time(table, socket, host, core).map_err(|why| miette!("{why}"))?;
    match is_json {
        true => output::json(&as_json(&diagnosis))?,
        false => output::text(&as_text(&diagnosis))?,
    }
    let prevents = |finding: &&Finding| finding.severity == Severity::Error;
    match diagnosis.findings.iter().find(prevents) {
        Some(first) => Err(miette!(
            help = first.advice.clone(),
            "the bus at {interface} cannot be run: {}",
            first.cause
        )),
        None => Ok(()),
    }
}

/// Text output: findings, devices, times, remarks.
fn as_text(diagnosis: &Diagnosis) -> String {
    let Diagnosis { findings, bus, host } = diagnosis;
    let mut said = String::new();
    for (number, finding) in (1..).zip(findings) {
        said += &format!("{number}. {}: {finding}\n", finding.severity.name());
    }
    if findings.is_empty() {
        said += &format!(
            "Nothing is wrong with the bus at {}: its {} devices are those of the table, went to SAFEOP, and exchange \
             frames in time.\n",
            host.interface,
            bus.line.len()
        );
    }
    if !bus.line.is_empty() {
        let rows: Vec<Vec<String>> = (0..bus.line.len()).map(|k| row(diagnosis, k)).collect();
        let header = [
            "",
            "device",
            "product",
            "revision",
            "damaged frames",
            "lost links",
            "watchdog ms",
            "delay us",
        ];
        said += &format!("\n{}\n", output::table(&header, &rows));
    }
    if let Some(seen) = &bus.listening {
        said += &format!("\n{}\n", times(seen));
    }
    host.remarks.iter().for_each(|remark| said += &format!("\n{remark}"));
    said.trim_end().to_string()
}

/// Row of a device in the text output.
fn row(diagnosis: &Diagnosis, position: usize) -> Vec<String> {
    let bus = &diagnosis.bus;
    let Some(device) = bus.line.get(position) else { return Vec::new() };
    let shown = bus.set_up.get(position);
    let [_, product, revision] = device.identity.unwrap_or_default();
    let errors = device.errors_after.unwrap_or(device.errors);
    let sum = |count: &dyn Fn(usize) -> u8| (0..4).map(|k| u32::from(count(k))).sum::<u32>();
    let watchdog = shown.and_then(|shown| shown.watchdog).map(|ns| 1e-6 * ns as f64);
    vec![
        position.to_string(),
        bus.devices.get(position).map_or_else(String::new, |facts| facts.name.clone()),
        format!("0x{product:08X}"),
        format!("0x{revision:08X}"),
        sum(&|port| errors.damaged(port)).to_string(),
        sum(&|port| errors.lost_links[port]).to_string(),
        output::optional(watchdog, 1),
        output::optional(shown.map(|shown| 1e-3 * f64::from(shown.delay)), 2),
    ]
}

/// Statistics of the frames, as text.
fn times(seen: &Listening) -> String {
    let us = |times: &Percentiles| {
        let shares = [times.min, times.p1, times.p50, times.p99, times.max];
        shares.map(|ns| format!("{:.0}", 1e-3 * ns as f64)).join(" / ")
    };
    format!(
        "{} cycles in SAFEOP, {} frames, {} lost, {} with a working counter other than {}, {} outputs late\n\
         us, smallest / 1 / 50 / 99 % / largest: margin of the outputs to SYNC0 {}; first exchange after SYNC0 {}; \
         round trip {}; this computer sends late by {}, with periods of {}",
        seen.cycles,
        seen.exchanges,
        seen.lost,
        seen.wrong_working_counter,
        seen.working_counter,
        seen.late_outputs,
        us(&seen.margin),
        us(&seen.phase),
        us(&seen.round_trip),
        us(&seen.late_by),
        us(&seen.period)
    )
}

/// JSON output.
fn as_json(diagnosis: &Diagnosis) -> Value {
    let Diagnosis { findings, bus, host } = diagnosis;
    let findings: Vec<Value> = findings
        .iter()
        .map(|finding| {
            json!({
                "severity": finding.severity.name(), "stage": finding.stage.name(),
                "cause": finding.cause, "advice": finding.advice,
            })
        })
        .collect();
    let devices: Vec<Value> = (0..bus.line.len())
        .map(|position| {
            let name = bus.devices.get(position).map(|facts| &facts.name);
            json!({
                "position": position, "name": name, "registers": bus.line.get(position).map(registers),
                "set_up": bus.set_up.get(position).map(set_up),
            })
        })
        .collect();
    let interrupts: Vec<Value> = host
        .interrupts
        .iter()
        .map(
            |thread| json!({ "pid": thread.pid, "name": thread.name, "priority": thread.priority }),
        )
        .collect();
    json!({
        "interface": host.interface, "findings": findings, "devices": devices,
        "listening": bus.listening.as_ref().map(listening),
        "host": {
            "rx_coalescing_us": host.rx_coalescing_us, "rx_is_adaptive": host.is_adaptive,
            "gro_flush_timeout_us": host.gro_flush_timeout_ns.map(|ns| 1e-3 * ns as f64),
            "interrupts": interrupts,
        },
        "remarks": host.remarks,
    })
}

fn registers(device: &LineDevice) -> Value {
    let errors = device.errors_after.unwrap_or(device.errors);
    json!({
        "identity": device.identity.map(|[vendor, product, revision]| {
            json!({ "vendor": vendor, "product": product, "revision": revision })
        }),
        "links": (0..4).map(|port| device.has_link(port)).collect::<Vec<_>>(),
        "al_status_before": device.state, "al_status_code_before": device.code,
        "al_status_code": device.state_after.map(|[_, code]| code),
        "invalid_frames": errors.invalid_frames, "receive_errors": errors.receive_errors,
        "forwarded_errors": errors.forwarded, "processing_unit_errors": errors.processing_unit,
        "pdi_errors": errors.pdi, "lost_links": errors.lost_links,
    })
}

fn set_up(shown: &SetUp) -> Value {
    let us = |ns: Option<u32>| ns.map(|ns| 1e-3 * f64::from(ns));
    let ms = |ns: Option<u64>| ns.map(|ns| 1e-6 * ns as f64);
    json!({
        "delay_us": us(Some(shown.delay)), "watchdog_ms": ms(shown.watchdog),
        "pdi_watchdog_ms": ms(shown.pdi_watchdog),
        "dc_activation": shown.dc_activation, "sync_types": shown.sync_types, "cycle_us": us(shown.cycle),
        "shortest_cycle_us": us(shown.shortest_cycle), "calc_and_copy_us": us(shown.calc_and_copy),
        "output_bytes": shown.sizes.map(|sizes| sizes[0]), "input_bytes": shown.sizes.map(|sizes| sizes[1]),
        "clock_difference_us": shown.clock_difference.map(|ns| 1e-3 * ns as f64),
    })
}

fn listening(seen: &Listening) -> Value {
    let us = |times: &Percentiles| {
        let us = |ns: u64| 1e-3 * ns as f64;
        json!({
            "min": us(times.min), "p1": us(times.p1), "p50": us(times.p50), "p99": us(times.p99),
            "max": us(times.max),
        })
    };
    json!({
        "cycles": seen.cycles, "exchanges": seen.exchanges, "lost": seen.lost,
        "wrong_working_counter": seen.wrong_working_counter, "working_counter": seen.working_counter,
        "late_outputs": seen.late_outputs, "margin_to_sync0_us": us(&seen.margin),
        "phase_us": us(&seen.phase), "round_trip_us": us(&seen.round_trip), "late_by_us": us(&seen.late_by),
        "period_us": us(&seen.period),
    })
}
