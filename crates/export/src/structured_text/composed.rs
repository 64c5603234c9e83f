//! Units composed of the recorded ones: the simulation feedforward, and two tasks as in the paper.

use super::GLOBALS;
use super::unit::{Declared, Kind, Section, Task, Unit};

fn input(name: &str, initial: &str, comment: &str) -> Declared {
    Declared::new(Section::Input, name, "LREAL", Some(initial), comment)
}

fn output(name: &str, comment: &str) -> Declared {
    Declared::new(Section::Output, name, "LREAL", None, comment)
}

fn local(name: &str, kind: &str, comment: &str) -> Declared {
    Declared::new(Section::Local, name, kind, None, comment)
}

fn flag(name: &str, comment: &str) -> Declared {
    Declared::new(Section::Input, name, "BOOL", None, comment)
}

/// Inputs and outputs of a controller's block, without those of a simulated crane.
fn frame(controller: &Unit) -> [Vec<Declared>; 2] {
    let own = ["bReset", "bPrepare", "xSim", "vSim", "pLSim", "nMotor"];
    let of = |section: Section| -> Vec<Declared> {
        let all = controller.variables.iter();
        all.filter(|v| v.section == section && !own.contains(&v.name.as_str())).cloned().collect()
    };
    [of(Section::Input), of(Section::Output)]
}

/// A call's arguments, each the variable of the same name with a prefix.
fn arguments(inputs: &[Declared], before: &str) -> String {
    let each: Vec<String> = inputs.iter().map(|v| format!("{0} := {before}{0}", v.name)).collect();
    each.chunks(4).map(|some| some.join(", ")).collect::<Vec<_>>().join(",\n        ")
}

/// The benchmark controller with simulation feedforward and its simulated crane (section 4, figure 15). A control
/// period has `steps` simulation steps; each call is one step of `step` \[s\].
pub(super) fn simulation_feedforward(controller: &Unit, steps: u32, step: &str) -> Unit {
    let [inputs, outputs] = frame(controller);
    let given = arguments(&inputs, "");
    let shows: String =
        outputs.iter().map(|v| format!("{0} := fbController.{0};\n", v.name)).collect();
    let count = steps.to_string();
    let mut variables = vec![
        flag("bReset", "Restart: the simulated crane at rest at its start"),
        flag("bPrepare", "A parameter of one of the blocks was changed; counts in any call"),
    ];
    variables.extend(inputs);
    variables.extend([
        input("tStep", step, "Simulation step [s]"),
        Declared::new(
            Section::Input,
            "nPerPeriod",
            "DINT",
            Some(&count),
            "Simulation steps in a control period",
        ),
    ]);
    variables.extend(outputs);
    variables.extend([
        output("nSim", "Motor speed of the simulated crane [rev/s]"),
        output("xSim", "Its piston position [m]"),
        output("vSim", "Its piston velocity [m/s]"),
        output("pLSim", "Its load pressure [Pa]"),
        local("fbController", "FB_SimulationFeedforwardController", ""),
        local("fbHydraulics", "FB_HydraulicModel", ""),
        local("fbBoom", "FB_FlexibleBoom", ""),
        local("iStep", "DINT", ""),
        local("bBegins", "BOOL", ""),
        local("bChanged", "BOOL", "A parameter was changed since the controllers acted"),
        local("bReady", "BOOL", ""),
    ]);
    let body = format!(
        "\
bBegins := bReset OR NOT bReady;
bChanged := bChanged OR bPrepare;
IF bBegins THEN
    (* a step of no length shows where the piston rests *)
    fbBoom(bReset := TRUE, bPrepare := TRUE, fCyl := 0.0E0, tStep := 0.0E0);
    fbHydraulics(bReset := TRUE, bPrepare := TRUE, nPump := 0.0E0, uValve := 1.0E0, xCyl := fbBoom.xCyl,
        vCyl := fbBoom.vCyl, tStep := 0.0E0);
    iStep := 0;
    bReady := TRUE;
END_IF;
IF iStep = 0 THEN
    fbController(bReset := bBegins, bPrepare := bChanged, xSim := fbBoom.xCyl, vSim := fbBoom.vCyl,
        pLSim := fbHydraulics.pL, {given});
    bChanged := FALSE;
END_IF;
(* values of the step's beginning go between the blocks (doi:10.3390/act14020080, section 5.1) *)
fbHydraulics(bReset := FALSE, bPrepare := bPrepare, nPump := fbController.nMotor, uValve := 1.0E0,
    xCyl := fbBoom.xCyl, vCyl := fbBoom.vCyl, tStep := tStep);
fbBoom(bReset := FALSE, bPrepare := bPrepare, fCyl := fbHydraulics.fCyl, tStep := tStep);
iStep := (iStep + 1) MOD nPerPeriod;
{shows}nSim := fbController.nMotor;
xSim := fbBoom.xCyl;
vSim := fbBoom.vCyl;
pLSim := fbHydraulics.pL;
"
    );
    Unit {
        kind: Kind::FunctionBlock,
        name: "FB_SimulationFeedforward".into(),
        comment: "Benchmark controller with the motor speed of a simulated crane as feedforward (section 4, figure 15 \
            of doi:10.3390/act14020080); holds and releases the load. One call is one simulation step; the controller \
            acts at each first of nPerPeriod."
            .into(),
        variables,
        body,
        tasks: Vec::new(),
    }
}

const RESTART: &str = "bRestart";
const PREPARE: &str = "bPrepareAll";

/// Signals between machine and controller, and the tasks, with the control period \[s\].
pub(super) fn globals(controller: &Unit, control: f64) -> Unit {
    /// Period of the test bench's task \[s\]: it finishes in some seconds and leaves time to other tasks.
    const TEST_BENCH: f64 = 10e-3;
    let [inputs, outputs] = frame(controller);
    let mut variables = vec![
        Declared::new(
            Section::Global,
            RESTART,
            "BOOL",
            None,
            "Set for one call: everything begins anew, the load held",
        ),
        Declared::new(
            Section::Global,
            PREPARE,
            "BOOL",
            None,
            "Set for one call: a gain was changed",
        ),
    ];
    variables.extend(
        inputs.into_iter().chain(outputs).map(|v| Declared { section: Section::Global, ..v }),
    );
    let task = |name: &str, interval: f64, priority: u32| Task {
        name: format!("{name}Task"),
        interval,
        priority,
        program: format!("PRG_{name}"),
    };
    Unit {
        kind: Kind::Globals,
        name: GLOBALS.into(),
        comment: "What goes between the machine and the controller. Inputs are written by the machine's program, outputs by PRG_Control.".into(),
        variables,
        body: String::new(),
        tasks: vec![task("Control", control, 1), task("TestBench", TEST_BENCH, 2)],
    }
}

/// The controller's task, called every control period \[s\]: the benchmark.
pub(super) fn control_task(controller: &Unit, control: f64) -> Unit {
    // milliseconds without the rounding noise of the unit
    let period = (control * 1e9).round() / 1e6;
    let [inputs, outputs] = frame(controller);
    let global = |v: &Declared| Declared {
        section: Section::External,
        initial: None,
        comment: String::new(),
        ..v.clone()
    };
    let mut variables: Vec<Declared> = [RESTART, PREPARE]
        .map(|name| Declared::new(Section::External, name, "BOOL", None, ""))
        .into();
    variables.extend(inputs.iter().chain(&outputs).map(global));
    variables.push(local("fbController", "FB_BenchmarkController", ""));
    let given = arguments(&inputs, &format!("{GLOBALS}."));
    let shown: String =
        outputs.iter().map(|v| format!("{GLOBALS}.{0} := fbController.{0};\n", v.name)).collect();
    Unit {
        kind: Kind::Program,
        name: "PRG_Control".into(),
        comment: format!(
            "To be called every control period of {period} ms: the benchmark controller, which holds and releases the \
             load. FB_SimulationFeedforward replaces it for simulation feedforward: the same inputs and outputs, \
             called every simulation step. FB_ScheduledLqrController replaces it with its preview arrays filled every \
             period, and has additional outputs: docs/how-to/export-twincat.md has such a program."
        ),
        variables,
        body: format!(
            "fbController(bReset := {GLOBALS}.{RESTART}, bPrepare := {GLOBALS}.{PREPARE},\n        {given});\n{shown}"
        ),
        tasks: Vec::new(),
    }
}
