//! Table of all trials, one row each, in the same form for every target.

use super::bounds::Bounds;
use super::case::Case;
use super::trial::Outcome;
use hydroboom_control::supervision::fault::Cause;
use hydroboom_control::supervision::frame::{STATUS_FALLBACK, STATUS_FAULT, frame_phase};

/// Row of the table: a trial of one target with its outcome and bounds.
#[derive(Clone, Debug)]
pub struct Row {
    /// Name of the tested controller and its language.
    pub target: &'static str,
    /// Test case.
    pub case: Case,
    /// Outcome of the trial, from the true motion of the machine.
    pub outcome: Outcome,
    /// Bounds with which the outcome is compared.
    pub bounds: Bounds,
    /// Largest difference of the piston position to the undisturbed trial \[m\].
    pub off: f64,
    /// Names of the outcomes that exceed their bounds; empty for a passed trial.
    pub beyond: Vec<&'static str>,
}

/// Number and name of a controller's status, as `1 holding`; for a fault its cause. Unknown numbers and NaN are named
/// `idle`.
pub fn status_name(code: f64) -> String {
    let name = match code {
        c if c >= STATUS_FAULT => Cause::from_number(c - STATUS_FAULT).map_or("fault", Cause::code),
        STATUS_FALLBACK => "fallback gains",
        frame_phase::HOLDING => "holding",
        frame_phase::RELEASING => "releasing",
        frame_phase::OPENING => "opening",
        frame_phase::CONTROLLING => "controlling",
        frame_phase::STOPPING => "stopping",
        _ => "idle",
    };
    format!("{code:.0} {name}")
}

impl Row {
    /// Row of a trial: its outcome compared with its bounds and with the undisturbed trial.
    pub fn new(
        target: &'static str,
        case: &Case,
        outcome: Outcome,
        bounds: Bounds,
        undisturbed: &Outcome,
    ) -> Self {
        Self {
            target,
            beyond: bounds.beyond(case, undisturbed, &outcome),
            off: outcome.off(undisturbed),
            case: case.clone(),
            outcome,
            bounds,
        }
    }

    /// Cells of the row in the order of [`HEADER`], in display units, with bounds in brackets.
    pub fn cells(&self) -> [String; 13] {
        let (o, b) = (&self.outcome, &self.bounds);
        let pair = |value: f64, bound: f64| format!("{:.2} ({:.1})", value * 1e3, bound * 1e3);
        let disturbed = self.case.disturbed.is_some();
        let is_changed = disturbed || self.case.gain.is_some();
        let off = match self.case.moves && is_changed && o.status < STATUS_FAULT {
            true => pair(self.off, b.off),
            false => "-".into(),
        };
        // during sustained oscillation the tracking error has no meaning
        let error = |value: f64| match (o.course.is_empty(), o.oscillates()) {
            (true, _) => "-".into(),
            (false, true) => "unstable".into(),
            (false, false) => format!("{:.2}", value * 1e3),
        };
        let oscillation = match o.oscillates() {
            true => {
                let [amplitude, frequency] = o.oscillation;
                format!(", oscillates by {:.1} mm at {frequency:.2} Hz", amplitude * 1e3)
            }
            false => String::new(),
        };
        [
            self.target.into(),
            self.case.name(),
            status_name(o.status) + &oscillation,
            o.release_time.map_or("-".into(), |time| format!("{time:.1}")),
            format!("{:.2}", o.lifted * 1e3),
            pair(o.dropped, b.dropped),
            pair(o.engaged, b.engaged),
            if disturbed { pair(o.strayed, b.strayed) } else { "-".into() },
            if o.stopped_in > 0.0 { pair(o.stopped_in, b.stopped) } else { "-".into() },
            off,
            error(o.rms),
            error(o.error),
            match self.beyond.is_empty() {
                true => "within".into(),
                false => self.beyond.join(", "),
            },
        ]
    }
}

/// Headings of the columns, with units.
pub const HEADER: [&str; 13] = [
    "target",
    "trial",
    "status at the end",
    "release s",
    "lift mm",
    "drop mm",
    "engaging mm",
    "from reference mm",
    "stop mm",
    "off course mm",
    "RMS error mm",
    "largest error mm",
    "bounds",
];

/// Table as CSV; without headings if `has_heads` is false, for appending to a file.
pub fn csv(rows: &[Row], has_heads: bool) -> String {
    let quoted = |cell: &str| format!("\"{}\"", cell.replace('"', "\"\""));
    let line =
        |cells: &[String]| cells.iter().map(|c| quoted(c)).collect::<Vec<_>>().join(",") + "\n";
    let header = line(&HEADER.map(String::from));
    let header = if has_heads { header } else { String::new() };
    rows.iter().fold(header, |text, row| text + &line(&row.cells()))
}
