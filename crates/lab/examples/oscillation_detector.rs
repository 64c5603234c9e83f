//! Does the detector of sustained oscillation, shown the piston position as an exported block reads it, fire on the runs that
//! the lab calls sustained by the true position, and on no others? The benchmark on a family of virtual cranes.
//!
//! ```sh
//! cargo run --release -p hydroboom-lab --example oscillation_detector -- 707 200 fast
//! cargo run --release -p hydroboom-lab --example oscillation_detector -- 707 200 reversal
//! ```

#![expect(clippy::unwrap_used, reason = "an example that cannot set up has failed")]

use hydroboom_control::reference::profile::SetPoint;
use hydroboom_control::reference::trajectory::Trajectory;
use hydroboom_control::strategy::Strategy;
use hydroboom_control::supervision::oscillation_detector::{OscillationDetector, OscillationState};
use hydroboom_description::Description;
use hydroboom_lab::family::member;
use hydroboom_lab::motion_test::Sample;
use hydroboom_lab::rings_on::rings_on;
use hydroboom_lab::rivals::Contender;
use hydroboom_lab::scenario::{Course, CourseChoice, Load};
use hydroboom_lab::score::Score;
use hydroboom_lab::steering::steer;
use rayon::prelude::*;

/// Rest after the course \[s\], as the lab takes to decide.
const REST: f64 = 5.0;

struct WithRest<'a>(&'a dyn Course);

impl Trajectory for WithRest<'_> {
    fn reference(&self, time: f64) -> SetPoint<f64> {
        self.0.reference(time.min(self.0.duration()))
    }
    fn duration(&self) -> f64 {
        self.0.duration() + REST
    }
    fn speed(&self) -> f64 {
        self.0.speed()
    }
}

impl Course for WithRest<'_> {
    fn name(&self) -> String {
        self.0.name()
    }
    fn loads(&self) -> &[Load] {
        self.0.loads()
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [seed, count, course] = arguments.as_slice() else {
        println!("seed, number of cranes, and fast or a scenario's name are expected");
        return;
    };
    let (seed, count): (u64, u64) = (seed.parse().unwrap(), count.parse().unwrap());
    let model = Description::uia_single_boom().unwrap();
    let nominal = Description::uia_virtual().unwrap();
    let choice = match course.as_str() {
        "fast" => CourseChoice::Motion(model.numbers.fast),
        name => CourseChoice::Scenario(name.into()),
    };
    let found: Vec<[bool; 2]> = (0..count)
        .into_par_iter()
        .map(|number| {
            let crane = member(&nominal, seed, number).unwrap().crane;
            let course = choice.of(&crane).unwrap();
            let benchmark = Contender::from(Strategy::BenchmarkClosedLoop);
            let mut score = Score::new();
            let end = steer(&model, &crane, benchmark, course.as_ref(), |sample: &Sample| {
                score.add(sample);
                Ok(())
            });
            let sustained =
                end.is_err() || rings_on(&model, &crane, benchmark, course.as_ref(), &score);
            let (mut state, mut fired) = (OscillationState::default(), false);
            let longer = WithRest(course.as_ref());
            let period = model.numbers.control_period;
            // a crane that breaks has been counted above
            let _ = steer(&model, &crane, benchmark, &longer, |sample: &Sample| {
                let error = sample.reference.position - sample.reading.stroke;
                let rests = sample.reference.velocity == 0.0;
                let detector = OscillationDetector::POSITIONING;
                fired |= detector.update(&mut state, error, rests, period);
                Ok(())
            });
            [sustained, fired]
        })
        .collect();
    let of = |wanted: [bool; 2]| found.iter().filter(|both| **both == wanted).count();
    println!(
        "{course}, {count} cranes of seed {seed}: sustained and found {}, sustained and not found {}, found and not sustained {}, neither {}",
        of([true, true]),
        of([true, false]),
        of([false, true]),
        of([false, false])
    );
}
