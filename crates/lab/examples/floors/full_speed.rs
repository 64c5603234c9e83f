//! What the motor alone leaves of the error where a reference is faster than it: of a piston without mass, on oil that gives nowhere, that moves no
//! faster than the crane's motor can. Oil that gives lends a piston some millimetres of travel
//! while its pressure changes, so that one on soft oil may have less.

use super::{Case, Failure, Left};
use hydroboom_design::operating_points::OperatingPoints;

/// Duration of a step \[s\].
const STEP: f64 = 1e-3;
/// A reference that moves no farther in a step rests \[m\].
const RESTS: f64 = 1e-9;

/// Such a piston, and where it is to be at the end of each step \[m\].
struct Piston {
    points: OperatingPoints,
    /// Largest motor speed \[rev/s\].
    motor_speed: f64,
    /// The crane's pump flow over that of the model, whose operating points these are.
    delivers: f64,
    wanted: Vec<f64>,
}

impl Piston {
    fn new(Case { model, crane, course, .. }: &Case) -> Result<Self, Failure> {
        let points = super::operating_points(model, crane)?;
        let delivers = crane.numbers.flow_gain / model.numbers.flow_gain;
        let steps = (course.duration() / STEP).round() as u64;
        let wanted = (0..=steps).map(|k| course.reference(k as f64 * STEP).position).collect();
        Ok(Self { points, motor_speed: model.numbers.motor_speed, delivers, wanted })
    }

    /// How far it can move in and out within a step, at a position \[m\].
    fn farthest(&self, position: f64) -> [f64; 2] {
        let at = self.points.at(position);
        let rest = &at.equilibrium;
        let spring = at.spring(self.points.stiffness(rest.load_pressure));
        let speed_per_velocity =
            (rest.load_pressure_slope - spring.pressure_by_velocity) / spring.pressure_by_speed;
        [-self.motor_speed, self.motor_speed]
            .map(|speed| STEP * (self.delivers * speed - rest.holding_speed) / speed_per_velocity)
    }

    /// Where it is at the end of each step that nobody told where it will have to be \[m\].
    fn untold(&self) -> Vec<f64> {
        let mut position = self.wanted[0];
        let follow = |wanted: &f64| {
            let [inwards, outwards] = self.farthest(position);
            position += (wanted - position).clamp(inwards, outwards);
            position
        };
        self.wanted.iter().map(follow).collect()
    }

    /// Where it is at best if all of it is known beforehand \[m\].
    fn told(&self) -> Vec<f64> {
        self.moves().iter().flat_map(|part| self.best_of(&self.wanted[part.clone()])).collect()
    }

    /// One move after the other, each to one side, with half of the rests around it.
    fn moves(&self) -> Vec<std::ops::Range<usize>> {
        let count = self.wanted.len();
        let side = |k: usize| {
            let by = self.wanted[k] - self.wanted[k - 1];
            if by.abs() < RESTS { 0.0 } else { by.signum() }
        };
        let moving: Vec<usize> = (1..count).filter(|k| side(*k) != 0.0).collect();
        let turned = moving.windows(2).filter(|pair| side(pair[0]) != side(pair[1]));
        let between = turned.map(|pair| pair[0].midpoint(pair[1]));
        let ends: Vec<_> = std::iter::once(0).chain(between).chain([count]).collect();
        ends.windows(2).map(|pair| pair[0]..pair[1]).collect()
    }

    /// The nearest to a move to one side of all that are nowhere faster than the fastest that the piston is anywhere along it. Less what that would move by then,
    /// such a one never rises (falls, inwards): the nearest of those is found by taking the mean of what rises until nothing does.
    fn best_of(&self, wanted: &[f64]) -> Vec<f64> {
        let out = wanted[wanted.len() - 1] > wanted[0];
        let side = if out { 1.0 } else { -1.0 };
        let speeds = wanted.iter().map(|at| side * self.farthest(*at)[usize::from(out)]);
        let fastest = speeds.fold(0.0, f64::max);
        // means of what has been taken together, and of how many
        let mut means: Vec<(f64, usize)> = Vec::new();
        for (k, at) in wanted.iter().enumerate() {
            let mut last = (side * at - fastest * k as f64, 1);
            while let Some((mean, count)) = means.pop_if(|(mean, _)| *mean < last.0) {
                let together = count + last.1;
                let sum = mean * count as f64 + last.0 * last.1 as f64;
                last = (sum / together as f64, together);
            }
            means.push(last);
        }
        let level = means.iter().flat_map(|(mean, count)| std::iter::repeat_n(*mean, *count));
        level.enumerate().map(|(k, mean)| side * (mean + fastest * k as f64)).collect()
    }

    fn left(&self, went: &[f64]) -> Left {
        let off = went.iter().zip(&self.wanted).map(|(at, wanted)| at - wanted);
        let square: f64 = off.clone().map(|off| off * off).sum();
        let farthest = off.fold(0.0, |farthest: f64, off| farthest.max(off.abs()));
        Left { rms: (square / went.len() as f64).sqrt(), farthest }
    }
}

/// What a piston is off that nothing but its largest speed hinders: at best if all of the course is known beforehand, and if nothing is.
pub fn left(case: &Case) -> Result<[Left; 2], Failure> {
    let piston = Piston::new(case)?;
    Ok([piston.told(), piston.untold()].map(|went| piston.left(&went)))
}
