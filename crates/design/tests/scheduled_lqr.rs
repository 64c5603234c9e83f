//! State estimator and scheduled LQR on their own reduced model of the paper's crane.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up has failed")]

use hydroboom_control::estimation::error_covariance::{CONSIDERED, ConsideredParameters};
use hydroboom_control::estimation::extended_kalman_filter::{EstimatorInput, ExtendedKalmanFilter};
use hydroboom_control::estimation::reduced_model::{MachineState, ReducedModel, STATES};
use hydroboom_control::estimation::retained_parameters::RetainedParameters;
use hydroboom_control::estimation::state_estimator::{
    LARGEST_DELAY, StateEstimator, StateEstimatorState,
};
use hydroboom_control::feedback::inverse_dynamics::inverse_dynamics;
use hydroboom_control::feedback::scheduled_lqr::ScheduledLqr;
use hydroboom_control::reference::preview::Preview;
use hydroboom_control::reference::profile::SetPoint;
use hydroboom_control::reference::smoothing::smoothed;
use hydroboom_description::{Description, schema::KEYS};
use hydroboom_design::scheduled_lqr::designed;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

const PERIOD: f64 = 1e-3;
const BEYOND: f64 = 1.5e5;

fn crane(delay_cycles: usize) -> (StateEstimator<f64>, ScheduledLqr<f64>) {
    designed(&Description::uia_single_boom().unwrap(), delay_cycles).unwrap()
}

/// At rest at a piston position with a payload.
fn at_rest(model: &ReducedModel<f64>, position: f64, payload: f64) -> MachineState<f64> {
    let at = model.at(position, payload);
    MachineState {
        position: position - at.compliance * at.holding_pressure,
        velocity: 0.0,
        load_pressure: at.holding_pressure,
        friction: 0.0,
        disturbance: 0.0,
        unknown_flow: 0.0,
        payload,
        transition_pressure: 35e5,
    }
}

fn measured(
    model: &ReducedModel<f64>,
    z: &MachineState<f64>,
    motor_speed: f64,
) -> EstimatorInput<f64> {
    EstimatorInput {
        position: model.piston(z),
        position_is_good: 1.0,
        load_pressure: z.load_pressure,
        load_pressure_is_good: 1.0,
        rod_side_term: BEYOND,
        motor_speed,
    }
}

/// A raised-cosine move of 60 mm in a second, begun at 0.5 s.
fn reference(time: f64) -> SetPoint<f64> {
    let t = (time - 0.5).clamp(0.0, 1.0);
    let turn = std::f64::consts::PI * t;
    SetPoint {
        position: 0.2 + 0.03 * (1.0 - turn.cos()),
        velocity: 0.03
            * std::f64::consts::PI
            * turn.sin()
            * if t > 0.0 && t < 1.0 { 1.0 } else { 0.0 },
    }
}

/// The motor speed from inverse dynamics moves the model along the reference without feedback.
#[test]
fn inverse_dynamics_move_the_model_along_the_reference() {
    let (estimator, _) = crane(1);
    let model = estimator.filter.model;
    let mut z = at_rest(&model, 0.2, 250.0);
    let window = 0.03;
    let mut preview = Preview::new(PERIOD, reference);
    let mut largest = 0.0_f64;
    for k in 0..2500 {
        let time = f64::from(k) * PERIOD;
        // the speed in the middle of the step
        let next = smoothed(|after| preview.at(after), window, 0.5 * PERIOD);
        let speed = inverse_dynamics(&model, &z, &next, 0.01, BEYOND).motor_speed;
        z = model.step(&z, speed, BEYOND, PERIOD);
        preview.advance(|after| reference(time + PERIOD + after));
        let now = smoothed(|after| preview.at(after), window, 0.0);
        largest = largest.max((model.piston(&z) - now.position).abs());
    }
    // friction, which the smoothed sign anticipates by its turning speed, and the step itself
    assert!(largest < 1e-3, "{largest} m off 60 mm");
    assert!((z.position - at_rest(&model, 0.26, 250.0).position).abs() < 1e-3, "{z:?}");
}

/// On a machine equal to the model with noise of the stated size, errors have the size of the filter's
/// covariance. Shares within two standard deviations are compared.
#[test]
fn the_filter_is_consistent_on_its_own_model() {
    let (estimator, _) = crane(0);
    let exact = ConsideredParameters::from_array([0.0; CONSIDERED]);
    let filter = ExtendedKalmanFilter { considered: exact, ..estimator.filter };
    let shares = shares_within_two_deviations(&filter);
    assert!(shares.iter().all(|share| *share > 0.85), "{shares:?}");
    // deviations that are twice too large would leave next to none outside
    let mean = shares.iter().sum::<f64>() / STATES as f64;
    assert!(mean < 0.985, "{shares:?}");
}

/// The same where friction, pump, equivalent mass and sensor lag of the machine differ from those of the
/// model: the error covariance includes these differences.
#[test]
fn the_error_covariance_covers_parameter_errors() {
    let (estimator, _) = crane(0);
    let shares = shares_within_two_deviations(&estimator.filter);
    assert!(shares.iter().all(|share| *share > 0.85), "{shares:?}");
}

/// Where every parameter is exact and the load is constant, the error covariance is the filter's own, and
/// its gain is the Kalman gain.
#[test]
fn without_considered_parameters_the_error_covariance_is_the_filters_own() {
    let (estimator, _) = crane(0);
    let exact = ConsideredParameters::from_array([0.0; CONSIDERED]);
    let filter = ExtendedKalmanFilter { considered: exact, ..estimator.filter };
    let model = filter.model;
    let mut z = at_rest(&model, 0.2, 250.0);
    let mut state = filter.start(&measured(&model, &z, 0.0));
    for k in 0..3000 {
        let speed = model.leakage(z.load_pressure) + 15.0 * (3.0 * f64::from(k) * PERIOD).sin();
        z = model.step(&z, speed, BEYOND, PERIOD);
        filter.update(&mut state, &measured(&model, &z, speed));
    }
    for i in 0..STATES {
        for j in 0..STATES {
            let scale = (state.covariance[i][i] * state.covariance[j][j]).sqrt();
            let off = (state.errors[i][j] - state.covariance[i][j]).abs();
            assert!(off < 1e-9 * scale, "{i}, {j}: {off} of {scale}");
        }
    }
}

/// Shares of errors of each state within two standard deviations, on twelve machines drawn from what the filter says of states, noise and parameters.
fn shares_within_two_deviations(filter: &ExtendedKalmanFilter<f64>) -> [f64; STATES] {
    let mut random = Pcg64Mcg::seed_from_u64(20_261_128);
    let mut normal = move || -> f64 { random.sample(StandardNormal) };
    let mut random = Pcg64Mcg::seed_from_u64(20_261_129);
    let mut parameter =
        move |deviation: f64| random.random_range(-1.0..=1.0) * 3_f64.sqrt() * deviation;
    let (mut inside, mut total) = ([0; STATES], 0);
    for run in 0..12 {
        let c = filter.considered;
        let mass = 1.0 + parameter(c.equivalent_mass);
        let model = ReducedModel {
            coulomb: filter.model.coulomb + parameter(c.coulomb),
            viscous: filter.model.viscous + parameter(c.viscous),
            displacement: filter.model.displacement + parameter(c.displacement),
            equivalent_mass: filter.model.equivalent_mass.map(|p| p.map(|c| c * mass)),
            compliance: filter.model.compliance.map(|p| p.map(|c| c * mass * mass)),
            ..filter.model
        };
        let sensor_lag = filter.sensor_lag + parameter(c.sensor_lag);
        let mut z = at_rest(&model, 0.2, 100.0 + 20.0 * f64::from(run));
        let d = filter.initial_deviation;
        z.transition_pressure = (35e5 + d.transition_pressure * normal()).clamp(10e5, 60e5);
        z.unknown_flow = d.unknown_flow * normal();
        let noisy = |z: &MachineState<f64>, mean: f64, a: f64, b: f64| EstimatorInput {
            position: model.piston(z) - sensor_lag * z.velocity + filter.measurement_noise[0] * a,
            load_pressure: z.load_pressure + filter.measurement_noise[1] * b,
            ..measured(&model, z, mean)
        };
        let mut state = filter.start(&noisy(&z, 0.0, normal(), normal()));
        for k in 0..8000 {
            let time = f64::from(k) * PERIOD;
            let holding = model.leakage(z.load_pressure);
            let speed = holding + 15.0 * (3.0 * time).sin() + 4.0 * (11.0 * time).sin();
            z = model.step(&z, speed, BEYOND, PERIOD);
            let at = model.at(z.position, z.payload);
            let oil = model.bulk_modulus(z.load_pressure, z.transition_pressure, BEYOND);
            let by_speed = model.displacement * model.stiffness(&at, oil);
            let load_pressure = by_speed * filter.flow_ripple;
            let q = MachineState { load_pressure, ..filter.process_noise }.to_array();
            let moved: [f64; STATES] = z.to_array();
            z = MachineState::from_array(std::array::from_fn(|i| {
                moved[i] + q[i] * PERIOD.sqrt() * normal()
            }));
            filter.update(&mut state, &noisy(&z, speed, normal(), normal()));
            if k % 500 == 499 && k > 1000 {
                total += 1;
                let (found, sigma) =
                    (state.estimate.to_array(), filter.deviation(&state).to_array());
                for i in 0..STATES {
                    inside[i] += u32::from((found[i] - z.to_array()[i]).abs() < 2.0 * sigma[i]);
                }
            }
        }
    }
    // 95 % of a normal distribution; 168 samples, partly correlated, scatter by 3 %
    inside.map(|count| f64::from(count) / f64::from(total))
}

/// Signals that are not good change nothing, at any value. The estimates stay finite and are predicted by
/// the model.
#[test]
fn invalid_signals_do_not_update_the_estimates() {
    let (estimator, _) = crane(1);
    let model = estimator.filter.model;
    let z = at_rest(&model, 0.2, 250.0);
    let good = measured(&model, &z, model.leakage(z.load_pressure));
    let mut state = estimator.start(&good);
    let command = good.motor_speed;
    for _ in 0..500 {
        estimator.update(&mut state, &good, command);
    }
    let before = estimator.filter.deviation(&state.filter);
    let lost = EstimatorInput {
        position: f64::NAN,
        position_is_good: 0.0,
        load_pressure: f64::INFINITY,
        load_pressure_is_good: 0.0,
        ..good
    };
    for _ in 0..50 {
        estimator.update(&mut state, &lost, command);
    }
    let now = state.filter.estimate;
    assert!(now.to_array().into_iter().all(f64::is_finite), "{now:?}");
    assert!((now.position - z.position).abs() < 1e-4, "{now:?}");
    // what is not measured is known less and less
    let deviation = estimator.filter.deviation(&state.filter);
    assert!(deviation.position > before.position, "{deviation:?}, {before:?}");
    assert!(deviation.load_pressure > before.load_pressure, "{deviation:?}, {before:?}");
}

/// Smallest eigenvalue of a covariance, each error over its deviation.
fn smallest_eigenvalue<const N: usize>(p: &[[f64; N]; N]) -> f64 {
    let scaled = nalgebra::SMatrix::<f64, N, N>::from_fn(|i, j| {
        p[i][j] / (p[i][i] * p[j][j]).sqrt().max(f64::MIN_POSITIVE)
    });
    let all = nalgebra::DMatrix::from_column_slice(N, N, scaled.as_slice());
    all.symmetric_eigenvalues().min()
}

/// Parameters are restored with a far smaller variance than the present one. Both covariances stay positive
/// semidefinite, and neither falls below the retained variance while the parameters are frozen.
#[test]
fn covariances_stay_valid_when_parameters_are_restored_or_frozen() {
    let (estimator, _) = crane(1);
    let model = estimator.filter.model;
    let mut z = at_rest(&model, 0.2, 250.0);
    let holding = model.leakage(z.load_pressure);
    let mut state = estimator.start(&measured(&model, &z, holding));
    let mut moved = |estimator: &StateEstimator<f64>, state: &mut _, is_frozen: bool| {
        for k in 0..1500 {
            let speed = holding + 8.0 * (0.01 * f64::from(k)).sin();
            z = model.step(&z, speed, BEYOND, PERIOD);
            let good = measured(&model, &z, speed);
            estimator.update_frozen(state, &good, speed, is_frozen);
        }
        measured(&model, &z, holding)
    };
    let good = moved(&estimator, &mut state, false);
    estimator.hold(&mut state, &good);
    let retained = RetainedParameters {
        flow_variance: 1e-6,
        transition_variance: 1e6,
        flow_transition_covariance: 0.5,
        ..RetainedParameters::of(&state)
    };
    estimator.restore(&mut state, &retained, true);
    let check = |state: &StateEstimatorState<f64>| {
        let filter = &state.filter;
        for smallest in
            [smallest_eigenvalue(&filter.covariance), smallest_eigenvalue(&filter.errors)]
        {
            assert!(smallest > -1e-9, "{smallest:e}");
        }
    };
    check(&state);
    moved(&estimator, &mut state, true);
    check(&state);
    let after = RetainedParameters::of(&state);
    assert_eq!(after.unknown_flow, retained.unknown_flow);
    assert_eq!(after.transition_pressure, retained.transition_pressure);
    assert!(after.flow_variance >= retained.flow_variance, "{after:?}");
    assert!(after.transition_variance >= retained.transition_variance, "{after:?}");
    moved(&estimator, &mut state, false);
    check(&state);
    assert!(RetainedParameters::of(&state).unknown_flow != retained.unknown_flow);
}

/// Law and estimator on the reduced model: rest, motion and rest again.
#[test]
fn the_law_follows_the_reference_on_the_reduced_model() {
    for delay_cycles in [0, 1, 2, 20] {
        let (estimator, law) = crane(delay_cycles);
        let model = estimator.filter.model;
        let mut z = at_rest(&model, 0.2, 250.0);
        // the crane's oil stiffens at another pressure than the filter starts with
        z.transition_pressure = 42e5;
        let mut speed = model.leakage(z.load_pressure);
        let first = measured(&model, &z, speed);
        let mut estimated = estimator.start(&first);
        let mut state = law.start(
            law.settled_regulator(&estimator, &estimated),
            &estimator,
            &estimated,
            first.position,
        );
        let mut preview = Preview::new(PERIOD, reference);
        let mut readings = vec![first; delay_cycles + 1];
        let mut commands = vec![speed; delay_cycles + 1];
        let mut largest = 0.0_f64;
        for k in 0..3000 {
            let time = f64::from(k) * PERIOD;
            let command = law.update(&mut state, &estimator, &estimated, &preview);
            commands.push(command);
            let arrived = commands[commands.len() - 1 - delay_cycles];
            let next = speed + 0.15 * (arrived - speed);
            z = model.step(&z, 0.5 * (speed + next), BEYOND, PERIOD);
            speed = next;
            readings.push(measured(&model, &z, speed));
            let read = readings[readings.len() - 1 - delay_cycles];
            estimator.update(&mut estimated, &read, command);
            preview.advance(|after| reference(time + PERIOD + after));
            largest = largest.max((model.piston(&z) - reference(time + PERIOD).position).abs());
        }
        assert!(largest < 0.6e-3, "{delay_cycles} cycles: {largest} m");
        assert!((model.piston(&z) - 0.26).abs() < 0.05e-3, "{delay_cycles} cycles: {z:?}");
        let found = estimated.filter.estimate.transition_pressure;
        let sigma = estimator.filter.deviation(&estimated.filter).transition_pressure;
        assert!((found - 42e5).abs() < 2.0 * sigma, "{found} ± {sigma}");
        // at rest nothing excites the oil: what is known of it stays known
        let still = measured(&model, &z, speed);
        for _ in 0..20_000 {
            estimator.update(&mut estimated, &still, speed);
        }
        let after = estimator.filter.deviation(&estimated.filter).transition_pressure;
        assert!(after <= sigma, "{delay_cycles} cycles: {after} after {sigma}");
    }
}

/// The largest fieldbus delay of a crane file is the largest delay that the estimator compensates.
#[test]
fn every_permitted_fieldbus_delay_is_compensated() {
    let key = KEYS.iter().find(|key| key.path() == "fieldbus.delay_cycles").unwrap();
    assert_eq!(key.high, LARGEST_DELAY as f64);
}

/// For any input, law and estimator give finite numbers, and commands within the speed limit of the motor.
#[test]
fn commands_stay_within_motor_limits_for_any_measurement() {
    let (estimator, law) = crane(1);
    let model = estimator.filter.model;
    let z = at_rest(&model, 0.2, 250.0);
    let first = measured(&model, &z, 0.0);
    let mut random = Pcg64Mcg::seed_from_u64(7);
    let mut estimated = estimator.start(&first);
    let mut state = law.start(
        law.settled_regulator(&estimator, &estimated),
        &estimator,
        &estimated,
        first.position,
    );
    let preview = Preview::at_rest(PERIOD, 0.2);
    for _ in 0..3000 {
        let wild = EstimatorInput {
            position: random.random_range(0.0..0.5),
            load_pressure: random.random_range(-1e6..3e7),
            rod_side_term: random.random_range(0.0..5e6),
            motor_speed: random.random_range(-50.0..50.0),
            ..first
        };
        estimator.update(&mut estimated, &wild, state.command);
        let command = law.update(&mut state, &estimator, &estimated, &preview);
        assert!(command.abs() <= law.motor_speed, "{command}");
        let deviations = estimator.filter.deviation(&estimated.filter).to_array();
        assert!(deviations.into_iter().all(f64::is_finite), "{deviations:?}");
    }
}

/// One Riccati step per period, starting from zero, converges to the settled regulator within two seconds.
/// No period therefore needs more than one step.
#[test]
fn one_riccati_step_per_period_converges() {
    let (estimator, law) = crane(1);
    let model = estimator.filter.model;
    for payload in [0.0, 100.0, 307.0] {
        let z = at_rest(&model, 0.25, payload);
        let estimated = estimator.start(&measured(&model, &z, 0.0));
        let settled = law.settled_regulator(&estimator, &estimated);
        let mut followed = None;
        for _ in 0..2000 {
            followed = Some(law.follow_operating_point(followed, &estimator, &estimated));
        }
        let gains = followed.unwrap().gain.into_iter().zip(settled.gain);
        for (found, wanted) in gains {
            assert!((found - wanted).abs() < 1e-3 * wanted.abs(), "{payload} kg: {found} {wanted}");
        }
    }
}

/// A load that is removed at once displaces the piston by more than feedback may command. With the rollout
/// it returns sooner.
#[test]
fn the_rollout_returns_a_displaced_piston_sooner() {
    let squares = |improvement: f64| {
        let (estimator, mut law) = crane(1);
        law.rollout.improvement = improvement;
        let model = estimator.filter.model;
        let mut z = at_rest(&model, 0.25, 250.0);
        z.transition_pressure = 45e5;
        let mut speed = model.leakage(z.load_pressure);
        let first = measured(&model, &z, speed);
        let mut estimated = estimator.start(&first);
        let regulator = law.settled_regulator(&estimator, &estimated);
        let mut state = law.start(regulator, &estimator, &estimated, first.position);
        let preview = Preview::at_rest(PERIOD, 0.25);
        let (mut readings, mut commands) = (vec![first; 2], vec![speed; 2]);
        let mut sum = 0.0;
        for k in 0..9000 {
            if k == 500 {
                z.payload = 100.0;
            }
            let command = law.update(&mut state, &estimator, &estimated, &preview);
            commands.push(command);
            let arrived = commands[commands.len() - 2];
            let next = (speed + 0.15 * (arrived - speed)).clamp(speed - law.slew, speed + law.slew);
            z = model.step(&z, 0.5 * (speed + next), BEYOND, PERIOD);
            speed = next;
            readings.push(measured(&model, &z, speed));
            estimator.update(&mut estimated, &readings[readings.len() - 2], command);
            sum += (model.piston(&z) - 0.25).powi(2) * PERIOD;
        }
        assert!((model.piston(&z) - 0.25).abs() < 0.5e-3, "{z:?}");
        sum
    };
    let (with, without) = (squares(0.01), squares(1.0));
    assert!(with < 0.9 * without, "{with} with, {without} without");
}

/// A piston 60 mm from its reference: the governor leaves no more than its largest error to feedback, and
/// the reference returns no faster than the governor's velocity.
#[test]
fn the_governor_moves_the_reference_towards_a_distant_piston() {
    let (estimator, law) = crane(0);
    let model = estimator.filter.model;
    let mut z = at_rest(&model, 0.31, 250.0);
    let mut speed = model.leakage(z.load_pressure);
    let mut estimated = estimator.start(&measured(&model, &z, speed));
    let regulator = law.settled_regulator(&estimator, &estimated);
    let mut state = law.start(regulator, &estimator, &estimated, 0.25);
    let preview = Preview::at_rest(PERIOD, 0.25);
    let mut before = None;
    for _ in 0..9000 {
        let found = model.piston(&estimated.filter.estimate);
        let command = law.update(&mut state, &estimator, &estimated, &preview);
        let left = found - 0.25 - state.offset;
        assert!(left.abs() < law.governor.largest_error + 1e-9, "{left} m are left to feedback");
        if let Some(before) = before.replace(state.offset) {
            let velocity = (before - state.offset) / PERIOD;
            // where the piston, which may be faster, does not take it along
            let returns = left.abs() < law.governor.largest_error - 1e-9;
            let is_slow = velocity < law.governor.velocity + 1e-9;
            assert!(is_slow || !returns, "{velocity} m/s");
        }
        let next = (speed + 0.15 * (command - speed)).clamp(speed - law.slew, speed + law.slew);
        z = model.step(&z, 0.5 * (speed + next), BEYOND, PERIOD);
        speed = next;
        estimator.update(&mut estimated, &measured(&model, &z, speed), command);
    }
    assert!((model.piston(&z) - 0.25).abs() < 0.1e-3 && state.offset.abs() < 0.1e-3, "{z:?}");
}
