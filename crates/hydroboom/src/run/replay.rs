//! Replay of a log by the tasks.

use crate::output;
use hydroboom_control::supervision::fault::Cause;
use hydroboom_control::supervision::supervisor::State;
use hydroboom_description::Description;
use hydroboom_realtime::log;
use hydroboom_realtime::replay::replay as run;
use miette::{IntoDiagnostic, Result};
use serde_json::json;
use std::path::Path;

/// Replays the measurements of a log to controller and supervisor, and prints where their decisions differ from the
/// logged ones.
///
/// # Errors
///
/// If the log cannot be read, or the tasks cannot be made for the model.
pub fn replay(model: &Description, path: &Path, as_json: bool) -> Result<()> {
    let rows = log::rows(path).into_diagnostic()?;
    let records = run(model, &rows, None).into_diagnostic()?;
    let both = || rows.iter().zip(&records);
    let difference = |(row, record): (&log::Row, &hydroboom_realtime::control_task::Record)| {
        60.0 * (row.command.motor_speed - record.decision.command.motor_speed).abs()
    };
    let largest = both().map(difference).fold(0.0, f64::max);
    let other_states = both().filter(|(row, record)| row.state != record.decision.state).count();
    let first = both().find(|(row, record)| row.state != record.decision.state);
    let logged = rows.iter().find(|row| row.state == State::Fault);
    let replayed = records.iter().find_map(|r| r.decision.cause.map(|cause| (r.time, cause)));
    if as_json {
        return output::json(&json!({
            "periods": rows.len(), "command_differs_by_rpm": largest, "periods_in_another_state": other_states,
            "logged_fault": logged.map(|row| row.cause.as_str()),
            "fault": replayed.map(|(_, cause)| cause.code()), "fault_s": replayed.map(|(time, _)| time),
        }));
    }
    let mut text = format!(
        "{} control periods of {}: the motor's command differs by {largest:.4} rpm at most, the state in {other_states} \
         periods",
        rows.len(),
        path.display()
    );
    if let Some((row, record)) = first {
        text += &format!(
            "\nfirst at {:.3} s: {} then, {} now",
            record.time,
            row.state.name(),
            record.decision.state.name()
        );
    }
    // the course beyond the end is unknown: the controller brings the piston to rest there
    if rows.last().is_some_and(|row| row.state == State::Moving) {
        text +=
            "\nthe log ends while the piston moves: this may cause differences in its last seconds";
    }
    let code = |code: Option<&str>| code.filter(|c| !c.is_empty()).unwrap_or("none").to_string();
    text += &format!(
        "\nfault then: {}; now: {}",
        code(logged.map(|row| row.cause.as_str())),
        code(replayed.map(|(_, cause): (f64, Cause)| cause.code()))
    );
    output::text(&text)
}
