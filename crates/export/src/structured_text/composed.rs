//! Units that are put together from the recorded ones: the simulation that steers, and two tasks as the paper divides them.

use super::unit::{Declared, Kind, Section, Unit};

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

/// The simulated crane at rest.
const REST: &str = "    (* a step of no length shows where the piston rests *)
    fbBoom(bReset := TRUE, bPrepare := TRUE, fCyl := 0.0E0, tStep := 0.0E0);
    fbHydraulics(bReset := TRUE, bPrepare := TRUE, nPump := 0.0E0, uValve := 1.0E0, xCyl := fbBoom.xCyl,
        vCyl := fbBoom.vCyl, tStep := 0.0E0);
";

/// What is shown of the simulated crane.
const SHOWN: &str = "\
xSim := fbBoom.xCyl;
vSim := fbBoom.vCyl;
pLSim := fbHydraulics.pL;
";

/// A step of the simulated crane, whose motor is `of` a block.
fn simulated_step(of: &str) -> String {
    format!(
        "\
(* position, velocity and force of the step's beginning go between the blocks (section 5.1) *)
fbHydraulics(bReset := FALSE, bPrepare := bPrepare, nPump := {of}.nMotor, uValve := 1.0E0,
    xCyl := fbBoom.xCyl, vCyl := fbBoom.vCyl, tStep := tStep);
fbBoom(bReset := FALSE, bPrepare := bPrepare, fCyl := fbHydraulics.fCyl, tStep := tStep);
"
    )
}

/// The simulated crane under the benchmark controller: its motor speed is the feedforward of section 4 (figures 13 and 15).
///
/// `steps` simulation steps make a control period; each call is one step of `step` \[s\].
pub(super) fn simulation_feedforward(steps: u32, step: &str) -> Unit {
    let count = steps.to_string();
    Unit {
        kind: Kind::FunctionBlock,
        name: "FB_SimulationFeedforward".into(),
        comment: "The simulated crane under the benchmark controller; its motor speed is the feedforward (section 4). One call is one \
                  simulation step; the controller acts at each first of nPerPeriod."
            .into(),
        variables: vec![
            flag("bReset", "Begin again: the simulated crane at rest at its start"),
            flag("bPrepare", "A parameter of one of the blocks was changed"),
            input("xRef", "0.0E0", "Piston position that is wanted [m]"),
            input("vRef", "0.0E0", "Piston velocity that is wanted [m/s]"),
            input("tStep", step, "Simulation step [s]"),
            Declared::new(Section::Input, "nPerPeriod", "DINT", Some(&count), "Simulation steps in a control period"),
            output("nFeedforward", "Motor speed of the simulated crane [rev/s]"),
            output("xSim", "Its piston position [m]"),
            output("vSim", "Its piston velocity [m/s]"),
            output("pLSim", "Its load pressure [Pa]"),
            local("fbController", "FB_BenchmarkController", ""),
            local("fbMotor", "FB_SimulatedMotor", ""),
            local("fbHydraulics", "FB_HydraulicModel", ""),
            local("fbBoom", "FB_FlexibleBoom", ""),
            local("iStep", "DINT", ""),
            local("bBegins", "BOOL", ""),
            local("bReady", "BOOL", ""),
        ],
        body: format!(
            "\
bBegins := bReset OR NOT bReady;
IF bBegins THEN
{REST}    fbMotor(bReset := TRUE, bPrepare := TRUE, nWanted := 0.0E0);
    iStep := 0;
    bReady := TRUE;
END_IF;
IF iStep = 0 THEN
    fbController(bReset := bBegins, bPrepare := bPrepare, xRef := xRef, vRef := vRef, xCyl := fbBoom.xCyl,
        pL := fbHydraulics.pL, nSim := 0.0E0, uLead := 0.0E0);
    fbMotor(bReset := FALSE, bPrepare := bPrepare, nWanted := fbController.nRef);
END_IF;
{}iStep := (iStep + 1) MOD nPerPeriod;
nFeedforward := fbMotor.nMotor;
{SHOWN}",
            simulated_step("fbMotor")
        ),
    }
}

/// Model following: state feedback on the simulated crane, PI and pressure feedback on what the machine differs.
///
/// `steps` simulation steps make a control period; each call is one step of `step` \[s\].
pub(super) fn model_following(steps: u32, step: &str) -> Unit {
    let count = steps.to_string();
    Unit {
        kind: Kind::FunctionBlock,
        name: "FB_ModelFollowing".into(),
        comment: "State feedback makes the simulated crane follow the reference, PI and pressure feedback the machine the simulated \
                  crane (docs/model-following.md). One call is one simulation step; nRef changes at each first of nPerPeriod."
            .into(),
        variables: vec![
            flag("bReset", "Begin again: the simulated crane at rest at its start"),
            flag("bPrepare", "A parameter of one of the blocks was changed"),
            input("xRef", "0.0E0", "Piston position that is wanted [m]"),
            input("vRef", "0.0E0", "Piston velocity that is wanted [m/s]"),
            input("xCyl", "0.0E0", "Piston position of the machine [m]"),
            input("pL", "0.0E0", "Load pressure of the machine, p_A - (A_r/A_p) p_B [Pa]"),
            input("tStep", step, "Simulation step [s]"),
            Declared::new(Section::Input, "nPerPeriod", "DINT", Some(&count), "Simulation steps in a control period"),
            output("nRef", "Motor speed for the machine [rev/s]"),
            output("nSim", "Motor speed of the simulated crane [rev/s]"),
            output("xSim", "Its piston position [m]"),
            output("vSim", "Its piston velocity [m/s]"),
            output("pLSim", "Its load pressure [Pa]"),
            local("fbStateFeedback", "FB_StateFeedback", ""),
            local("fbController", "FB_FollowingController", ""),
            local("fbHydraulics", "FB_HydraulicModel", ""),
            local("fbBoom", "FB_FlexibleBoom", ""),
            local("iStep", "DINT", ""),
            local("bBegins", "BOOL", ""),
            local("bReady", "BOOL", ""),
        ],
        body: format!(
            "\
bBegins := bReset OR NOT bReady;
IF bBegins THEN
{REST}    iStep := 0;
    bReady := TRUE;
END_IF;
IF iStep = 0 THEN
    fbStateFeedback(bReset := bBegins, bPrepare := bPrepare, xRef := xRef, vRef := vRef, xSim := fbBoom.xCyl,
        vSim := fbBoom.vCyl, pLSim := fbHydraulics.pL);
    fbController(bReset := bBegins, bPrepare := bPrepare, xCyl := xCyl, pL := pL, nSim := fbStateFeedback.nMotor,
        xSim := fbBoom.xCyl, vSim := fbBoom.vCyl, pLSim := fbHydraulics.pL);
END_IF;
{}iStep := (iStep + 1) MOD nPerPeriod;
nRef := fbController.nRef;
nSim := fbStateFeedback.nMotor;
{SHOWN}",
            simulated_step("fbStateFeedback")
        ),
    }
}

/// What goes between the two tasks.
pub(super) fn globals() -> Unit {
    let global = |name: &str, kind: &str, comment: &str| {
        Declared::new(Section::Global, name, kind, None, comment)
    };
    Unit {
        kind: Kind::Globals,
        name: "GVL_Hydroboom".into(),
        comment: "What goes between the two tasks and the machine. Each LREAL is written by one task only.".into(),
        variables: vec![
            global("bBegin", "BOOL", "Set for one call of both tasks: the simulated crane begins where it rests"),
            global("xReference", "LREAL", "Piston position that is wanted [m]"),
            global("vReference", "LREAL", "Piston velocity that is wanted [m/s]"),
            global("xMeasured", "LREAL", "Piston position of the machine [m]"),
            global("pLoadMeasured", "LREAL", "Load pressure of the machine, p_A - (A_r/A_p) p_B [Pa]"),
            global("nSimulated", "LREAL", "Motor speed of the simulated crane [rev/s]"),
            global("nMotor", "LREAL", "Motor speed asked for [rev/s]"),
        ],
        body: String::new(),
    }
}

/// The task of the simulation, called every simulation step.
pub(super) fn simulation_task() -> Unit {
    Unit {
        kind: Kind::Program,
        name: "PRG_Simulation".into(),
        comment: "To be called in a task of its own, on a core of its own, every simulation step (50 us in the paper).".into(),
        variables: vec![local("fbFeedforward", "FB_SimulationFeedforward", "")],
        body: "\
fbFeedforward(bReset := GVL_Hydroboom.bBegin, xRef := GVL_Hydroboom.xReference, vRef := GVL_Hydroboom.vReference);
GVL_Hydroboom.nSimulated := fbFeedforward.nFeedforward;
"
        .into(),
    }
}

/// The task of the controller, called every control period.
pub(super) fn control_task() -> Unit {
    Unit {
        kind: Kind::Program,
        name: "PRG_Control".into(),
        comment: "To be called every control period (1 ms in the paper): feedforward from the simulation, PI and pressure feedback on \
                  the machine (figure 15)."
            .into(),
        variables: vec![local("fbController", "FB_BenchmarkController", "")],
        body: "\
fbController(bReset := GVL_Hydroboom.bBegin, xRef := GVL_Hydroboom.xReference, vRef := GVL_Hydroboom.vReference,
    xCyl := GVL_Hydroboom.xMeasured, pL := GVL_Hydroboom.pLoadMeasured, nSim := GVL_Hydroboom.nSimulated,
    uLead := 1.0E0);
GVL_Hydroboom.nMotor := fbController.nRef;
"
        .into(),
    }
}
