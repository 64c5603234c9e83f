//! ControllerChoices on a family, crane by crane, as JSON lines: `judge CONTENDERS COURSES SEED FROM TO`.
use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use hydroboom_lab::baselines::{Baseline, LQG, MPC, RETUNED};
use hydroboom_lab::closed_loop::controller_choice::ControllerChoice;
use hydroboom_lab::closed_loop::metrics::Metrics;
use hydroboom_lab::closed_loop::monte_carlo::member;
use hydroboom_lab::closed_loop::sample::Sample;
use hydroboom_lab::closed_loop::scenario::CourseChoice;
use hydroboom_lab::closed_loop::simulation::*;
use hydroboom_lab::closed_loop::sustained_oscillation::has_sustained_oscillation;
use std::io::Write;

/// The same errors of the true piston: no sensor, no fieldbus; and how far it runs ahead of the path, by regression on the path's velocity.
#[derive(Clone, Copy, Default)]
struct TrueScore {
    square: f64,
    count: u64,
    peak: f64,
    by_velocity: f64,
    velocity: f64,
}

impl TrueScore {
    fn add(&mut self, s: &Sample) {
        let error = s.truth.outputs.stroke - s.reference.position;
        let v = s.reference.velocity;
        self.square += error * error;
        self.count += 1;
        self.peak = if error.abs() > self.peak.abs() { error } else { self.peak };
        self.by_velocity += error * v;
        self.velocity += v * v;
    }
    fn rms(&self) -> f64 {
        (self.square / self.count.max(1) as f64).sqrt()
    }
    fn ahead(&self) -> f64 {
        self.by_velocity / self.velocity.max(1e-12)
    }
}

fn main() {
    let a: Vec<String> = std::env::args().collect();
    let mut model = Description::uia_single_boom().unwrap();
    // what the controllers know otherwise, e.g. `following.lead_ms=0`, and what they are called then
    if let Ok(sets) = std::env::var("KNOWN") {
        for set in sets.split(';').filter(|s| !s.is_empty()) {
            model.set(set).unwrap();
        }
    }
    let label = std::env::var("LABEL").ok();
    let nominal = Description::uia_virtual().unwrap();
    let contenders: Vec<ControllerChoice> = a[1]
        .split(',')
        .map(|name| match name {
            "benchmark" => Strategy::BenchmarkClosedLoop.into(),
            "following" => Strategy::ModelFollowing.into(),
            "reoptimised" => ControllerChoice::Baseline(Baseline::RetunedBenchmark(RETUNED)),
            "lqg" => ControllerChoice::Baseline(Baseline::Lqg(LQG)),
            "mpc" => ControllerChoice::Baseline(Baseline::LinearMpc(MPC)),
            "scheduled" => Strategy::ScheduledLqr.into(),
            other => panic!("{other}"),
        })
        .collect();
    let courses: Vec<CourseChoice> = a[2]
        .split(',')
        .map(|name| match name {
            "slow" => CourseChoice::Motion(model.numbers.slow),
            "fast" => CourseChoice::Motion(model.numbers.fast),
            other => CourseChoice::Scenario(other.into()),
        })
        .collect();
    let seed: u64 = a[3].parse().unwrap();
    let (from, to): (u64, u64) = (a[4].parse().unwrap(), a[5].parse().unwrap());
    let numbers: Vec<u64> = (from..to).collect();
    let stdout = std::io::stdout();
    let mut jobs: Vec<(Vec<u64>, usize, usize)> = Vec::new();
    for group in numbers.chunks(WIDTH) {
        for c in 0..courses.len() {
            for s in 0..contenders.len() {
                jobs.push((group.to_vec(), c, s));
            }
        }
    }
    let next = std::sync::atomic::AtomicUsize::new(0);
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| loop {
        let job = next.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        let Some((group, c, s)) = jobs.get(job) else { break };
        let members: Vec<_> = (0..WIDTH).map(|k| member(&nominal, seed, group[k.min(group.len() - 1)]).unwrap().crane).collect();
        let own: Vec<_> = members.iter().map(|m| courses[*c].of(m).unwrap()).collect();
        let lanes: [Case<'_>; WIDTH] = std::array::from_fn(|k| Case { crane: &members[k], controller: contenders[*s], course: own[k].as_ref() });
        let mut scores = lanes.map(|_| Metrics::new());
        let mut truths = [TrueScore::default(); WIDTH];
        let ends = simulate_side_by_side(&model, &lanes, |k, sample| {
            scores[k].add(sample);
            truths[k].add(sample);
        });
        for (k, number) in group.iter().enumerate() {
            let (rms, swings) = match &ends[k] {
                Ok(()) => (scores[k].rms() * 1e3, has_sustained_oscillation(&model, lanes[k].crane, contenders[*s], lanes[k].course, &scores[k])),
                Err(error) => { eprintln!("{number}: {error}"); (f64::NAN, true) }
            };
            let e = scores[k].effort();
            let t = &truths[k];
            let who = label.as_deref().unwrap_or(contenders[*s].name());
            let number_or_null = |x: f64| if x.is_nan() { "null".to_string() } else { format!("{x:.5}") };
            let mut out = stdout.lock();
            writeln!(out, "{{\"seed\":{seed},\"crane\":{number},\"course\":\"{}\",\"who\":\"{who}\",\"rms\":{},\"true\":{},\"peak\":{:.4},\"true_peak\":{:.4},\"ahead_ms\":{:.4},\"swings\":{swings},\"motor\":{:.2},\"energy\":{:.4}}}", own[k].name(), number_or_null(rms), number_or_null(if rms.is_nan() { rms } else { t.rms() * 1e3 }), scores[k].peak() * 1e3, t.peak * 1e3, t.ahead() * 1e3, e.motor_speed_rpm, e.energy_kj).unwrap();
            out.flush().unwrap();
        }
    });
        }
    });
}
