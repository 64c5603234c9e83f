//! Recordings of the scheduled LQR in Rust on the virtual crane, and replays by the exported controllers.

use super::evaluator::{Instance, Library};
use hydroboom_control::estimation::retained_parameters::RetainedParameters;
use hydroboom_control::memory::Memory;
use hydroboom_control::reference::preview::PreviewAhead;
use hydroboom_control::reference::profile::SetPoint;
use hydroboom_control::supervision::frame::{FrameInput, FrameOutput, frame_phase};
use hydroboom_control::supervision::framed_scheduled_lqr::{
    EstimatorRequest, FramedScheduledLqrInput, FramedScheduledLqrOutput, FramedScheduledLqrState,
};
use hydroboom_description::Description;
use hydroboom_export::Block;
use hydroboom_export::c::{Precision, files};
use hydroboom_export::closed_loop::{
    Case, Outcome, RustScheduledLqr, Target, TargetError, cases, run,
};
use hydroboom_export::fmi::{System, Version, archive, binary, unit};
use hydroboom_export::scheduled_lqr_controller;
use hydroboom_export::structured_text::{
    Unit, block_units, edge_name, in_single_precision, switch_name,
};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// The crane for which controllers are exported, and the virtual crane that they control.
pub fn cranes() -> (Description, Description) {
    (Description::uia_single_boom().unwrap(), Description::uia_virtual().unwrap())
}

/// All states of a controller, in the order of the block.
fn remembered(state: &FramedScheduledLqrState<f64>) -> Vec<f64> {
    let frame = &state.frame;
    let mut all = frame.memory.to_array().to_vec();
    all.extend(frame.drive.to_array());
    all.extend(frame.release.to_array());
    all.extend(frame.oscillation.to_array());
    let _ = state.controller.visited(&mut |_, number| {
        all.push(number);
        number
    });
    all
}

/// All inputs, in the order of the block.
fn given(input: &FramedScheduledLqrInput<f64>) -> Vec<f64> {
    let mut all = input.frame.to_array().to_vec();
    all.extend(input.request.to_array());
    all.extend(input.retained.to_array());
    all.extend(input.ahead.position);
    all.extend(input.ahead.velocity);
    all.extend(input.ahead.distant);
    all.push(input.ahead.length);
    all
}

/// All outputs.
fn shown(output: &FramedScheduledLqrOutput<f64>) -> Vec<f64> {
    let mut all = output.frame.to_array().to_vec();
    all.extend(output.estimator.to_array());
    all.extend(output.retained.to_array());
    all
}

/// Beginning of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum From {
    /// The first period.
    PowerUp,
    /// The period in which the load-holding valve is energised.
    Opening,
}

/// Requests to the estimator in a recorded period.
pub type Requests = fn(usize) -> (EstimatorRequest<f64>, RetainedParameters<f64>);

/// None.
pub fn nothing(_: usize) -> (EstimatorRequest<f64>, RetainedParameters<f64>) {
    (EstimatorRequest::default(), RetainedParameters::default())
}

/// A recording.
#[derive(Default)]
pub struct Recording {
    /// State before the first period.
    pub begin: Vec<f64>,
    /// Inputs of each period.
    pub given: Vec<Vec<f64>>,
    /// Outputs of each period, and states after it.
    pub wanted: Vec<Vec<f64>>,
    /// Position of the piston and of the reference in each \[m\].
    pub stroke: Vec<[f64; 2]>,
}

impl Recording {
    /// Its first periods.
    #[allow(dead_code, reason = "of the tests")]
    pub fn until(&self, period: usize) -> Self {
        let Self { begin, given, wanted, stroke } = self;
        let [given, wanted] = [given, wanted].map(|rows| rows[..period].to_vec());
        Self { begin: begin.clone(), given, wanted, stroke: stroke[..period].to_vec() }
    }
}

/// A controller under recording.
struct Recorded {
    inner: RustScheduledLqr,
    recording: Recording,
    from: From,
    periods: usize,
    requests: Requests,
}

impl Target for Recorded {
    fn name(&self) -> &'static str {
        self.inner.name()
    }

    fn look_ahead(&mut self, at: &dyn Fn(f64) -> SetPoint<f64>) {
        self.inner.look_ahead(at);
    }

    fn period(
        &mut self,
        input: &FrameInput<f64>,
        _gain: f64,
    ) -> Result<FrameOutput<f64>, TargetError> {
        let phase = self.inner.state().frame.memory.phase;
        let recording = &mut self.recording;
        let begins = self.from == From::PowerUp || phase >= frame_phase::OPENING;
        let records = begins || !recording.begin.is_empty();
        if records && recording.given.len() < self.periods {
            if recording.begin.is_empty() {
                recording.begin = remembered(self.inner.state());
            }
            let (request, retained) = (self.requests)(recording.given.len());
            (self.inner.input().request, self.inner.input().retained) = (request, retained);
        }
        let output = self.inner.advance(input);
        let recording = &mut self.recording;
        if records && recording.given.len() < self.periods {
            recording.given.push(given(self.inner.input()));
            let after = remembered(self.inner.state());
            recording.wanted.push([shown(&output), after].concat());
            recording.stroke.push([input.stroke, input.reference_position]);
        }
        Ok(output.frame)
    }
}

/// An undisturbed course over the whole range of the trials, after a second at standstill.
pub fn plain(model: &Description) -> Case {
    let all = cases(model);
    let is_plain = |c: &&Case| c.moves && c.disturbed.is_none() && c.gain.is_none();
    Case { rest: 1.0, ..all.iter().find(is_plain).unwrap().clone() }
}

/// A recording of at most `length` periods, with a preview of the given length.
pub fn recorded(
    case: &Case,
    length: usize,
    requests: Requests,
    (from, periods): (From, usize),
) -> (Recording, Outcome) {
    let (model, machine) = cranes();
    let inner = RustScheduledLqr::new(&model, length).unwrap();
    let mut target = Recorded { inner, recording: Recording::default(), from, periods, requests };
    let outcome = run(&model, &machine, case, &mut target).unwrap();
    (target.recording, outcome)
}

/// Names of the outputs and states.
pub fn names() -> Vec<String> {
    let block = scheduled_lqr_controller(&cranes().0).unwrap();
    let outputs = block.outputs.iter().map(|v| v.name.clone());
    outputs.chain(block.states.iter().map(|(v, _)| v.name.clone())).collect()
}

/// Number of outputs.
pub fn shown_count() -> usize {
    scheduled_lqr_controller(&cranes().0).unwrap().outputs.len()
}

/// Reads the initial state, then the inputs of each period, and writes outputs and states.
const MAIN: &str = r#"
#include "controller.h"
#include <stdio.h>
static int get(hb_real *to, size_t count)
{
    size_t i;
    for (i = 0; i < count; i++) {
        double value;
        if (fread(&value, sizeof value, 1, stdin) != 1) {
            return 0;
        }
        to[i] = (hb_real)value;
    }
    return 1;
}
static int put(const hb_real *from, size_t count)
{
    size_t i;
    for (i = 0; i < count; i++) {
        const double value = (double)from[i];
        if (fwrite(&value, sizeof value, 1, stdout) != 1) {
            return 0;
        }
    }
    return 1;
}
int main(void)
{
    static hb_scheduled_lqr_controller_state s;
    static hb_scheduled_lqr_controller_input u;
    static hb_scheduled_lqr_controller_output y;
    const size_t size = sizeof(hb_real);
    hb_scheduled_lqr_controller_start(&s);
    if (!get((hb_real *)&s, sizeof s / size)) {
        return 1;
    }
    while (get((hb_real *)&u, sizeof u / size)) {
        hb_scheduled_lqr_controller_update(&s, &u, &y);
        if (!put((hb_real *)&y, sizeof y / size) || !put((hb_real *)&s, sizeof s / size)) {
            return 1;
        }
    }
    return 0;
}
"#;

/// The controller in C, compiled to a program.
pub fn compiled(folder: &Path, precision: Precision, options: &[&str]) -> PathBuf {
    let block = scheduled_lqr_controller(&cranes().0).unwrap();
    let made = files(&[block], "controller", precision).unwrap();
    std::fs::write(folder.join("controller.h"), made.header).unwrap();
    std::fs::write(folder.join("controller.c"), made.source).unwrap();
    std::fs::write(folder.join("main.c"), MAIN).unwrap();
    let output = Command::new("cc")
        .current_dir(folder)
        .args(["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O2", "-ffp-contract=off"])
        .args(options)
        .args(["controller.c", "main.c", "-lm", "-o", "program"])
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    folder.join("program")
}

fn bytes_of<'a>(numbers: impl Iterator<Item = &'a f64>) -> Vec<u8> {
    numbers.flat_map(|v| v.to_le_bytes()).collect()
}

fn rows_of(bytes: &[u8], width: usize) -> Vec<Vec<f64>> {
    let eight = |c: &[u8]| f64::from_le_bytes(c.try_into().unwrap());
    let numbers: Vec<f64> = bytes.chunks_exact(8).map(eight).collect();
    numbers.chunks_exact(width).map(<[f64]>::to_vec).collect()
}

/// Results of a program for a recording: a row for each period with outputs and states.
pub fn in_c(program: &Path, recording: &Recording) -> Vec<Vec<f64>> {
    let mut child =
        Command::new(program).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    let mut input = child.stdin.take().unwrap();
    let bytes = bytes_of(recording.begin.iter().chain(recording.given.iter().flatten()));
    let writing = std::thread::spawn(move || input.write_all(&bytes).unwrap());
    let output = child.wait_with_output().unwrap();
    writing.join().unwrap();
    assert!(output.status.success(), "{:?}", output.status);
    let rows = rows_of(&output.stdout, recording.wanted[0].len());
    assert_eq!(rows.len(), recording.wanted.len());
    rows
}

/// Name of a variable, and its index if it is an entry of an array.
fn split(name: &str) -> (&str, Option<usize>) {
    match name.strip_suffix(']').and_then(|name| name.split_once('[')) {
        Some((array, place)) => (array, place.parse().ok()),
        None => (name, None),
    }
}

/// The interpreted function block.
pub struct OnPlc {
    block: Instance,
    /// The block from which it was generated.
    made: Block,
    /// Inputs besides the frame's, and the preview as period \[s\] and length, in closed loop.
    input: FramedScheduledLqrInput<f64>,
    period: f64,
    length: usize,
}

impl OnPlc {
    /// The block in `LREAL` or `REAL` before its first call, with a preview of `length` control periods in closed loop.
    pub fn new(precision: Precision, length: usize) -> Self {
        let (model, _) = cranes();
        let made = scheduled_lqr_controller(&model).unwrap();
        let mut units = block_units(&made).unwrap();
        if precision == Precision::Single {
            units = in_single_precision(units).unwrap();
        }
        let input = *RustScheduledLqr::new(&model, length).unwrap().input();
        let texts: Vec<String> = units.iter().map(Unit::text).collect();
        let library = Library::parse(texts.iter().map(String::as_str));
        let block = library.instance(&units.last().unwrap().name);
        Self { block, made, input, period: model.numbers.control_period, length }
    }

    /// Sets all states.
    fn remember(&mut self, memory: &[f64]) {
        // the first call resets the states, so it is made before they are set
        self.block.call_with(&[], &[("bReset", true)]);
        for ((v, _), value) in self.made.states.iter().zip(memory) {
            let (name, place) = split(&v.name);
            let camel = edge_name(name);
            let name = format!("s{}{}", camel[..1].to_uppercase(), &camel[1..]);
            match place {
                Some(place) => self.block.set_in_list(&name, place, *value),
                None => self.block.set(&name, *value),
            }
        }
    }

    /// The estimated payload and its standard deviation \[kg\].
    #[allow(dead_code, reason = "of an example")]
    pub fn payload(&self) -> [f64; 2] {
        ["payload", "payload_deviation"].map(|name| self.block.value(&edge_name(name)))
    }

    /// Calls the block with all inputs; returns all outputs.
    fn call(&mut self, given: &[f64]) -> Vec<f64> {
        let Self { block, made, .. } = self;
        let is_switch = |unit: &str| unit == "0/1";
        for ((v, _), value) in made.inputs.iter().zip(given) {
            match split(&v.name) {
                (name, Some(place)) => block.set_in_list(&edge_name(name), place, *value),
                (name, None) if is_switch(&v.unit) => block.truth(&switch_name(name), *value > 0.5),
                (name, None) => block.set(&edge_name(name), *value),
            }
        }
        block.call(&[]);
        let shown = made.outputs.iter().map(|v| match v.unit.as_str() {
            unit if is_switch(unit) => f64::from(u8::from(block.holds(&switch_name(&v.name)))),
            "code" => block.count(&edge_name(&v.name)) as f64,
            _ => block.value(&edge_name(&v.name)),
        });
        shown.collect()
    }
}

impl Target for OnPlc {
    fn name(&self) -> &'static str {
        "Structured Text, scheduled LQR"
    }

    fn look_ahead(&mut self, at: &dyn Fn(f64) -> SetPoint<f64>) {
        self.input.ahead = PreviewAhead::new(self.period, self.length, at);
    }

    fn period(
        &mut self,
        input: &FrameInput<f64>,
        _gain: f64,
    ) -> Result<FrameOutput<f64>, TargetError> {
        self.input.frame = *input;
        let shown = self.call(&given(&self.input));
        Ok(FrameOutput::from_array(std::array::from_fn(|k| shown[k])))
    }
}

/// Outputs of the interpreted Structured Text in each period of a recording, which may begin at any state.
pub fn in_structured_text(precision: Precision, recording: &Recording) -> Vec<Vec<f64>> {
    let mut block = OnPlc::new(precision, 0);
    block.remember(&recording.begin);
    recording.given.iter().map(|given| block.call(given)).collect()
}

/// Outputs of the FMU in each period of a recording from power-up on, run by FMPy in a folder.
pub fn in_fmu(
    python: &str,
    version: Version,
    recording: &Recording,
    place: &Path,
) -> Vec<Vec<f64>> {
    let (model, _) = cranes();
    let block = scheduled_lqr_controller(&model).unwrap();
    let unit = unit(&block, None, &model, version).unwrap();
    let library = binary(&unit, System::Linux, &place.join("build")).unwrap().unwrap();
    let path = place.join("controller.fmu");
    std::fs::write(&path, archive(&unit, &[(System::Linux, library)]).unwrap()).unwrap();
    let [given, found] = ["given", "found"].map(|name| place.join(name));
    std::fs::write(&given, bytes_of(recording.given.iter().flatten())).unwrap();
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fmi_check.py");
    let output =
        Command::new(python).args([script, "replayed"]).args([&path, &given, &found]).output();
    let output = output.unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    rows_of(&std::fs::read(&found).unwrap(), block.outputs.len())
}

/// Largest difference of each output over all periods, relative to its largest value.
pub fn shares_off(found: &[Vec<f64>], recording: &Recording) -> Vec<(String, f64)> {
    assert_eq!(found.len(), recording.wanted.len());
    let of = |k: usize| {
        let size = recording.wanted.iter().map(|row| row[k].abs()).fold(0.0, f64::max);
        let off = found.iter().zip(&recording.wanted).map(|(found, wanted)| {
            // two values that are both not finite count as equal
            if found[k].is_nan() && wanted[k].is_nan() {
                return 0.0;
            }
            let off = (found[k] - wanted[k]).abs();
            // a single NaN counts as the largest difference
            if off.is_nan() { f64::INFINITY } else { off }
        });
        let off = off.fold(0.0, f64::max);
        if off == 0.0 { 0.0 } else { off / size }
    };
    let names = names();
    (0..shown_count()).map(|k| (names[k].clone(), of(k))).collect()
}
