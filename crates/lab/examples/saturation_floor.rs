//! What the motor alone leaves of the error where a reference is faster than it: of a piston without mass, on oil that gives nowhere, that moves no
//! faster than the crane's motor can. Beside it what benchmark and model following have. Oil that gives lends a piston some millimetres of travel
//! while its pressure changes, so that one on soft oil may have less.
//!
//! `saturation_floor -- 32` for the first 32 cranes of seed 1; without a number for 16.

use hydroboom_control::ModelFollowing;
use hydroboom_description::Description;
use hydroboom_design::schedule;
use hydroboom_lab::LabError;
use hydroboom_lab::family::member;
use hydroboom_lab::motion_test::Strategy;
use hydroboom_lab::scenario::{Course, CourseChoice};
use hydroboom_lab::score::Score;
use hydroboom_lab::steering::steer;
use rayon::prelude::*;
use std::error::Error;

const SEED: u64 = 1;
const CRANES: u64 = 16;
/// Duration of a step \[s\].
const STEP: f64 = 1e-3;

/// How fast the piston can move in and out, at a position \[m\] and the motor's limit \[m/s\]. The law is the model's; `delivers` is the crane's pump
/// flow over the model's.
fn fastest(law: &ModelFollowing<f64>, delivers: f64, position: f64) -> [f64; 2] {
    let at = law.station(position);
    let spring = at.spring(law.stiffness_at(at.rest.load_pressure));
    let speed_per_velocity =
        (at.rest.load_pressure_slope - spring.pressure_by_velocity) / spring.pressure_by_speed;
    [-law.limits.speed, law.limits.speed]
        .map(|speed| (delivers * speed - at.rest.holding_speed) / speed_per_velocity)
}

/// Root of the mean square \[m\] of what a piston is behind that nothing but its largest speed hinders.
fn floor(
    model: &Description,
    crane: &Description,
    course: &dyn Course,
) -> Result<f64, Box<dyn Error + Send + Sync>> {
    let law = schedule(model)?.at(crane.numbers.payload);
    let delivers = crane.numbers.flow_gain / model.numbers.flow_gain;
    let steps = (course.duration() / STEP).round() as u64;
    let mut position = course.reference(0.0).position;
    let mut square = 0.0;
    for k in 1..=steps {
        let wanted = course.reference(k as f64 * STEP).position;
        let [inwards, outwards] = fastest(&law, delivers, position);
        position += (wanted - position).clamp(STEP * inwards, STEP * outwards);
        square += (wanted - position).powi(2);
    }
    Ok((square / steps as f64).sqrt())
}

/// The same of a strategy on the crane.
fn rms(
    model: &Description,
    crane: &Description,
    strategy: Strategy,
    course: &dyn Course,
) -> Result<f64, LabError> {
    let mut score = Score::new(course.duration());
    steer(model, crane, strategy, course, |sample| {
        score.add(sample);
        Ok(())
    })?;
    Ok(score.rms())
}

fn main() -> Result<(), Box<dyn Error + Send + Sync>> {
    let count = std::env::args().nth(1).map_or(Ok(CRANES), |number| number.parse())?;
    let model = Description::uia_single_boom()?;
    let nominal = Description::uia_virtual()?;
    let choice = CourseChoice::Scenario("saturation".into());
    let one = |number: u64| -> Result<[f64; 3], Box<dyn Error + Send + Sync>> {
        let crane = member(&nominal, SEED, number)?.crane;
        let course = choice.of(&crane)?;
        let of = |strategy| rms(&model, &crane, strategy, course.as_ref());
        let steered = [of(Strategy::BenchmarkClosedLoop)?, of(Strategy::ModelFollowing)?];
        Ok([floor(&model, &crane, course.as_ref())?, steered[0], steered[1]]
            .map(|error| 1e3 * error))
    };
    let rows: Vec<_> = (0..count).into_par_iter().map(one).collect::<Result<_, _>>()?;
    println!("RMS [mm]     the motor alone   benchmark   model following");
    for (number, [floor, benchmark, following]) in rows.iter().enumerate() {
        println!("crane {number:>3}         {floor:>9.2}   {benchmark:>9.2}   {following:>15.2}");
    }
    let median = |of: &dyn Fn(&[f64; 3]) -> f64| {
        let mut values: Vec<_> = rows.iter().map(of).collect();
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
    };
    let [alone, has] = [0, 2].map(|of| median(&|row| row[of] / row[1]));
    println!(
        "of the benchmark's, in the median: {alone:.2} by the motor alone, {has:.2} by model following"
    );
    Ok(())
}
