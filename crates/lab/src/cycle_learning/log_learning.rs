//! Learning from a recorded log: identification of the machine, and feedforward and iterative learning
//! control with the identified model.
//!
//! Cycles are run on the virtual crane of the identified model. Commands are proposed only if four
//! conditions are met. The model is valid for the log, its values are within the crane file's ranges,
//! learning converges, and the crane's margins are kept.

use super::drive_delay::with_drive;
use super::experiment::{CycleReport, Subject, reports};
use super::identification::{Identification, identified, overrides};
use super::identified_payload::IdentifiedPayload;
use super::margins::exceeded;
use super::replay::{at_rest, replayed};
use super::saturation::saturations;
use super::stages::Stages;
use super::usability::outside_range;
use crate::LabError;
use crate::closed_loop::scenario::{Course, CourseChoice};
use hydroboom_control::command::AxisCommand;
use hydroboom_description::Description;
use hydroboom_identify::{Aspect, Judgement, Window};
use hydroboom_measurement::{Measurement, Signal, Signals, Track};
use hydroboom_virtual_crane::surrogate;

/// Machine identified from a log, with the validity of its model.
#[derive(Clone, Debug)]
pub struct LoggedMachine {
    /// Identified model.
    pub model: Description,
    /// Identified parameters, each as an override `section.key=value` of the crane file; empty if the log is refused.
    pub identified: Vec<String>,
    /// Identified payload; none if the log is refused.
    pub payload: Option<IdentifiedPayload>,
    /// Judgement of the model by the log: position, pressures, frequency and damping against their limits.
    pub judged: Vec<Judgement>,
    /// Reasons why no correction is proposed for this machine; empty if one may be proposed.
    pub refusals: Vec<String>,
    /// Remarks on the log, a sentence each.
    pub remarks: Vec<String>,
}

/// Least travel of a log's piston in each direction, as a share of the crane's own motion \[-\]; an estimate. Delivery and leakage of the pump and friction, which
/// feedforward depends on, show in motion only.
const LEAST_TRAVEL: f64 = 0.1;

/// Key of the payload.
const PAYLOAD: &str = "payload.mass_kg=";

/// Share of the whole computing time that the identification takes.
const IDENTIFICATION: f64 = 0.2;

/// Identifies the machine of a log. `go_on` receives the share done of the whole computation and returns whether to
/// continue.
///
/// # Errors
///
/// [`LabError::Input`] if the window is outside the log; [`LabError::Identify`] if the log lacks a required signal, or
/// the model cannot be run with it; [`LabError::Stopped`] if `go_on` returned false.
pub fn identify_log(
    model: &Description,
    log: (&Measurement, &Signals),
    window: Window,
    go_on: &(dyn Fn(f64) -> bool + Sync),
) -> Result<LoggedMachine, LabError> {
    if let Some(reason) = outside_log(log.1, window) {
        return Err(LabError::Input { file: log.0.name.clone(), reason });
    }
    if let Some(refusal) = too_little_motion(model, log.1, window) {
        let (model, refusals) = (model.clone(), vec![refusal]);
        let (identified, payload, judged, remarks) = Default::default();
        return Ok(LoggedMachine { model, identified, payload, judged, refusals, remarks });
    }
    let within = |share: f64| go_on(IDENTIFICATION * share);
    let stages = Stages::new(1, &within);
    let Identification { model: found, judged, improbable, payload, mut remarks } =
        identified(&with_drive(model), log, window, &stages)?;
    let identified = overrides(model, &found);
    let mut refusals: Vec<String> = Vec::new();
    let wrong =
        |j: &&Judgement| matches!(j.aspect, Aspect::Position | Aspect::Pressures) && !j.is_right();
    for j in judged.iter().filter(wrong) {
        let (unit, size) = j.signal.shown();
        refusals.push(format!(
            "no model near the crane file's reproduces this log: {} differs by {:.2} {unit} RMS, limit {:.2}; is \
             it a log of another crane?",
            j.signal.symbol(),
            j.found / size,
            j.limit / size
        ));
    }
    refusals.extend(
        improbable.into_iter().map(|said| format!("{said}: is it a log of another crane?")),
    );
    let (payloads, others): (Vec<_>, Vec<_>) = outside_range(model, &identified)
        .into_iter()
        .partition(|assignment| assignment.starts_with(PAYLOAD));
    refusals.extend(payloads.into_iter().map(|key| {
        format!(
            "{key} is outside the crane file's range: another crane, or a load beyond its rating"
        )
    }));
    // a refused fit must not be used
    let identified = if refusals.is_empty() { identified } else { Vec::new() };
    let payload = payload.filter(|_| refusals.is_empty());
    if refusals.is_empty() {
        remarks.extend(others.into_iter().map(|key| {
            format!(
                "{key} is outside the crane file's range: widen the range there before it is used"
            )
        }));
    }
    let period = found.numbers.control_period;
    let asked = log.1.get(Signal::MotorCommand).or_else(|| log.1.get(Signal::MotorSpeed));
    if let Some((asked, (first, last))) = asked.zip(log.1.overlap(&[Signal::Stroke])) {
        let count = ((last - first) / period).max(0.0) as usize;
        let commands: Vec<f64> =
            (0..count).filter_map(|k| asked.held(first + (k as f64 + 0.5) * period)).collect();
        remarks.extend(saturations(&found, &commands, period));
    }
    Ok(LoggedMachine { model: found, identified, payload, judged, refusals, remarks })
}

/// Error of a window without any time of the log; none for others, or without a position.
fn outside_log(log: &Signals, window: Window) -> Option<String> {
    let (first, last) = log.overlap(&[Signal::Stroke])?;
    let (from, to) = (window.from.unwrap_or(first), window.to.unwrap_or(last));
    let at = |time: Option<f64>, end: &str| time.map_or(end.into(), |time| format!("{time:.3} s"));
    (from.max(first) >= to.min(last)).then(|| {
        format!(
            "it lasts {:.3} s, with the piston's position from {first:.3} to {last:.3} s, and the window from {} to {} has no time of it",
            last - first,
            at(window.from, "its beginning"),
            at(window.to, "its end")
        )
    })
}

/// Reason to refuse a log with too little piston motion; none for sufficient motion or without a position.
fn too_little_motion(model: &Description, log: &Signals, window: Window) -> Option<String> {
    let n = &model.numbers;
    let motion = (n.motion_end - n.motion_start).abs();
    let travel = travel(log.get(Signal::Stroke)?, window);
    let [out, back] = travel.map(|travel| 1e3 * travel);
    travel.iter().any(|travel| *travel < LEAST_TRAVEL * motion).then(|| {
        format!(
            "the log's piston moves out by {out:.1} mm and back by {back:.1} mm. To identify pump and friction \
             for a motion of {:.0} mm, {:.0} mm each way are needed: record one whole cycle",
            1e3 * motion,
            1e3 * LEAST_TRAVEL * motion
        )
    })
}

/// Largest travel \[m\] of a piston outwards and inwards within a window.
fn travel(stroke: &Track, window: Window) -> [f64; 2] {
    let is_within = |time: f64| {
        window.from.is_none_or(|from| time >= from) && window.to.is_none_or(|to| time <= to)
    };
    let (mut lowest, mut highest) = (f64::INFINITY, f64::NEG_INFINITY);
    let mut travel = [0.0_f64; 2];
    for (_, at) in stroke.time().iter().zip(stroke.values()).filter(|(time, _)| is_within(**time)) {
        (lowest, highest) = (lowest.min(*at), highest.max(*at));
        travel = [travel[0].max(at - lowest), travel[1].max(highest - at)];
    }
    travel
}

/// Feedforward and iterative learning control for a machine identified from a log: reports of cycles on its virtual
/// crane, each with the proposed commands.
///
/// # Errors
///
/// [`LabError::Description`] if the identified parameters give an impossible machine; [`LabError::Plant`] if the
/// virtual crane has no state of rest; [`LabError::Scenario`] if a course has an unknown name.
pub fn learn_for(
    model: &Description,
    machine: &LoggedMachine,
    courses: &[CourseChoice],
    go_on: &(dyn Fn(f64) -> bool + Sync),
) -> Result<Vec<CycleReport>, LabError> {
    let mut described = model.clone();
    described.set_together(machine.identified.iter().map(String::as_str))?;
    let crane = described.virtual_crane().0;
    let within = |share: f64| go_on(IDENTIFICATION + (1.0 - IDENTIFICATION) * share);
    let name = format!("virtual crane of {} as identified from the log", model.name);
    let identified = Some(&machine.model);
    let subject = Subject { name: &name, crane: &crane, identified, payload: machine.payload };
    let mut reports = reports(model, &[subject], courses, &within)?;
    for report in &mut reports {
        let course = courses.iter().map(|course| course.of(&crane));
        let course = course.filter_map(Result::ok).find(|course| course.name() == report.course);
        let (Some(course), Some(commands)) = (course, &report.proposal) else { continue };
        let go_on = |_: f64| within(1.0);
        let said = corners(&machine.model, commands, course.as_ref(), &Stages::new(1, &go_on))?;
        if !said.is_empty() {
            report.proposal = None;
            report.remarks.push(format!("no commands are proposed: {}", said.join("; ")));
        }
    }
    Ok(reports)
}

/// Margins that the commands exceed on the model with payload and transition pressure at the ends of their
/// ranges.
fn corners(
    model: &Description,
    commands: &[AxisCommand<f64>],
    course: &dyn Course,
    stages: &Stages<'_>,
) -> Result<Vec<String>, LabError> {
    let n = &model.numbers;
    let ends = |path: &str, value: f64| model.range(path).map_or([value; 2], |r| [r.low, r.high]);
    let mut said = Vec::new();
    for payload in ends("payload.mass_kg", n.payload) {
        for transition in ends("oil.transition_bar", n.transition) {
            let mut other = model.clone();
            (other.numbers.payload, other.numbers.transition) = (payload, transition);
            let mut machine = at_rest(&surrogate(&other), course)?;
            let at = format!(
                "with payload.mass_kg={payload:.0} and oil.transition_bar={:.1}",
                transition * 1e-5
            );
            match replayed(commands, &mut machine, course, stages) {
                Ok((record, _)) => {
                    let exceeded = exceeded(model, &record, course);
                    said.extend(exceeded.into_iter().map(|sentence| format!("{at} {sentence}")));
                }
                Err(LabError::Stopped) => return Err(LabError::Stopped),
                Err(error) => said.push(format!("{at} {error}")),
            }
        }
    }
    Ok(said)
}
