//! Which machines nobody can lead in open loop: a cycle told again from the same rest, but for 1 rpm more over the first tenth of a second of the motion.
//! Most end where that oil takes them, some micrometres off; on soft oil some swing, the more the longer.
//!
//! Without arguments on the first twelve cranes of seed 1; else on those of a seed, or all 200: `open_loop_growth -- 1 55 134`, `open_loop_growth -- 1`
//! (seven minutes).

mod asked;

use asked::{asked, jobs};
use hydroboom_description::Description;
use hydroboom_lab::LabError;
use hydroboom_lab::astray::astray;
use hydroboom_lab::closed_loop::monte_carlo::member;
use hydroboom_lab::closed_loop::scenario::CourseChoice;
use rayon::prelude::*;
use std::error::Error;

/// A machine that strays by this \[m\] is said so.
const FAR: f64 = 1e-4;

fn largest(errors: &[f64]) -> f64 {
    errors.iter().fold(0.0, |largest, error| f64::max(largest, error.abs()))
}

fn main() -> Result<(), Box<dyn Error>> {
    let (seed, cranes) = asked(1, 200)?;
    let model = Description::uia_single_boom()?;
    let nominal = Description::uia_virtual()?;
    let speeds = [model.numbers.slow, model.numbers.fast];
    let jobs = jobs(&cranes, speeds);
    let strayed = jobs.par_iter().map(|(number, speed)| {
        let crane = member(&nominal, seed, *number)?.crane;
        let course = CourseChoice::Motion(*speed).of(&crane)?;
        let astray = astray(&model, &crane, course.as_ref())?;
        // the way up, and the way down
        let (up, down) = astray.split_at(astray.len() / 2);
        Ok([largest(up), largest(down)])
    });
    let strayed = strayed.collect::<Result<Vec<_>, LabError>>()?;
    for ((number, speed), [up, down]) in jobs.iter().zip(&strayed) {
        if up.max(*down) > FAR || cranes.len() <= 12 {
            let [speed, up, down] = [speed, up, down].map(|si| si * 1e3);
            println!(
                "crane {number}, {speed:.0} mm/s: {up:.4} mm on its way up, {down:.4} mm down"
            );
        }
    }
    let mut most: Vec<f64> = strayed.iter().map(|[up, down]| up.max(*down) * 1e3).collect();
    most.sort_by(f64::total_cmp);
    let far = most.iter().filter(|mm| **mm > FAR * 1e3).count();
    println!(
        "median {:.4} mm, more than {} mm on {far} of {}",
        most[most.len() / 2],
        FAR * 1e3,
        most.len()
    );
    Ok(())
}
