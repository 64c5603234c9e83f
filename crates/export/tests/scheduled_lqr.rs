//! The scheduled LQR with its estimator within the frame: generated C beside the Rust that it was recorded from.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up has failed")]

use hydroboom_control::estimation::retained_parameters::RetainedParameters;
use hydroboom_control::memory::Memory;
use hydroboom_control::reference::preview::PreviewAhead;
use hydroboom_control::reference::profile::SetPoint;
use hydroboom_control::supervision::frame::{FrameInput, FrameOutput, STATUS_FAULT, frame_phase};
use hydroboom_control::supervision::framed_scheduled_lqr::{
    EstimatorRequest, FramedScheduledLqrInput, FramedScheduledLqrOutput, FramedScheduledLqrState,
};
use hydroboom_description::Description;
use hydroboom_export::c::{Precision, files};
use hydroboom_export::closed_loop::{
    Bad, Case, Compiled, Disturbed, Moment, Outcome, Recorder, RustScheduledLqr, Target,
    TargetError, bounds, cases, run,
};
use hydroboom_export::scheduled_lqr_controller;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Control periods that are recorded: two seconds and more, from when the valve opens on.
const PERIODS: usize = 3500;

fn cranes() -> (Description, Description) {
    (Description::uia_single_boom().unwrap(), Description::uia_virtual().unwrap())
}

/// Everything that a controller remembers, in the order of the block.
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

/// Everything that it is given, in the order of the block.
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

/// Everything that it shows.
fn shown(output: &FramedScheduledLqrOutput<f64>) -> Vec<f64> {
    let mut all = output.frame.to_array().to_vec();
    all.extend(output.estimator.to_array());
    all.extend(output.retained.to_array());
    all
}

/// What was recorded from the period in which the valve opens on.
#[derive(Default)]
struct Recording {
    /// State before the first period.
    begin: Vec<f64>,
    /// What is given in each.
    given: Vec<Vec<f64>>,
    /// What is shown in each, and remembered after it.
    wanted: Vec<Vec<f64>>,
    /// Position of the piston and of the reference in each \[m\].
    stroke: Vec<[f64; 2]>,
}

/// A controller that is recorded.
struct Recorded {
    inner: RustScheduledLqr,
    recording: Recording,
    /// Asked of the estimator in recorded period k.
    request: fn(usize) -> (EstimatorRequest<f64>, RetainedParameters<f64>),
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
        let records = phase >= frame_phase::OPENING || !recording.begin.is_empty();
        if records && recording.given.len() < PERIODS {
            if recording.begin.is_empty() {
                recording.begin = remembered(self.inner.state());
            }
            let (request, retained) = (self.request)(recording.given.len());
            (self.inner.input().request, self.inner.input().retained) = (request, retained);
        }
        let output = self.inner.advance(input);
        let recording = &mut self.recording;
        if records && recording.given.len() < PERIODS {
            recording.given.push(given(self.inner.input()));
            let after = remembered(self.inner.state());
            recording.wanted.push([shown(&output), after].concat());
            recording.stroke.push([input.stroke, input.reference_position]);
        }
        Ok(output.frame)
    }
}

/// A course from end to end of what is tried, undisturbed.
fn plain(model: &Description) -> Case {
    let all = cases(model);
    all.iter().find(|c| c.moves && c.disturbed.is_none() && c.gain.is_none()).unwrap().clone()
}

fn nothing(_: usize) -> (EstimatorRequest<f64>, RetainedParameters<f64>) {
    (EstimatorRequest::default(), RetainedParameters::default())
}

fn recorded(
    length: usize,
    request: fn(usize) -> (EstimatorRequest<f64>, RetainedParameters<f64>),
) -> (Recording, Outcome) {
    let (model, machine) = cranes();
    let inner = RustScheduledLqr::new(&model, length).unwrap();
    let mut target = Recorded { inner, recording: Recording::default(), request };
    let mut case = plain(&model);
    case.rest = 1.0;
    let outcome = run(&model, &machine, &case, &mut target).unwrap();
    (target.recording, outcome)
}

fn folder(name: &str) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::create_dir_all(&path).unwrap();
    path
}

/// Reads the state to begin with, then what is given in each period, and writes what is shown and remembered.
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

fn compiled(folder: &Path, precision: Precision, options: &[&str]) -> PathBuf {
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

/// What a program answers to a recording, a row for each period.
fn answered(program: &Path, recording: &Recording) -> Vec<Vec<f64>> {
    let mut child =
        Command::new(program).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    let mut input = child.stdin.take().unwrap();
    let numbers = recording.begin.iter().chain(recording.given.iter().flatten());
    let bytes: Vec<u8> = numbers.flat_map(|v| v.to_le_bytes()).collect();
    let writing = std::thread::spawn(move || input.write_all(&bytes).unwrap());
    let output = child.wait_with_output().unwrap();
    writing.join().unwrap();
    assert!(output.status.success(), "{:?}", output.status);
    let width = recording.wanted[0].len();
    let eight = |c: &[u8]| f64::from_le_bytes(c.try_into().unwrap());
    let numbers: Vec<f64> = output.stdout.chunks_exact(8).map(eight).collect();
    assert_eq!(numbers.len(), width * recording.wanted.len());
    numbers.chunks_exact(width).map(<[f64]>::to_vec).collect()
}

/// Names of what is shown and remembered.
fn names() -> Vec<String> {
    let block = scheduled_lqr_controller(&cranes().0).unwrap();
    let outputs = block.outputs.iter().map(|v| v.name.clone());
    outputs.chain(block.states.iter().map(|(v, _)| v.name.clone())).collect()
}

/// The estimator is asked for everything in turn, while it has the load and while not.
fn everything(k: usize) -> (EstimatorRequest<f64>, RetainedParameters<f64>) {
    let is = |from: usize, to: usize| f64::from(u8::from((from..to).contains(&k)));
    let request = EstimatorRequest {
        reset_estimator: is(20, 22),
        freeze_parameters: is(1500, 1700),
        restore_parameters: is(40, 44),
    };
    let retained = RetainedParameters {
        unknown_flow: 0.05,
        transition_pressure: if k == 41 { f64::NAN } else { 30e5 },
        flow_variance: 0.01,
        flow_transition_covariance: 100.0,
        transition_variance: 1e10,
        drive_coefficient: 0.1,
        drive_variance: 1e-4,
    };
    (request, retained)
}

/// A release, rest and motion with the whole preview, a short one and none; every output and every number of the memory, in every
/// period.
#[test]
fn what_was_recorded_gives_the_same_bits_in_c() {
    let folder = folder("c-scheduled-lqr");
    let program = compiled(&folder, Precision::Double, &[]);
    let names = names();
    let mut rolled = 0;
    for (length, request) in [(800, nothing as fn(usize) -> _), (60, everything), (0, nothing)] {
        let (recording, outcome) = recorded(length, request);
        assert_eq!(recording.given.len(), PERIODS, "{outcome:?}");
        let found = answered(&program, &recording);
        let place = names.iter().position(|name| name == "lqr_rollout_is_evaluating").unwrap();
        let evaluating = recording.wanted.iter().filter(|row| row[place] > 0.5).count();
        rolled += evaluating;
        for (k, (found, wanted)) in found.iter().zip(&recording.wanted).enumerate() {
            for ((name, found), wanted) in names.iter().zip(found).zip(wanted) {
                assert!(
                    found.to_bits() == wanted.to_bits() || found == wanted,
                    "preview of {length}, period {k}, {name}: {found:e} for {wanted:e}"
                );
            }
        }
    }
    assert!(rolled > 100, "the rollout has decided in {rolled} periods only");
}

/// Retained parameters are taken while the load is held, all or none of them; frozen ones stay while the controller moves the load.
#[test]
fn parameters_are_restored_while_the_load_is_held_and_frozen_on_request() {
    let names = names();
    let (recording, _) = recorded(60, everything);
    let of =
        |k: usize, name: &str| recording.wanted[k][names.iter().position(|n| n == name).unwrap()];
    let (_, given) = everything(43);
    // period 41 gives a pressure that is no number: nothing is taken
    for k in [40, 41, 43, 44] {
        assert_eq!(of(k, "retained_unknown_flow"), given.unknown_flow, "period {k}");
        assert_eq!(of(k, "retained_transition_pressure"), given.transition_pressure, "period {k}");
        assert_eq!(of(k, "retained_drive_coefficient"), given.drive_coefficient, "period {k}");
    }
    for k in [40, 43] {
        assert_eq!(of(k, "retained_flow_variance"), given.flow_variance, "period {k}");
        assert_eq!(of(k, "retained_transition_variance"), given.transition_variance, "period {k}");
    }
    for name in ["unknown_flow", "transition_pressure", "drive_coefficient"] {
        let name = format!("retained_{name}");
        let (before, frozen, later) = (of(1499, &name), of(1699, &name), of(3000, &name));
        assert_eq!(frozen, before, "{name}");
        assert!(later != frozen && before != of(44, &name), "{name} is never estimated");
    }
}

/// Puts something into a preview.
type Spoil = fn(&mut PreviewAhead<f64>);

/// A preview with one entry that is no number or infinite, from a period on in which the piston moves.
struct Spoilt {
    inner: RustScheduledLqr,
    spoil: Spoil,
    /// Periods in which the controller has had the load.
    controlled: usize,
}

impl Target for Spoilt {
    fn name(&self) -> &'static str {
        self.inner.name()
    }

    fn look_ahead(&mut self, at: &dyn Fn(f64) -> SetPoint<f64>) {
        self.inner.look_ahead(at);
        if self.controlled > 1500 {
            (self.spoil)(&mut self.inner.input().ahead);
        }
    }

    fn period(
        &mut self,
        input: &FrameInput<f64>,
        _gain: f64,
    ) -> Result<FrameOutput<f64>, TargetError> {
        let output = self.inner.advance(input).frame;
        self.controlled += usize::from(output.status == frame_phase::CONTROLLING);
        Ok(output)
    }
}

/// It never moves the load anywhere else: either the load is held, or the path is followed as well as with a short preview.
#[test]
fn a_preview_that_is_no_number_moves_the_load_nowhere_else() {
    let (model, machine) = cranes();
    let spoils: [(&str, Spoil); 7] = [
        ("next position", |a| a.position[0] = f64::NAN),
        ("position", |a| a.position[100] = f64::NAN),
        ("last position", |a| a.position[799] = f64::NAN),
        ("infinite position", |a| a.position[50] = f64::INFINITY),
        ("velocity", |a| a.velocity[5] = f64::NAN),
        ("distant position", |a| a.distant[3] = f64::NAN),
        ("length", |a| a.length = f64::NAN),
    ];
    let moment = Moment::Motion;
    let disturbed = Some(Disturbed { input: 0, bad: Bad::NotANumber, periods: 1, moment });
    let wrong = Case { disturbed, ..plain(&model) };
    let held = Outcome { status: STATUS_FAULT + 29.0, ..Outcome::default() };
    let stop = bounds(&model, &wrong, &Outcome::default(), &held).unwrap();
    for (what, spoil) in spoils {
        let inner = RustScheduledLqr::new(&model, 800).unwrap();
        let mut target = Spoilt { inner, spoil, controlled: 0 };
        let outcome = run(&model, &machine, &plain(&model), &mut target).unwrap();
        assert!(target.controlled > 1500, "{what}: {}", outcome.status);
        assert!(!outcome.is_not_finite, "{what}");
        // held at once from the fast speed, or on as with a shorter preview
        match outcome.status >= STATUS_FAULT {
            true => assert!(outcome.stopped_in < stop.stopped, "{what}: {} m", outcome.stopped_in),
            false => assert!(outcome.error < 5e-3, "{what}: {} m", outcome.error),
        }
        println!("{what}: status {}", outcome.status);
    }
}

/// What `hydroboom export closed-loop` runs: the compiled block behind its pipes gives what Rust gives, with a preview and without.
#[test]
fn the_program_of_the_closed_loop_gives_what_rust_gives() {
    let (model, machine) = cranes();
    let block = scheduled_lqr_controller(&model).unwrap();
    for length in [800, 0] {
        let place = folder(&format!("c-scheduled-lqr-{length}"));
        let precision = Precision::Double;
        let compiled = Compiled::in_c_with_preview("C", &block, length, precision, &place).unwrap();
        let mut c = Recorder::new(Box::new(compiled.start().unwrap()));
        let mut rust = Recorder::new(Box::new(RustScheduledLqr::new(&model, length).unwrap()));
        let case = plain(&model);
        run(&model, &machine, &case, &mut c).unwrap();
        run(&model, &machine, &case, &mut rust).unwrap();
        assert_eq!(c.rows.len(), rust.rows.len(), "{length}");
        for (k, ((_, found), (_, wanted))) in c.rows.iter().zip(&rust.rows).enumerate() {
            assert_eq!(found.to_array(), wanted.to_array(), "{length}, period {k}");
        }
    }
}

/// In closed loop with the virtual crane, with whatever preview.
#[test]
fn it_moves_the_load_with_any_preview() {
    for length in [800, 60, 0] {
        let (recording, outcome) = recorded(length, nothing);
        assert_eq!(outcome.status, frame_phase::CONTROLLING, "{length}: {outcome:?}");
        let errors = recording.stroke.iter().map(|[x, r]| (x - r).abs());
        let largest = errors.fold(0.0, f64::max);
        println!("preview of {length} periods: largest error {:.2} mm", 1e3 * largest);
        assert!(outcome.status < STATUS_FAULT && largest < 5e-3, "{length}: {largest} m");
    }
}

/// Single precision computes other commands. Beside the same readings they stay near those in double precision.
#[test]
fn single_precision_stays_near_double() {
    let folder = folder("c-scheduled-lqr-single");
    let program = compiled(&folder, Precision::Single, &[]);
    let (recording, _) = recorded(800, nothing);
    let found = answered(&program, &recording);
    let (mut sum, mut largest, mut size) = (0.0, 0.0_f64, 0.0_f64);
    for (found, wanted) in found.iter().zip(&recording.wanted) {
        let off: f64 = found[0] - wanted[0];
        sum += off * off;
        largest = largest.max(off.abs());
        size = size.max(wanted[0].abs());
    }
    let rms = (sum / found.len() as f64).sqrt();
    println!("float: motor speed off by {rms:.4} rev/s rms, {largest:.4} at most, of {size:.2}");
    assert!(largest.is_finite() && size > 1.0);
    assert!(largest < 0.05 * size, "{largest} of {size} rev/s");
}
