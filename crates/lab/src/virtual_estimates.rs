//! Estimates compared with true values: the state estimator of the scheduled LQR runs beside the virtual
//! crane under any command.
//!
//! The estimator is designed for the model's crane file alone. Its inputs are measurements and commands.
//! True values are those at the time of the measurement, which the fieldbus delays by some control periods.
//! Outputs that are not states get their standard deviation from the error covariance P by first-order
//! propagation, σ² = ∇h P ∇hᵀ, with exact derivatives.

use crate::closed_loop::sample::Sample;
use crate::closed_loop::scenario::{Load, due};
use hydroboom_control::estimation::error_covariance::{ERRORS, as_variables, output_deviation};
use hydroboom_control::estimation::reduced_model::{MachineState, ReducedModel};
use hydroboom_control::estimation::tip::{TipEstimator, TipMemory};
use hydroboom_control::feedback::scheduled_lqr_controller::ScheduledLqrController;
use hydroboom_control::measurement::Measurement;
use hydroboom_description::Description;
use hydroboom_design::scheduled_lqr::scheduled_lqr_controller;
use hydroboom_design::tip::tip_estimator;
use hydroboom_math::{Dual, Real};
use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};
use std::collections::VecDeque;

/// Names of the estimates with their units, and these units in SI units.
const QUANTITIES: [(&str, f64); 10] = [
    ("payload_kg", 1.0),
    ("load_pressure_bar", 1e5),
    ("piston_velocity_mm_s", 1e-3),
    ("transition_pressure_bar", 1e5),
    // cylinder friction, pre-sliding and viscous
    ("friction_n", 1.0),
    ("disturbance_bar", 1e5),
    ("unknown_flow_rpm", 1.0 / 60.0),
    // relative to the boom's bearing, x and y
    ("tip_x_mm", 1e-3),
    ("tip_y_mm", 1e-3),
    ("drive_lag_ms", 1e-3),
];
/// Number of quantities from the filter's state: all except the last.
const FILTERED: usize = QUANTITIES.len() - 1;
/// Number of quantities before the tip.
pub(crate) const OF_STATE: usize = FILTERED - 2;
/// Index of the payload.
const PAYLOAD: usize = 0;
/// Names of the innovations with their units, and these units in SI units.
const INNOVATIONS: [(&str, f64); 2] = [("position_mm", 1e-3), ("load_pressure_bar", 1e5)];

/// Estimate of one quantity compared with its true value, in the unit at the end of its name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Compared {
    /// Estimate at the end of the run, in the unit of the name.
    pub estimated: f64,
    /// Standard deviation of the estimate; none for the drive's lag, which is estimated by recursive least squares.
    pub deviation: Option<f64>,
    /// True value at the end of the run; none if the crane has no such quantity.
    #[serde(rename = "true")]
    pub true_value: Option<f64>,
    /// RMS error over the run; none without a true value.
    pub rms_error: Option<f64>,
}

/// Estimates at the end of a run, and their errors over the run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EstimateSummary([Compared; QUANTITIES.len()]);

impl EstimateSummary {
    /// Names of the quantities, which end in the unit, and their estimates.
    pub fn iter(&self) -> impl Iterator<Item = (&'static str, &Compared)> {
        QUANTITIES.iter().map(|(name, _)| *name).zip(&self.0)
    }
}

impl Serialize for EstimateSummary {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let mut map = to.serialize_map(Some(QUANTITIES.len()))?;
        for (name, compared) in self.iter() {
            map.serialize_entry(name, compared)?;
        }
        map.end()
    }
}

/// State estimator in parallel with a run, with the true values.
pub(crate) struct ParallelEstimator<'a> {
    controller: ScheduledLqrController,
    /// Tip estimator; none if the tip is not estimated.
    tip: Option<TipEstimator<f64>>,
    tip_memory: TipMemory<f64>,
    area_ratio: f64,
    delay: usize,
    /// Payload \[kg\], and later load changes.
    payload: f64,
    loads: &'a [Load],
    /// Whether the load-holding valve was open in the last period, and the commanded motor speed \[rev/s\].
    is_released: bool,
    command: f64,
    number: u64,
    /// True values since the sampling of the next measurement to arrive, newest last.
    past: VecDeque<[Option<f64>; FILTERED]>,
    /// Estimates in SI units.
    estimated: [f64; QUANTITIES.len()],
    deviation: [f64; FILTERED],
    truth: [Option<f64>; FILTERED],
    square_errors: [f64; FILTERED],
    compared: u64,
}

impl<'a> ParallelEstimator<'a> {
    /// None if the model has no such design, or its control period differs from the crane's.
    pub(crate) fn new(
        model: &Description,
        crane: &Description,
        loads: &'a [Load],
        is_released: bool,
    ) -> Option<Self> {
        if model.numbers.control_period != crane.numbers.control_period {
            return None;
        }
        Some(Self {
            controller: scheduled_lqr_controller(model).ok()?,
            tip: tip_estimator(model),
            tip_memory: TipMemory::default(),
            area_ratio: crane.cylinder().area_ratio(),
            delay: crane.numbers.fieldbus_delay.round() as usize,
            payload: crane.numbers.payload,
            loads,
            is_released,
            command: 0.0,
            number: 0,
            past: VecDeque::new(),
            estimated: [f64::NAN; QUANTITIES.len()],
            deviation: [f64::NAN; FILTERED],
            truth: [None; FILTERED],
            square_errors: [0.0; FILTERED],
            compared: 0,
        })
    }

    /// Names of the columns of [`row`](Self::row).
    pub(crate) fn header() -> impl Iterator<Item = String> {
        let estimated = QUANTITIES.iter().map(|(name, _)| format!("estimated_{name}"));
        let deviation = QUANTITIES[..FILTERED].iter().map(|(name, _)| format!("deviation_{name}"));
        let innovation = INNOVATIONS.iter().map(|(name, _)| format!("innovation_{name}"));
        estimated.chain(deviation).chain(innovation).chain(["mean_nis".into()])
    }

    /// Estimates, their standard deviations and the innovations in the units of their names.
    pub(crate) fn row(&self) -> impl Iterator<Item = f64> {
        let (mut innovation, mut mean_nis) = ([f64::NAN; INNOVATIONS.len()], f64::NAN);
        if let Some(estimated) = self.controller.estimated() {
            (innovation, mean_nis) = (estimated.filter.innovation, estimated.filter.mean_nis);
        }
        let units = QUANTITIES.iter().map(|(_, unit)| unit);
        let estimated = self.estimated.into_iter().zip(units.clone()).map(|(v, unit)| v / unit);
        let deviation = self.deviation.into_iter().zip(units).map(|(v, unit)| v / unit);
        let innovation = innovation.into_iter().zip(INNOVATIONS).map(|(v, (_, unit))| v / unit);
        estimated.chain(deviation).chain(innovation).chain([mean_nis])
    }

    /// Processes a control period.
    pub(crate) fn see(&mut self, sample: &Sample) {
        self.number += 1;
        let measurement = Measurement::new(self.number, sample.time, [sample.signals]);
        match self.is_released {
            true => self.controller.observe(&measurement, self.command),
            false => self.controller.observe_held(&measurement),
        }
        if let (Some(tip), Some(estimated)) = (&self.tip, self.controller.estimated()) {
            let filter = &self.controller.estimator().filter;
            tip.update(&mut self.tip_memory, filter, &estimated.filter);
        }
        self.is_released = sample.command.holding_valve >= 0.5;
        self.command = sample.command.motor_speed;
        self.payload = due(&mut self.loads, sample.time).unwrap_or(self.payload);
        self.past.push_back(self.true_values(sample));
        // the estimator has no measurement before the delay has passed
        if self.past.len() > self.delay + 1 {
            self.past.pop_front();
        }
        self.estimate(sample.signals.motor_speed);
    }

    fn true_values(&self, sample: &Sample) -> [Option<f64>; FILTERED] {
        let o = &sample.truth.outputs;
        let load_pressure = o.pressure_a - self.area_ratio * o.pressure_b;
        let transition = sample.truth.transition_pressure;
        let known = [self.payload, load_pressure, o.velocity, transition, o.friction_force];
        let tip = [o.tip_x, o.tip_y];
        core::array::from_fn(|k| match k.checked_sub(OF_STATE) {
            Some(direction) => tip.get(direction).copied(),
            None => known.get(k).copied(),
        })
    }

    /// Compares the newest estimates with the truth at their measurement; `motor_speed` is the measured one
    /// \[rev/s\].
    fn estimate(&mut self, motor_speed: f64) {
        let Some(estimated) = self.controller.estimated() else { return };
        let (filter, rod_side_term) = (&estimated.filter, estimated.rod_side_term);
        let settings = &self.controller.estimator().filter;
        let constant = Dual::<f64, ERRORS>::constant;
        let (model, z) = as_variables(&settings.model, &filter.estimate);
        let found = quantities(&model, &z, constant(motor_speed), constant(rod_side_term));
        self.truth = self.past.front().copied().unwrap_or_default();
        let mut found = found.map(|h| (h.value, output_deviation(&filter.errors, &h.slope)));
        found[PAYLOAD].1 = settings.payload_deviation(filter);
        let tip = self.tip.map(|tip| tip.estimate(&self.tip_memory, &settings.model, filter));
        let tip = tip.map_or([(f64::NAN, f64::NAN); 2], |tip| {
            [(tip.x, tip.deviation_x), (tip.y, tip.deviation_y)]
        });
        for (k, (value, deviation)) in found.into_iter().chain(tip).enumerate() {
            (self.estimated[k], self.deviation[k]) = (value, deviation);
            self.square_errors[k] += (value - self.truth[k].unwrap_or(value)).powi(2);
        }
        self.estimated[FILTERED] = estimated.drive.time_constant(settings.period);
        self.compared += 1;
    }

    /// Summary; none if nothing was estimated.
    pub(crate) fn summary(&self) -> Option<EstimateSummary> {
        (self.compared > 0).then(|| {
            EstimateSummary(core::array::from_fn(|k| {
                let unit = QUANTITIES[k].1;
                let truth = self.truth.get(k).copied().flatten();
                let rms = |sum: f64| (sum / self.compared as f64).sqrt() / unit;
                Compared {
                    estimated: self.estimated[k] / unit,
                    deviation: self.deviation.get(k).map(|deviation| deviation / unit),
                    true_value: truth.map(|value| value / unit),
                    rms_error: truth.and(self.square_errors.get(k).copied()).map(rms),
                }
            }))
        })
    }
}

/// Estimated quantities of a filter state in the order of [`QUANTITIES`], at a motor speed \[rev/s\].
pub(crate) fn quantities<T: Real>(
    model: &ReducedModel<T>,
    z: &MachineState<T>,
    motor_speed: T,
    rod_side_term: T,
) -> [T; OF_STATE] {
    [
        z.payload,
        z.load_pressure,
        model.piston_velocity(z, motor_speed, rod_side_term),
        z.transition_pressure,
        model.piston_area * model.viscous.mul_add(z.velocity, z.friction),
        z.disturbance,
        z.unknown_flow,
    ]
}
