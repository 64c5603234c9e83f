//! Example machines in C and in Python, each a process of its own around the live C library. Each follows a
//! course at 120 mm/s as the same crane does in this process. Each holds its load when the controller
//! stops, and after it was suspended itself.

// the dependency makes cargo build the library that the examples load
use hydroboom_live as _;

use hydroboom_control::strategy::Strategy;
use hydroboom_control::supervision::fault::Cause;
use hydroboom_control::supervision::limits::{Limits, MachineStatus};
use hydroboom_control::supervision::supervisor::State;
use hydroboom_description::Description;
use hydroboom_design::limits;
use hydroboom_machine_interface::session::WATCHDOG;
use hydroboom_realtime::bus_task::BusTask;
use hydroboom_realtime::control_task::{ControlTask, Record};
use hydroboom_realtime::course::Course;
use hydroboom_realtime::desk::Desk;
use hydroboom_realtime::local_lockstep::LocalLockstep;
use hydroboom_realtime::lockstep::Lockstep;
use hydroboom_realtime::operator::Operator;
use hydroboom_realtime::simulation_task::SimulationTask;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, OnceLock};

const STRATEGY: Strategy = Strategy::SimulationFeedforwardClosedLoop;
const PERIOD: f64 = 1e-3;
/// Largest RMS tracking error of a strategy with feedback at 120 mm/s, as in lockstep.rs [m].
const LARGEST_RMS: f64 = 1.1e-3;
/// Largest position difference between the same crane in two processes at any time of the course [m].
/// Rounding causes it, and a check valve can amplify it.
const SAME: f64 = 1e-6;
/// Largest movement of a held load [mm].
const HELD: f64 = 0.05;
/// Largest number of control periods of a course.
const LONGEST: usize = 60_000;

/// Target directory of this test, which also contains the library.
fn built() -> PathBuf {
    std::env::current_exe().unwrap().parent().unwrap().to_path_buf()
}

fn crates() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// The example in C.
fn in_c() -> Command {
    static PROGRAM: OnceLock<PathBuf> = OnceLock::new();
    let program = PROGRAM.get_or_init(|| {
        let program = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("machine_example");
        let mut cc = Command::new("cc");
        cc.args(["-std=gnu99", "-O1", "-Wall", "-Wextra", "-Werror"]);
        for include in ["machine_interface/include", "c_interface/include"] {
            cc.arg("-I").arg(crates().join(include));
        }
        cc.arg(crates().join("machine_interface/examples/machine.c")).arg("-L").arg(built());
        let done = cc.args(["-lhydroboom_live", "-lm", "-o"]).arg(&program).output().unwrap();
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        program
    });
    let mut command = Command::new(program);
    command.env("LD_LIBRARY_PATH", built());
    command
}

/// Example in Python; none if there is no Python.
fn in_python() -> Option<Command> {
    if Command::new("python3").arg("--version").output().is_err() {
        eprintln!("skipped: python3 is not on the PATH");
        return None;
    }
    let mut command = Command::new("python3");
    command.arg(crates().join("machine_interface/examples/machine.py"));
    command.arg(built().join("libhydroboom_live.so"));
    Some(command)
}

/// Crane that the examples open. Its sensors have no noise, so that the monitor of stuck signals is
/// switched off.
fn model() -> Description {
    let mut model = Description::uia_single_boom().unwrap();
    model.set("supervision.stuck_ms=0").unwrap();
    model
}

/// Controller in this process and machine in another.
struct Rig {
    run: LocalLockstep,
    machine: Child,
    operator: Operator,
    desk: Desk,
    limits: Limits,
}

impl Rig {
    fn new(mut machine: Command) -> Self {
        let model = model();
        let n = &model.numbers;
        let motion = model.motion(n.fast);
        let limits = limits(&model, motion.speed).unwrap();
        let control = ControlTask::new(&model, Course::new(Arc::new(motion)), limits, STRATEGY);
        let simulation = SimulationTask::new(&model, motion.start).unwrap();
        let (mut bus, side) = BusTask::open(0, PERIOD).unwrap();
        machine.arg(bus.port().to_string()).arg("--simulated-time").stdout(Stdio::piped());
        let machine = machine.spawn().unwrap();
        for _ in 0..100 {
            bus.wait(200_000_000);
            bus.receive(0);
            if bus.endpoint.has_begun() {
                break;
            }
        }
        assert!(bus.endpoint.has_begun(), "no machine has come");
        let periods = (n.simulation_period, PERIOD);
        let run = LocalLockstep::new((control, simulation), (bus, side), periods);
        let operator = Operator::automatic(PERIOD);
        Self { run, machine, operator, desk: Desk::new(STRATEGY), limits }
    }

    fn period(&mut self) -> Record {
        self.run.period(&mut self.operator, &self.desk)
    }

    /// Runs until the piston moves at full speed.
    fn at_full_speed(machine: Command) -> Self {
        let mut rig = Self::new(machine);
        for _ in 0..LONGEST {
            let record = rig.period();
            assert_eq!(record.decision.cause, None);
            let fastest = record.course_speed;
            if record.course_time.is_some() && record.reference.velocity >= 0.99 * fastest {
                return rig;
            }
        }
        panic!("it does not come to full speed");
    }

    /// Runs on without a machine: it is reported as lost as soon as its measurements are stale.
    fn finds_the_machine_lost(&mut self) {
        let causes: Vec<Option<Cause>> = (0..500).map(|_| self.period().decision.cause).collect();
        let found = causes.iter().position(|cause| cause.is_some()).unwrap();
        assert_eq!(causes[found], Some(Cause::MachineLost));
        assert!(found as f64 * PERIOD <= self.limits.stale + 3.0 * PERIOD, "{found}");
    }

    /// Upper bound of the piston's travel after the last command [mm].
    fn stopping_distance(&self) -> f64 {
        1e3 * self.limits.speed * (self.limits.stopping_time() + WATCHDOG.as_secs_f64())
    }
}

/// Final output of a machine: position at the last command and at the end [mm], motor speed, valve.
fn end_of(machine: Child) -> [f64; 4] {
    let output = machine.wait_with_output().unwrap();
    assert!(output.status.success(), "{}", output.status);
    let printed = String::from_utf8(output.stdout).unwrap();
    let held = printed
        .lines()
        .find(|line| line.starts_with("held"))
        .unwrap_or_else(|| panic!("{printed}"));
    let numbers: Vec<f64> = held.split([' ', ',']).filter_map(|word| word.parse().ok()).collect();
    numbers.try_into().unwrap()
}

/// Course time and position of the piston [m].
fn strokes(records: &[Record]) -> Vec<(f64, f64)> {
    records.iter().filter_map(|r| Some((r.course_time?, r.signals().stroke))).collect()
}

/// Records of the same course with the crane in this process.
fn simulated_here() -> &'static [Record] {
    static RECORDS: OnceLock<Vec<Record>> = OnceLock::new();
    RECORDS.get_or_init(|| {
        let model = model();
        let motion = model.motion(model.numbers.fast);
        let mut run = Lockstep::new(&model, &model, motion, STRATEGY).unwrap();
        let (mut operator, mut records) = (Operator::automatic(PERIOD), Vec::new());
        while !operator.is_done() && records.len() < LONGEST {
            records.push(run.period(&mut operator, STRATEGY).unwrap());
        }
        records
    })
}

/// Runs a course: positions as in this process, load held at the end, no datagram lost or late.
fn plays_a_course(machine: Command) {
    let mut rig = Rig::new(machine);
    let mut records = Vec::new();
    while !rig.operator.is_done() && records.len() < LONGEST {
        records.push(rig.period());
    }
    let last = records.last().unwrap();
    assert_eq!((last.decision.state, last.decision.cause), (State::Holding, None));
    assert_eq!(last.status, Some(MachineStatus::Enabled));
    assert_eq!(last.link.unwrap().delay.unwrap().cycles(), [0, 0]);
    let (counters, refused) = rig.run.bus.endpoint.counters();
    assert_eq!((counters.lost, counters.dropped(), refused), (0, 0, 0));
    let errors: Vec<f64> = records.iter().filter_map(Record::error).collect();
    let rms = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
    assert!(errors.len() > 10_000 && rms < LARGEST_RMS, "{rms} m of {}", errors.len());
    let (there, here) = (strokes(&records), strokes(simulated_here()));
    assert_eq!(there.len(), here.len());
    let apart = there.iter().zip(&here).map(|((_, a), (_, b))| (a - b).abs()).fold(0.0, f64::max);
    assert!(apart < SAME, "{apart} m apart, RMS {rms} m");
    drop(rig.run);
    let [last, end, motor, valve] = end_of(rig.machine);
    assert_eq!([motor, valve], [0.0, 0.0]);
    assert!((end - last).abs() < HELD, "a held load moved from {last} to {end} mm");
}

#[test]
fn a_machine_in_c_completes_a_course() {
    plays_a_course(in_c());
}

#[test]
fn a_machine_in_python_completes_a_course() {
    if let Some(machine) = in_python() {
        plays_a_course(machine);
    }
}

#[test]
fn a_machine_stops_itself_if_its_controller_ends_in_motion() {
    let rig = Rig::at_full_speed(in_c());
    let most = rig.stopping_distance();
    drop(rig.run);
    let [last, end, motor, valve] = end_of(rig.machine);
    assert_eq!([motor, valve], [0.0, 0.0]);
    // it continued for its watchdog time
    assert!(end > last && end - last < most, "from {last} to {end} mm, {most} mm are allowed");
}

#[test]
fn a_suspended_machine_is_lost_and_holds_its_load_on_resuming() {
    let mut rig = Rig::at_full_speed(in_c());
    let stopped_at = 1e3 * rig.period().signals().stroke;
    // simulated time continues without the machine until the supervisor reports it as lost
    let most = rig.stopping_distance() + 1e3 * rig.limits.speed * rig.limits.stale;
    let process = rig.machine.id().to_string();
    let signal = |name: &str| {
        assert!(Command::new("kill").args([name, &process]).status().unwrap().success());
    };
    signal("-STOP");
    rig.finds_the_machine_lost();
    signal("-CONT");
    // it is commanded to hold its load, and does
    let mut last = rig.period();
    (0..500).for_each(|_| last = rig.period());
    assert_eq!(
        (last.decision.state, last.decision.cause),
        (State::Fault, Some(Cause::MachineLost))
    );
    drop(rig.run);
    let [_, end, motor, valve] = end_of(rig.machine);
    assert_eq!([motor, valve], [0.0, 0.0]);
    assert!(
        (end - stopped_at).abs() < most,
        "from {stopped_at} to {end} mm, {most} mm are allowed"
    );
}

/// Its port is closed from then on (SIGKILL), which the operating system reports to the controller's socket.
#[test]
fn a_killed_machine_is_lost_and_the_fault_remains() {
    let mut rig = Rig::at_full_speed(in_c());
    rig.machine.kill().unwrap();
    rig.machine.wait().unwrap();
    rig.finds_the_machine_lost();
    let last = rig.period();
    assert_eq!(
        (last.decision.state, last.decision.cause),
        (State::Fault, Some(Cause::MachineLost))
    );
    assert_eq!(last.decision.command.holding_valve, 0.0);
}
