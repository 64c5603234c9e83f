//! The scheduled LQR with its estimator within the frame: generated C against Rust.

use crate::evaluator::Instance;
use crate::recording::{
    From, Recording, Requests, compiled, cranes, in_c, in_fmu, in_structured_text, names, nothing,
    plain, recorded, shares_off,
};
use hydroboom_control::estimation::retained_parameters::RetainedParameters;
use hydroboom_control::reference::preview::PreviewAhead;
use hydroboom_control::reference::profile::SetPoint;
use hydroboom_control::supervision::frame::{FrameInput, FrameOutput, STATUS_FAULT, frame_phase};
use hydroboom_control::supervision::framed_scheduled_lqr::EstimatorRequest;
use hydroboom_export::c::Precision;
use hydroboom_export::closed_loop::{
    Bad, Case, Compiled, Disturbed, Moment, Outcome, Recorder, RustScheduledLqr, Target,
    TargetError, bounds, run,
};
use hydroboom_export::fmi::Version;
use hydroboom_export::scheduled_lqr_controller;
use std::path::PathBuf;
use std::sync::OnceLock;

/// Recorded control periods: two seconds and more, from the opening of the valve.
const PERIODS: usize = 3500;

fn folder(name: &str) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::create_dir_all(&path).unwrap();
    path
}

fn of_course(length: usize, requests: Requests) -> (Recording, Outcome) {
    recorded(&plain(&cranes().0), length, requests, (From::Opening, PERIODS))
}

/// Lengths of the preview: the whole one, a short one and none.
const PREVIEWS: [usize; 3] = [800, 60, 0];

/// A course without requests for each of the previews, recorded once for all tests.
fn without_requests() -> &'static [(Recording, Outcome); PREVIEWS.len()] {
    static COURSES: OnceLock<[(Recording, Outcome); PREVIEWS.len()]> = OnceLock::new();
    COURSES.get_or_init(|| PREVIEWS.map(|length| of_course(length, nothing)))
}

/// All requests to the estimator in turn, with and without the load.
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

/// A release, standstill and motion with the whole preview, a short one and none: all outputs and states in every
/// period.
#[test]
fn recorded_periods_give_the_same_bits_in_c() {
    let folder = folder("c-scheduled-lqr");
    let program = compiled(&folder, Precision::Double, &[]);
    let names = names();
    let mut rolled = 0;
    let [whole, _, none] = without_requests();
    for (length, (recording, outcome)) in
        [(800, whole), (60, &of_course(60, everything)), (0, none)]
    {
        assert_eq!(recording.given.len(), PERIODS, "{outcome:?}");
        let found = in_c(&program, recording);
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

/// Retained parameters are restored only as a whole and while the load is held; frozen ones stay constant during
/// control.
#[test]
fn parameters_are_restored_while_the_load_is_held_and_frozen_on_request() {
    let names = names();
    let (recording, _) = of_course(60, everything);
    let of =
        |k: usize, name: &str| recording.wanted[k][names.iter().position(|n| n == name).unwrap()];
    let (_, given) = everything(43);
    // the pressure of period 41 is NaN: nothing is restored
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
    // the variance of a parameter that is not estimated does not decrease
    for name in ["retained_flow_variance", "retained_transition_variance"] {
        let (before, frozen) = (of(1499, name), of(1699, name));
        assert!(frozen >= before, "{name}: {frozen} after {before}");
    }
}

/// Changes entries of a preview.
type Spoil = fn(&mut PreviewAhead<f64>);

/// A preview with one NaN or infinite entry, from a period in motion on.
struct Spoilt {
    inner: RustScheduledLqr,
    spoil: Spoil,
    /// Number of periods in which the controller has had the load.
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

/// The load is held, or the tracking is as good as with a shorter preview.
#[test]
fn a_nonfinite_preview_does_not_displace_the_load() {
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
        // stopped at once from the fast speed, or continued as with a shorter preview
        match outcome.status >= STATUS_FAULT {
            true => assert!(outcome.stopped_in < stop.stopped, "{what}: {} m", outcome.stopped_in),
            false => assert!(outcome.error < 5e-3, "{what}: {} m", outcome.error),
        }
        println!("{what}: status {}", outcome.status);
    }
}

/// The compiled block behind its pipes, as in `hydroboom export closed-loop`, gives Rust's results.
#[test]
fn the_closed_loop_program_gives_the_results_of_rust() {
    program_gives_the_results_of_rust(&[800]);
}

/// The same without preview.
#[test]
#[ignore = "campaign"]
fn campaign_the_closed_loop_program_without_preview_gives_the_results_of_rust() {
    program_gives_the_results_of_rust(&[0]);
}

fn program_gives_the_results_of_rust(lengths: &[usize]) {
    let (model, machine) = cranes();
    let block = scheduled_lqr_controller(&model).unwrap();
    for &length in lengths {
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

/// In closed loop with the virtual crane, with different previews.
#[test]
fn the_reference_is_tracked_with_any_preview_length() {
    for (length, (recording, outcome)) in PREVIEWS.into_iter().zip(without_requests()) {
        assert_eq!(outcome.status, frame_phase::CONTROLLING, "{length}: {outcome:?}");
        let errors = recording.stroke.iter().map(|[x, r]| (x - r).abs());
        let largest = errors.fold(0.0, f64::max);
        println!("preview of {length} periods: largest error {:.2} mm", 1e3 * largest);
        assert!(outcome.status < STATUS_FAULT && largest < 5e-3, "{length}: {largest} m");
    }
}

/// Commands in single precision differ; for the same readings they stay close to those in double precision.
#[test]
fn single_precision_stays_near_double() {
    let folder = folder("c-scheduled-lqr-single");
    let program = compiled(&folder, Precision::Single, &[]);
    let (recording, _) = &without_requests()[0];
    let found = in_c(&program, recording);
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

/// Indices of the preview's positions among the inputs.
const PREVIEW: std::ops::Range<usize> = 23..823;

/// Largest relative difference of a language with its own elementary functions.
const SHARE: f64 = 1e-6;

/// Two seconds from the opening of the valve: engagement, standstill and the beginning of a motion. The example
/// `scheduled_lqr_targets` runs a minute from power-up.
#[test]
fn structured_text_gives_the_results_of_rust() {
    let recording = without_requests()[0].0.until(2000);
    let found = in_structured_text(Precision::Double, &recording);
    for (name, share) in shares_off(&found, &recording) {
        assert!(share <= SHARE, "{name} is off by {share:e} of its size");
    }
}

/// The same in `REAL`, for half a second of control: as close to double precision as `float` in C.
#[test]
#[ignore = "campaign"]
fn campaign_structured_text_in_single_precision_stays_near_double() {
    let recording = without_requests()[0].0.until(1500);
    let single = in_structured_text(Precision::Single, &recording);
    let in_c = in_c(&compiled(&folder("c-beside-real"), Precision::Single, &[]), &recording);
    let mut differs = false;
    for (name, share) in shares_off(&single, &recording) {
        assert!(share < 0.02, "{name} is off by {share:e} of its size");
        differs |= share > SHARE;
    }
    assert!(differs, "single precision is rounded nowhere");
    let size = recording.wanted.iter().map(|row| row[0].abs()).fold(0.0, f64::max);
    for (k, (plc, c)) in single.iter().zip(&in_c).enumerate() {
        assert!((plc[0] - c[0]).abs() < 0.01 * size, "period {k}: {} and {} rev/s", plc[0], c[0]);
    }
}

/// Each result is rounded like single precision in Rust.
#[test]
fn the_evaluator_rounds_real_to_single_precision() {
    let text = "FUNCTION_BLOCK FB_Rounded\nVAR_INPUT\n x : REAL;\nEND_VAR\nVAR_OUTPUT\n y : REAL;\n z : REAL;\nEND_VAR\n\
                y := x * x - 0.1E0 / SQRT(x);\nz := EXP(-x) + DINT_TO_REAL(REAL_TO_DINT(x));\nEND_FUNCTION_BLOCK";
    let mut block = Instance::parse(text);
    for k in 1..200_u8 {
        let x = 0.37_f32 * f32::from(k);
        block.call(&[("x", f64::from(x))]);
        let (y, z) = (x * x - 0.1 / x.sqrt(), (-x).exp() + x.round_ties_even());
        assert_eq!(block.value("y"), f64::from(y), "{x}");
        assert!((block.value("z") - f64::from(z)).abs() <= f64::from(z * f32::EPSILON), "{x}");
    }
}

/// From power-up, the only initial state of an FMU. FMI 2.0 has no arrays, and is tested up to the end of the release.
#[test]
fn an_fmu_gives_the_results_of_rust() {
    fmu_gives_the_results_of_rust(Version::Two, 1000);
}

/// The same by FMI 3.0 along a motion, then with a preview that is not finite.
#[test]
#[ignore = "campaign"]
fn campaign_an_fmu_with_arrays_gives_the_results_of_rust() {
    fmu_gives_the_results_of_rust(Version::Three, 7500);
}

fn fmu_gives_the_results_of_rust(version: Version, periods: usize) {
    let Ok(python) = std::env::var("HYDROBOOM_FMPY") else {
        eprintln!("skipped: HYDROBOOM_FMPY names no Python with FMPy");
        return;
    };
    let case = plain(&cranes().0);
    let (mut recording, _) = recorded(&case, 800, nothing, (From::PowerUp, periods));
    let moved = recording.stroke.iter().map(|[_, reference]| (reference - case.stroke).abs());
    let moved = moved.fold(0.0, f64::max);
    assert_eq!(moved > 0.05, version == Version::Three, "the reference moves by {moved} m");
    if version == Version::Three {
        // from here on the preview is not finite: the block must give the result of C and Rust, without an error
        let place = names().iter().position(|name| name == "status").unwrap();
        let spoilt = recording.given.len() - 100;
        recording.given[spoilt..].iter_mut().for_each(|row| row[PREVIEW].fill(f64::NAN));
        let program = compiled(&folder("c-for-fmu"), Precision::Double, &[]);
        recording.wanted = in_c(&program, &recording);
        assert!(recording.wanted[spoilt + 50][place] > STATUS_FAULT, "the load is not held");
    }
    let found =
        in_fmu(&python, version, &recording, &folder(&format!("fmu-scheduled-lqr-{version:?}")));
    for (name, share) in shares_off(&found, &recording) {
        assert!(share <= SHARE, "{version:?}: {name} is off by {share:e} of its size");
    }
}
