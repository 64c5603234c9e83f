//! What open loop can come to at best: pump flow, leakage, slip, oil, friction and the motor's lag fitted to the very errors that they are to
//! reduce, with the payload known. Nothing that is learned on line of these can do better. It takes some minutes.
//!
//! Without arguments on the cranes that `hydroboom learn --family 12 --seed 7` has; else on those of a seed: `open_loop_floor -- 5 3 7 14`.

mod asked;

use asked::{asked, jobs};
use hydroboom_control::flow_balance::Balance;
use hydroboom_control::learner::Known;
use hydroboom_description::Description;
use hydroboom_design::{leakage, schedule};
use hydroboom_lab::LabError;
use hydroboom_lab::closed_loop::monte_carlo::member;
use hydroboom_lab::closed_loop::scenario::CourseChoice;
use hydroboom_lab::open_loop::OpenLoop;
use nalgebra::{DMatrix, DVector, SVector};
use rayon::prelude::*;
use std::error::Error;

/// How many numbers are fitted.
const FITTED: usize = 7;
/// Pump flow gain, a factor on all leakage, where the oil stiffens \[bar\], a factor on Coulomb friction, slip \[cm³/(rev kbar)\], lag of the motor \[ms\], a
/// factor on viscous friction.
type Guess = SVector<f64, FITTED>;
/// By how much each is changed for its slope; how little of each is no change; within what it stays.
const STEPS: [f64; FITTED] = [2e-3, 0.05, 0.5, 0.05, 0.06, 1.0, 0.05];
const DAMPING: [f64; FITTED] = [1e-3, 1e-6, 1e-3, 1e-4, 3e-4, 1e-3, 1e-4];
const WITHIN: [[f64; 2]; FITTED] =
    [[0.5, 1.5], [0.0, 30.0], [5.0, 60.0], [0.1, 5.0], [0.0, 10.0], [0.0, 45.0], [0.1, 9.0]];
const ITERATIONS: usize = 10;
/// m³/(rev Pa) in a cm³/(rev kbar).
const SLIP: f64 = 1e-14;

struct Case<'a> {
    model: &'a Description,
    /// What leaks of the model with that payload \[m³/s\].
    leakage: f64,
    crane: Description,
    course: CourseChoice,
}

impl Case<'_> {
    /// Errors \[mm\] in open loop.
    fn errors(&self, guess: &Guess) -> Result<DVector<f64>, LabError> {
        let leakage = guess[1] * self.leakage;
        let balance = Balance {
            flow_gain: guess[0],
            leakage,
            slip: guess[4] * SLIP,
            transition: guess[2] * 1e5,
        };
        let payload = self.crane.numbers.payload;
        let known = Known {
            weighed: payload,
            payload,
            friction: [guess[3], guess[6]],
            balance,
            lag: guess[5] * 1e-3,
        };
        let course = self.course.of(&self.crane)?;
        let errors = OpenLoop::new(self.model, &known)?.errors(&self.crane, course.as_ref())?;
        Ok(DVector::from_iterator(errors.len(), errors.iter().map(|error| error * 1e3)))
    }

    /// By Gauss and Newton: RMS \[mm\] with the crane's own numbers, and the least that was found, with what.
    fn fit(&self) -> Result<(f64, f64, Guess), LabError> {
        let rms = |errors: &DVector<f64>| errors.norm() / (errors.len() as f64).sqrt();
        let n = &self.crane.numbers;
        let mut guess = Guess::from([n.flow_gain, 1.5, n.transition * 1e-5, 1.0, 0.0, 5.0, 1.0]);
        let mut errors = self.errors(&guess)?;
        let begun = rms(&errors);
        for _ in 0..ITERATIONS {
            let mut slopes = DMatrix::zeros(errors.len(), FITTED);
            for (k, step) in STEPS.into_iter().enumerate() {
                let moved = self.errors(&(guess + Guess::ith(k, step)))?;
                slopes.set_column(k, &((moved - &errors) / step));
            }
            let damped =
                slopes.tr_mul(&slopes) + DMatrix::from_diagonal(&DVector::from_row_slice(&DAMPING));
            let Some(change) = damped.lu().solve(&slopes.tr_mul(&errors)) else { break };
            let nearer = [1.0, 0.5, 0.2].into_iter().find_map(|share| {
                let mut next = guess;
                for (k, [least, most]) in WITHIN.into_iter().enumerate() {
                    next[k] = (next[k] - share * change[k]).clamp(least, most);
                }
                let found = self.errors(&next).ok()?;
                (rms(&found) < rms(&errors)).then_some((next, found))
            });
            let Some(nearer) = nearer else { break };
            (guess, errors) = nearer;
        }
        Ok((begun, rms(&errors), guess))
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let (seed, cranes) = asked(7, 12)?;
    let model = Description::uia_single_boom()?;
    let nominal = Description::uia_virtual()?;
    let speeds = [model.numbers.slow, model.numbers.fast];
    let jobs = jobs(&cranes, speeds);
    let laws = schedule(&model)?;
    let fits = jobs.par_iter().map(|(number, speed)| {
        let crane = member(&nominal, seed, *number)?.crane;
        let leakage = leakage(&model.numbers, &laws.at(crane.numbers.payload));
        let course = CourseChoice::Motion(*speed);
        Case { model: &model, leakage, crane, course }.fit()
    });
    let fits = fits.collect::<Result<Vec<_>, LabError>>()?;
    for ((number, speed), (begun, least, guess)) in jobs.iter().zip(&fits) {
        let speed = speed * 1e3;
        println!(
            "crane {number}, {speed:.0} mm/s: {begun:.2} mm, then {least:.2} mm with flow gain {:.3}, {:.1} times the leakage, oil at {:.0} bar, {:.1} and {:.1} times the friction, slip {:.2} cm3/(rev kbar), lag {:.1} ms",
            guess[0], guess[1], guess[2], guess[3], guess[6], guess[4], guess[5]
        );
    }
    let mut least: Vec<f64> = fits.iter().map(|fit| fit.1).collect();
    least.sort_by(f64::total_cmp);
    let below = least.iter().filter(|rms| **rms < 1.0).count();
    println!("median {:.2} mm, below 1 mm on {below} of {}", least[least.len() / 2], least.len());
    Ok(())
}
