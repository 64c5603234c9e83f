//! Comparison of the detector of sustained oscillation in the exported blocks, which reads the measured
//! piston position, with the lab's criterion, which uses the true position. Benchmark controller on a
//! family of virtual cranes.
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
use hydroboom_lab::closed_loop::controller_choice::ControllerChoice;
use hydroboom_lab::closed_loop::metrics::Metrics;
use hydroboom_lab::closed_loop::monte_carlo::member;
use hydroboom_lab::closed_loop::sample::Sample;
use hydroboom_lab::closed_loop::scenario::{Course, CourseChoice, Load};
use hydroboom_lab::closed_loop::simulation::simulate_closed_loop;
use hydroboom_lab::closed_loop::sustained_oscillation::has_sustained_oscillation;
use rayon::prelude::*;

/// Rest after the course \[s\], as long as the lab's criterion needs.
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
            let benchmark = ControllerChoice::from(Strategy::BenchmarkClosedLoop);
            let mut metrics = Metrics::new();
            let end = simulate_closed_loop(
                &model,
                &crane,
                benchmark,
                course.as_ref(),
                |sample: &Sample| {
                    metrics.add(sample);
                    Ok(())
                },
            );
            let sustained = end.is_err()
                || has_sustained_oscillation(&model, &crane, benchmark, course.as_ref(), &metrics);
            let (mut state, mut fired) = (OscillationState::default(), false);
            let longer = WithRest(course.as_ref());
            let period = model.numbers.control_period;
            // a crane whose simulation fails has been counted above
            let _ = simulate_closed_loop(&model, &crane, benchmark, &longer, |sample: &Sample| {
                let error = sample.reference.position - sample.signals.stroke;
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
