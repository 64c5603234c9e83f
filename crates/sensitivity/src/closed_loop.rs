//! Closed-loop simulation of a motion under a strategy, generic over the number type.

use crate::case::SEGMENTS;
use crate::error::SensitivityError;
use hydroboom_control::feedback::benchmark::{Benchmark, BenchmarkInput};
use hydroboom_control::reference::profile::{OutAndBack, SetPoint};
use hydroboom_control::strategy::Strategy;
use hydroboom_description::schema::Numbers;
use hydroboom_description::{BuildError, Description};
use hydroboom_identify::{Number, Stepper};
use hydroboom_model::{Crane, CraneState, Input};

/// Steps of the implicit scheme in a control period.
const STEPS: u32 = 2;

/// The benchmark controller as described, converted to another number type: its parameters do not vary.
fn controller<T: Number>(description: &Description) -> Benchmark<T> {
    description.benchmark_over(&Numbers::from_array(description.numbers.to_array().map(T::lit)))
}

/// A machine with these parameters, in equilibrium at a stroke \[m\].
pub(crate) fn machine<T: Number>(
    description: &Description,
    numbers: &Numbers<T>,
    stroke: T,
) -> Result<(Crane<T, SEGMENTS>, CraneState<T, SEGMENTS>), SensitivityError> {
    let crane = description.crane_over::<T, SEGMENTS>(numbers)?;
    let start = description.start_over(numbers, stroke);
    let state = T::rest(&crane, &start).map_err(BuildError::from)?;
    Ok((crane, state))
}

/// Closed loop of machine and controller, with the machine's state at the beginning of each control period.
struct Loop<'a, T> {
    description: &'a Description,
    motion: &'a OutAndBack<f64>,
    controller: Benchmark<T>,
    crane: Crane<T, SEGMENTS>,
    state: CraneState<T, SEGMENTS>,
}

impl<T: Number> Loop<'_, T> {
    /// Runs the motion; `decide` returns the commanded motor speed.
    fn run(
        mut self,
        what: &str,
        mut decide: impl FnMut(usize, &SetPoint<f64>, &BenchmarkInput<T>, &Benchmark<T>, T) -> T,
    ) -> Result<(), SensitivityError> {
        let period = self.description.benchmark().period;
        let stepper = Stepper::new(&self.crane);
        let periods = (self.motion.duration() / period).round() as usize;
        let mut motor = T::zero();
        for k in 0..=periods {
            let time = k as f64 * period;
            let reference = self.motion.reference(time);
            let p = self.crane.circuit.pressures(&self.state.circuit);
            let pose = self.crane.boom.pose(&self.state.boom.angle);
            let seen = BenchmarkInput {
                stroke: self.crane.boom.cylinder_pose(&pose).stroke,
                load_pressure: self.crane.cylinder.load_pressure(p.a, p.b),
            };
            if !(seen.stroke.plain() + p.a.plain()).is_finite() {
                return Err(SensitivityError::Broken { what: what.into(), time });
            }
            let wanted = decide(k, &reference, &seen, &self.controller, p.a);
            motor = self.controller.limits.follow(motor, wanted, self.controller.period);
            let input = Input { pump_speed: motor, holding_valve: T::one() };
            self.state = stepper
                .moved(&self.crane, &self.state, &input, period, STEPS)
                .ok_or_else(|| SensitivityError::Broken { what: what.into(), time })?;
        }
        Ok(())
    }
}

fn over<T: Number>(reference: &SetPoint<f64>) -> SetPoint<T> {
    SetPoint { position: T::lit(reference.position), velocity: T::lit(reference.velocity) }
}

/// RMS tracking error \[m\], and standard deviation of p_A \[Pa\], of a machine with these parameters under a
/// strategy. `simulated` holds the motor speeds of the parallel simulation \[rev/s\].
pub(crate) fn follow<T: Number>(
    description: &Description,
    numbers: &Numbers<T>,
    motion: &OutAndBack<f64>,
    strategy: Strategy,
    simulated: Option<&[f64]>,
) -> Result<[T; 2], SensitivityError> {
    let (crane, state) = machine(description, numbers, T::lit(motion.start))?;
    let looped = Loop { description, motion, controller: controller(description), crane, state };
    let mut memory = None;
    let mut square = T::zero();
    let mut pressures: Vec<T> = Vec::new();
    looped.run(strategy.name(), |k, reference, seen, controller, pressure| {
        let reference = over(reference);
        square = square + (seen.stroke - reference.position).square();
        pressures.push(pressure);
        let feedforward = match simulated {
            Some(speeds) => T::lit(speeds[k.min(speeds.len() - 1)]),
            None => controller.velocity_feedforward(&reference),
        };
        match strategy.measures() {
            true => {
                let memory = memory.get_or_insert_with(|| controller.start(seen));
                controller.update(memory, &reference, seen, feedforward)
            }
            false => feedforward,
        }
    })?;
    let count = T::lit(pressures.len() as f64);
    let mean = pressures.iter().fold(T::zero(), |sum, p| sum + *p) / count;
    let swing = pressures.iter().fold(T::zero(), |sum, p| sum + (*p - mean).square()) / count;
    Ok([(square / count).sqrt(), swing.sqrt()])
}

/// Commanded motor speeds \[rev/s\] of the nominal machine under the benchmark controller, one a control period:
/// the feedforward of the strategies that simulate the crane.
pub(crate) fn motor_speeds(
    description: &Description,
    motion: &OutAndBack<f64>,
) -> Result<Vec<f64>, SensitivityError> {
    let (crane, state) = machine(description, &description.numbers, motion.start)?;
    let looped: Loop<'_, f64> =
        Loop { description, motion, controller: controller(description), crane, state };
    let mut memory = None;
    let mut speeds = Vec::new();
    let mut motor = 0.0;
    looped.run("the simulation beside the machine", |_, reference, seen, controller, _| {
        let memory = memory.get_or_insert_with(|| controller.start(seen));
        let feedforward = controller.velocity_feedforward(reference);
        let wanted = controller.update(memory, reference, seen, feedforward);
        motor = controller.limits.follow(motor, wanted, controller.period);
        speeds.push(motor);
        wanted
    })?;
    Ok(speeds)
}
