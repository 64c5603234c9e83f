//! Structured Text, read by an independent parser and interpreted, against Rust.

use crate::course::inputs;
use crate::evaluator;
use crate::evaluator::{Instance, Library};
use crate::on_plc::rows;
use hydroboom_control::supervision::frame::{STATUS_FAULT, frame_phase};
use hydroboom_description::Description;
use hydroboom_export::Block;
use hydroboom_export::structured_text::{
    Form, Kind, Section, Unit, function_block, plcopen, twincat, units,
};
use hydroboom_export::{blocks, controller};
use hydroboom_model::stepping::published;
use hydroboom_model::{Crane, CraneState, Input, Outputs};

const STEP: f64 = 50e-6;

fn text_of(block: &Block) -> String {
    function_block(block).unwrap().text()
}

/// Relative to the signal's scale in a motion, 1e-9. Functions of the platform and products that round
/// twice differ in the sixteenth digit. Differences of large pressures within a step lose some digits.
fn agrees(what: &str, step: usize, found: f64, wanted: f64, scale: f64) {
    let off = (found - wanted).abs() / scale;
    assert!(off <= 1e-9, "{what} after step {step}: {found} for {wanted}");
}

fn cranes() -> [Description; 2] {
    let text = hydroboom_description::UIA_SINGLE_BOOM;
    let of = |text: &str| Description::parse("crane", text).unwrap();
    [of(text), of(&text.replace("\"stribeck\"", "\"lugre\""))]
}

fn set_boom(boom: &mut Instance, state: &CraneState<f64, 3>) {
    for i in 0..3 {
        boom.set(&format!("sPhi{}", i + 1), state.boom.angle[i]);
        boom.set(&format!("sOmega{}", i + 1), state.boom.angular_velocity[i]);
    }
}

fn set_hydraulics(hydraulics: &mut Instance, state: &CraneState<f64, 3>) {
    let names = ["sPPA", "sPA", "sPB", "sPPB", "sPAcc"];
    for (name, value) in names.into_iter().zip(state.circuit.nodes.to_array()) {
        hydraulics.set(name, value);
    }
    hydraulics.set("sVolGas", state.circuit.gas_volume);
    hydraulics.set("sZBristle", state.bristle);
}

/// Both blocks, and the Rust crane in its initial equilibrium.
fn beside(description: &Description) -> (Instance, Instance, Crane<f64, 3>, CraneState<f64, 3>) {
    let [hydraulics, boom] = blocks(description).unwrap().map(|b| Instance::parse(&text_of(&b)));
    let crane = description.crane::<3>().unwrap();
    let n = &description.numbers;
    let state = crane.at_rest(&description.start_over(n, n.motion_start)).unwrap();
    (hydraulics, boom, crane, state)
}

/// A step of the hydraulics at a piston position and velocity.
fn step_hydraulics(block: &mut Instance, input: &Input<f64>, (stroke, velocity): (f64, f64)) {
    block.call(&[
        ("nPump", input.pump_speed),
        ("uValve", input.holding_valve),
        ("xCyl", stroke),
        ("vCyl", velocity),
        ("tStep", STEP),
    ]);
}

fn pressures(o: &Outputs<f64>) -> [(&'static str, f64); 5] {
    [
        ("pPA", o.pressure_pump_a),
        ("pA", o.pressure_a),
        ("pB", o.pressure_b),
        ("pPB", o.pressure_pump_b),
        ("pAcc", o.pressure_accumulator),
    ]
}

/// Each step begins at Rust's state. The published step chatters at the load-holding valves, so that two runs with
/// different rounding diverge there by bars, both equally correct.
#[test]
fn each_of_ten_thousand_steps_equals_that_in_rust() {
    for description in cranes() {
        let (mut hydraulics, mut boom, crane, mut state) = beside(&description);
        for (k, input) in inputs(10_000).iter().enumerate() {
            let before = crane.outputs(&state);
            if k > 0 {
                set_boom(&mut boom, &state);
                set_hydraulics(&mut hydraulics, &state);
            }
            published(&crane, &mut state, input, STEP);
            let wanted = crane.outputs(&state);
            step_hydraulics(&mut hydraulics, input, (before.stroke, before.velocity));
            agrees("fCyl", k, hydraulics.value("fCyl"), before.cylinder_force, 1e4);
            boom.call(&[("fCyl", before.cylinder_force), ("tStep", STEP)]);
            agrees("xCyl", k, boom.value("xCyl"), wanted.stroke, 0.1);
            agrees("vCyl", k, boom.value("vCyl"), wanted.velocity, 0.1);
            agrees("yTip", k, boom.value("yTip"), wanted.tip_y, 1.0);
            agrees("zBristle", k, hydraulics.value("sZBristle"), state.bristle, 1e-4);
            agrees("volGas", k, hydraulics.value("sVolGas"), state.circuit.gas_volume, 1e-3);
            for (name, pressure) in pressures(&wanted) {
                agrees(name, k, hydraulics.value(name), pressure, 1e5);
            }
        }
    }
}

#[test]
fn a_motion_ends_as_in_rust_and_can_be_restarted() {
    let description = Description::uia_single_boom().unwrap();
    let (mut hydraulics, mut boom, crane, mut state) = beside(&description);
    let begin = crane.outputs(&state);
    let (mut stroke, mut velocity) = (begin.stroke, begin.velocity);
    for (k, input) in inputs(10_000).iter().enumerate() {
        published(&crane, &mut state, input, STEP);
        step_hydraulics(&mut hydraulics, input, (stroke, velocity));
        boom.call(&[("fCyl", hydraulics.value("fCyl")), ("tStep", STEP)]);
        (stroke, velocity) = (boom.value("xCyl"), boom.value("vCyl"));
        let wanted = crane.outputs(&state).stroke;
        assert!((stroke - wanted).abs() < 1e-6, "{stroke} m for {wanted} after step {k}");
    }
    assert!((stroke - begin.stroke).abs() > 1e-3, "nothing moved");
    boom.call_with(&[("fCyl", 0.0), ("tStep", 0.0)], &[("bReset", true)]);
    agrees("xCyl, begun again", 0, boom.value("xCyl"), begin.stroke, 0.1);
}

/// One engagement, a second at standstill, and an input error of each kind, on the virtual crane; for the controller
/// with simulation only the engagement.
#[test]
fn the_framed_controllers_hold_release_and_stop_on_the_virtual_crane() {
    let model = Description::uia_single_boom().unwrap();
    let machine = Description::uia_virtual().unwrap();
    let rows = rows(&model, &machine, 1);
    assert_eq!(rows.len(), 6);
    for row in rows {
        assert!(row.beyond.is_empty(), "{:?}", row.cells());
        assert!(row.outcome.release_time.is_some(), "{:?}", row.cells());
        let stops = row.outcome.status >= STATUS_FAULT;
        assert_eq!(stops, row.case.disturbed.is_some(), "{:?}", row.cells());
    }
}

/// A strategy's function block from all units of a PLC project.
fn steering(description: &Description, name: &str) -> Instance {
    let texts: Vec<String> = units(description)
        .unwrap()
        .iter()
        .filter(|u| u.kind != Kind::Globals)
        .map(Unit::text)
        .collect();
    Library::parse(texts.iter().map(String::as_str)).instance(name)
}

/// Blocks replayed by the test bench.
const REPLAYED: [&str; 5] = [
    "HydraulicModel",
    "FlexibleBoom",
    "BenchmarkController",
    "SimulationFeedforwardController",
    "SimulationFeedforward",
];
/// Periods in a call, and the number of calls.
const PERIODS: usize = 20;
const CALLS: usize = 300 * PERIODS;

/// All units of a PLC project, and the text of their test bench.
fn with_bench() -> (Vec<String>, String) {
    let all = units(&Description::uia_single_boom().unwrap()).unwrap();
    let is_bench = |u: &&Unit| u.name == "PRG_TestBench";
    let bench = all.iter().find(is_bench).unwrap().text();
    let others = all.iter().filter(|u| u.kind != Kind::Globals && !is_bench(u));
    (others.map(Unit::text).collect(), bench)
}

/// Runs a test bench to its end; `before` may change it before each call.
fn run(bench: &mut Instance, mut before: impl FnMut(&mut Instance, usize)) {
    bench.truth("bBegun", false);
    for call in 0..CALLS {
        before(bench, call);
        bench.run();
        assert_eq!(bench.holds("bDone"), call + 1 == CALLS, "after call {call}");
        assert!(bench.holds("bDone") || !bench.holds("bPassed"), "passed before the end");
    }
}

/// Blocks that a test bench reports as failed; its outputs must be consistent.
fn failed(bench: &Instance) -> Vec<&'static str> {
    let passed = |name: &&&str| bench.holds(&format!("bPassed{name}"));
    let worst = |name: &&str| bench.value(&format!("fWorst{name}"));
    for name in &REPLAYED {
        assert!(worst(name).is_finite());
        assert_eq!(passed(&name), worst(name) < 1e-6, "{name}: {}", worst(name));
    }
    assert_eq!(bench.holds("bPassed"), REPLAYED.iter().all(|name| passed(&name)));
    assert_eq!(bench.value("fWorst"), REPLAYED.iter().map(worst).fold(0.0, f64::max));
    REPLAYED.iter().filter(|name| !passed(name)).copied().collect()
}

/// Other cranes are replayed too, with elementary functions that differ in the last digit.
#[test]
fn the_test_bench_passes_on_other_cranes_and_platforms() {
    let text = hydroboom_description::UIA_SINGLE_BOOM;
    let of = |from: &str, to: &str| {
        assert!(text.contains(from), "{from}");
        Description::parse("crane", &text.replace(from, to)).unwrap()
    };
    let cranes = [
        Description::uia_single_boom().unwrap(),
        of("\"stribeck\"", "\"lugre\""),
        of("= { value = 307.0", "= { value = 50.0"),
        of("= { value = 307.0", "= { value = 370.0"),
        of("= { value = 65.0", "= { value = 80.0"),
    ];
    for (k, crane) in cranes.iter().enumerate() {
        for off in [-1.0, 0.0, 1.0] {
            let mut bench = steering(crane, "PRG_TestBench");
            evaluator::LAST_DIGIT.set(off * f64::EPSILON);
            run(&mut bench, |_, _| {});
            evaluator::LAST_DIGIT.set(0.0);
            assert!(failed(&bench).is_empty(), "crane {k}, {off}: {:?}", bench.shown());
        }
    }
}

#[test]
fn the_test_bench_passes_as_exported_and_can_be_restarted() {
    let (others, text) = with_bench();
    for name in REPLAYED {
        assert!(text.contains(&format!("fb{name} : FB_{name};")), "{name} is not replayed");
    }
    // the 3/2 valve is energised, de-energised and energised
    for (from, valve) in [(0, "1.0E0"), (65, "0.0E0"), (105, "1.0E0")] {
        let switched = text.split_once(&format!("IF iCall = {from} THEN")).unwrap().1;
        let switched = switched.split_once("END_IF").unwrap().0;
        let name =
            text.split_once("FB_HydraulicModel.uValve").unwrap().1.split_once(" : ").unwrap().0;
        let name = name.split_whitespace().last().unwrap();
        assert!(switched.contains(&format!("{name} := {valve};")), "{switched}");
    }
    assert!(text.len() < 400_000, "{} bytes", text.len());
    let library = Library::parse(others.iter().map(String::as_str).chain([text.as_str()]));
    let mut bench = library.instance("PRG_TestBench");
    for _ in 0..2 {
        run(&mut bench, |_, _| {});
        assert!(failed(&bench).is_empty(), "{:?}: {:?}", failed(&bench), bench.shown());
        // well below the tolerance: functions of another platform differ in the last digits
        assert!(bench.value("fWorst") < 1e-8, "{:?}", bench.shown());
    }
    // the bench stays constant after its end
    bench.run();
    assert!(bench.holds("bPassed"));
}

/// A parameter of a block within the bench, and the block that fails after its change.
#[test]
fn the_test_bench_names_the_block_that_differs() {
    let (others, text) = with_bench();
    let library = Library::parse(others.iter().map(String::as_str).chain([text.as_str()]));
    let changes = [
        ("HydraulicModel", None, "cylinder_piston_mm", 65.01),
        ("FlexibleBoom", None, "payload_mass_kg", 308.0),
        ("BenchmarkController", None, "controller_proportional_per_s", 4.6),
        ("SimulationFeedforwardController", None, "controller_proportional_per_s", 4.6),
        ("SimulationFeedforward", Some("fbHydraulics"), "pump_displacement_cm3", 14.0),
        ("SimulationFeedforward", Some("fbBoom"), "payload_mass_kg", 308.0),
        ("SimulationFeedforward", Some("fbController"), "controller_proportional_per_s", 90.0),
    ];
    for (name, within, parameter, value) in changes {
        for value in [value, f64::NAN, f64::INFINITY] {
            let mut bench = library.instance("PRG_TestBench");
            let block = bench.inner(&format!("fb{name}"));
            let block = match within {
                Some(within) => block.inner(within),
                None => block,
            };
            block.set(parameter, value);
            run(&mut bench, |_, _| {});
            assert_eq!(failed(&bench), [name], "{within:?} {parameter} = {value}");
        }
    }
}

/// The hydraulics are also compared while the 3/2 valve is closed: with an open valve they fail.
#[test]
fn the_test_bench_covers_the_closed_valve() {
    let (others, text) = with_bench();
    // a call may be broken between two lines
    let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
    let valve = text.split_once("uValve := ").unwrap().1.split_once(',').unwrap().0;
    let open = text.replace(&format!("uValve := {valve}"), "uValve := 1.0E0");
    let library = Library::parse(others.iter().map(String::as_str).chain([open.as_str()]));
    let mut bench = library.instance("PRG_TestBench");
    run(&mut bench, |_, _| {});
    assert_eq!(failed(&bench), ["HydraulicModel"]);
}

/// NaN in a single call, followed by a reset, is still reported.
#[test]
fn the_test_bench_latches_a_nan() {
    let (others, text) = with_bench();
    let library = Library::parse(others.iter().map(String::as_str).chain([text.as_str()]));
    let states = [
        ("HydraulicModel", "sPA"),
        ("FlexibleBoom", "sPhi1"),
        ("BenchmarkController", "sControllerIntegral"),
        ("SimulationFeedforwardController", "sControllerIntegral"),
    ];
    for (name, state) in states {
        let mut bench = library.instance("PRG_TestBench");
        run(&mut bench, |bench, call| {
            if call == 260 * PERIODS {
                bench.inner(&format!("fb{name}")).set(state, f64::NAN);
            }
        });
        assert_eq!(failed(&bench), [name]);
        assert!(bench.value(&format!("fWorst{name}")) > 1.0, "{:?}", bench.shown());
    }
}

/// A change of one number in every second recorded array makes exactly the recorded blocks fail.
#[test]
fn the_test_bench_detects_one_changed_number() {
    let (others, text) = with_bench();
    let mut seen = Vec::new();
    let library = Library::parse(others.iter().map(String::as_str).chain([text.as_str()]));
    let declared: Vec<&str> = text.lines().collect();
    let mut arrays = 0;
    for (k, line) in declared.iter().enumerate() {
        let Some((array, _)) = line.trim().split_once(" : ARRAY[0..299]") else { continue };
        let comment = declared[k - 1];
        let of: Vec<&str> =
            REPLAYED.into_iter().filter(|name| comment.contains(&format!("FB_{name}."))).collect();
        assert!(!of.is_empty(), "{comment}");
        arrays += 1;
        if arrays % 2 == 0 {
            continue;
        }
        // a different number for some arrays, none for the others
        let value = if arrays % 4 == 1 { 1e9 } else { f64::NAN };
        let mut bench = library.instance("PRG_TestBench");
        run(&mut bench, |bench, call| {
            if call == 1 {
                bench.set_in_list(array, 260, value);
            }
        });
        let found = failed(&bench);
        assert!(
            !found.is_empty() && found.iter().all(|name| of.contains(name)),
            "{comment}: {found:?}"
        );
        seen.extend(of);
    }
    assert!(REPLAYED.iter().all(|name| seen.contains(name)), "{seen:?}");
}

#[test]
fn twincat_and_plcopen_files_are_well_formed_and_hold_the_same_text() {
    let description = Description::uia_single_boom().unwrap();
    let all = units(&description).unwrap();
    let project = plcopen::project(&all);
    let document = roxmltree::Document::parse(&project).unwrap();
    let pous: Vec<_> = document
        .descendants()
        .filter(|n| n.has_tag_name("pou") || n.tag_name().name() == "pou")
        .collect();
    assert_eq!(pous.len(), all.len() - 1);
    for unit in &all {
        let (name, content) = twincat::file(unit);
        let document = roxmltree::Document::parse(&content).unwrap();
        let text = |tag: &str| {
            let node = document.descendants().find(|n| n.tag_name().name() == tag);
            node.and_then(|n| n.text()).map(str::to_string)
        };
        assert_eq!(text("Declaration").unwrap(), unit.declaration(Form::TwinCat));
        if unit.kind == Kind::Globals {
            assert!(name.ends_with(".TcGVL"));
            continue;
        }
        assert!(name.ends_with(".TcPOU"));
        assert_eq!(text("ST").unwrap(), unit.statements(Form::TwinCat));
        let pou = pous.iter().find(|n| n.attribute("name") == Some(&unit.name)).unwrap();
        let body = pou.descendants().find(|n| n.tag_name().name() == "ST").unwrap();
        let body: String =
            body.descendants().filter_map(|n| n.is_text().then(|| n.text()).flatten()).collect();
        assert_eq!(body.trim(), unit.statements(Form::Standard).trim());
        let declared = pou.descendants().filter(|n| n.tag_name().name() == "variable").count();
        let results = unit.variables.iter().filter(|v| v.section == Section::Result);
        let returned = pou.descendants().filter(|n| n.tag_name().name() == "returnType").count();
        let is_function = usize::from(unit.kind == Kind::Function);
        assert_eq!((returned, results.count()), (is_function, is_function));
        assert_eq!(declared, unit.variables.len() - returned);
        let passed = pou.descendants().filter(|n| n.tag_name().name() == "inOutVars");
        let passed: usize =
            passed.map(|n| n.children().filter(roxmltree::Node::is_element).count()).sum();
        let of_unit = unit.variables.iter().filter(|v| v.section == Section::InOut);
        assert_eq!(passed, of_unit.count());
    }
    // comments name the paper, and the period of this crane
    let comment = |name: &str| &all.iter().find(|unit| unit.name == name).unwrap().comment;
    assert!(comment("PRG_Control").contains("every control period of 1 ms:"));
    assert!(comment("FB_BenchmarkController").contains("section 2.3.1 of doi:10.3390/act14020080"));
}

#[test]
fn a_changed_parameter_takes_effect_on_prepare_only() {
    let description = Description::uia_single_boom().unwrap();
    let [hydraulics, _] = blocks(&description).unwrap();
    let text = text_of(&hydraulics);
    let inputs = [("nPump", 0.0), ("uValve", 1.0), ("xCyl", 0.2), ("vCyl", 0.05), ("tStep", STEP)];
    let after = |says: bool| {
        let mut block = Instance::parse(&text);
        block.call(&inputs);
        let difference = block.value("pA") - block.value("pB");
        block.set("cylinder_piston_mm", 70.0);
        block.call_with(&inputs, &[("bPrepare", says)]);
        (block.value("fCyl"), difference)
    };
    let ((with, difference), (without, _)) = (after(true), after(false));
    // a larger piston, on both sides
    let grown =
        std::f64::consts::FRAC_PI_4 * (0.07_f64.powi(2) - description.numbers.piston.powi(2));
    assert!(grown > 1e-4, "the piston has 70 mm already");
    let wanted = difference * grown;
    assert!(((with - without) / wanted - 1.0).abs() < 1e-9, "{with} and {without} N, {wanted}");
}

/// Inputs that move a simulated crane: a reference, and a load held at another position.
const MOVED: [(&str, f64); 3] = [("xRef", 0.051), ("vRef", 0.02), ("xCyl", 0.052)];

/// Outputs of a composed block over its next steps, with a parameter of an inner block changed before step `changed`;
/// `says` gives the steps in which `bPrepare` is set.
fn shown_after(
    block: &Instance,
    (inner, parameter, value): (&str, &str, f64),
    changed: usize,
    says: impl Fn(usize) -> bool,
) -> Vec<[f64; 2]> {
    let mut block = block.clone();
    let names = MOVED;
    let mut shown = Vec::new();
    for step in 0..60 {
        if step == changed {
            block.inner(inner).set(parameter, value);
        }
        block.call_with(&names, &[("bPrepare", says(step))]);
        shown.push([block.inner("fbBoom").value("xCyl"), block.inner("fbHydraulics").value("pL")]);
    }
    shown
}

/// `bPrepare` in any step of a control period reaches every inner block.
#[test]
fn prepare_in_any_call_applies_a_changed_parameter() {
    let description = Description::uia_single_boom().unwrap();
    let name = "FB_SimulationFeedforward";
    let changes = [
        ("fbController", "controller_pressure_feedback_m3_per_spa", 1e-9),
        ("fbController", "controller_high_pass_s", 0.1),
        ("fbHydraulics", "cylinder_piston_mm", 66.0),
        ("fbBoom", "payload_mass_kg", 200.0),
    ];
    let mut begun = steering(&description, name);
    for _ in 0..400 {
        begun.call(&MOVED);
    }
    for change in changes {
        let never = shown_after(&begun, change, 0, |_| false);
        for changed in [0, 1, 7, 19] {
            let once = shown_after(&begun, change, changed, |step| step == changed);
            let always = shown_after(&begun, change, changed, |step| step >= changed);
            assert_eq!(once, always, "{change:?} at step {changed}");
            assert!(once != never, "{change:?} at step {changed}");
        }
    }

    // together with a reset, and alone in the first call
    for (resets, begins) in [(true, &begun), (false, &steering(&description, name))] {
        let mut block = begins.clone();
        let mut fresh = steering(&description, name);
        for (inner, parameter, value) in changes {
            block.inner(inner).set(parameter, value);
            fresh.inner(inner).set(parameter, value);
        }
        block.call_with(&MOVED, &[("bReset", resets), ("bPrepare", true)]);
        fresh.call(&MOVED);
        for _ in 0..40 {
            assert_eq!(block.shown(), fresh.shown());
            block.call(&MOVED);
            fresh.call(&MOVED);
        }
    }
}

/// A small unit for the interpreter.
fn few(declarations: &str, statements: &str) -> String {
    format!("FUNCTION_BLOCK FB_Few VAR {declarations} END_VAR {statements} END_FUNCTION_BLOCK")
}

/// The interpreter refuses double declarations, and values of another type than the variable's.
#[test]
fn the_evaluator_refuses_what_the_standard_does() {
    let variables = "x : LREAL; k : DINT; b : BOOL; a : ARRAY[0..1] OF LREAL; fb : FB_Inner;";
    let inner = "FUNCTION_BLOCK FB_Inner VAR_INPUT u : LREAL; END_VAR END_FUNCTION_BLOCK";
    let read = |text: &str| {
        let mut block = Library::parse([text, inner]).instance("FB_Few");
        block.run();
    };
    read(&few(variables, "x := a[1]; a[k] := fb.u; fb(u := X); B := (k = 1) OR (x < 1.0);"));
    let wrong = [
        ("x := missing;", "missing is not declared"),
        ("missing := x;", "missing is not declared"),
        ("x := b;", "types of x "),
        ("k := x;", "types of k "),
        ("a[0] := k;", "\"a\""),
        ("a := a;", "\"a\""),
        ("x := a[2];", "a has no entry 2"),
        ("k := 2; x := a[k];", "out of bounds"),
        ("k := 2; a[k] := x;", "out of bounds"),
        ("x := a[x];", "\"x\""),
        ("x := x + k;", "Add"),
        ("x := TAN(x);", "TAN"),
        ("x := SQRT(k);", "SQRT"),
        ("IF x THEN k := 1; END_IF;", "\"x\""),
        ("FOR x := 0 TO 1 DO k := 1; END_FOR;", "x does not count"),
        ("x := fb.missing;", "missing is not declared"),
        ("fb(missing := x);", "missing is not declared"),
        ("fb(u := b);", "types of u "),
        ("x(u := x);", "x is number"),
    ];
    let texts = wrong.map(|(statement, expected)| (few(variables, statement), expected));
    let twice = (few("x : LREAL; X : DINT;", ""), "X is declared twice");
    let unknown = (few("fb : FB_Missing;", ""), "no unit FB_MISSING");
    let initial = (few("x : LREAL := TRUE;", ""), "types of x ");
    for (text, expected) in texts.into_iter().chain([twice, unknown, initial]) {
        let panic = std::panic::catch_unwind(|| read(&text)).expect_err(&text);
        let message = panic.downcast_ref::<String>().unwrap();
        assert!(message.contains(expected), "{text}: {message}");
    }
}

/// Halves are rounded to even; inputs begin with zero and other arrays with NaN; a clone has its own memory.
#[test]
fn the_evaluator_computes_as_the_standard_says() {
    let text = "FUNCTION_BLOCK FB_Few VAR_INPUT u : ARRAY[0..1] OF LREAL; x : LREAL; END_VAR \
        VAR a : ARRAY[0..1] OF LREAL; k : DINT; n : DINT; s : LREAL; y : LREAL; whole : DINT; END_VAR \
        K := LREAL_TO_DINT(x); Whole := k; y := A[0]; s := U[1]; \
        FOR n := 1 TO 3 DO s := s + DINT_TO_LREAL(n) * -2.0; END_FOR; \
        IF NOT (s < x) AND (x > 1.0) THEN s := SEL(k = 2, 7.0, LIMIT(0.0, x, 1.5)) / 2.0; END_IF; \
        k := (k + 7) MOD LIMIT(1, k, 5); END_FUNCTION_BLOCK";
    let mut block = Instance::parse(text);
    let before = block.clone();
    for (x, whole, rest) in [(0.5, 0, 0), (1.5, 2, 1), (2.5, 2, 1), (-1.5, -2, 0), (3.6, 4, 3)] {
        block.set("X", x);
        block.run();
        assert_eq!((block.count("whole"), block.count("k")), (whole, rest), "{x}");
        assert!(block.value("s") == -12.0 && block.value("y").is_nan());
    }
    block.set_in_list("u", 1, 15.0);
    for (x, found) in [(1.0, 3.0), (2.0, 0.75), (2.9, 3.5), (3.0, 3.5), (3.1, 3.0)] {
        block.set("x", x);
        block.run();
        assert_eq!(block.value("s"), found, "{x}");
    }
    assert_eq!((before.value("x"), before.count("n"), block.count("n")), (0.0, 0, 3));
}

/// A function and a function block with an array, for the interpreter.
const CALLED: [&str; 2] = [
    "FUNCTION F_Twice : LREAL VAR_INPUT u : LREAL; END_VAR VAR calls : DINT; END_VAR \
     calls := calls + 1; F_Twice := u * 2.0 * DINT_TO_LREAL(calls); END_FUNCTION",
    "FUNCTION_BLOCK FB_Add VAR_INPUT u : LREAL; k : DINT; END_VAR VAR_IN_OUT into : ARRAY[0..2] OF LREAL; END_VAR \
     VAR_OUTPUT sum : LREAL; END_VAR VAR calls : DINT; END_VAR \
     calls := calls + 1; into[k] := into[k] + u; sum := into[0] + into[1] + into[2] + 100.0 * DINT_TO_LREAL(calls); END_FUNCTION_BLOCK",
];

fn calling(declarations: &str, statements: &str) -> Instance {
    let text = few(declarations, statements);
    Library::parse(CALLED.into_iter().chain([text.as_str()])).instance("FB_Few")
}

/// A function is reset in each call, a function block keeps its state; an array by reference is the caller's.
#[test]
fn the_evaluator_calls_as_the_standard_says() {
    let declared = "x : LREAL; y : LREAL; fb : FB_Add; a : ARRAY[0..2] OF LREAL; other : ARRAY[0..2] OF LREAL; k : DINT;";
    let statements = "FOR k := 0 TO 2 DO a[k] := 1.0; other[k] := 5.0; END_FOR; \
        fb(u := F_Twice(u := 3.0) + F_Twice(u := 0.5), k := 1, into := a); x := fb.sum + a[1]; \
        FOR k := 0 TO 1 DO fb(u := 1.0, k := k, into := other); END_FOR; y := fb.sum - other[0] + a[0];";
    let mut block = calling(declared, statements);
    block.run();
    assert_eq!(
        (block.value("x"), block.value("y")),
        (10.0 + 100.0 + 8.0, 17.0 + 300.0 - 6.0 + 1.0)
    );
}

#[test]
fn the_evaluator_refuses_calls_that_the_standard_does() {
    let declared = "x : LREAL; fb : FB_Add; a : ARRAY[0..2] OF LREAL; short : ARRAY[0..1] OF LREAL; END_VAR \
        VAR_INPUT given : ARRAY[0..2] OF LREAL;";
    let wrong = [
        ("fb(u := x, k := 0);", "each VAR_IN_OUT is given"),
        ("fb(u := x, into := short);", "types of short "),
        ("fb(u := x, into := given);", "given is an input"),
        ("fb(u := x, into := x);", "x is no array"),
        ("fb(u := x, into := a, sum := x);", "sum of fb is not given"),
        ("fb(u := x, into := a, calls := 1);", "calls of fb is not given"),
        ("x := F_Twice();", "each input is given"),
        ("x := F_Missing(u := x);", "F_Missing"),
        ("a[0] := F_Twice(u := TRUE);", "types of u "),
    ];
    for (statement, expected) in wrong {
        let panic = std::panic::catch_unwind(|| calling(declared, statement)).expect_err(statement);
        let message = panic.downcast_ref::<String>().unwrap();
        assert!(message.contains(expected), "{statement}: {message}");
    }
}

/// Names and numbers of a text, without its comments.
fn words(text: &str) -> Vec<String> {
    let mut code = String::new();
    let mut rest = text;
    while let Some((before, comment)) = rest.split_once("(*") {
        let (inside, after) = comment.split_once("*)").unwrap();
        assert!(!inside.contains("(*"), "a comment within a comment: {inside}");
        code += before;
        code.push(' ');
        rest = after;
    }
    code += rest;
    assert!(!code.contains("*)") && !code.contains('{') && !code.contains("//"), "{code}");
    let signs = |c: char| !(c.is_ascii_alphanumeric() || "_.#-".contains(c));
    code.split(signs).filter(|word| !word.is_empty()).map(str::to_string).collect()
}

/// Names valid in the standard, and numbers that each tool reads as an LREAL or as a DINT.
#[test]
fn plain_text_conforms_to_the_standard() {
    // of the language, and of its functions and function blocks
    let keywords = "ABS ACOS ACTION ADD AND ARRAY ASIN AT ATAN BOOL BY BYTE CAL CASE CONCAT CONFIGURATION CONSTANT COS CTD CTU \
        CTUD DATE DELETE DINT DIV DO DT DWORD ELSE ELSIF EN ENO EQ EXIT EXP EXPT FALSE FIND FOR FROM FUNCTION GE GT IF IN INSERT \
        INT INTERVAL JMP LD LE LEFT LEN LIMIT LINT LN LOG LREAL LT MAX MID MIN MOD MOVE MUL MUX NE NOT OF ON OR PLC PRIORITY \
        PROGRAM R REAL REPEAT REPLACE RESOURCE RET RETAIN RETURN RIGHT ROL ROR RS S SEL SEMA SHL SHR SIN SINGLE SINT SQRT SR ST \
        STEP STRING STRUCT SUB TAN TASK THEN TIME TO TOD TOF TON TP TRANSITION TRUE TRUNC TYPE UDINT UINT ULINT UNTIL USINT VAR \
        WHILE WITH WORD XOR";
    let keywords: Vec<&str> = keywords.split_whitespace().collect();
    let all = units(&Description::uia_single_boom().unwrap()).unwrap();
    let types = ["BOOL", "LREAL", "DINT"];
    for (k, unit) in all.iter().enumerate() {
        // a function's result has the function's name
        let variables = unit.variables.iter().filter(|v| v.section != Section::Result);
        let mut names: Vec<String> = variables.map(|v| v.name.to_uppercase()).collect();
        names.extend(
            unit.tasks.iter().flat_map(|t| [t.name.to_uppercase(), t.instance().to_uppercase()]),
        );
        names.push(unit.name.to_uppercase());
        for name in &names {
            assert!(!keywords.contains(&name.as_str()), "{name} of {}", unit.name);
            assert!(
                !name.contains("__") && !name.ends_with('_') && !name.starts_with('_'),
                "{name}"
            );
        }
        let count = names.len();
        names.sort();
        names.dedup();
        assert_eq!(count, names.len(), "a name twice in {}", unit.name);
        for variable in &unit.variables {
            let kind = variable.kind.rsplit(" OF ").next().unwrap();
            let known = all[..k].iter().any(|before| before.name == kind);
            assert!(types.contains(&kind) || known, "{kind} of {} is not known", unit.name);
        }
        let text = unit.text();
        assert!(!text.contains("GVL_"), "{text}");
        for word in words(&text).iter().filter(|w| w.starts_with(|c: char| c.is_ascii_digit())) {
            let is_integer = word.chars().all(|c| c.is_ascii_digit());
            let is_range = word.split("..").all(|n| n.parse::<u32>().is_ok());
            let is_real = word.parse::<f64>().is_ok()
                && word.split_once('.').is_some_and(|(_, rest)| {
                    rest.starts_with(|c: char| c.is_ascii_digit()) && rest.contains('E')
                });
            assert!(is_integer || is_range || is_real, "{word} in {}", unit.name);
        }
    }
}

/// Programs declare the global variables that they use, with the types of the configuration, and each has a task.
#[test]
fn the_configuration_declares_globals_and_schedules_programs() {
    let description = Description::uia_single_boom().unwrap();
    let all = units(&description).unwrap();
    let configuration = all.last().unwrap();
    assert_eq!(configuration.kind, Kind::Globals);
    let text = configuration.text();
    for expected in [
        "CONFIGURATION Hydroboom\nVAR_GLOBAL\n",
        "END_VAR\n\nRESOURCE Controller ON PLC\n",
        "    TASK ControlTask(INTERVAL := T#1ms, PRIORITY := 1);\n",
        "    TASK TestBenchTask(INTERVAL := T#10ms, PRIORITY := 2);\n",
        "    PROGRAM Control WITH ControlTask : PRG_Control;\n",
        "    PROGRAM TestBench WITH TestBenchTask : PRG_TestBench;\nEND_RESOURCE\nEND_CONFIGURATION\n",
    ] {
        assert!(text.contains(expected), "{expected} is not in\n{text}");
    }
    let project = plcopen::project(&all);
    let document = roxmltree::Document::parse(&project).unwrap();
    for unit in all.iter().filter(|u| u.kind == Kind::Program) {
        assert!(configuration.tasks.iter().any(|task| task.program == unit.name), "{}", unit.name);
        let externals: Vec<_> =
            unit.variables.iter().filter(|v| v.section == Section::External).collect();
        for external in &externals {
            let global = configuration.variables.iter().find(|v| v.name == external.name).unwrap();
            assert_eq!((global.section, &global.kind), (Section::Global, &external.kind));
            let (name, qualified) = (&external.name, format!("GVL_Hydroboom.{}", external.name));
            assert!(unit.statements(Form::TwinCat).contains(&qualified), "{qualified}");
            assert!(words(&unit.statements(Form::Standard)).contains(name), "{name}");
        }
        assert!(!unit.declaration(Form::TwinCat).contains("EXTERNAL"));
        let pou = document.descendants().find(|n| n.attribute("name") == Some(&unit.name)).unwrap();
        let listed = pou.descendants().find(|n| n.tag_name().name() == "externalVars");
        let count = listed.map_or(0, |all| all.children().filter(|n| n.is_element()).count());
        assert_eq!(count, externals.len());
        let instance = document.descendants().find(|n| n.attribute("typeName") == Some(&unit.name));
        let task = instance.and_then(|n| n.parent()).unwrap();
        assert!(task.attribute("interval").unwrap().starts_with("T#"));
    }
    // only a list of variables
    let list = twincat::file(configuration).1;
    assert!(list.contains("VAR_GLOBAL") && !list.contains("CONFIGURATION"), "{list}");
}

/// The program in a PLC gives the results of its block.
/// The comment of the control task names every controller that may be called there.
#[test]
fn the_control_task_names_every_alternative_controller() {
    let units = units(&Description::uia_single_boom().unwrap()).unwrap();
    let control = units.iter().find(|unit| unit.name == "PRG_Control").unwrap();
    let has = |unit: &&Unit, name: &str| unit.variables.iter().any(|v| v.name == name);
    let leads = |unit: &&Unit| has(unit, "bHoldingValve") && has(unit, "nRef") && has(unit, "xRef");
    let others: Vec<&Unit> =
        units.iter().filter(|unit| unit.kind == Kind::FunctionBlock).filter(leads).collect();
    assert!(others.len() >= 3, "{}", others.len());
    for other in others.iter().filter(|unit| unit.name != "FB_SimulationFeedforwardController") {
        let text = control.text();
        assert!(text.contains(&other.name), "{} is not named: {}", other.name, control.comment);
    }
}

#[test]
fn the_program_reads_and_writes_global_variables() {
    let description = Description::uia_single_boom().unwrap();
    let mut control = steering(&description, "PRG_Control");
    let mut block = Instance::parse(&text_of(&controller(&description).unwrap()));
    let measured = [
        ("xRef", 0.2),
        ("xCyl", 0.2),
        ("pPA", 3e5),
        ("pA", 65e5),
        ("pB", 5e5),
        ("pPB", 3e5),
        ("uValveRead", -1.0),
    ];
    for period in 0..1000 {
        let noise = f64::from(period % 2) * 1e-6;
        let now = measured.map(|(name, value)| (name, value * (1.0 + noise)));
        let asked = [("bEnable", true), ("bStart", period > 100)];
        // an ideal drive
        let turns = control.value("nRef");
        control.set("nRead", turns);
        block.set("nRead", turns);
        now.iter().for_each(|(name, value)| control.set(name, *value));
        asked.iter().for_each(|(name, value)| control.truth(name, *value));
        control.run();
        block.call_with(&now, &asked);
        assert_eq!(control.count("nStatus"), block.count("nStatus"));
        assert_eq!(control.value("nRef"), block.value("nRef"));
        assert!(!control.holds("bHoldingValve"));
    }
    assert_eq!(control.count("nStatus") as f64, frame_phase::RELEASING);
    assert!(control.value("nRef") > 0.1, "{}", control.value("nRef"));
}

#[test]
fn lines_are_short_and_the_text_is_reproducible() {
    let description = Description::uia_single_boom().unwrap();
    let made = || -> Vec<String> {
        units(&description)
            .unwrap()
            .iter()
            .map(hydroboom_export::structured_text::Unit::text)
            .collect()
    };
    let first = made();
    assert_eq!(first, made());
    for line in first.iter().flat_map(|text| text.lines()) {
        assert!(line.len() <= 120 && line.is_ascii(), "{line}");
        assert!(!line.contains("//") && !line.contains("__"), "{line}");
    }
}
