//! Test of the nonlinear predictive controller, iterated to convergence, against IPOPT's solutions of the
//! same problems.
//!
//! `tests/oracle/nonlinear_mpc_problems.json` contains the problems, and `nonlinear_mpc_solutions.json` the
//! solutions by `nonlinear_mpc.py` in the same folder. New problems are written by `cargo test -p
//! hydroboom-lab --lib problems_of_the_oracle -- --ignored`.

use super::estimated_machine::EstimatedMachine;
use super::horizon::{BEGINS, BLOCKS, PERIODS};
use super::nonlinear_mpc::{GaussNewton, ITERATIONS, NonlinearMpc};
use super::optimal_control_problem::{MachineLimits, OptimalControlProblem};
use super::reference_ahead::{ReferenceHorizon, ReferencePoint};
use hydroboom_control::estimation::reduced_model::MachineState;
use hydroboom_control::estimation::state_estimator::PredictedState;
use hydroboom_control::feedback::inverse_dynamics::inverse_dynamics;
use hydroboom_control::feedback::riccati::Matrix;
use hydroboom_control::measurement::{AxisSignals, Measurement};
use hydroboom_control::reference::smoothing::SmoothSetPoint;
use hydroboom_description::Description;
use hydroboom_math::Real;
use serde_json::{Value, json};
use std::cell::RefCell;
use std::path::{Path, PathBuf};

/// Controller's machine model at rest at mid-stroke with the crane file's payload.
pub(super) fn machine_at_rest(description: &Description) -> EstimatedMachine {
    let mut machine = EstimatedMachine::new(description).unwrap();
    let (stroke, payload) = (0.25, description.numbers.payload);
    let pressure_a = machine.law.model.at(stroke, payload).holding_pressure;
    let signals = AxisSignals { stroke, pressure_a, ..AxisSignals::default() };
    machine.start(&Measurement::new(1, 0.0, [signals]), 0);
    machine
}

/// Problem along a reference of given velocity \[m/s\] and acceleration \[m/s²\], from a state on the
/// reference, with sliding friction.
pub(super) fn problem_along(
    machine: &EstimatedMachine,
    velocity: f64,
    acceleration: f64,
) -> OptimalControlProblem {
    let (law, now) = (&machine.law, machine.now().unwrap());
    let friction = if velocity > 0.0 { law.model.coulomb } else { 0.0 };
    let begin = MachineState { friction, ..now.estimated.filter.estimate };
    let begun = now.estimated.filter.estimate.position;
    let at = |periods: f64| {
        let t = periods * law.period;
        let reference = SmoothSetPoint {
            position: begun + velocity * t + 0.5 * acceleration * t * t,
            velocity: velocity + acceleration * t,
            acceleration,
            jerk: 0.0,
        };
        let state = inverse_dynamics(&law.model, &begin, &reference, 0.0, 0.0);
        ReferencePoint { state, piston: reference.position }
    };
    let lag = now.estimated.drive.ramp_delay(law.period) / law.period;
    let reference = ReferenceHorizon {
        points: std::array::from_fn(|k| at(BEGINS[k] as f64)),
        motor_speeds: std::array::from_fn(|k| {
            at(BEGINS[k] as f64 + 0.5 * (PERIODS[k] - 1) as f64 + lag).state.motor_speed
        }),
    };
    let PredictedState { position, velocity, load_pressure, motor_speed } = at(0.0).state;
    OptimalControlProblem {
        model: law.model,
        begin: MachineState { position, velocity, load_pressure, ..begin },
        motor_speed,
        rod_side_term: 0.0,
        drive: now.estimated.drive.coefficient,
        period: law.period,
        limits: MachineLimits {
            motor_speed: law.motor_speed,
            slew: law.slew,
            pressure: [0.0, 210e5],
            pressure_price: 10.0,
        },
        weights: law.weights(),
        reference,
        cost_to_go: machine.regulator().cost_to_go,
    }
}

/// Solution at which further Gauss-Newton steps have no effect.
fn converged(problem: &OptimalControlProblem) -> GaussNewton {
    let mut newton = GaussNewton::new(problem.reference.motor_speeds);
    for _ in 0..60 {
        let change = newton.step(problem, 30).unwrap();
        if change < 1e-7 {
            return newton;
        }
    }
    newton
}

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/oracle").join(name)
}

fn read(name: &str) -> Value {
    serde_json::from_str(&std::fs::read_to_string(file(name)).unwrap()).unwrap()
}

fn written(problem: &OptimalControlProblem, name: &str, active: &str) -> Value {
    let model = RefCell::new(Vec::new());
    let note = &model;
    problem.model.map(|value| {
        note.borrow_mut().push(value);
        value
    });
    let limits = &problem.limits;
    let point = |p: &ReferencePoint| {
        let PredictedState { position, velocity, load_pressure, motor_speed } = p.state;
        [position, velocity, load_pressure, motor_speed, p.piston]
    };
    json!({
        "name": name, "active": active, "model": model.borrow().clone(), "begin": problem.begin.to_array(),
        "motor_speed": problem.motor_speed, "rod_side_term": problem.rod_side_term, "drive": problem.drive,
        "period": problem.period, "largest_speed": limits.motor_speed, "slew": limits.slew,
        "pressure": limits.pressure, "price": limits.pressure_price, "weights": problem.weights,
        "points": problem.reference.points.iter().map(point).collect::<Vec<_>>(),
        "motor_speeds": problem.reference.motor_speeds, "cost_to_go": problem.cost_to_go, "periods": PERIODS,
    })
}

/// A list of numbers.
fn numbers<const N: usize>(of: &Value) -> [f64; N] {
    std::array::from_fn(|k| of[k].as_f64().unwrap())
}

/// Problem as recorded; `any` supplies the fields that are not recorded.
fn as_written(value: &Value, any: &OptimalControlProblem) -> OptimalControlProblem {
    let of = |key: &str| value[key].as_f64().unwrap();
    assert_eq!(numbers::<BLOCKS>(&value["periods"]), PERIODS.map(|p| p as f64), "another horizon");
    let place = RefCell::new(0..);
    let (next, model) = (&place, value["model"].as_array().unwrap());
    let cost_to_go: Matrix<f64> = std::array::from_fn(|i| numbers(&value["cost_to_go"][i]));
    OptimalControlProblem {
        model: any.model.map(|_| model[next.borrow_mut().next().unwrap()].as_f64().unwrap()),
        begin: MachineState::from_array(numbers(&value["begin"])),
        motor_speed: of("motor_speed"),
        rod_side_term: of("rod_side_term"),
        drive: of("drive"),
        period: of("period"),
        limits: MachineLimits {
            motor_speed: of("largest_speed"),
            slew: of("slew"),
            pressure: numbers(&value["pressure"]),
            pressure_price: of("price"),
        },
        weights: numbers(&value["weights"]),
        reference: ReferenceHorizon {
            points: std::array::from_fn(|k| {
                let [position, velocity, load_pressure, motor_speed, piston] =
                    numbers(&value["points"][k]);
                let state = PredictedState { position, velocity, load_pressure, motor_speed };
                ReferencePoint { state, piston }
            }),
            motor_speeds: numbers(&value["motor_speeds"]),
        },
        cost_to_go,
    }
}

/// Four problems: no active limit, motor speed, slew rate, pressure.
#[test]
#[ignore = "writes the problems that the oracle solves"]
fn problems_of_the_oracle() {
    let description = Description::uia_single_boom().unwrap();
    let machine = machine_at_rest(&description);
    let mut free = problem_along(&machine, 0.05, 0.0);
    free.begin.position -= 3e-4;
    free.begin.load_pressure += 0.5e5;
    let mut fast = problem_along(&machine, 0.1, 0.0);
    fast.begin.position -= 20e-3;
    let mut sudden = problem_along(&machine, 0.05, 0.0);
    sudden.begin.position -= 2e-3;
    sudden.drive = 0.4;
    let mut pressed = problem_along(&machine, 0.05, 0.05);
    pressed.begin.position -= 3e-3;
    pressed.limits.pressure[1] = pressed.begin.load_pressure + 1.5e5;
    let all = [
        written(&free, "free", "none"),
        written(&fast, "fast", "motor speed"),
        written(&sudden, "sudden", "slew"),
        written(&pressed, "pressed", "pressure"),
    ];
    let text = all.map(|one| one.to_string()).join(",\n");
    std::fs::write(file("nonlinear_mpc_problems.json"), format!("[\n{text}\n]\n")).unwrap();
}

/// Compares commands, piston-side pressures and the active limit of each recorded problem.
#[test]
fn the_converged_controller_finds_what_ipopt_finds() {
    let any = problem_along(&machine_at_rest(&Description::uia_single_boom().unwrap()), 0.0, 0.0);
    let (problems, solutions) =
        (read("nonlinear_mpc_problems.json"), read("nonlinear_mpc_solutions.json"));
    for value in problems.as_array().unwrap() {
        let name = value["name"].as_str().unwrap();
        let problem = as_written(value, &any);
        let found = converged(&problem).commands;
        let solution = &solutions[name];
        let commands: [f64; BLOCKS] = numbers(&solution["commands"]);
        let limit = problem.limits.motor_speed;
        for (k, (own, oracle)) in found.iter().zip(commands).enumerate() {
            let off = (own - oracle) / limit;
            assert!(off.abs() < 1e-4, "{name}, block {k}: {own} for {oracle} rev/s");
        }
        let pressures: [f64; BLOCKS] = numbers(&solution["pressures"]);
        for (own, oracle) in problem.pressures(&found).iter().zip(pressures) {
            assert!((own - oracle).abs() < 200.0, "{name}: {own} for {oracle} Pa");
        }
        let first = problem.drive * (found[0] - problem.motor_speed);
        let active = match value["active"].as_str().unwrap() {
            "motor speed" => found.iter().any(|u| u.abs() > limit - 1e-6),
            "slew" => first.abs() > (1.0 - 1e-3) * problem.limits.slew,
            "pressure" => pressures.iter().any(|p| *p > problem.limits.pressure[1] - 200.0),
            _ => found.iter().all(|u| u.abs() < 0.9 * limit),
        };
        assert!(active, "{name}: {found:?}");
    }
}

/// With the regulator's own plant and no active limit the first command is the regulator's. The remaining
/// differences are move blocking and the model's integration step of up to 5 ms. The load's mode of 15
/// rad/s turns by 0.04 rad in half such a step.
#[test]
fn nonlinear_mpc_on_a_linear_plant_is_the_regulator() {
    let mut machine = machine_at_rest(&Description::uia_single_boom().unwrap());
    let model = &mut machine.law.model;
    // no gradients along the stroke, no leakage, constant bulk modulus
    for polynomial in model.equivalent_mass.iter_mut().chain(&mut model.compliance) {
        polynomial[1..].fill(0.0);
    }
    model.holding_pressure.iter_mut().for_each(|polynomial| polynomial[1..].fill(0.0));
    model.oil.bulk_modulus_min = model.oil.bulk_modulus_max;
    model.leakage = 0.0;
    // constant volume
    model.volume += 1e3 * model.volume;
    model.oil.bulk_modulus_max *= 1e3;
    model.oil.bulk_modulus_min *= 1e3;
    let now = machine.now().unwrap();
    let regulator = machine.law.settled_regulator(now.estimator, now.estimated);
    for off in OFF {
        let mut problem = problem_along(&machine, 0.05, 0.0);
        problem.cost_to_go = regulator.cost_to_go;
        // the regulator uses a lag of this rate, the drive of the problem the exact discrete share
        problem.drive = 1.0 - Real::exp(-problem.drive);
        let wanted = regulator_command(&regulator.gain, off);
        let found = first_change(&mut problem, off);
        assert!((found / wanted - 1.0).abs() < 0.05, "{off:?}: {found} for {wanted} rev/s");
    }
}

/// Deviations of load position, load velocity, load pressure and motor speed.
const OFF: [[f64; 4]; 4] =
    [[2e-4, 0.0, 0.0, 0.0], [0.0, 2e-3, 0.0, 0.0], [0.0, 0.0, 5e4, 0.0], [0.0, 0.0, 0.0, 0.5]];

fn regulator_command(gain: &[f64; 4], off: [f64; 4]) -> f64 {
    -gain.iter().zip(off).map(|(k, off)| k * off).sum::<f64>()
}

/// Change of the reference's motor speed by one step for an initial state with the given deviation.
fn first_change(problem: &mut OptimalControlProblem, off: [f64; 4]) -> f64 {
    let [position, velocity, load_pressure, motor_speed] = off;
    problem.begin.position += position;
    problem.begin.velocity += velocity;
    problem.begin.load_pressure += load_pressure;
    problem.motor_speed += motor_speed;
    let own = problem.reference.motor_speeds;
    let mut newton = GaussNewton::new(own);
    newton.step(problem, ITERATIONS).unwrap();
    newton.commands[0] - own[0]
}

/// The crane's own reduced model includes gradients along the stroke and of the bulk modulus, which the
/// regulator neglects. They change the command by some percent.
#[test]
fn nonlinear_mpc_near_an_operating_point_approximates_the_regulator() {
    let machine = machine_at_rest(&Description::uia_single_boom().unwrap());
    let [position, velocity, load_pressure, _] = OFF;
    for off in [position, velocity, load_pressure] {
        let mut problem = problem_along(&machine, 0.05, 0.0);
        let wanted = regulator_command(&machine.regulator().gain, off);
        let found = first_change(&mut problem, off);
        assert!((found / wanted - 1.0).abs() < 0.1, "{off:?}: {found} for {wanted} rev/s");
    }
}

/// One step with the iterations of a control period, starting from the reference's commands, keeps the
/// limits of the first block.
#[test]
fn a_single_step_keeps_the_limits_of_the_motor() {
    let machine = machine_at_rest(&Description::uia_single_boom().unwrap());
    for error in [-50e-3, -5e-3, 5e-3, 50e-3] {
        let mut problem = problem_along(&machine, 0.05, 0.0);
        problem.begin.position += error;
        let mut newton = GaussNewton::new(problem.reference.motor_speeds);
        newton.step(&problem, ITERATIONS).unwrap();
        let command = problem.allowed(newton.commands[0]);
        let turned = problem.drive * (command - problem.motor_speed);
        let limits = &problem.limits;
        assert!(command.abs() <= limits.motor_speed, "{command} rev/s");
        assert!(turned.abs() <= limits.slew * (1.0 + 1e-12), "{turned} rev/s in a period");
        assert!(turned * error < -0.9 * limits.slew * error.abs(), "{error} m: {turned} rev/s");
    }
}

/// A pressure limit is kept without violating the motor's limits.
#[test]
fn a_lower_limit_of_the_pressure_is_kept_within_the_limits_of_the_motor() {
    let machine = machine_at_rest(&Description::uia_single_boom().unwrap());
    let mut problem = problem_along(&machine, 0.05, 0.0);
    problem.begin.position -= 10e-3;
    let most = |problem: &OptimalControlProblem| {
        let commands = converged(problem).commands;
        let speeds = commands.iter().all(|u| u.abs() <= problem.limits.motor_speed);
        assert!(speeds, "{commands:?}");
        problem.pressures(&commands).into_iter().fold(0.0, f64::max)
    };
    let free = most(&problem);
    problem.limits.pressure[1] = 0.5 * (free + problem.begin.load_pressure);
    let limited = most(&problem);
    assert!(limited < problem.limits.pressure[1] + 1e3, "{limited} of {free} Pa");
    assert!(limited > problem.limits.pressure[1] - 0.2e5, "nothing was active");
}

/// The controller's price of a pressure violation exceeds every multiplier. Where the problem with hard
/// limits has a solution, the problem with prices has the same one.
#[test]
fn penalised_pressure_limits_equal_hard_ones_where_feasible() {
    let description = Description::uia_single_boom().unwrap();
    let machine = machine_at_rest(&description);
    let controller = NonlinearMpc::controller(&description).unwrap();
    let price = controller.optimiser.limits.pressure_price;
    for behind in [1e-3, 3e-3, 10e-3] {
        let mut problem = problem_along(&machine, 0.05, 0.05);
        problem.begin.position -= behind;
        problem.limits.pressure[1] = problem.begin.load_pressure + 1.5e5;
        let [priced, hard] = [price, f64::INFINITY].map(|price| {
            problem.limits.pressure_price = price;
            converged(&problem).commands
        });
        let highest = problem.pressures(&priced).into_iter().fold(0.0, f64::max);
        let limit = problem.limits.pressure[1];
        assert!((highest - limit).abs() < 200.0, "{behind} m: {highest} for {limit} Pa");
        for (priced, hard) in priced.iter().zip(hard) {
            let off = (priced - hard) / problem.limits.motor_speed;
            assert!(off.abs() < 1e-5, "{behind} m: {priced} for {hard} rev/s");
        }
    }
}
