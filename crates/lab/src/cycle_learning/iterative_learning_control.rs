//! Norm-optimal iterative learning control of the motor speed.
//!
//! Commands of cycle j are `u_j = u_0 + Φ p_j`, Φ continuous and piecewise linear; the tracking error is
//! `e_j = e_0 + G p_j`, G from the model linearised along the reference. The next parameters minimise
//! `|e_{j+1}|² + ρ |p_{j+1} − p_j|² + μ |p_{j+1}|²`:
//!
//! ```text
//! p_{j+1} = (GᵀG + (ρ + μ) I)⁻¹ ((GᵀG + ρ I) p_j − Gᵀ e_j)
//! ```
//!
//! On a machine with response G' the parameters follow `p_{j+1} = T p_j + …` with `T = N⁻¹ (GᵀG + ρ I − Gᵀ
//! G')` and `N = GᵀG + (ρ + μ) I`. Suppose that the norm `‖T‖_N`, weighted by N, is below one. Then cycles
//! from the same initial state contract the parameters to a fixed point on one machine, and keep them
//! bounded if the machine varies between cycles. The error of single cycles may grow. Without a reset the
//! initial state varies, and the condition does not apply.
//!
//! Sources:
//! N. Amann, D. H. Owens, E. Rogers, *Iterative learning control for discrete-time systems with exponential
//! rate of convergence*, IEE Proc. Control Theory Appl. 143 (1996) 217-224;
//! S. Gunnarsson, M. Norrlöf, *On the design of ILC algorithms using optimization*, Automatica 37 (2001)
//! 2011-2016;
//! convergence in lifted form: D. A. Bristow, M. Tharayil, A. G. Alleyne, *A survey of iterative learning
//! control*, IEEE Control Systems 26 (2006) 96-114.

use super::linearised_response::{decimation, lowest_frequency, periods_per_knot, response};
use super::stages::Stages;
use crate::LabError;
use crate::closed_loop::scenario::Course;
use hydroboom_control::command::AxisCommand;
use hydroboom_control::measurement::AxisSignals;
use hydroboom_description::Description;
use hydroboom_design::DesignError;
use hydroboom_design::scheduled_lqr::known_delay;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use serde::Serialize;

/// Contraction of iterative learning control: the norm `‖T‖_N` of the correction's change per cycle \[-\], below 1 for
/// convergence.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Convergence {
    /// Norm on the identified model itself \[-\].
    pub model: f64,
    /// Largest norm over the corners of the ranges of payload and oil \[-\].
    pub worst: f64,
    /// Parameters of the corner with the largest norm, as overrides.
    pub worst_case: String,
}

impl Convergence {
    /// Whether cycles from the same initial state converge on all these machines: the largest norm is below 1.
    pub fn is_contraction(&self) -> bool {
        self.worst < 1.0
    }
}

/// Learning law for one model and one course.
pub(crate) struct IterativeLearning {
    /// Half the averaging window of the measured error \[s\].
    average: f64,
    /// Interval of the knots \[s\].
    interval: f64,
    /// Control period \[s\].
    period: f64,
    /// Measurement delay due to the fieldbus \[s\]. Measurements are compared with the reference of that
    /// earlier time.
    reading_delay: f64,
    /// Largest motor speed \[rev/s\].
    fastest: f64,
    /// G \[m/(rev/s)\]: derivative of the errors with respect to the parameters.
    response: DMatrix<f64>,
    /// GᵀG + ρ I.
    learned: DMatrix<f64>,
    /// GᵀG + (ρ + μ) I.
    normal: Cholesky<f64, Dyn>,
}

impl IterativeLearning {
    /// Learning law for a model of the machine along a course of `periods` control periods.
    ///
    /// # Errors
    ///
    /// [`LabError::Design`] if there is no reduced model.
    pub(crate) fn new(
        model: &Description,
        course: &dyn Course,
        periods: usize,
    ) -> Result<Self, LabError> {
        let n = &model.numbers;
        let frequency = lowest_frequency(model, course, periods)?;
        if !(frequency.is_finite() && frequency > 0.0) {
            let reason = "the load on boom and oil has no frequency along the course".into();
            return Err(DesignError::NoFit(reason).into());
        }
        let interval = n.learning_knots / frequency;
        let response = response(model, course, periods, interval)?;
        let [rho, mu] = [n.learning_change, n.learning_size]
            .map(|weight| weight.powi(2) * response.nrows() as f64);
        let size = response.ncols();
        let learned = response.tr_mul(&response) + rho * DMatrix::identity(size, size);
        let normal = &learned + mu * DMatrix::identity(size, size);
        let normal = normal.cholesky().ok_or_else(|| {
            DesignError::NoFit("the response of the tracking error is not a number".into())
        })?;
        let (period, fastest, average) = (n.control_period, n.motor_speed, n.learning_average);
        let reading_delay = f64::from(known_delay(model)) * period;
        let law =
            Self { average, interval, period, reading_delay, fastest, response, learned, normal };
        Ok(law)
    }

    /// Zero correction, for the first cycle.
    pub(crate) fn no_correction(&self) -> Correction {
        Correction { parameters: DVector::zeros(self.response.ncols()) }
    }

    /// Correction for the next cycle from the last one and its measured error.
    pub(crate) fn learn(
        &self,
        last: &Correction,
        readings: &[AxisSignals<f64>],
        course: &dyn Course,
    ) -> Correction {
        let error = self.error(readings, course);
        Correction { parameters: self.next(&last.parameters, &error) }
    }

    /// p_{j+1} from p_j and e_j.
    fn next(&self, last: &DVector<f64>, error: &DVector<f64>) -> DVector<f64> {
        self.normal.solve(&(&self.learned * last - self.response.tr_mul(error)))
    }

    /// Commands plus a correction.
    pub(crate) fn corrected(
        &self,
        commands: &[AxisCommand<f64>],
        by: &Correction,
    ) -> Vec<AxisCommand<f64>> {
        let per = periods_per_knot(self.interval, self.period);
        let knot = |i: usize| by.parameters.get(i).copied().unwrap_or(0.0);
        let corrected = |(k, command): (usize, &AxisCommand<f64>)| {
            let (i, share) = (k / per, (k % per) as f64 / per as f64);
            let more = knot(i) + share * (knot(i + 1) - knot(i));
            let motor_speed = (command.motor_speed + more).clamp(-self.fastest, self.fastest);
            AxisCommand { motor_speed, ..*command }
        };
        commands.iter().enumerate().map(corrected).collect()
    }

    /// Measured tracking error \[m\], averaged to reduce noise.
    fn error(&self, readings: &[AxisSignals<f64>], course: &dyn Course) -> DVector<f64> {
        let error: Vec<f64> = readings
            .iter()
            .enumerate()
            .map(|(k, at)| {
                let time = (k as f64 * self.period - self.reading_delay).max(0.0);
                at.stroke - course.reference(time).position
            })
            .collect();
        let around = (self.average / self.period).round() as usize;
        let every = decimation(self.period);
        DVector::from_fn(self.response.nrows(), |row, _| {
            let (k, last) = (row * every, error.len());
            let near = &error[k.saturating_sub(around).min(last)..(k + around + 1).min(last)];
            near.iter().sum::<f64>() / near.len().max(1) as f64
        })
    }

    /// `‖T‖_N` for the response G' of another machine: largest singular value of `C⁻¹ (GᵀG + ρ I − Gᵀ G')
    /// C⁻ᵀ`, N = C Cᵀ. Infinite if it is NaN.
    fn contraction(&self, other: &DMatrix<f64>) -> f64 {
        let factor = self.normal.l();
        let whole = &self.learned - self.response.tr_mul(other);
        let left = factor.solve_lower_triangular(&whole);
        let both = left.and_then(|left| factor.solve_lower_triangular(&left.transpose()));
        let both = both.filter(|both| both.iter().all(|v| v.is_finite()));
        both.map_or(f64::INFINITY, |both| both.singular_values().max())
    }

    /// Contraction on the model, and on machines at all combinations of payload and oil from their ranges
    /// (`learning.corner_points`).
    ///
    /// # Errors
    ///
    /// See [`Self::new`]; [`LabError::Stopped`] on request.
    pub(crate) fn convergence(
        &self,
        model: &Description,
        course: &dyn Course,
        periods: usize,
        stages: &Stages<'_>,
    ) -> Result<Convergence, LabError> {
        let own = self.contraction(&self.response);
        let mut found =
            Convergence { model: own, worst: own, worst_case: "the model itself".into() };
        let n = &model.numbers;
        let corners = |path: &str, value: f64| {
            let range = model.range(path).map_or([value; 2], |range| [range.low, range.high]);
            points(range, value, n.learning_corners.round() as usize)
        };
        for payload in corners("payload.mass_kg", n.payload) {
            for transition in corners("oil.transition_bar", n.transition) {
                stages.within(0.0)?;
                let mut other = model.clone();
                (other.numbers.payload, other.numbers.transition) = (payload, transition);
                let contraction =
                    self.contraction(&response(&other, course, periods, self.interval)?);
                if contraction > found.worst {
                    found.worst = contraction;
                    found.worst_case = format!(
                        "payload.mass_kg={payload:.0}, oil.transition_bar={:.1}",
                        transition * 1e-5
                    );
                }
            }
        }
        Ok(found)
    }
}

/// `count` points of a range from end to end; a single one is `value`.
fn points([low, high]: [f64; 2], value: f64, count: usize) -> Vec<f64> {
    match count {
        0 | 1 => vec![value],
        _ => (0..count).map(|k| low + (high - low) * k as f64 / (count - 1) as f64).collect(),
    }
}

/// Correction of the motor speed: values at knots \[rev/s\], linear in between.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Correction {
    parameters: DVector<f64>,
}

#[cfg(test)]
mod tests {
    use super::super::drive_delay::with_drive;
    use super::super::replay::{at_rest, replayed};
    use super::*;
    use hydroboom_virtual_crane::surrogate;

    fn course() -> impl Course {
        let model = Description::uia_single_boom().unwrap();
        model.motion(model.numbers.fast)
    }

    /// Machine whose pump delivers less and leaks more than the paper's.
    fn machine() -> Description {
        let mut machine = with_drive(&Description::uia_single_boom().unwrap());
        machine.set("friction.law=lugre").unwrap();
        machine.numbers.flow_gain -= 0.03;
        machine.numbers.internal_leakage *= 1.5;
        machine
    }

    /// Measurements of a machine under commands.
    fn readings(
        machine: &Description,
        commands: &[AxisCommand<f64>],
        course: &dyn Course,
    ) -> Vec<AxisSignals<f64>> {
        let go_on = |_: f64| true;
        let mut machine = at_rest(&surrogate(machine), course).unwrap();
        replayed(commands, &mut machine, course, &Stages::new(1, &go_on)).unwrap().0.readings
    }

    /// Velocity feedforward.
    fn feedforward(course: &dyn Course) -> Vec<AxisCommand<f64>> {
        let model = Description::uia_single_boom().unwrap();
        let (law, period) = (model.benchmark(), model.numbers.control_period);
        let command = |k: usize| {
            let reference = course.reference(k as f64 * period);
            AxisCommand { motor_speed: law.velocity_feedforward(&reference), holding_valve: 1.0 }
        };
        (0..(course.duration() / period) as usize).map(command).collect()
    }

    fn rms(errors: impl ExactSizeIterator<Item = f64>) -> f64 {
        let count = errors.len() as f64;
        (errors.map(|e| e * e).sum::<f64>() / count).sqrt()
    }

    /// After a correction during motion, the nonlinear model oscillates about the linearised response.
    /// Their means agree.
    #[test]
    fn the_linearised_response_agrees_with_the_nonlinear_model() {
        let (course, machine) = (course(), machine());
        let commands = feedforward(&course);
        let (interval, column) = (0.4, 7);
        let response = response(&machine, &course, commands.len(), interval).unwrap();
        let period = machine.numbers.control_period;
        let raised: Vec<_> = commands
            .iter()
            .enumerate()
            .map(|(k, command)| {
                let hat = 1.0 - (k as f64 * period / interval - f64::from(column)).abs();
                AxisCommand { motor_speed: command.motor_speed + hat.max(0.0), ..*command }
            })
            .collect();
        let [before, after] =
            [commands, raised].map(|commands| readings(&machine, &commands, &course));
        // one second from the end of the correction
        let begin = (f64::from(column + 1) * interval / period) as usize;
        let every = decimation(period);
        let rows = begin / every..begin / every + 100;
        let mean = |of: &dyn Fn(usize) -> f64| rows.clone().map(of).sum::<f64>() / 100.0;
        let moved = mean(&|row| after[row * every].stroke - before[row * every].stroke);
        let linear = mean(&|row| response[(row, column as usize)]);
        assert!((linear / moved - 1.0).abs() < 0.02, "{linear} for {moved} m/(rev/s)");
    }

    /// Learning with a model whose pump differs from the machine's reduces the machine's error.
    #[test]
    fn learning_reduces_the_error_under_model_mismatch() {
        let course = course();
        let model = with_drive(&Description::uia_single_boom().unwrap());
        let commands = feedforward(&course);
        let periods = commands.len();
        let learning = IterativeLearning::new(&model, &course, periods).unwrap();
        let (mut correction, mut errors) = (learning.no_correction(), Vec::new());
        for _ in 0..4 {
            let corrected = learning.corrected(&commands, &correction);
            let readings = readings(&machine(), &corrected, &course);
            errors.push(rms(learning.error(&readings, &course).iter().copied()));
            correction = learning.learn(&correction, &readings, &course);
        }
        assert!(errors[0] > 2e-3 && errors[3] < 0.05 * errors[0], "{errors:?}");
    }

    /// With closely spaced knots a correction excites the load's mode. Without a bound on its size a cycle
    /// may increase the error on a crane with another payload, which the convergence test reports.
    #[test]
    fn a_correction_that_excites_the_load_fails_the_convergence_test() {
        let (course, mut model) = (course(), with_drive(&Description::uia_single_boom().unwrap()));
        let periods = feedforward(&course).len();
        let convergence = |model: &Description| {
            let learning = IterativeLearning::new(model, &course, periods).unwrap();
            let go_on = |_: f64| true;
            let stages = Stages::new(1, &go_on);
            learning.convergence(model, &course, periods, &stages).unwrap()
        };
        for set in
            ["knot_periods=1", "change_weight_mm_s_per_rev=0", "size_weight_mm_s_per_rev=0.005"]
        {
            model.set(&format!("learning.{set}")).unwrap();
        }
        let close = convergence(&model);
        assert!(!close.is_contraction() && close.model < 1.0, "{close:?}");
        assert!(close.worst_case.contains("payload.mass_kg="), "{close:?}");
        // without corners only the model counts
        model.set("learning.corner_points=1").unwrap();
        assert!(convergence(&model).is_contraction());
    }

    /// On machines whose response is a multiple of the model's, T is self-adjoint in the inner product of
    /// N, and its norm is its spectral radius. The law then converges if and only if the norm is below one,
    /// each cycle by at least that factor. On any other machine the condition is sufficient.
    #[test]
    fn the_norm_is_below_one_where_learning_converges() {
        let (course, model) = (course(), with_drive(&Description::uia_single_boom().unwrap()));
        let periods = feedforward(&course).len();
        let learning = IterativeLearning::new(&model, &course, periods).unwrap();
        let go_on = |_: f64| true;
        let stop = |_: f64| false;
        let stages = Stages::new(1, &go_on);
        let convergence = learning.convergence(&model, &course, periods, &stages).unwrap();
        assert!(convergence.is_contraction());
        let stopped = Stages::new(1, &stop);
        let stopped = learning.convergence(&model, &course, periods, &stopped);
        assert!(matches!(stopped, Err(LabError::Stopped)));
        let (own, size) = (&learning.response, learning.response.ncols());
        let offset = DVector::from_fn(own.nrows(), |k, _| 1e-3 * (0.05 * k as f64).sin());
        let mu = model.numbers.learning_size.powi(2) * own.nrows() as f64;
        let factor = learning.normal.l();
        // distances from the fixed point, μ p + Gᵀ (e_0 + G' p) = 0, in the norm |Cᵀ p| of N = C Cᵀ
        let distances = |other: &DMatrix<f64>| -> Vec<f64> {
            let settles = own.tr_mul(other) + mu * DMatrix::identity(size, size);
            let settled = settles.lu().solve(&-own.tr_mul(&offset)).unwrap();
            let mut p = DVector::zeros(size);
            let cycle = |_| {
                let distance = factor.tr_mul(&(&p - &settled)).norm();
                p = learning.next(&p, &(&offset + other * &p));
                distance
            };
            (0..60).map(cycle).collect()
        };
        let falls = |other: &DMatrix<f64>, norm: f64| {
            let all = distances(other);
            all.windows(2).all(|pair| pair[1] <= norm * (1.0 + 1e-6) * pair[0])
        };
        let mut diverging = 0;
        for times in [0.3, 1.0, 1.8, 2.2, 4.0] {
            let other = times * own;
            let norm = learning.contraction(&other);
            if norm < 1.0 {
                assert!(falls(&other, norm), "{times}: {norm}");
            } else {
                let all = distances(&other);
                assert!(all[59] > 10.0 * all[0], "{times}: {norm}, {} {}", all[0], all[59]);
                diverging += 1;
            }
        }
        assert_eq!(diverging, 2);
        let other = response(&machine(), &course, periods, learning.interval).unwrap();
        let norm = learning.contraction(&other);
        assert!(norm < 1.0 && falls(&other, norm), "{norm}");
    }
}
