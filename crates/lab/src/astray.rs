//! How far a machine strays that is told nearly the same.

use crate::LabError;
use crate::closed_loop::scenario::Course;
use crate::learning::Cycle;
use crate::open_loop::at_rest;
use hydroboom_control::command::AxisCommand;
use hydroboom_description::Description;

/// So much more is it told \[rev/s\], for so long \[s\].
const BY: f64 = 1.0 / 60.0;
const FOR: f64 = 0.1;

/// How far a machine strays \[m\] from where a cycle under model following has led it, at the beginning of each control period: told the same from the same
/// rest, but for 1 rpm more over the first tenth of a second of the motion. What a machine makes of that, all that nobody knows of it makes, too.
///
/// # Errors
///
/// [`LabError`] when the crane cannot be steered along the course.
pub fn astray(
    model: &Description,
    crane: &Description,
    course: &dyn Course,
) -> Result<Vec<f64>, LabError> {
    let Cycle { told, .. } = Cycle::of(model, crane, course)?;
    let period = crane.numbers.control_period;
    let moves = |k: &usize| course.reference(*k as f64 * period).velocity != 0.0;
    let from = (0..told.len()).find(moves).unwrap_or(0);
    let to = (from + (FOR / period).round() as usize).min(told.len());
    let mut more = told.clone();
    more[from..to].iter_mut().for_each(|command| command.motor_speed += BY);
    // where they are: the last digit of what is read hides what grows
    let [mut led, mut other] = [at_rest(crane, course)?, at_rest(crane, course)?];
    let apart = |(told, more): (&AxisCommand<f64>, &AxisCommand<f64>)| {
        let apart = other.truth().outputs.stroke - led.truth().outputs.stroke;
        led.advance(told).and_then(|()| other.advance(more)).map(|()| apart)
    };
    let apart: Result<Vec<f64>, _> = told.iter().zip(&more).map(apart).collect();
    apart.map_err(LabError::during("the cycle once more"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::closed_loop::monte_carlo::member;
    use std::f64::consts::PI;

    /// A piston is off by the oil that it got, over its area; not one that the oil of an empty boom swings by itself.
    #[test]
    fn what_a_machine_got_more_moves_it_so_much_where_it_does_not_swing_by_itself() {
        let model = Description::uia_single_boom().unwrap();
        let nominal = Description::uia_virtual().unwrap();
        let course = nominal.motion(nominal.numbers.fast);
        let most = |crane: &Description| {
            let astray = astray(&model, crane, &course).unwrap();
            astray.iter().fold(0.0, |most, off| f64::max(most, off.abs()))
        };
        let n = &nominal.numbers;
        let area = PI / 4.0 * n.piston.powi(2);
        let by_oil = BY * FOR * n.displacement * n.flow_gain / area;
        let swings = member(&nominal, 1, 55).unwrap().crane;
        let [calm, swinging] = [&nominal, &swings].map(most);
        // once more as much while the oil swings to it
        assert!((by_oil..2.0 * by_oil).contains(&calm), "{calm} m for {by_oil} m");
        assert!(swinging > 100.0 * by_oil, "{swinging} m for {by_oil} m");
    }
}
