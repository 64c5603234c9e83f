//! Checks for impossible and for implausible machines.

use crate::Description;
use crate::schema::{
    CircuitChoice, DeliveryChoice, FrictionChoice, KEYS, ReliefChoice, StructureChoice,
};
use hydroboom_math::Dual;
use hydroboom_model::EquilibriumError;
use hydroboom_model::hydraulics::{FrictionLaw, Stribeck};

/// Largest magnitude of a negative determinant of a correlation matrix that rounding to a crane file's digits explains.
const ROUNDED: f64 = 1e-3;

impl Description {
    /// The first condition that makes the machine impossible, if any: a key involved, the reason, and the remedy.
    pub(crate) fn impossible(&self) -> Option<(&'static str, String, String)> {
        let n = &self.numbers;
        let mm = 1e3;
        if n.rod >= n.piston {
            return Some((
                "cylinder.rod_mm",
                format!(
                    "the rod ({:.1} mm) is not thinner than the piston ({:.1} mm)",
                    n.rod * mm,
                    n.piston * mm
                ),
                "exchange cylinder.rod_mm and cylinder.piston_mm, or check both".into(),
            ));
        }
        let reach = match self.choices.structure {
            StructureChoice::Beam => n.boom_length,
            StructureChoice::Links => n.link_1_length,
        };
        if n.mount_x > reach {
            return Some((
                "geometry.mount_x_mm",
                format!(
                    "the cylinder's mount at {:.0} mm lies beyond the end of what carries it, {:.0} mm",
                    n.mount_x * mm,
                    reach * mm
                ),
                "geometry.mount_x_mm is measured from the bearing along the boom".into(),
            ));
        }
        // the triangle of bearing, foot and mount must close over the whole stroke
        let (b, c) = (n.base_x.hypot(n.base_y), n.mount_x.hypot(n.mount_y));
        let (nearest, farthest) = ((b - c).abs(), b + c);
        let longest = n.shortest + n.stroke;
        if n.shortest <= nearest || longest >= farthest {
            return Some((
                "geometry.shortest_mm",
                format!(
                    "the cylinder cannot reach: it is {:.0} to {:.0} mm long, its mounts are \
                     {:.0} to {:.0} mm apart",
                    n.shortest * mm,
                    longest * mm,
                    nearest * mm,
                    farthest * mm
                ),
                "check geometry.shortest_mm, cylinder.stroke_mm and the positions of B and C"
                    .into(),
            ));
        }
        if let Some(contradiction) = self.contradicting_limits() {
            return Some(contradiction);
        }
        if let Some(contradiction) = self.impossible_correlations() {
            return Some(contradiction);
        }
        if n.bulk_modulus_min > n.bulk_modulus_max {
            return Some((
                "oil.bulk_modulus_min_mpa",
                "the oil would be stiffer at low pressure than at high".into(),
                "exchange oil.bulk_modulus_min_mpa and oil.bulk_modulus_max_mpa".into(),
            ));
        }
        let wrong = match self.choices.circuit {
            CircuitChoice::SelfContained => self.impossible_self_contained(),
            CircuitChoice::ValveControlled => self.impossible_valve(),
        };
        wrong.or_else(|| self.unbalanced())
    }

    /// Checks the order of limits of estimator and control law.
    fn contradicting_limits(&self) -> Option<(&'static str, String, String)> {
        let n = &self.numbers;
        let pairs = [
            ("estimator.lowest_transition_bar", "estimator.highest_transition_bar"),
            ("estimator.nis_threshold", "estimator.nis_inconsistent"),
            ("estimator.nis_threshold", "estimator.nis_certain"),
            ("estimator.least_leakage_deviation", "estimator.most_leakage_deviation"),
            ("estimator.shortest_drive_lag_ms", "estimator.drive_lag_ms"),
            ("estimator.drive_lag_ms", "estimator.longest_drive_lag_ms"),
            ("scheduled_lqr.shortest_window_ms", "scheduled_lqr.longest_window_ms"),
            ("scheduled_lqr.rollout_short_ms", "scheduled_lqr.rollout_long_ms"),
            ("scheduled_lqr.position_feedback_percent", "scheduled_lqr.feedback_percent"),
        ];
        let numbers = n.to_array();
        let value = |path: &str| {
            let index = KEYS.iter().position(|key| key.path() == path)?;
            Some((KEYS[index].to_unit(numbers[index]), KEYS[index].unit))
        };
        // removes the rounding noise of unit conversion
        let shown = |value: f64| (value * 1e6).round() / 1e6;
        pairs.into_iter().find_map(|(low, high)| {
            let ((less, unit), (more, _)) = (value(low)?, value(high)?);
            (less > more).then(|| {
                (
                    low,
                    format!(
                        "{low} is {} {unit}, and {high} is {} {unit}",
                        shown(less),
                        shown(more)
                    ),
                    format!("{low} is {high} at most"),
                )
            })
        })
    }

    /// Checks that the matrix of three correlations is positive semidefinite: its determinant must not be negative.
    fn impossible_correlations(&self) -> Option<(&'static str, String, String)> {
        let n = &self.numbers;
        let [a, b, c] = [n.tip_bending_base, n.tip_bending_offset, n.tip_base_offset];
        let determinant = 1.0 + 2.0 * a * b * c - a * a - b * b - c * c;
        (determinant < -ROUNDED).then(|| {
            (
                "tip.bending_base_correlation",
                format!(
                    "correlations of {a}, {b} (tip.bending_offset_correlation) and {c} (tip.base_offset_correlation) contradict each other"
                ),
                "take all three from one survey (`hydroboom tip`), or leave them out: 0".into(),
            )
        })
    }

    /// Checks of a valve-controlled circuit.
    fn impossible_valve(&self) -> Option<(&'static str, String, String)> {
        let n = &self.numbers;
        (n.spool_neutral == n.spool_full).then(|| {
            let text =
                format!("the valve's middle and its full travel are both at {} V", n.spool_full);
            (
                "valve.full_lift_v",
                text,
                "valve.full_lift_v is the command of full travel to lift".into(),
            )
        })
    }

    /// Checks of a self-contained circuit, and of the conditions of the published tests.
    fn impossible_self_contained(&self) -> Option<(&'static str, String, String)> {
        let n = &self.numbers;
        let mm = 1e3;
        for (low, high, path, what) in [
            (
                n.holding_cracking,
                n.holding_opening,
                "holding_valve.opening_bar",
                "load-holding valve 3",
            ),
            (n.return_cracking, n.return_opening, "return_valve.opening_bar", "return valve 7"),
            (n.check_cracking, n.check_opening, "check_valve.opening_bar", "check valve 8"),
            (n.relief_cracking, n.relief_opening, "relief.opening_bar", "relief valve 13"),
        ] {
            if low >= high {
                return Some((
                    path,
                    format!("{what} would be fully open before it begins to open"),
                    format!("{path} must be above the cracking pressure"),
                ));
            }
        }
        if n.precharge >= n.working_pressure {
            return Some((
                "accumulator.working_bar",
                "the accumulator holds no oil: it is filled to no more than its precharge".into(),
                "accumulator.working_bar must be above accumulator.precharge_bar".into(),
            ));
        }
        for (position, path) in
            [(n.motion_start, "motion.start_mm"), (n.motion_end, "motion.end_mm")]
        {
            if position > n.stroke {
                return Some((
                    path,
                    format!(
                        "`{path}` = {:.0} mm lies beyond the stroke of {:.0} mm",
                        position * mm,
                        n.stroke * mm
                    ),
                    "positions are measured from the lower stop".into(),
                ));
            }
        }
        let distance = (n.motion_end - n.motion_start).abs();
        for (speed, path) in [(n.slow, "motion.slow_mm_s"), (n.fast, "motion.fast_mm_s")] {
            if speed * n.ramp > distance {
                return Some((
                    path,
                    format!(
                        "the motion of {:.0} mm is over before {:.0} mm/s are reached",
                        distance * mm,
                        speed * mm
                    ),
                    "lower the speed or shorten motion.ramp_s".into(),
                ));
            }
        }
        let periods = n.control_period / n.simulation_period;
        if (periods - periods.round()).abs() > 1e-9 * periods || periods < 0.5 {
            return Some((
                "controller.control_period_ms",
                format!("the control period is {periods:.3} simulation steps, not a whole number"),
                "make controller.control_period_ms a multiple of \
                 controller.simulation_period_us"
                    .into(),
            ));
        }
        None
    }

    /// Checks that the load can be held over the whole stroke.
    fn unbalanced(&self) -> Option<(&'static str, String, String)> {
        let n = &self.numbers;
        let rigid = self.with_rigid_boom();
        [0.0, 0.5, 1.0].into_iter().find_map(|share| {
            rigid.rest_error(share * n.stroke).map(|error| {
                (
                    "payload.mass_kg",
                    format!("{error} (stroke {:.0} mm)", share * n.stroke * 1e3),
                    "check geometry, payload and the cylinder's diameters".into(),
                )
            })
        })
    }

    /// The crane with a rigid boom, which suffices for statics and is fast to solve; links stay.
    fn with_rigid_boom(&self) -> Self {
        match self.choices.structure {
            StructureChoice::Beam => self.divided(1),
            StructureChoice::Links => self.clone(),
        }
    }

    /// Largest piston-side pressure \[Pa\] in equilibrium over the stroke; `None` if no pressure holds the load, or
    /// the circuit is not self-contained.
    pub(crate) fn holding_pressure(&self) -> Option<f64> {
        let rigid = self.with_rigid_boom();
        match rigid.segment_shares.len() {
            1 => rigid.holding_pressure_of::<1>(),
            2 => rigid.holding_pressure_of::<2>(),
            _ => rigid.holding_pressure_of::<3>(),
        }
    }

    fn holding_pressure_of<const N: usize>(&self) -> Option<f64> {
        let crane = self.crane::<N>().ok()?;
        let at = |share: f64| crane.at_rest(&self.start(share * self.numbers.stroke)).ok();
        let pressures = [0.0, 0.5, 1.0].into_iter().filter_map(at).map(|s| s.circuit.nodes.a);
        pressures.max_by(f64::total_cmp)
    }

    /// The reason why there is no equilibrium at a stroke \[m\], if there is none.
    fn rest_error(&self, stroke: f64) -> Option<EquilibriumError> {
        match self.segment_shares.len() {
            1 => self.rest_error_of::<1>(stroke),
            2 => self.rest_error_of::<2>(stroke),
            _ => self.rest_error_of::<3>(stroke),
        }
    }

    fn rest_error_of<const N: usize>(&self, stroke: f64) -> Option<EquilibriumError> {
        match self.choices.circuit {
            CircuitChoice::SelfContained => {
                self.crane::<N>().ok()?.at_rest(&self.start(stroke)).err()
            }
            CircuitChoice::ValveControlled => {
                let start = self.valve_start_over(&self.numbers, stroke);
                let crane = self.valve_crane_over::<f64, N>(&self.numbers).ok()?;
                crane.at_rest(&start).err()
            }
        }
    }

    /// Warnings of implausible values and combinations, as sentences for the user; empty if there are none.
    pub fn warnings(&self) -> Vec<String> {
        let n = &self.numbers;
        let mut warnings = self.impossible_ranges();
        if self.choices.friction == FrictionChoice::Stribeck {
            let law = Stribeck {
                viscous: n.viscous,
                coulomb: n.coulomb,
                stiction: n.stiction,
                stribeck_slope: 1.0 / n.stribeck_velocity,
                steepness: n.steepness,
            }
            .map(Dual::<f64, 1>::constant);
            let steepest = (1..=2000)
                .map(|i| {
                    let v = f64::from(i) * n.stribeck_velocity / 100.0;
                    (law.evaluate(Dual::variable(v, 0), Dual::constant(0.0)).0.slope[0], v)
                })
                .min_by(|a, b| a.0.total_cmp(&b.0));
            if let Some((slope, v)) = steepest
                && slope < 0.0
            {
                warnings.push(format!(
                    "friction falls with speed by {:.0} N s/m at {:.1} mm/s: negative damping, the \
                     crane may hunt there (friction.stiction_n against friction.viscous_ns_per_m)",
                    -slope,
                    v * 1e3
                ));
            }
        }
        if self.choices.structure == StructureChoice::Beam && n.payload_x > 1.001 * n.boom_length {
            warnings.push(format!(
                "the payload hangs beyond the boom: payload.x_mm = {:.0}, and boom.length_mm = {:.0}",
                n.payload_x * 1e3,
                n.boom_length * 1e3
            ));
        }
        if self.choices.circuit != CircuitChoice::SelfContained {
            return warnings;
        }
        // what the pump delivers of what it displaces; computed delivery loses by compression only
        let gain = match self.choices.delivery {
            DeliveryChoice::Published => n.flow_gain,
            DeliveryChoice::Computed => 1.0,
        };
        let area = std::f64::consts::FRAC_PI_4 * n.piston.powi(2);
        let needed = n.fast * area / (n.displacement * gain);
        if needed > n.motor_speed {
            warnings.push(format!(
                "motion.fast_mm_s needs {:.0} rpm, more than motor.max_speed_rpm = {:.0}",
                needed * 60.0,
                n.motor_speed * 60.0
            ));
        }
        let delivered = n.motor_speed * n.displacement * gain;
        let held = self.holding_pressure().filter(|pressure| *pressure > 0.0);
        let leakage = |pressure: f64| (n.internal_leakage + n.case_leakage_a) * pressure.sqrt();
        if let Some(pressure) = held.filter(|pressure| leakage(*pressure) > delivered) {
            warnings.push(format!(
                "the pump leaks {:.0} L/min at the {:.0} bar that hold the load, and delivers {:.0} L/min at \
                 motor.max_speed_rpm: pump.internal_leakage_m3_s_sqrtpa = {:e}, pump.case_leakage_a_m3_s_sqrtpa = \
                 {:e}",
                leakage(pressure) * 60e3,
                pressure * 1e-5,
                delivered * 60e3,
                n.internal_leakage,
                n.case_leakage_a
            ));
        }
        let swept = std::f64::consts::FRAC_PI_4 * n.rod.powi(2) * n.stroke;
        let oil = n.accumulator_volume
            * (1.0 - (n.precharge + n.atmosphere) / (n.working_pressure + n.atmosphere));
        if oil - n.residual_volume < swept {
            warnings.push(format!(
                "the accumulator holds {:.2} L of oil, the rod displaces {:.2} L: it runs empty",
                oil * 1e3,
                swept * 1e3
            ));
        }
        if self.choices.relief == ReliefChoice::Fitted && n.relief_cracking > 350e5 {
            warnings.push("the relief valves open only above 350 bar".into());
        }
        warnings
    }
}
