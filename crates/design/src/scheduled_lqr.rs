//! State estimator and gain-scheduled LQR for a crane.

use crate::{DesignError, reduced_model_fit::reduced_model};
use hydroboom_control::estimation::drive_identification::DriveIdentification;
use hydroboom_control::estimation::error_covariance::ConsideredParameters;
use hydroboom_control::estimation::extended_kalman_filter::ExtendedKalmanFilter;
use hydroboom_control::estimation::innovation_test::InnovationTest;
use hydroboom_control::estimation::reduced_model::{MachineState, ReducedModel};
use hydroboom_control::estimation::state_estimator::StateEstimator;
use hydroboom_control::feedback::rollout::Rollout;
use hydroboom_control::feedback::scheduled_lqr::{ScheduledLqr, ScheduledLqrSettings};
use hydroboom_control::feedback::scheduled_lqr_controller::ScheduledLqrController;
use hydroboom_control::reference::governor::ReferenceGovernor;
use hydroboom_description::{Description, Numbers, Ranges};
use hydroboom_math::Real;
use std::f64::consts::TAU;

/// State estimator for the crane of a description. `delay_cycles` is the delay of measurements, and of commands
/// \[control periods\].
///
/// ```
/// use hydroboom_control::estimation::extended_kalman_filter::EstimatorInput;
/// use hydroboom_description::Description;
/// use hydroboom_design::{reduced_model_fit::reduced_model, scheduled_lqr::state_estimator};
///
/// let description = Description::uia_single_boom()?;
/// let model = reduced_model(&description)?;
/// let measured = EstimatorInput {
///     position: 0.25,
///     position_is_good: 1.0,
///     load_pressure: model.at(0.25, 200.0).holding_pressure,
///     load_pressure_is_good: 1.0,
///     rod_side_term: 1.5e5,
///     motor_speed: 0.0,
/// };
/// // the pressure of a load at rest shows its mass
/// let state = state_estimator(&description, &model, 2).start(&measured);
/// assert!((state.filter.estimate.payload - 200.0).abs() < 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn state_estimator(
    description: &Description,
    model: &ReducedModel<f64>,
    delay_cycles: usize,
) -> StateEstimator<f64> {
    let n = &description.numbers;
    let tuning = &n.tuning;
    // where the crane file has no sensors, those of its virtual crane
    let (equipped, _) = description.virtual_crane();
    let sensors = &equipped.numbers;
    let range = description.ranges();
    let per_kg = pressure_per_payload(model);
    let [lowest, highest] = state_limits(n, model);
    let position = sensors.position_noise.hypot(sensors.position_resolution / 12_f64.sqrt());
    let pressure = sensors.pressure_noise * sensors.pressure_span;
    let filter = ExtendedKalmanFilter {
        model: *model,
        initial_deviation: initial_deviation(n, &range, model),
        process_noise: process_noise(n, model),
        flow_ripple: tuning.estimator_flow_ripple,
        lowest,
        highest,
        measurement_noise: [
            position.max(tuning.estimator_position_noise),
            pressure.hypot(tuning.estimator_pressure_noise),
        ],
        noise_memory: tuning.estimator_noise_memory,
        excitation_velocity: tuning.estimator_excitation_velocity,
        divergence_time: tuning.estimator_divergence_time,
        sensor_lag: match sensors.sensor_bandwidth > 0.0 {
            true => 1.0 / (TAU * sensors.sensor_bandwidth),
            false => 0.0,
        },
        considered: considered_parameters(n, &range, model),
        payload_arm: tuning.estimator_payload_position / n.payload_x.max(1e-3),
        payload_change: uniform_deviation(0.0, model.maximum_payload),
        force_change: uniform_deviation(0.0, model.maximum_payload) * per_kg.abs(),
        payload_variance_limit: tuning.estimator_payload_variance_limit,
        innovation_test: InnovationTest {
            time_constant: tuning.estimator_nis_time,
            threshold: tuning.estimator_nis_threshold,
            inconsistent: tuning.estimator_nis_inconsistent,
            certain: tuning.estimator_nis_certain,
        },
        period: n.control_period,
    };
    // of a first-order lag in a period
    let share = |lag: f64| 1.0 - (-n.control_period / lag).exp();
    StateEstimator {
        filter,
        drive: DriveIdentification {
            memory: tuning.estimator_drive_memory,
            speed_noise: tuning.estimator_speed_noise,
            largest_deviation: tuning.estimator_drive_deviation,
            smallest: share(tuning.estimator_longest_drive_lag),
            largest: share(tuning.estimator_shortest_drive_lag),
        },
        drive_coefficient: share(tuning.estimator_drive_lag),
        slew: n.motor_slew * n.control_period,
        free_slew: tuning.estimator_free_slew,
        measurement_delay_cycles: delay_cycles,
        command_delay_cycles: delay_cycles,
    }
}

/// Standard deviation of a value that is anywhere in its range: a uniform distribution.
fn uniform_deviation(low: f64, high: f64) -> f64 {
    (high - low) / 12_f64.sqrt()
}

/// Pressure that holds a payload, over its mass, in the middle of the stroke \[Pa/kg\].
fn pressure_per_payload(model: &ReducedModel<f64>) -> f64 {
    let heavy = model.at(model.half_stroke, model.maximum_payload).holding_pressure;
    (heavy - model.at(model.half_stroke, 0.0).holding_pressure) / model.maximum_payload
}

/// Standard deviations of the initial state.
fn initial_deviation(
    n: &Numbers<f64>,
    range: &Ranges,
    model: &ReducedModel<f64>,
) -> MachineState<f64> {
    let tuning = &n.tuning;
    let middle = model.at(model.half_stroke, n.payload);
    let breakaway = (range.high.coulomb + range.high.stiction) / model.piston_area;
    let worn = range.high.internal_leakage / n.internal_leakage.max(1e-15);
    let leakage = model.leakage(middle.holding_pressure)
        * Real::clamp(worn - 1.0, tuning.estimator_least_leakage, tuning.estimator_most_leakage);
    MachineState {
        position: tuning.estimator_initial_position,
        velocity: tuning.estimator_initial_velocity,
        load_pressure: tuning.estimator_initial_pressure,
        friction: model.coulomb,
        disturbance: tuning.estimator_initial_disturbance,
        unknown_flow: leakage,
        payload: breakaway / pressure_per_payload(model).abs() / 3_f64.sqrt(),
        transition_pressure: uniform_deviation(range.low.transition, range.high.transition),
    }
}

/// Process noise: drift of each state.
fn process_noise(n: &Numbers<f64>, model: &ReducedModel<f64>) -> MachineState<f64> {
    let tuning = &n.tuning;
    MachineState {
        position: tuning.estimator_position_drift,
        velocity: tuning.estimator_velocity_drift,
        load_pressure: 0.0,
        friction: tuning.estimator_friction_drift,
        disturbance: tuning.estimator_disturbance_drift,
        unknown_flow: tuning.estimator_flow_drift,
        payload: tuning.estimator_payload_drift * model.maximum_payload,
        transition_pressure: tuning.estimator_transition_drift,
    }
}

/// Lowest and highest value of each state.
fn state_limits(n: &Numbers<f64>, model: &ReducedModel<f64>) -> [MachineState<f64>; 2] {
    let tuning = &n.tuning;
    let highest = MachineState {
        position: 2.0 * n.stroke,
        velocity: tuning.estimator_largest_velocity,
        load_pressure: tuning.estimator_largest_pressure,
        friction: tuning.estimator_largest_friction * model.coulomb,
        disturbance: tuning.estimator_largest_disturbance,
        unknown_flow: tuning.estimator_largest_flow * n.motor_speed,
        payload: model.maximum_payload,
        transition_pressure: tuning.estimator_highest_transition,
    };
    let lowest = MachineState {
        payload: 0.0,
        transition_pressure: tuning.estimator_lowest_transition,
        ..highest.map(|value| -value)
    };
    [lowest, highest]
}

/// Standard deviations of the consider parameters, which the filter does not estimate.
fn considered_parameters(
    n: &Numbers<f64>,
    range: &Ranges,
    model: &ReducedModel<f64>,
) -> ConsideredParameters<f64> {
    // a value that stands to one side of its range is off by more than the range's own deviation
    let about = |value: f64, low: f64, high: f64| {
        uniform_deviation(low, high).hypot(0.5 * (low + high) - value)
    };
    ConsideredParameters {
        coulomb: about(n.coulomb, range.low.coulomb, range.high.coulomb) / model.piston_area,
        viscous: about(n.viscous, range.low.viscous, range.high.viscous) / model.piston_area,
        displacement: model.displacement
            * (about(n.displacement, range.low.displacement, range.high.displacement)
                / n.displacement)
                .hypot(about(n.flow_gain, range.low.flow_gain, range.high.flow_gain) / n.flow_gain),
        equivalent_mass: n.tuning.estimator_mass_deviation,
        sensor_lag: n.tuning.estimator_sensor_lag,
    }
}

/// Scheduled LQR for the crane of a description, without its state estimator.
pub fn scheduled_lqr(description: &Description, model: &ReducedModel<f64>) -> ScheduledLqr<f64> {
    let n = &description.numbers;
    let tuning = &n.tuning;
    ScheduledLqr {
        model: *model,
        settings: ScheduledLqrSettings {
            position_tolerance: tuning.lqr_position,
            velocity_tolerance: tuning.lqr_velocity,
            command_tolerance: tuning.lqr_command,
            feedback_limit: tuning.lqr_feedback,
            position_limit: tuning.lqr_position_feedback,
            filling_share: tuning.lqr_filling,
            filling_friction: tuning.lqr_filling_friction,
            shortest_window: tuning.lqr_shortest_window,
            longest_window: tuning.lqr_longest_window,
            window_time_constant: tuning.lqr_window_time,
        },
        governor: ReferenceGovernor {
            largest_error: tuning.lqr_governor_error,
            rate: tuning.lqr_governor_rate,
            rate_by_frequency: tuning.lqr_governor_rate_by_mode,
            velocity: tuning.lqr_governor_speed * n.motor_speed / model.revolutions_per_metre(),
        },
        rollout: Rollout {
            horizon: tuning.lqr_rollout_horizon,
            short: tuning.lqr_rollout_short,
            long: tuning.lqr_rollout_long,
            improvement: tuning.lqr_rollout_improvement,
            offset: tuning.lqr_rollout_offset,
            payload_probability: tuning.lqr_payload_probability,
        },
        motor_speed: n.motor_speed,
        slew: n.motor_slew * n.control_period,
        period: n.control_period,
    }
}

/// Scheduled LQR with its state estimator for the crane of a description, with the crane file's fieldbus delay.
///
/// ```
/// use hydroboom_control::measurement::{AxisSignals, Measurement};
/// use hydroboom_description::Description;
/// use hydroboom_design::scheduled_lqr::scheduled_lqr_controller;
/// use hydroboom_model::Scheme;
/// use hydroboom_plant::plant;
///
/// let description = Description::uia_single_boom()?;
/// let mut controller = scheduled_lqr_controller(&description)?;
/// let rest = plant(&description, &description.start(0.25), Scheme::Implicit, 1e-3)?.outputs();
/// let (stroke, pressure_a, pressure_b) = (rest.stroke, rest.pressure_a, rest.pressure_b);
/// let signals = AxisSignals { stroke, pressure_a, pressure_b, ..AxisSignals::default() };
/// controller.observe_held(&Measurement::new(1, 0.0, [signals]));
/// // the held load is weighed within 2 kg by the first measurement
/// let payload = controller.estimated().map(|estimated| estimated.filter.estimate.payload);
/// assert!(payload.is_some_and(|mass| (mass - description.numbers.payload).abs() < 2.0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
///
/// As [`reduced_model`].
pub fn scheduled_lqr_controller(
    description: &Description,
) -> Result<ScheduledLqrController, DesignError> {
    let (estimator, law) = designed(description, known_delay(description) as usize)?;
    Ok(ScheduledLqrController::new(estimator, law, description.cylinder().area_ratio()))
}

/// Fieldbus delay of measurements, and of commands \[control periods\], by the crane file, or that of a typical
/// fieldbus.
pub fn known_delay(description: &Description) -> u32 {
    let (equipped, _) = description.virtual_crane();
    equipped.numbers.fieldbus_delay.round() as u32
}

/// State estimator and scheduled LQR for the crane of a description. `delay_cycles` is the delay of measurements, and
/// of commands \[control periods\].
///
/// # Errors
///
/// As [`reduced_model`].
pub fn designed(
    description: &Description,
    delay_cycles: usize,
) -> Result<(StateEstimator<f64>, ScheduledLqr<f64>), DesignError> {
    let model = reduced_model(description)?;
    Ok((state_estimator(description, &model, delay_cycles), scheduled_lqr(description, &model)))
}
