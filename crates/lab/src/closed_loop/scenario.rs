//! Test scenarios: courses of the piston with load changes (section 6.3).

use crate::LabError;
use hydroboom_control::reference::profile::{OutAndBack, PointToPoint, RampShape, SetPoint};
use hydroboom_control::reference::trajectory::Trajectory;
use hydroboom_description::Description;
use serde::Serialize;

/// Reference trajectory of the piston with a name and load changes.
pub trait Course: Trajectory {
    /// Name in tables and messages.
    fn name(&self) -> String;
    /// Changes of the payload in the order of their times.
    fn loads(&self) -> &[Load] {
        &[]
    }
    /// Whether the controllers have a preview. Without one, as with a joystick, they know past and present
    /// set points only.
    fn is_known_ahead(&self) -> bool {
        true
    }
}

/// Name of the out-and-back motion of a crane file at a speed \[mm/s\], rounded to whole mm/s, as `25 mm/s`.
pub fn motion_name(speed_mm_s: f64) -> String {
    format!("{speed_mm_s:.0} mm/s")
}

impl Course for OutAndBack<f64> {
    fn name(&self) -> String {
        motion_name(self.speed * 1e3)
    }
}

/// Load change: the payload from a time on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Load {
    /// Time since the start of the course \[s\].
    pub time: f64,
    /// Mass of the payload \[kg\].
    pub mass: f64,
}

/// Payload \[kg\] of the last change in `loads` up to a time \[s\]; none if there is no change by then. The changes up
/// to that time are removed from `loads`, which must be in the order of their times.
pub fn due(loads: &mut &[Load], time: f64) -> Option<f64> {
    let count = loads.iter().take_while(|load| load.time <= time).count();
    let (now, later) = loads.split_at(count);
    *loads = later;
    now.last().map(|load| load.mass)
}

/// Move of a scenario.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Leg {
    begin: f64,
    from: f64,
    /// Direction: +1 outwards, −1 inwards.
    sign: f64,
    way: PointToPoint<f64>,
}

/// Test scenario: moves of the piston between positions, with rests and load changes.
#[derive(Clone, Debug)]
pub struct Scenario {
    /// Name at the command line.
    pub name: &'static str,
    /// Description of the situation.
    pub meaning: &'static str,
    start: f64,
    legs: Vec<Leg>,
    loads: Vec<Load>,
    duration: f64,
}

/// Summary of a scenario, for a list.
#[derive(Clone, Debug, Serialize)]
pub struct Outline {
    /// Name at the command line.
    pub name: &'static str,
    /// Description of the situation.
    pub meaning: &'static str,
    /// Number of moves from one position to another.
    pub moves: usize,
    /// Duration of the course \[s\], rests included.
    pub duration_s: f64,
    /// Largest reference speed of the piston \[mm/s\].
    pub speed_mm_s: f64,
}

impl Scenario {
    fn new(name: &'static str, meaning: &'static str, start: f64) -> Self {
        Self { name, meaning, start, legs: Vec::new(), loads: Vec::new(), duration: 0.0 }
    }

    fn rest(mut self, duration: f64) -> Self {
        self.duration += duration;
        self
    }

    fn go(mut self, to: f64, speed: f64, ramp: f64, profile: RampShape) -> Self {
        let from =
            self.legs.last().map_or(self.start, |leg| leg.from + leg.sign * leg.way.distance);
        let way = PointToPoint { distance: (to - from).abs(), speed, ramp, profile };
        let sign = if to < from { -1.0 } else { 1.0 };
        self.legs.push(Leg { begin: self.duration, from, sign, way });
        self.duration += way.duration();
        self
    }

    fn load(mut self, mass: f64) -> Self {
        self.loads.push(Load { time: self.duration, mass });
        self
    }

    /// Payload change in the middle of the last move.
    fn load_on_the_way(mut self, mass: f64) -> Self {
        let middle = self.legs.last().map(|leg| leg.begin + 0.5 * leg.way.duration());
        self.loads.extend(middle.map(|time| Load { time, mass }));
        self
    }

    /// Summary of the scenario: number of moves, duration and largest speed.
    pub fn outline(&self) -> Outline {
        Outline {
            name: self.name,
            meaning: self.meaning,
            moves: self.legs.len(),
            duration_s: self.duration,
            speed_mm_s: self.speed() * 1e3,
        }
    }
}

impl Trajectory for Scenario {
    fn reference(&self, t: f64) -> SetPoint<f64> {
        let begun = self.legs.partition_point(|leg| leg.begin <= t);
        match begun.checked_sub(1).map(|last| self.legs[last]) {
            Some(leg) => {
                let done = leg.way.at(t - leg.begin);
                SetPoint {
                    position: leg.from + leg.sign * done.position,
                    velocity: leg.sign * done.velocity,
                }
            }
            None => SetPoint { position: self.start, velocity: 0.0 },
        }
    }
    fn duration(&self) -> f64 {
        self.duration
    }
    fn speed(&self) -> f64 {
        self.legs.iter().map(|leg| leg.way.speed).fold(0.0, f64::max)
    }
}

impl Course for Scenario {
    fn name(&self) -> String {
        self.name.into()
    }
    fn loads(&self) -> &[Load] {
        &self.loads
    }
}

/// Selected course: the motion of the crane file, or a test scenario.
#[derive(Clone, Debug, PartialEq)]
pub enum CourseChoice {
    /// Motion of the crane file at a speed \[m/s\].
    Motion(f64),
    /// Scenario of this name.
    Scenario(String),
}

impl CourseChoice {
    /// Course for a crane, within its stroke, speeds and payload.
    ///
    /// # Errors
    ///
    /// [`LabError::Scenario`] if there is no scenario of that name.
    pub fn of(&self, crane: &Description) -> Result<Box<dyn Course>, LabError> {
        match self {
            Self::Motion(speed) => Ok(Box::new(crane.motion(*speed))),
            Self::Scenario(name) => {
                let all = scenarios(crane);
                let names = all.iter().map(|s| s.name).collect::<Vec<_>>().join(", ");
                let wanted = all.into_iter().find(|scenario| scenario.name == name);
                match wanted {
                    Some(scenario) => Ok(Box::new(scenario)),
                    None => Err(LabError::Scenario { name: name.clone(), names }),
                }
            }
        }
    }
}

/// All test scenarios, adapted to the stroke, the speeds and the payload of a crane.
pub fn scenarios(crane: &Description) -> Vec<Scenario> {
    let p = MotionParameters::of(crane);
    vec![
        p.payload_change(),
        p.start_stop(),
        p.small_moves(),
        p.reversal(),
        p.saturation(),
        p.load_in_motion(),
        p.shift(),
    ]
}

/// Positions \[m\], speeds \[m/s\], ramp \[s\] and payload \[kg\] of a crane for its scenarios.
struct MotionParameters {
    start: f64,
    end: f64,
    fast: f64,
    slow: f64,
    /// Piston speed at the largest motor speed.
    fastest: f64,
    ramp: f64,
    profile: RampShape,
    payload: f64,
}

impl MotionParameters {
    fn of(crane: &Description) -> Self {
        let n = &crane.numbers;
        Self {
            start: n.motion_start,
            end: n.motion_end,
            fast: n.fast,
            slow: n.slow,
            fastest: n.motor_speed * n.displacement / crane.cylinder().piston_area,
            ramp: n.ramp,
            profile: crane.motion(n.fast).profile,
            payload: n.payload,
        }
    }

    /// Position at a share of the way.
    fn at(&self, share: f64) -> f64 {
        self.start + share * (self.end - self.start)
    }

    fn payload_change(&self) -> Scenario {
        let Self { start, end, fast, ramp, profile, payload, .. } = *self;
        Scenario::new(
            "payload-change",
            "lifts a load, sets it down, comes back with half of it and without",
            start,
        )
        .rest(2.0)
        .go(end, fast, ramp, profile)
        .rest(2.0)
        .load(0.5 * payload)
        .rest(3.0)
        .go(start, fast, ramp, profile)
        .rest(2.0)
        .load(0.0)
        .rest(3.0)
        .go(self.at(0.5), fast, ramp, profile)
        .rest(2.0)
        .load(payload)
        .rest(4.0)
    }

    fn start_stop(&self) -> Scenario {
        let Self { start, fast, ramp, profile, .. } = *self;
        let meaning = "starts and stops ten times on the way up and down";
        let mut all = Scenario::new("start-stop", meaning, start).rest(2.0);
        for k in (1..=10).chain((0..10).rev()) {
            all = all.go(self.at(f64::from(k) / 10.0), fast, 0.3 * ramp, profile).rest(0.5);
        }
        all.rest(2.0)
    }

    fn small_moves(&self) -> Scenario {
        let Self { slow, ramp, profile, .. } = *self;
        let (middle, meaning) = (self.at(0.5), "positions to and fro by 1, 2, 5 and 10 mm");
        let mut all = Scenario::new("small-moves", meaning, middle).rest(2.0);
        for millimetres in [1.0, 2.0, 5.0, 10.0] {
            all = all
                .go(middle + millimetres * 1e-3, slow, 0.3 * ramp, profile)
                .rest(2.0)
                .go(middle, slow, 0.3 * ramp, profile)
                .rest(2.0);
        }
        all
    }

    fn reversal(&self) -> Scenario {
        let Self { fast, ramp, profile, .. } = *self;
        let (low, high) = (self.at(0.3), self.at(0.7));
        let mut all =
            Scenario::new("reversal", "reverses under load without a pause", low).rest(2.0);
        for _ in 0..5 {
            all = all.go(high, fast, 0.5 * ramp, profile).go(low, fast, 0.5 * ramp, profile);
        }
        all.rest(3.0)
    }

    /// A third faster than the largest motor speed allows.
    fn saturation(&self) -> Scenario {
        let Self { start, end, fastest, ramp, profile, .. } = *self;
        Scenario::new("saturation", "asks for a third more than the motor can", start)
            .rest(2.0)
            .go(end, 4.0 / 3.0 * fastest, ramp, profile)
            .rest(3.0)
            .go(start, 4.0 / 3.0 * fastest, ramp, profile)
            .rest(4.0)
    }

    fn load_in_motion(&self) -> Scenario {
        let Self { start, end, fast, ramp, profile, payload, .. } = *self;
        Scenario::new(
            "load-in-motion",
            "picks a load up while it lifts, and loses half of it while it lowers",
            start,
        )
        .rest(1.0)
        .load(0.7 * payload)
        .rest(4.0)
        .go(end, fast, ramp, profile)
        .load_on_the_way(payload)
        .rest(4.0)
        .go(start, fast, ramp, profile)
        .load_on_the_way(0.5 * payload)
        .rest(4.0)
    }

    fn shift(&self) -> Scenario {
        let Self { start, end, fast, ramp, profile, .. } = *self;
        let mut shift = Scenario::new(
            "shift",
            "eight hours of work: twelve cycles, then a break as long, again and again, oil warming",
            start,
        )
        .rest(2.0);
        while shift.duration < 8.0 * 3600.0 {
            let begun = shift.duration;
            for _ in 0..12 {
                shift = shift
                    .go(end, fast, ramp, profile)
                    .rest(3.0)
                    .go(start, fast, ramp, profile)
                    .rest(3.0);
            }
            let worked = shift.duration - begun;
            shift = shift.rest(worked);
        }
        shift
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_course_is_continuous_and_stays_within_the_stroke() {
        let crane = Description::uia_single_boom().unwrap();
        for scenario in scenarios(&crane) {
            let step = 0.01;
            let mut before = scenario.reference(0.0);
            let mut time = step;
            while time <= scenario.duration().min(600.0) {
                let now = scenario.reference(time);
                let mean = 0.5 * (now.velocity + before.velocity);
                let gap = (now.position - before.position - mean * step).abs();
                // at the corners of the ramps the gap is a velocity step over one period
                assert!(gap < 2e-4, "{}: {gap} m at {time} s", scenario.name);
                assert!((0.0..=crane.numbers.stroke).contains(&now.position), "{}", scenario.name);
                assert!(now.velocity.abs() <= scenario.speed() * (1.0 + 1e-9));
                (before, time) = (now, time + step);
            }
        }
    }
}
