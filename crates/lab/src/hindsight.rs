//! What a whole cycle tells in hindsight: a model of the machine, fitted until it goes where the machine went.
//!
//! The state estimator tells payload and transition pressure. What that leaves open, as what the pump delivers and leaks, how much of friction is viscous, or
//! where the oil stiffens by a bar, moves soft oil by millimetres over a cycle. So does what the published model leaves out: seals that hold a piston at rest,
//! and with it any pressure that they can. So the model is told from start to end what the machine was told, from the pressures that were read at the start,
//! with friction that holds at rest; and its numbers are moved until it is where the machine was read to be.

use crate::LabError;
use crate::closed_loop::simulation::WIDTH;
use crate::motor_as_read::motor_as_read;
use crate::stand_in::{StandIn, StandIns};
use hydroboom_control::command::AxisCommand;
use hydroboom_control::measurement::AxisSignals;
use hydroboom_description::schema::FrictionChoice;
use hydroboom_description::{Description, Difference, Numbers};
use hydroboom_design::operating_points::OperatingPoints;
use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use nalgebra::{DMatrix, DVector, Dyn, storage::Owned};

/// Numbers that are fitted: pump flow gain, leakage, where the oil stiffens, slip, Coulomb, viscous and static friction, where the check valves open and
/// how wide, the cylinder's dead volumes; and what the start was, beyond what was read: rod side, accumulator, how far the pump's lines were loaded.
const FITTED: usize = 13;
/// What each is moved by for its slope, and counted in: of the flow gain, \[m³/s\], \[Pa\], \[m³/(rev Pa)\], shares of the model's friction, of what
/// static friction has become, \[Pa\], a share of the pressure that the valves take, a share; \[Pa\], \[Pa\], a share.
const STEPS: [f64; FITTED] =
    [1e-3, 5e-8, 5e4, 5e-16, 0.03, 0.03, 0.1, 5e3, 1.0, 0.03, 1e4, 1e4, 0.01];
/// So many such steps it may be off by what is known before.
const DOUBTS: [f64; FITTED] =
    [5.0, 10.0, 30.0, 10.0, 10.0, 17.0, 10.0, 6.0, 20.0, 10.0, 1.0, 1.0, 1.0];
/// A number that is moved by as much weighs as one position that is off by this \[m\]: it decides only what the cycle leaves open, as how much of
/// friction is viscous at a single speed.
const WEIGHT: f64 = 1e-3;
/// No pressure at which oil stiffens is lower \[Pa\], and no friction is less than this share of the model's.
const LOWEST: [f64; 2] = [1e5, 0.05];
/// The rod side's pressure weighs so much \[m/Pa\]: it tells what the check valves take, which moves the piston of a light crane.
const ROD_SIDE: f64 = 1e-8;
/// Positions and that pressure are compared once in so many control periods.
const EVERY: usize = 10;
/// A model that cannot go on is off by this \[m\].
const FAILED: f64 = 1.0;
/// The search ends where the sum of squares, or what it is a sum over, changes by no more than this share.
const ENOUGH: [f64; 2] = [1e-2, 1e-3];
/// It looks for slopes no more often than about so many times.
const PATIENCE: usize = 10;
/// Its first step is no longer than this many of [`STEPS`]: what a number does far away says little of a light crane. Without a bound, and with each
/// number counted by how much it does in place of these steps, crane 9 of seed 7 ends where it strays by 1.5 mm for 0.09.
const FIRST: f64 = 10.0;

/// What a machine was told from a rest on, and what was read of it.
pub(crate) struct Log<'a> {
    /// Commands, each held for a control period.
    pub told: &'a [AxisCommand<f64>],
    /// Readings at the beginning of each, as many.
    pub read: &'a [AxisSignals<f64>],
}

/// A model of a machine, fitted to a log of it. The payload and how late the motor is stay as they are known.
///
/// # Errors
///
/// [`LabError`] when the model is nowhere at rest.
pub(crate) fn fitted(model: &Description, log: &Log) -> Result<Description, LabError> {
    let found = Hindsight::new(model, log)?.searched();
    Ok(found.machine(&found.moved))
}

/// What of a description was fitted, as overrides (`--set`) that every command takes.
pub(crate) fn overrides(model: &Description, fitted: &Description) -> Vec<String> {
    let of = |difference: Difference| match difference.there.parse::<f64>() {
        Ok(value) => format!("{}={}", difference.key, six_digits(value)),
        Err(_) => difference.assignment(),
    };
    model.differences(fitted).into_iter().map(of).collect()
}

/// More digits than a log tells.
fn six_digits(value: f64) -> String {
    match (1e-3..1e6).contains(&value.abs()) {
        true => {
            let whole = value.abs().log10().floor().max(0.0) as usize;
            format!("{value:.0$}", 5_usize.saturating_sub(whole))
        }
        false => format!("{value:.5e}"),
    }
}

/// The model beside a log.
struct Hindsight<'a> {
    model: &'a Description,
    /// What leaks of it at rest at mid-stroke \[m³/s\].
    leakage: f64,
    log: &'a Log<'a>,
    /// The motor that comes nearest to the speeds that were read.
    motor: Numbers<f64>,
    /// By how many steps each number is moved from that.
    moved: DVector<f64>,
}

impl<'a> Hindsight<'a> {
    fn new(model: &'a Description, log: &'a Log) -> Result<Self, LabError> {
        let n = &model.numbers;
        let points = OperatingPoints::new(model)?;
        let resting = points.at(0.5 * n.stroke).equilibrium;
        let leakage = resting.holding_speed * n.displacement * n.flow_gain;
        let motor = motor_as_read(n, log.told, log.read);
        let moved = DVector::zeros(FITTED);
        Ok(Self { model, leakage, log, motor, moved })
    }

    /// With its numbers moved to where the model goes as the machine went.
    fn searched(self) -> Self {
        let [ftol, xtol] = ENOUGH;
        let search = LevenbergMarquardt::new().with_patience(PATIENCE).with_stepbound(FIRST);
        search.with_scale_diag(false).with_ftol(ftol).with_xtol(xtol).minimize(self).0
    }

    /// The model with its numbers moved.
    fn machine(&self, moved: &DVector<f64>) -> Description {
        let by = |k: usize| STEPS[k] * moved[k];
        let [transition, share] = LOWEST;
        let mut machine = self.model.clone();
        let n = &mut machine.numbers;
        // a crane file's pump delivers no more than it displaces
        let flow_gain = n.flow_gain + by(0);
        n.displacement *= flow_gain.max(1.0);
        n.flow_gain = flow_gain.min(1.0);
        // what leaks is fitted, and not where: all by the same factor
        let leakage = (self.leakage + by(1)).max(0.0);
        let worn = if self.leakage > 0.0 { leakage / self.leakage } else { 1.0 };
        for leakage in [
            &mut n.internal_leakage,
            &mut n.slip_at_rest,
            &mut n.case_leakage_a,
            &mut n.case_leakage_b,
        ] {
            *leakage *= worn;
        }
        n.transition = (n.transition + by(2)).max(transition);
        n.slip_per_speed = (n.slip_per_speed + by(3)).max(0.0);
        let [coulomb, viscous] = [1.0 + by(4), 1.0 + by(5)].map(|f| f.max(share));
        // what breaks away is seals, as what slides slowly is
        n.coulomb *= coulomb;
        n.stiction *= coulomb;
        n.viscous *= viscous;
        machine.choices.friction = FrictionChoice::LuGre;
        if let Some(rest) = self.log.read.first() {
            machine = resting(&machine, rest);
        }
        let n = &mut machine.numbers;
        n.tuning.estimator_drive_lag = self.motor.tuning.estimator_drive_lag;
        n.drive_bandwidth = self.motor.drive_bandwidth;
        n.drive_damping = self.motor.drive_damping;
        n.stiction *= (1.0 + by(6)).max(0.0);
        n.check_cracking = (n.check_cracking + by(7)).max(0.0);
        // by the pressure that they take, in which the piston is near linear
        n.check_coefficient /= (1.0 + by(8)).max(share).sqrt();
        let volumes = (1.0 + by(9)).max(share);
        n.dead_volume_a *= volumes;
        n.dead_volume_b *= volumes;
        n.rod_side += by(10);
        n.working_pressure += by(11);
        n.preload = (n.preload + by(12)).clamp(0.0, 1.0);
        machine
    }

    /// Periods at whose beginning positions are compared.
    fn compared(&self) -> impl ExactSizeIterator<Item = usize> {
        (0..self.log.read.len()).step_by(EVERY)
    }

    /// How far a model so moved has gone by each of them less how far the machine was read to have \[m\], and how much more it has on its rod side, so
    /// weighed; of several, side by side.
    fn off<const W: usize>(
        &self,
        moved: [&DVector<f64>; W],
    ) -> [Result<DVector<f64>, LabError>; W] {
        let begun = self.log.read.first().map_or(0.0, |rest| rest.stroke);
        let machines = moved.map(|moved| self.machine(moved));
        match StandIns::new(&machines, begun) {
            Ok(Some(together)) => self.off_together(together),
            _ => machines.map(|machine| self.off_alone(StandIn::new(&machine, begun)?)),
        }
    }

    fn off_together<const W: usize>(
        &self,
        mut together: StandIns<W>,
    ) -> [Result<DVector<f64>, LabError>; W] {
        let mut went = Vec::with_capacity(self.log.told.len());
        for command in self.log.told {
            went.push(together.outputs().map(|o| [o.stroke, o.pressure_b]));
            together.advance(&[*command; W]);
        }
        std::array::from_fn(|lane| match together.stopped(lane) {
            Some(error) => Err(LabError::during("the cycle in hindsight")(error)),
            None => Ok(self.beyond(went.iter().map(|went| went[lane]).collect())),
        })
    }

    fn off_alone(&self, mut stand_in: StandIn) -> Result<DVector<f64>, LabError> {
        let mut went = Vec::with_capacity(self.log.told.len());
        for command in self.log.told {
            let AxisSignals { stroke, pressure_b, .. } = stand_in.signals();
            went.push([stroke, pressure_b]);
            stand_in.advance(command).map_err(LabError::during("the cycle in hindsight"))?;
        }
        Ok(self.beyond(went))
    }

    /// The same of a model that was at these positions and had these pressures on its rod side.
    fn beyond(&self, went: Vec<[f64; 2]>) -> DVector<f64> {
        let read = self.log.read;
        let farther = |k: usize| went[k][0] - read[k].stroke;
        let start = if read.is_empty() { 0.0 } else { farther(0) };
        let positions = self.compared().map(|k| farther(k) - start);
        let rod_side = self.compared().map(|k| ROD_SIDE * (went[k][1] - read[k].pressure_b));
        DVector::from_iterator(2 * positions.len(), positions.chain(rod_side))
    }

    /// That, and how far the numbers are moved.
    fn missed<const W: usize>(&self, moved: [&DVector<f64>; W]) -> [DVector<f64>; W] {
        let failed = |_| DVector::repeat(2 * self.compared().len(), FAILED);
        let mut off = self.off(moved).into_iter();
        moved.map(|moved| {
            let off = off.next().expect("as many").unwrap_or_else(failed);
            let doubted = moved.iter().zip(DOUBTS).map(|(moved, doubt)| WEIGHT * moved / doubt);
            let all = off.iter().copied().chain(doubted);
            DVector::from_iterator(off.len() + FITTED, all)
        })
    }
}

impl LeastSquaresProblem<f64, Dyn, Dyn> for Hindsight<'_> {
    type ParameterStorage = Owned<f64, Dyn>;
    type ResidualStorage = Owned<f64, Dyn>;
    type JacobianStorage = Owned<f64, Dyn, Dyn>;

    fn set_params(&mut self, moved: &DVector<f64>) {
        self.moved.copy_from(moved);
    }

    fn params(&self) -> DVector<f64> {
        self.moved.clone()
    }

    fn residuals(&self) -> Option<DVector<f64>> {
        let [missed] = self.missed([&self.moved]);
        Some(missed)
    }

    fn jacobian(&self) -> Option<DMatrix<f64>> {
        // the first of them as it is
        let mut moved = vec![self.moved.clone(); FITTED + 1];
        moved[1..].iter_mut().enumerate().for_each(|(k, moved)| moved[k] += 1.0);
        let last = moved.len() - 1;
        let groups = (0..moved.len()).step_by(WIDTH);
        let group = |first: usize| std::array::from_fn(|lane| &moved[(first + lane).min(last)]);
        let missed: Vec<_> = groups.flat_map(|first| self.missed::<WIDTH>(group(first))).collect();
        let slopes: Vec<_> = missed[1..=FITTED].iter().map(|there| there - &missed[0]).collect();
        Some(DMatrix::from_columns(&slopes))
    }
}

/// A model that starts from the pressures that are read of a machine at rest.
fn resting(model: &Description, rest: &AxisSignals<f64>) -> Description {
    let mut model = model.clone();
    let n = &mut model.numbers;
    n.rod_side = rest.pressure_b;
    n.working_pressure = rest.pressure_accumulator;
    let [held, loaded] =
        [rest.pressure_a, rest.pressure_pump_a].map(|p| p - rest.pressure_accumulator);
    // an empty crane may hold no more than the accumulator has
    n.preload = if held > 0.0 { (loaded / held).clamp(0.0, 1.0) } else { 1.0 };
    model
}

#[cfg(test)]
mod tests {
    use super::*;

    const STROKE: f64 = 0.2;

    /// Up at two speeds, down at two, and rests in between.
    fn told() -> Vec<AxisCommand<f64>> {
        let speeds = [0.0, 15.0, 30.0, 0.0, -15.0, -30.0, 0.0];
        let each = |motor_speed: f64| [AxisCommand { motor_speed, holding_valve: 1.0 }; 800];
        speeds.into_iter().flat_map(each).collect()
    }

    /// What is read of a model that stands in for a machine under what is told.
    fn read(machine: &Description, told: &[AxisCommand<f64>]) -> Vec<AxisSignals<f64>> {
        let mut machine = StandIn::new(machine, STROKE).unwrap();
        let mut read = Vec::new();
        for command in told {
            read.push(machine.signals());
            machine.advance(command).unwrap();
        }
        read
    }

    /// What is known a little wrong before, and what is not estimated, is known in hindsight by as much as moves the piston.
    #[test]
    fn the_model_goes_where_the_machine_went() {
        let model = Description::uia_single_boom().unwrap();
        let mut machine = model.clone();
        machine.set("friction.law=lugre").unwrap();
        let n = &mut machine.numbers;
        n.flow_gain -= 0.02;
        n.slip_per_speed = 3e-15;
        n.transition += 2e5;
        n.internal_leakage *= 1.5;
        n.coulomb *= 1.3;
        n.viscous *= 1.6;
        n.stiction *= 2.0;
        n.check_coefficient *= 0.25;
        n.rod_side += 1e5;
        n.working_pressure += 3e4;
        let told = told();
        let read = read(&machine, &told);
        let log = Log { told: &told, read: &read };
        let hindsight = Hindsight::new(&model, &log).unwrap();
        let fitted = fitted(&model, &log).unwrap();
        // told the same, it is where the machine was
        let mut stand_in = StandIn::new(&fitted, STROKE).unwrap();
        let mut square = 0.0;
        for (command, read) in told.iter().zip(&read) {
            square += (stand_in.signals().stroke - read.stroke).powi(2);
            stand_in.advance(command).unwrap();
        }
        let [before] = hindsight.off([&hindsight.moved]);
        // positions, and after them the rod side
        let before = before.unwrap();
        let before = before.rows(0, before.len() / 2);
        let [before, after] =
            [before.norm_squared() / before.len() as f64, square / told.len() as f64]
                .map(f64::sqrt);
        assert!(after < 0.02 * before, "{before} {after}");
        let off = |of: &Description| (of.numbers.flow_gain - machine.numbers.flow_gain).abs();
        assert!(off(&fitted) < 0.2 * off(&model), "{:?}", fitted.numbers.flow_gain);
        // 1.6 in place of 1 where the rod side is not compared: a heavy load hardly moves by what they take
        let wider =
            |of: &Description| of.numbers.check_coefficient / machine.numbers.check_coefficient;
        assert!((wider(&fitted) - 1.0).abs() < 0.1, "{} for {}", wider(&fitted), wider(&model));
    }

    /// A model that already goes there is left as it is, but for the law of its friction, and starts from what was read.
    #[test]
    fn what_is_known_stays() {
        let mut model = Description::uia_single_boom().unwrap();
        model.set("friction.law=lugre").unwrap();
        let told = told();
        let read = read(&model, &told);
        let log = Log { told: &told, read: &read };
        let hindsight = Hindsight::new(&model, &log).unwrap().searched();
        assert!(hindsight.moved.amax() < 1e-9, "{} steps", hindsight.moved);
        let fitted = fitted(&model, &log).unwrap();
        for difference in model.differences(&fitted) {
            let [here, there] = [&difference.here, &difference.there]
                .map(|value| value.parse::<f64>().expect("no choice differs"));
            // one that is 0 has been moved, if at all, by no more than that
            let same = here == 0.0 || (there - here).abs() < 1e-9 * here.abs();
            assert!(same, "{}", difference.assignment());
        }
    }
}
