//! Units that are put together from the recorded ones: the simulation that steers, and two tasks as the paper divides them.

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

/// A function block that steers with a simulated crane: what is its own.
struct Steering {
    name: &'static str,
    comment: &'static str,
    inputs: Vec<Declared>,
    outputs: Vec<Declared>,
    blocks: Vec<Declared>,
    /// Done as it begins, and at each first step of a control period.
    begins: &'static str,
    acts: &'static str,
    /// The block that has the simulated crane's motor speed.
    motor: &'static str,
    shows: &'static str,
}

impl Steering {
    /// The function block: `steps` simulation steps make a control period; each call is one step of `step` \[s\].
    fn unit(self, steps: u32, step: &str) -> Unit {
        let count = steps.to_string();
        let Self { name, comment, inputs, outputs, blocks, begins, acts, motor, shows } = self;
        let mut variables = vec![
            flag("bReset", "Begin again: the simulated crane at rest at its start"),
            flag("bPrepare", "A parameter of one of the blocks was changed; counts in any call"),
            input("xRef", "0.0E0", "Piston position that is wanted [m]"),
            input("vRef", "0.0E0", "Piston velocity that is wanted [m/s]"),
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
            output("xSim", "Its piston position [m]"),
            output("vSim", "Its piston velocity [m/s]"),
            output("pLSim", "Its load pressure [Pa]"),
        ]);
        variables.extend(blocks);
        variables.extend([
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
{begins}    iStep := 0;
    bReady := TRUE;
END_IF;
IF iStep = 0 THEN
{acts}    bChanged := FALSE;
END_IF;
(* position, velocity and force of the step's beginning go between the blocks (section 5.1) *)
fbHydraulics(bReset := FALSE, bPrepare := bPrepare, nPump := {motor}.nMotor, uValve := 1.0E0,
    xCyl := fbBoom.xCyl, vCyl := fbBoom.vCyl, tStep := tStep);
fbBoom(bReset := FALSE, bPrepare := bPrepare, fCyl := fbHydraulics.fCyl, tStep := tStep);
iStep := (iStep + 1) MOD nPerPeriod;
{shows}xSim := fbBoom.xCyl;
vSim := fbBoom.vCyl;
pLSim := fbHydraulics.pL;
"
        );
        Unit {
            kind: Kind::FunctionBlock,
            name: name.into(),
            comment: comment.into(),
            variables,
            body,
            tasks: Vec::new(),
        }
    }
}

/// The simulated crane under the benchmark controller: its motor speed is the feedforward of section 4 (figures 13 and 15).
pub(super) fn simulation_feedforward(steps: u32, step: &str) -> Unit {
    let steering = Steering {
        name: "FB_SimulationFeedforward",
        comment: "The simulated crane under the benchmark controller; its motor speed is the feedforward (section 4). One call is one \
                  simulation step; the controller acts at each first of nPerPeriod.",
        inputs: Vec::new(),
        outputs: vec![output("nFeedforward", "Motor speed of the simulated crane [rev/s]")],
        blocks: vec![
            local("fbController", "FB_BenchmarkController", ""),
            local("fbMotor", "FB_SimulatedMotor", ""),
        ],
        begins: "    fbMotor(bReset := TRUE, bPrepare := TRUE, nWanted := 0.0E0);\n",
        acts: "    fbController(bReset := bBegins, bPrepare := bChanged, xRef := xRef, vRef := vRef, xCyl := fbBoom.xCyl,
        pL := fbHydraulics.pL, nSim := 0.0E0, uLead := 0.0E0);
    fbMotor(bReset := FALSE, bPrepare := bChanged, nWanted := fbController.nRef);\n",
        motor: "fbMotor",
        shows: "nFeedforward := fbMotor.nMotor;\n",
    };
    steering.unit(steps, step)
}

/// Model following: state feedback on the simulated crane, an observer and feedback of what the machine differs.
pub(super) fn model_following(steps: u32, step: &str) -> Unit {
    let steering = Steering {
        name: "FB_ModelFollowing",
        comment: "State feedback makes the simulated crane follow the reference, feedback of what differs the machine the simulated \
                  crane (docs/model-following.md). One call is one simulation step; nRef changes at each first of nPerPeriod.",
        inputs: vec![
            input("xCyl", "0.0E0", "Piston position of the machine [m]"),
            input("pL", "0.0E0", "Load pressure of the machine, p_A - (A_r/A_p) p_B [Pa]"),
            input("nRead", "0.0E0", "Motor speed of the machine, as its drive tells it [rev/s]"),
        ],
        outputs: vec![
            output("nRef", "Motor speed for the machine [rev/s]"),
            output("nSim", "Motor speed of the simulated crane [rev/s]"),
        ],
        blocks: vec![
            local("fbStateFeedback", "FB_StateFeedback", ""),
            local("fbController", "FB_FollowingController", ""),
        ],
        begins: "",
        acts: "    fbStateFeedback(bReset := bBegins, bPrepare := bChanged, xRef := xRef, vRef := vRef, xSim := fbBoom.xCyl,
        vSim := fbBoom.vCyl, pLSim := fbHydraulics.pL);
    fbController(bReset := bBegins, bPrepare := bChanged, xRef := xRef, vRef := vRef, xAhead := fbStateFeedback.xAhead,
        nAhead := fbStateFeedback.nAhead, xCyl := xCyl, pL := pL, nRead := nRead,
        nSim := fbStateFeedback.nMotor, xSim := fbBoom.xCyl, vSim := fbBoom.vCyl, pLSim := fbHydraulics.pL);\n",
        motor: "fbStateFeedback",
        shows: "nRef := fbController.nRef;\nnSim := fbStateFeedback.nMotor;\n",
    };
    steering.unit(steps, step)
}

/// A global variable: name, type, meaning.
type Global = [&'static str; 3];

const BEGIN: Global =
    ["bBegin", "BOOL", "Set for one call of both tasks: the simulated crane begins where it rests"];
const PREPARE: Global =
    ["bPrepare", "BOOL", "Set for one call of both tasks: a parameter of their blocks was changed"];
const POSITION: Global = ["xReference", "LREAL", "Piston position that is wanted [m]"];
const VELOCITY: Global = ["vReference", "LREAL", "Piston velocity that is wanted [m/s]"];
const MEASURED: Global = ["xMeasured", "LREAL", "Piston position of the machine [m]"];
const LOAD: Global =
    ["pLoadMeasured", "LREAL", "Load pressure of the machine, p_A - (A_r/A_p) p_B [Pa]"];
const SIMULATED: Global = ["nSimulated", "LREAL", "Motor speed of the simulated crane [rev/s]"];
const MOTOR: Global = ["nMotor", "LREAL", "Motor speed asked for [rev/s]"];

/// What goes between the two tasks, and the tasks: intervals of simulation and control \[s\].
pub(super) fn globals(simulation: f64, control: f64) -> Unit {
    /// Often enough that the test bench is done in some seconds, and seldom enough to be in nobody's way \[s\].
    const TEST_BENCH: f64 = 10e-3;
    let global =
        |[name, kind, comment]: Global| Declared::new(Section::Global, name, kind, None, comment);
    let all = [BEGIN, PREPARE, POSITION, VELOCITY, MEASURED, LOAD, SIMULATED, MOTOR];
    let task = |name: &str, interval: f64, priority: u32| Task {
        name: format!("{name}Task"),
        interval,
        priority,
        program: format!("PRG_{name}"),
    };
    Unit {
        kind: Kind::Globals,
        name: GLOBALS.into(),
        comment: "What goes between the two tasks and the machine. Each LREAL is written by one task only.".into(),
        variables: all.map(global).into(),
        body: String::new(),
        tasks: vec![
            task("Simulation", simulation, 0),
            task("Control", control, 1),
            task("TestBench", TEST_BENCH, 2),
        ],
    }
}

/// A program that uses global variables.
fn program(name: &str, comment: &str, block: Declared, used: &[Global], body: &str) -> Unit {
    let external =
        |[name, kind, _]: &Global| Declared::new(Section::External, name, kind, None, "");
    let mut variables: Vec<Declared> = used.iter().map(external).collect();
    variables.push(block);
    Unit {
        kind: Kind::Program,
        name: name.into(),
        comment: comment.into(),
        variables,
        body: body.into(),
        tasks: Vec::new(),
    }
}

/// The task of the simulation, called every simulation step.
pub(super) fn simulation_task() -> Unit {
    program(
        "PRG_Simulation",
        "To be called in a task of its own, on a core of its own, every simulation step (50 us in the paper).",
        local("fbFeedforward", "FB_SimulationFeedforward", ""),
        &[BEGIN, PREPARE, POSITION, VELOCITY, SIMULATED],
        "\
fbFeedforward(bReset := GVL_Hydroboom.bBegin, bPrepare := GVL_Hydroboom.bPrepare, xRef := GVL_Hydroboom.xReference,
    vRef := GVL_Hydroboom.vReference);
GVL_Hydroboom.nSimulated := fbFeedforward.nFeedforward;
",
    )
}

/// The task of the controller, called every control period.
pub(super) fn control_task() -> Unit {
    program(
        "PRG_Control",
        "To be called every control period (1 ms in the paper): feedforward from the simulation, PI and pressure feedback on \
         the machine (figure 15).",
        local("fbController", "FB_BenchmarkController", ""),
        &[BEGIN, PREPARE, POSITION, VELOCITY, MEASURED, LOAD, SIMULATED, MOTOR],
        "\
fbController(bReset := GVL_Hydroboom.bBegin, bPrepare := GVL_Hydroboom.bPrepare, xRef := GVL_Hydroboom.xReference,
    vRef := GVL_Hydroboom.vReference, xCyl := GVL_Hydroboom.xMeasured, pL := GVL_Hydroboom.pLoadMeasured,
    nSim := GVL_Hydroboom.nSimulated, uLead := 1.0E0);
GVL_Hydroboom.nMotor := fbController.nRef;
",
    )
}
