//! FMUs run by an independent master, FMPy.
//!
//! `HYDROBOOM_FMPY` names its Python, as `./test` does; otherwise these tests print that they are skipped.

use hydroboom_control::supervision::frame::{FrameInput, FrameOutput};
use hydroboom_description::Description;
use hydroboom_description::schema::Numbers;
use hydroboom_export::closed_loop::{
    Bad, Case, Moment, Recorder, RustBenchmark, RustSimulationFeedforward, Target, cases, run,
};
use hydroboom_export::fmi::{System, Unit, Version, archive, binary, twincat_settings, unit};
use hydroboom_export::{
    controller, crane_model, scheduled_lqr_controller, simulation_feedforward, slopes,
};
use hydroboom_math::Dual;
use hydroboom_model::stepping::published;
use hydroboom_model::{Crane, Input};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Mutex, PoisonError};

fn python() -> Option<String> {
    let found = std::env::var("HYDROBOOM_FMPY").ok().filter(|path| Path::new(path).exists());
    if found.is_none() {
        eprintln!("skipped: HYDROBOOM_FMPY names no Python with FMPy");
    }
    found
}

fn folder() -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("fmi");
    std::fs::create_dir_all(&path).unwrap();
    path
}

const BOTH: [Version; 2] = [Version::Two, Version::Three];

fn model(crane: &Description, version: Version) -> Unit {
    let block = crane_model(crane).unwrap();
    unit(&block, Some(&slopes(crane, &block).unwrap()), crane, version).unwrap()
}

/// All controllers, by the names of their FMUs.
const CONTROLLERS: [&str; 2] = ["controller", "simulation-feedforward"];

fn steering(crane: &Description, what: &str, version: Version) -> Unit {
    let block = match what {
        "simulation-feedforward" => simulation_feedforward(crane).unwrap(),
        "scheduled-lqr" => scheduled_lqr_controller(crane).unwrap(),
        _ => controller(crane).unwrap(),
    };
    unit(&block, None, crane, version).unwrap()
}

/// The model or a controller of the paper's crane.
fn exported(what: &str, version: Version) -> Unit {
    let crane = Description::uia_single_boom().unwrap();
    match what {
        "model" => model(&crane, version),
        _ => steering(&crane, what, version),
    }
}

/// Path of an FMU, compiled once for all tests.
fn written(what: &str, version: Version) -> String {
    static WRITTEN: Mutex<BTreeMap<String, String>> = Mutex::new(BTreeMap::new());
    let name = format!("{what}-{version:?}");
    let mut written = WRITTEN.lock().unwrap_or_else(PoisonError::into_inner);
    let of_it = written.entry(name).or_insert_with_key(|name| {
        let unit = exported(what, version);
        let library = binary(&unit, System::Linux, &folder().join(name)).unwrap().unwrap();
        let path = folder().join(format!("{name}.fmu"));
        std::fs::write(&path, archive(&unit, &[(System::Linux, library)]).unwrap()).unwrap();
        path.to_str().unwrap().to_string()
    });
    of_it.clone()
}

/// Output of FMPy.
fn fmpy(python: &str, arguments: &[&str]) -> String {
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fmi_check.py");
    let output = Command::new(python).arg(script).args(arguments).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn fmus_are_valid() {
    let Some(python) = python() else { return };
    for version in BOTH {
        for what in ["model", "scheduled-lqr"].into_iter().chain(CONTROLLERS) {
            let path = folder().join(format!("{what}-{version:?}-sources.fmu"));
            std::fs::write(&path, archive(&exported(what, version), &[]).unwrap()).unwrap();
            let path = path.to_str().unwrap();
            assert_eq!(fmpy(&python, &["validated", path]), "", "{what} {version:?}");
        }
    }
}

/// A copy of the FMU with a binary compiled by a plain compiler from its packed source.
fn from_packed_source(path: &str, version: Version) -> String {
    let mut packed = zip::ZipArchive::new(std::fs::File::open(path).unwrap()).unwrap();
    let sources = folder().join(format!("packed-{version:?}"));
    let _ = std::fs::remove_dir_all(&sources);
    packed.extract(&sources).unwrap();
    let library = sources.join("again.so");
    let output = Command::new("gcc")
        .args(["-shared", "-fPIC", "-O1", "-o"])
        .arg(&library)
        .args(["hydroboom.c", "fmu.c"].map(|name| sources.join("sources").join(name)))
        .arg("-lm")
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let crane = Description::uia_single_boom().unwrap();
    let whole = model(&crane, version);
    let bytes = std::fs::read(&library).unwrap();
    let again = folder().join(format!("again-{version:?}.fmu"));
    std::fs::write(&again, archive(&whole, &[(System::Linux, bytes)]).unwrap()).unwrap();
    again.to_str().unwrap().to_string()
}

#[test]
fn an_fmu_and_its_source_give_the_results_of_rust() {
    let Some(python) = python() else { return };
    let description = Description::uia_single_boom().unwrap();
    let crane = description.crane::<3>().unwrap();
    let n = &description.numbers;
    let mut state = crane.at_rest(&description.start_over(n, n.motion_start)).unwrap();
    let mut inputs = String::from("pump_speed,holding_valve\n");
    let mut wanted = Vec::new();
    for k in 0..1000_u32 {
        let holding_valve = if (600..700).contains(&k) { 0.0 } else { 1.0 };
        let input = Input { pump_speed: 20.0 * (0.01 * f64::from(k)).sin(), holding_valve };
        writeln!(inputs, "{:?},{holding_valve:?}", input.pump_speed).unwrap();
        for _ in 0..20 {
            published(&crane, &mut state, &input, n.simulation_period);
        }
        let seen = crane.outputs(&state);
        wanted.push([seen.stroke, seen.pressure_a, seen.pressure_pump_a, seen.tip_y]);
    }
    let table = folder().join("inputs.csv");
    std::fs::write(&table, inputs).unwrap();
    let outputs = "stroke+pressure_a+pressure_pump_a+tip_y";
    let paths = BOTH.map(|version| written("model", version));
    let again = [0, 1].map(|k| from_packed_source(&paths[k], BOTH[k]));
    for path in paths.iter().chain(&again) {
        let printed = fmpy(&python, &["simulated", path, table.to_str().unwrap(), outputs]);
        let found: Vec<Vec<f64>> =
            printed.lines().map(|l| l.split(',').map(|v| v.parse().unwrap()).collect()).collect();
        assert_eq!(found.len(), wanted.len());
        for (k, (found, wanted)) in found.iter().zip(&wanted).enumerate() {
            assert_eq!(found.as_slice(), wanted, "{path} after {k} ms");
        }
    }
}

/// A release, a motion and wrong inputs, recorded in closed loop: the FMUs of both framed controllers give Rust's
/// outputs.
#[test]
fn fmus_of_framed_controllers_give_the_outputs_of_rust() {
    let Some(python) = python() else { return };
    let model = Description::uia_single_boom().unwrap();
    let machine = Description::uia_virtual().unwrap();
    // in motion, and a finite number: a table cannot hold NaN
    let wrong = |c: &&Case| {
        c.disturbed.is_some_and(|d| {
            d.periods == 10
                && d.bad == Bad::Thousandfold
                && d.moment == Moment::Motion
                && FrameInput::NAMES[d.input] == "pressure_a"
        })
    };
    let case = cases(&model).iter().find(wrong).unwrap().clone();
    let targets: [(&str, Box<dyn Target>); 2] = [
        ("controller", Box::new(RustBenchmark::new(&model).unwrap())),
        ("simulation-feedforward", Box::new(RustSimulationFeedforward::new(&model).unwrap())),
    ];
    for (what, inner) in targets {
        let mut recorder = Recorder::new(inner);
        run(&model, &machine, &case, &mut recorder).unwrap();
        let mut inputs = FrameInput::NAMES.join(",") + "\n";
        for (given, _) in &recorder.rows {
            let cells = given.to_array().map(|v| format!("{v:?}"));
            writeln!(inputs, "{}", cells.join(",")).unwrap();
        }
        let table = folder().join(format!("framed-{what}.csv"));
        std::fs::write(&table, inputs).unwrap();
        for version in BOTH {
            let path = written(what, version);
            let outputs = FrameOutput::NAMES.join("+");
            let printed = fmpy(&python, &["simulated", &path, table.to_str().unwrap(), &outputs]);
            let found: Vec<Vec<f64>> = printed
                .lines()
                .map(|l| l.split(',').map(|v| v.parse().unwrap()).collect())
                .collect();
            assert_eq!(found.len(), recorder.rows.len());
            for (k, (found, (_, wanted))) in found.iter().zip(&recorder.rows).enumerate() {
                assert_eq!(found.as_slice(), wanted.to_array(), "{what} {version:?} in period {k}");
            }
        }
    }
}

#[test]
fn states_are_saved_and_instances_are_independent() {
    let Some(python) = python() else { return };
    for version in BOTH {
        assert_eq!(fmpy(&python, &["kept", &written("model", version)]), "", "{version:?}");
    }
}

/// Each logged line contains one of these texts, in their order, and there are no other lines.
fn lines_contain(printed: &str, wanted: &[&str]) {
    let lines: Vec<&str> = printed.lines().collect();
    for (line, wanted) in lines.iter().zip(wanted) {
        assert!(line.contains(wanted), "{line:?} says nothing of {wanted:?} in {lines:#?}");
    }
    assert_eq!(lines.len(), wanted.len(), "{lines:#?}");
}

#[test]
fn failed_calls_return_an_error_and_never_ok() {
    let Some(python) = python() else { return };
    for version in BOTH {
        let printed = fmpy(&python, &["diverged", &written("model", version)]);
        let mut wanted = vec!["diverged"];
        wanted.extend(["after a step that diverged"; 2]);
        wanted.extend(["no multiple"; 5]);
        wanted.extend(["only parameters"; 2]);
        lines_contain(&printed, &wanted);
    }
}

#[test]
fn calls_out_of_order_are_refused_and_those_in_order_go_on() {
    let Some(python) = python() else { return };
    for version in BOTH {
        let printed = fmpy(&python, &["disordered", &written("model", version)]);
        let mut wanted = vec!["before initialization"; 4];
        wanted.extend(["in initialization mode"; 3]);
        wanted.extend((version == Version::Two).then_some("in initialization mode"));
        wanted.extend(["between steps"; 2]);
        wanted.push("state_pressure_a can be set before and in initialization mode only");
        wanted.extend(["not the end of the last step"; 2]);
        wanted.extend(["after termination"; 3]);
        wanted.extend(["before initialization", "beyond the stop time"]);
        lines_contain(&printed, &wanted);
    }
}

#[test]
fn values_that_no_crane_can_have_are_refused() {
    let Some(python) = python() else { return };
    for version in BOTH {
        let printed = fmpy(&python, &["impossible", &written("model", version)]);
        let no_number = "payload_mass_kg cannot be set to a value that is no number";
        lines_contain(
            &printed,
            &[
                "cylinder_piston_mm = 0 is outside of its range, 5 to 1000",
                "payload_mass_kg = -1 is outside of its range, 0 to 1000000",
                no_number,
                no_number,
                no_number,
                "step = 6e-05 is outside of its range, 1e-07 to 5.2",
                "step = 0 is outside",
                "holding_valve = 1.5 is outside of its range, 0 to 1",
                "pump_speed = 1e+09 is outside",
                "state_pressure_a = 200000000 is outside",
                "state_angle_1 = 7 is outside",
                "cylinder_piston_mm = 0 is outside",
                "the rod is not thinner than the piston",
                "the cylinder cannot reach",
                "the accumulator holds no oil",
                "motion_start_mm lies beyond the stroke",
                "the load is too heavy",
                "the rod is not thinner than the piston",
            ],
        );
    }
}

#[test]
fn a_changed_crane_starts_at_rest_unless_the_user_gives_a_state() {
    let Some(python) = python() else { return };
    let description = Description::uia_single_boom().unwrap();
    let names = "payload_mass_kg+motion_start_mm";
    let outputs = "stroke+pressure_a+pressure_pump_a+pressure_b+tip_y+state_angle_1+state_angle_3";
    for (values, payload, start_mm) in
        [("500+100", 500.0, 100.0), ("0+250", 0.0, 250.0), ("307+480", 307.0, 480.0)]
    {
        let mut n = description.numbers;
        n.payload = payload;
        n.motion_start = start_mm * 1e-3;
        let crane: Crane<f64, 3> = description.crane_over(&n).unwrap();
        let state = crane.at_rest(&description.start_over(&n, n.motion_start)).unwrap();
        let seen = crane.outputs(&state);
        let wanted = [
            seen.stroke,
            seen.pressure_a,
            seen.pressure_pump_a,
            seen.pressure_b,
            seen.tip_y,
            state.boom.angle[0],
            state.boom.angle[2],
        ];
        for version in BOTH {
            let path = written("model", version);
            let printed = fmpy(&python, &["balanced", &path, names, values, outputs]);
            let lines: Vec<&str> = printed.lines().collect();
            assert_eq!(lines.len(), 4, "{lines:?}");
            for pair in lines.chunks(2) {
                let found = pair[0].split(',').map(|v| v.parse::<f64>().unwrap());
                for (found, wanted) in found.zip(wanted) {
                    let close = (found - wanted).abs() <= 1e-10 * wanted.abs();
                    assert!(close, "{values}: {found} for {wanted}");
                }
                // in equilibrium: 0.05 bar, where the crane file's state would oscillate by 70 bar
                let swing: f64 = pair[1].parse().unwrap();
                assert!(swing < 0.05e5, "{values}: p_A swings by {swing} Pa");
            }
        }
    }
    for version in BOTH {
        assert_eq!(fmpy(&python, &["own_state", &written("model", version)]), "");
    }
}

#[test]
fn steps_at_large_times_are_those_at_small_ones() {
    let Some(python) = python() else { return };
    for version in BOTH {
        let printed = fmpy(&python, &["late", &written("model", version)]);
        // rounding remainders are summed: the second such step is refused
        lines_contain(&printed, &["no multiple", "1"]);
    }
}

/// Every variable has a nominal value; settable ones start within their range; every unit that base units can express
/// is defined.
#[test]
fn variables_have_ranges_and_their_units_are_defined() {
    let crane = Description::uia_single_boom().unwrap();
    for version in BOTH {
        let controllers = CONTROLLERS.map(|what| steering(&crane, what, version));
        for unit in [model(&crane, version)].into_iter().chain(controllers) {
            let text = &unit.files[0].1;
            let description = roxmltree::Document::parse(text).unwrap();
            let number = |n: &roxmltree::Node<'_, '_>, name: &str| -> Option<f64> {
                n.attribute(name).map(|text| text.parse().unwrap())
            };
            let (tag, named) = match version {
                Version::Two => ("Real", "ScalarVariable"),
                Version::Three => ("Float64", "Float64"),
            };
            let mut bounded = 0;
            for n in description.descendants().filter(|n| n.has_tag_name(tag)) {
                let variable = n.ancestors().find(|n| n.has_tag_name(named)).unwrap();
                if variable.attribute("causality") == Some("independent") {
                    continue;
                }
                assert!(number(&n, "nominal").unwrap() > 0.0, "{variable:?}");
                let (low, high) = (number(&n, "min"), number(&n, "max"));
                if let (Some(low), Some(high), Some(start)) = (low, high, number(&n, "start")) {
                    assert!(low <= start && start <= high && low < high, "{variable:?}");
                    bounded += 1;
                }
                if matches!(variable.attribute("causality"), Some("parameter" | "input")) {
                    assert!(low.is_some() && high.is_some(), "{variable:?}");
                }
            }
            assert!(bounded > 3, "{bounded}");
            for n in description.descendants().filter(|n| n.has_tag_name("Unit")) {
                let is_defined = n.children().any(|n| n.has_tag_name("BaseUnit"));
                let is_root = n.attribute("name").unwrap().contains("^0.5");
                assert_eq!(is_defined, !is_root, "{n:?}");
            }
            let steps = description.descendants().find(|n| n.has_tag_name("CoSimulation")).unwrap();
            let varies = steps.attribute("canHandleVariableCommunicationStepSize");
            assert_eq!(varies, Some(if version == Version::Two { "false" } else { "true" }));
            let n = &crane.numbers;
            let is_model = unit.identifier.ends_with("hydroboom_model");
            let own = if is_model { n.simulation_period } else { n.control_period };
            let fixed = (version == Version::Three).then_some(own);
            assert_eq!(number(&steps, "fixedInternalStepSize"), fixed);
        }
    }
}

#[test]
fn a_crane_file_whose_step_is_unstable_is_not_exported() {
    let refused = |overrides: &[&str], limit: &str| {
        let mut crane = Description::uia_single_boom().unwrap();
        overrides.iter().for_each(|set| crane.set(set).unwrap());
        let message = crane_model(&crane).unwrap_err().to_string();
        assert!(
            message.contains("simulation_period_us = ") && message.contains(limit),
            "{message}"
        );
        let message = simulation_feedforward(&crane).unwrap_err().to_string();
        assert!(message.contains(limit), "{message}");
    };
    refused(&["controller.simulation_period_us=1000"], "limit of friction at rest");
    // bristles at the motor's largest speed
    let stiff = ["friction.law=lugre", "friction.bristle_stiffness_n_per_mm=3e5"];
    refused(&stiff, "2 g/(sigma_0 |v|)");
    // seals with realistic stiffness are exported
    let mut crane = Description::uia_single_boom().unwrap();
    crane.set("friction.law=lugre").unwrap();
    crane_model(&crane).unwrap();
}

/// The result is compared with Rust above, where both variants must give the same bits.
#[test]
fn the_binary_for_linux_has_both_ways_to_multiply_and_add() {
    let crane = Description::uia_single_boom().unwrap();
    let place = folder().join("dispatched");
    let unit = model(&crane, Version::Two);
    binary(&unit, System::Linux, &place).unwrap().unwrap();
    let printed = |program: &str, arguments: &[&str]| {
        let output = Command::new(program).current_dir(&place).args(arguments).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    };
    let of = |object: &str| printed("objdump", &["-d", object]).matches("vfmadd").count();
    assert_eq!((of("plain.o"), of("functions.o")), (0, 0));
    assert!(of("fused.o") > 100);
    // only the standard's functions are exported symbols
    let seen = printed("nm", &["-D", "--defined-only", "fmu.so"]);
    assert!(seen.lines().all(|line| line.contains(" fmi2")), "{seen}");
}

#[test]
fn a_cross_compiler_for_windows_takes_the_source() {
    let crane = Description::uia_single_boom().unwrap();
    for version in BOTH {
        let place = folder().join(format!("windows-{version:?}"));
        let controllers = CONTROLLERS.map(|what| steering(&crane, what, version));
        for unit in [model(&crane, version)].into_iter().chain(controllers) {
            match binary(&unit, System::Windows, &place).unwrap() {
                // first bytes of every Windows binary
                Some(library) => assert_eq!(&library[..2], b"MZ"),
                None => eprintln!("skipped: x86_64-w64-mingw32-gcc is not on the PATH"),
            }
        }
    }
}

/// TwinCAT finds the settings of an FMU by the tool that made it.
#[test]
fn settings_for_twincat_name_the_tool_that_the_fmu_names() {
    let crane = Description::uia_single_boom().unwrap();
    let settings = twincat_settings();
    let settings = roxmltree::Document::parse(&settings).unwrap();
    let name = settings.descendants().find(|n| n.has_tag_name("ToolName")).unwrap();
    for version in BOTH {
        let unit = model(&crane, version);
        let description = roxmltree::Document::parse(&unit.files[0].1).unwrap();
        assert_eq!(description.root_element().attribute("generationTool"), name.text());
    }
}

#[test]
fn the_same_crane_gives_the_same_archive() {
    let crane = Description::uia_single_boom().unwrap();
    let made = || archive(&model(&crane, Version::Three), &[]).unwrap();
    assert!(made() == made());
}

#[test]
fn directional_derivatives_are_the_slopes_of_the_model() {
    let Some(python) = python() else { return };
    type D = Dual<f64, 3>;
    let description = Description::uia_single_boom().unwrap();
    let n = &description.numbers;
    let crane = description.crane::<3>().unwrap();
    let mut state = crane.at_rest(&description.start_over(n, n.motion_start)).unwrap();
    let input = Input { pump_speed: 8.0, holding_valve: 1.0 };
    for _ in 0..4000 {
        published(&crane, &mut state, &input, n.simulation_period);
    }
    // direction along the pump speed, the payload and a pressure
    let mut numbers = Numbers::from_array(n.to_array().map(D::constant));
    numbers.payload.slope[1] = 1.0;
    let over: Crane<D, 3> = description.crane_over(&numbers).unwrap();
    let mut state = state.map(D::constant);
    state.circuit.nodes.pump_a.slope[2] = 1.0;
    let mut input = input.map(D::constant);
    input.pump_speed.slope[0] = 1.0;
    let (rates, seen) = (over.derivative(&state, &input), over.outputs(&state));
    let wanted = [
        seen.stroke,
        seen.pressure_pump_a,
        rates.circuit.nodes.pump_a,
        rates.angular_acceleration[0],
        rates.circuit.gas_volume,
    ];

    let unknown =
        "stroke+pressure_pump_a+der_pressure_pump_a+der_angular_velocity_1+der_gas_volume";
    let known = "pump_speed+payload_mass_kg+state_pressure_pump_a";
    for version in BOTH {
        let printed = fmpy(&python, &["sloped", &written("model", version), unknown, known]);
        let mut lines = printed.lines();
        let mut row = || -> Vec<f64> {
            lines.next().unwrap().split(',').map(|v| v.parse().unwrap()).collect()
        };
        assert_eq!(row(), wanted.map(|d| d.value), "{version:?}");
        for direction in 0..3 {
            for (found, wanted) in row().into_iter().zip(wanted) {
                let wanted = wanted.slope[direction];
                let close = (found - wanted).abs() <= 1e-12 * wanted.abs();
                assert!(close, "{version:?} along {direction}: {found} for {wanted}");
            }
        }
        let errors: Vec<&str> = lines.collect();
        assert!(errors.len() == 2 && errors.iter().all(|e| e.contains("slopes are along")));
    }
}
