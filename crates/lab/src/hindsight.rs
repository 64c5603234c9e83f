//! What a whole cycle tells in hindsight: what was learned on the way, fitted until the model goes where the machine went.
//!
//! What is learned on the way comes of balances over a tenth of a second. What those leave open, as how much of friction is viscous, or where the oil
//! stiffens by a bar, moves soft oil by millimetres over a cycle. So the model is told from start to end what the machine was told, and the
//! numbers are moved until it is where the machine was read to be.

use crate::{LabError, plant};
use hydroboom_control::{Balance, Command, Known, Schedule};
use hydroboom_description::Description;
use hydroboom_design::{informed, schedule};
use hydroboom_model::{Input, Scheme};
use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use nalgebra::{DMatrix, DVector, Dyn, storage::Owned};

/// Numbers that are fitted: pump flow gain, leakage, where the oil stiffens, slip, Coulomb and viscous friction.
const FITTED: usize = 6;
/// What each is moved by for its slope, and counted in: of the flow gain, \[m³/s\], \[Pa\], \[m³/(rev Pa)\], of either friction.
const STEPS: [f64; FITTED] = [1e-3, 5e-8, 5e4, 5e-16, 0.03, 0.03];
/// So many such steps it may be off by what was learned on the way.
const DOUBTS: [f64; FITTED] = [5.0, 10.0, 30.0, 10.0, 10.0, 17.0];
/// A number that is moved by as much weighs as one position that is off by this \[m\]: it decides only what the cycle leaves open, as how much of
/// friction is viscous at a single speed.
const WEIGHT: f64 = 1e-3;
/// No pressure at which oil stiffens is lower \[Pa\], and no friction is less than this share of the model's.
const LOWEST: [f64; 2] = [1e5, 0.05];
/// Positions are compared once in so many control periods.
const EVERY: usize = 10;
/// A model that cannot go on is off by this \[m\].
const FAILED: f64 = 1.0;
/// The search ends where the sum of squares, or what it is a sum over, changes by no more than this share.
const ENOUGH: [f64; 2] = [1e-2, 1e-3];
/// It looks for slopes no more often than about so many times.
const PATIENCE: usize = 4;

/// What a machine was told from a rest on, and where it was read to be.
pub(crate) struct Log<'a> {
    /// Commands, each held for a control period.
    pub told: &'a [Command<f64>],
    /// Piston position at the beginning of each \[m\].
    pub read: &'a [f64],
}

/// What is known of a machine, fitted to a log of it. The payload and how late the motor is stay as they are known.
///
/// # Errors
///
/// [`LabError`] when no state feedback can be designed for the model.
pub(crate) fn fitted(model: &Description, known: &Known, log: &Log) -> Result<Known, LabError> {
    let schedule = schedule(model)?;
    let start = Hindsight { model, schedule, before: *known, log, moved: DVector::zeros(FITTED) };
    let [ftol, xtol] = ENOUGH;
    let search = LevenbergMarquardt::new().with_patience(PATIENCE);
    let (end, _) = search.with_ftol(ftol).with_xtol(xtol).minimize(start);
    Ok(end.known(&end.moved))
}

/// The model beside a log.
struct Hindsight<'a> {
    model: &'a Description,
    schedule: Schedule,
    /// What was learned on the way.
    before: Known,
    log: &'a Log<'a>,
    /// By how many steps each number is moved from that.
    moved: DVector<f64>,
}

impl Hindsight<'_> {
    fn known(&self, moved: &DVector<f64>) -> Known {
        let by = |k: usize| STEPS[k] * moved[k];
        let Known { balance, friction, .. } = self.before;
        let [transition, share] = LOWEST;
        Known {
            balance: Balance {
                flow_gain: balance.flow_gain + by(0),
                leakage: (balance.leakage + by(1)).max(0.0),
                transition: (balance.transition + by(2)).max(transition),
                slip: (balance.slip + by(3)).max(0.0),
            },
            friction: [friction[0] + by(4), friction[1] + by(5)].map(|f| f.max(share)),
            ..self.before
        }
    }

    /// How late what is read is, in whole control periods and a part of one.
    fn late(&self) -> (usize, f64) {
        let late = self.before.lag / self.model.numbers.control_period;
        (late as usize, late.fract())
    }

    /// Periods at whose beginning positions are compared.
    fn compared(&self) -> impl ExactSizeIterator<Item = usize> {
        (self.late().0 + 1..self.log.read.len()).step_by(EVERY)
    }

    /// How far the model has gone by each period less how far the machine was read to have \[m\].
    fn off(&self, moved: &DVector<f64>) -> Result<DVector<f64>, LabError> {
        let Log { told, read } = self.log;
        let model = informed(self.model, &self.schedule, &self.known(moved));
        let (begun, period) = (read[0], model.numbers.control_period);
        let mut simulated = plant(&model, &model.start(begun), Scheme::Implicit, period)?;
        let mut went = Vec::with_capacity(told.len());
        for command in *told {
            went.push(simulated.outputs().stroke);
            let Command { motor_speed, holding_valve } = *command;
            let input = Input { pump_speed: motor_speed, holding_valve };
            simulated.advance(&input, 1).map_err(LabError::during("the cycle in hindsight"))?;
        }
        let (whole, part) = self.late();
        let compared = self.compared().map(|k| {
            let [after, before] = [went[k - whole], went[k - whole - 1]];
            (after + part * (before - after) - went[0]) - (read[k] - begun)
        });
        Ok(DVector::from_iterator(compared.len(), compared))
    }

    /// That, and how far the numbers are moved.
    fn missed(&self, moved: &DVector<f64>) -> DVector<f64> {
        let failed = |_| DVector::repeat(self.compared().len(), FAILED);
        let off = self.off(moved).unwrap_or_else(failed);
        let doubted = moved.iter().zip(DOUBTS).map(|(moved, doubt)| WEIGHT * moved / doubt);
        let all = off.iter().copied().chain(doubted);
        DVector::from_iterator(off.len() + FITTED, all)
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
        Some(self.missed(&self.moved))
    }

    fn jacobian(&self) -> Option<DMatrix<f64>> {
        let here = self.missed(&self.moved);
        let mut slopes = DMatrix::zeros(here.len(), FITTED);
        for k in 0..FITTED {
            let mut there = self.moved.clone();
            there[k] += 1.0;
            slopes.set_column(k, &(self.missed(&there) - &here));
        }
        Some(slopes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::learning::believed;

    const STROKE: f64 = 0.2;

    /// Up at two speeds, down at two, and rests in between.
    fn told() -> Vec<Command<f64>> {
        let speeds = [0.0, 15.0, 30.0, 0.0, -15.0, -30.0, 0.0];
        let each = |motor_speed: f64| [Command { motor_speed, holding_valve: 1.0 }; 800];
        speeds.into_iter().flat_map(each).collect()
    }

    /// Where a model that is informed so is read to be under what is told, its motor being late as known.
    fn read(model: &Description, known: &Known, told: &[Command<f64>]) -> Vec<f64> {
        let still = vec![STROKE; told.len()];
        let log = Log { told, read: &still };
        let schedule = schedule(model).unwrap();
        let moved = DVector::zeros(FITTED);
        let machine = Hindsight { model, schedule, before: *known, log: &log, moved };
        let off = machine.off(&machine.moved).unwrap();
        let mut read = still.clone();
        for (k, off) in machine.compared().zip(&off) {
            read[k] += off;
        }
        read
    }

    fn rms(model: &Description, known: &Known, log: &Log) -> f64 {
        let schedule = schedule(model).unwrap();
        let moved = DVector::zeros(FITTED);
        let beside = Hindsight { model, schedule, before: *known, log, moved };
        let off = beside.off(&beside.moved).unwrap();
        off.norm() / (off.len() as f64).sqrt()
    }

    /// What was learned a little wrong on the way is known in hindsight by as much as moves the piston.
    #[test]
    fn the_model_goes_where_the_machine_went() {
        let model = Description::uia_single_boom().unwrap();
        let known = believed(&model).unwrap();
        let Known { balance, .. } = known;
        let machine = Known {
            balance: Balance {
                flow_gain: balance.flow_gain - 0.02,
                slip: 3e-15,
                transition: balance.transition + 2e5,
                leakage: 1.5 * balance.leakage,
            },
            friction: [1.3, 1.6],
            ..known
        };
        let told = told();
        let read = read(&model, &machine, &told);
        let log = Log { told: &told, read: &read };
        let fitted = fitted(&model, &known, &log).unwrap();
        let [before, after] = [&known, &fitted].map(|known| rms(&model, known, &log));
        assert!(after < 0.02 * before, "{before} {after}");
        let off = |known: &Known| (known.balance.flow_gain - machine.balance.flow_gain).abs();
        assert!(off(&fitted) < 0.2 * off(&known), "{fitted:?}");
    }

    /// A model that already goes there is left as it is.
    #[test]
    fn what_was_learned_right_stays() {
        let model = Description::uia_single_boom().unwrap();
        let known = believed(&model).unwrap();
        let told = told();
        let read = read(&model, &known, &told);
        assert_eq!(fitted(&model, &known, &Log { told: &told, read: &read }).unwrap(), known);
    }
}
