//! The paper's main claims with the corresponding figures here, including those that are worse.

use crate::closed_loop::sample::Sample;
use crate::motion_test::Run;
use crate::paper;
use crate::study::{NOMINAL, OFF, VIRTUAL};
use hydroboom_control::strategy::Strategy;
use serde::Serialize;

/// Figure of a claim on one plant.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OnPlant {
    /// Name of the plant: nominal, off-model or virtual.
    pub plant: &'static str,
    /// Figure from measured signals, in the claim's unit. An eigenfrequency is computed from the linearised plant and
    /// not measured.
    pub measured: f64,
    /// Figure from the true state, in the claim's unit; equal to the measured one if the sensors are ideal.
    #[serde(rename = "true")]
    pub truth: f64,
    /// Whether the measured figure is worse than the paper's tables, or than its text where the tables have none. None
    /// if the paper states neither.
    pub worse_than_paper: Option<bool>,
}

/// Claim of the paper with the corresponding figure of this model.
#[derive(Clone, Debug, Serialize)]
pub struct Claim {
    /// Description of the compared quantities.
    pub compares: String,
    /// Unit of all figures of the claim.
    pub unit: &'static str,
    /// Whether a larger figure is better.
    pub more_is_better: bool,
    /// Value stated in the paper's abstract and conclusions, in the claim's unit; none for another crane.
    pub paper_stated: Option<f64>,
    /// Value in the paper's tables, or derived from them, in the claim's unit; none if the tables have none.
    pub paper_tables: Option<f64>,
    /// Figures on each plant, without the nominal plant where it would be compared with itself.
    pub plants: Vec<OnPlant>,
}

impl Claim {
    /// Figure on a plant; none if it was not computed there.
    pub fn on(&self, plant: &str) -> Option<&OnPlant> {
        self.plants.iter().find(|figure| figure.plant == plant)
    }

    /// Number of decimal places with which its figures are shown: one for percentages, else two.
    pub fn digits(&self) -> usize {
        if self.unit == "%" { 1 } else { 2 }
    }

    /// Names of the plants on which the figure is worse than the paper's.
    pub fn worse_on(&self) -> Vec<&'static str> {
        let worse = self.plants.iter().filter(|figure| figure.worse_than_paper == Some(true));
        worse.map(|figure| figure.plant).collect()
    }

    fn add(&mut self, plant: &'static str, [measured, truth]: [f64; 2]) {
        let paper = self.paper_tables.or(self.paper_stated);
        let worse_than_paper = paper
            .map(|paper| if self.more_is_better { measured < paper } else { measured > paper });
        self.plants.push(OnPlant { plant, measured, truth, worse_than_paper });
    }
}

/// Results of the study from which the claims are computed.
pub struct Shown<'a> {
    /// Whether the crane is the paper's; its figures apply to no other.
    pub is_papers_crane: bool,
    /// Stroke of the cylinder \[m\].
    pub stroke: f64,
    /// Slow and fast speed of the motion \[m/s\].
    pub speeds: [f64; 2],
    /// Piston positions of the eigenfrequencies \[mm\].
    pub eigen_stroke_mm: [f64; 3],
    /// Eigenfrequencies of the model at these positions \[Hz\], load held, without friction.
    pub model_hz: [f64; 3],
    /// Name and eigenfrequencies \[Hz\] at these positions of each plant that differs from the model.
    pub plants_hz: Vec<(&'static str, [f64; 3])>,
    /// Runs of all strategies, each with the name of its plant.
    pub runs: &'a [(String, Run)],
    /// The published model under velocity feedforward along the virtual crane's motions, slow and fast; none without a
    /// virtual crane.
    pub alongside: Option<[&'a Run; 2]>,
}

/// Claims in the order of the paper's conclusions. A figure is omitted if its run is missing, in sustained
/// oscillation or stopped.
pub fn claims(shown: &Shown<'_>) -> Vec<Claim> {
    let mut claims = vec![eigenfrequency(shown)];
    claims.extend([0, 1].map(|k| position(shown, k)));
    claims.extend([0, 1].map(|k| open_loop(shown, k)));
    claims.extend([0, 1].map(|k| closed_loop(shown, k)));
    claims
}

/// Mean accuracy \[%\] of eigenfrequencies in the same unit: 100 % minus the mean of |f_model / f_plant − 1|.
/// Negative if the mean deviation exceeds 100 %; NaN if a frequency is NaN.
pub fn accuracy_percent(model_hz: &[f64; 3], plant_hz: &[f64; 3]) -> f64 {
    let off = model_hz.iter().zip(plant_hz).map(|(model, plant)| (model / plant - 1.0).abs());
    100.0 * (1.0 - off.sum::<f64>() / model_hz.len() as f64)
}

fn eigenfrequency(shown: &Shown<'_>) -> Claim {
    let strokes = shown.eigen_stroke_mm.map(|stroke| format!("{stroke:.0}")).join(", ");
    let tables = accuracy_percent(&paper::EIGEN_SIMULATED_HZ, &paper::EIGEN_MEASURED_HZ);
    let mut claim = Claim {
        compares: format!("eigenfrequency at {strokes} mm: mean accuracy, model against plant"),
        unit: "%",
        more_is_better: true,
        paper_stated: shown.is_papers_crane.then_some(paper::STATED_EIGENFREQUENCY_PERCENT),
        paper_tables: shown.is_papers_crane.then_some(tables),
        plants: Vec::new(),
    };
    for (plant, hz) in &shown.plants_hz {
        claim.add(plant, [accuracy_percent(&shown.model_hz, hz); 2]);
    }
    claim
}

impl Shown<'_> {
    /// Run of a strategy at the slow (0) or the fast speed (1).
    fn run(&self, plant: &str, strategy: Strategy, k: usize) -> Option<&Run> {
        let is = |(name, run): &&(String, Run)| {
            name == plant && run.strategy == strategy && run.speed == self.speeds[k]
        };
        self.runs.iter().find(is).map(|(_, run)| run)
    }

    fn speed(&self, k: usize) -> String {
        format!("{:.0} mm/s", 1e3 * self.speeds[k])
    }
}

/// RMS difference of a quantity between two runs with the same periods.
fn rms_difference(a: &Run, b: &Run, value: fn(&Sample) -> f64) -> f64 {
    let pairs = a.samples.iter().zip(&b.samples);
    let square: f64 = pairs.map(|(a, b)| (value(a) - value(b)).powi(2)).sum();
    (square / a.samples.len().min(b.samples.len()).max(1) as f64).sqrt()
}

fn position(shown: &Shown<'_>, k: usize) -> Claim {
    let of_stroke = 100.0 / paper::STROKE_MM;
    let table_6 = of_stroke * paper::TABLE_6[0].3;
    let mut claim = Claim {
        compares: format!(
            "velocity feedforward, {}: RMS of plant less model, position",
            shown.speed(k)
        ),
        unit: "% of the stroke",
        more_is_better: false,
        paper_stated: shown.is_papers_crane.then_some(paper::STATED_POSITION_PERCENT),
        // Table 6 is at the fast speed
        paper_tables: (shown.is_papers_crane && k == 1).then_some(table_6),
        plants: Vec::new(),
    };
    let model = shown.run(NOMINAL, Strategy::VelocityFeedforward, k);
    for (plant, model) in [(OFF, model), (VIRTUAL, shown.alongside.map(|runs| runs[k]))] {
        let run = shown.run(plant, Strategy::VelocityFeedforward, k);
        let whole = |run: &&Run| run.stopped.is_none();
        if let (Some(model), Some(run)) = (model.filter(whole), run.filter(whole)) {
            let values: [fn(&Sample) -> f64; 2] =
                [|s| s.signals.stroke, |s| s.truth.outputs.stroke];
            claim
                .add(plant, values.map(|of| 100.0 / shown.stroke * rms_difference(model, run, of)));
        }
    }
    claim
}

/// Reduction of the RMS tracking error by `strategy` compared with `other` \[%\], measured and true.
fn less_by(shown: &Shown<'_>, claim: &mut Claim, [strategy, other]: [Strategy; 2], k: usize) {
    for plant in [NOMINAL, OFF, VIRTUAL] {
        if let (Some(run), Some(other)) =
            (shown.run(plant, strategy, k), shown.run(plant, other, k))
        {
            // the error of a sustained oscillation or of a stopped run is no tracking error
            if !run.is_stable() || !other.is_stable() {
                continue;
            }
            let (own, other) = (run.metrics(), other.metrics());
            let measured = 100.0 * (1.0 - own.rms() / other.rms());
            let truth = 100.0 * (1.0 - own.true_rms() / other.true_rms());
            claim.add(plant, [measured, truth]);
        }
    }
}

fn open_loop(shown: &Shown<'_>, k: usize) -> Claim {
    let stated = [Some(paper::STATED_OPEN_LOOP_PERCENT), None][k];
    let mut claim = Claim {
        compares: format!(
            "open loop, {}: RMS error, simulation below velocity feedforward",
            shown.speed(k)
        ),
        unit: "%",
        more_is_better: true,
        paper_stated: stated.filter(|_| shown.is_papers_crane),
        paper_tables: shown.is_papers_crane.then_some(paper::IMPROVEMENT_OPEN_LOOP_PERCENT[k]),
        plants: Vec::new(),
    };
    let pair = [Strategy::SimulationFeedforwardOpenLoop, Strategy::VelocityFeedforward];
    less_by(shown, &mut claim, pair, k);
    claim
}

fn closed_loop(shown: &Shown<'_>, k: usize) -> Claim {
    let stated = paper::STATED_CLOSED_LOOP_PERCENT[k];
    let mut claim = Claim {
        compares: format!(
            "closed loop, {}: RMS error, simulation feedforward below benchmark",
            shown.speed(k)
        ),
        unit: "%",
        more_is_better: true,
        paper_stated: shown.is_papers_crane.then_some(stated),
        paper_tables: shown.is_papers_crane.then_some(paper::IMPROVEMENT_CLOSED_LOOP_PERCENT[k]),
        plants: Vec::new(),
    };
    let pair = [Strategy::SimulationFeedforwardClosedLoop, Strategy::BenchmarkClosedLoop];
    less_by(shown, &mut claim, pair, k);
    claim
}

/// Note on how the table of claims is to be read.
pub const REMARK: &str = "\
Our eigenfrequencies are those of the linearised cranes without friction. The nominal plant equals the model, and so has no deviation from it. \
A negative reduction is an increase.";

/// Note on the paper's stated accuracy, for a table with the paper's figures.
pub const REMARK_ON_PAPER: &str = "The paper does not say at which speed its 1.2 % holds.";

#[cfg(test)]
mod tests {
    use super::*;
    use crate::closed_loop::metrics::SustainedOscillation;
    use crate::motion_test::run_all;
    use hydroboom_description::Description;

    /// The paper's text rounds figures of its tables. The definition of mean accuracy used here must
    /// reproduce the stated value.
    #[test]
    fn the_papers_tables_give_what_its_abstract_states() {
        let mean = accuracy_percent(&paper::EIGEN_SIMULATED_HZ, &paper::EIGEN_MEASURED_HZ);
        assert!((mean - paper::STATED_EIGENFREQUENCY_PERCENT).abs() < 0.5, "{mean} %");
        assert_eq!(
            paper::IMPROVEMENT_OPEN_LOOP_PERCENT[0].round(),
            paper::STATED_OPEN_LOOP_PERCENT
        );
        let closed = paper::IMPROVEMENT_CLOSED_LOOP_PERCENT.map(f64::round);
        assert_eq!(closed, paper::STATED_CLOSED_LOOP_PERCENT);
        let share = 100.0 * paper::STATED_POSITION_MM / paper::STROKE_MM;
        assert!((share - paper::STATED_POSITION_PERCENT).abs() < 0.05, "{share} % of the stroke");
        // the printed errors have two digits and reproduce the printed reductions within rounding
        for k in 0..2 {
            let [feedforward, open, benchmark, closed] = paper::TRACKING_MM.map(|(rms, _)| rms[k]);
            let near = |ratio: f64, percent: f64, within: f64| {
                let own = 100.0 * (1.0 - ratio);
                assert!((own - percent).abs() < within, "{own} % for {percent} %");
            };
            near(open / feedforward, paper::IMPROVEMENT_OPEN_LOOP_PERCENT[k], 0.05);
            near(closed / benchmark, paper::IMPROVEMENT_CLOSED_LOOP_PERCENT[k], 5.0);
        }
    }

    fn shown<'a>(runs: &'a [(String, Run)], speed: f64, is_papers_crane: bool) -> Shown<'a> {
        Shown {
            is_papers_crane,
            stroke: 0.5,
            speeds: [speed; 2],
            eigen_stroke_mm: paper::EIGEN_STROKE_MM,
            model_hz: [3.0; 3],
            plants_hz: vec![(OFF, [3.0, 3.0, 3.3])],
            runs,
            alongside: None,
        }
    }

    /// Figures by hand for runs with prescribed position errors.
    #[test]
    fn claims_give_the_figures_of_the_runs_and_name_worse_ones() {
        let model = Description::uia_single_boom().unwrap();
        let motion = model.motion(model.numbers.fast);
        let mut runs = Vec::new();
        for plant in [NOMINAL, OFF] {
            for mut run in run_all(&model, &model, &motion).unwrap() {
                let off = match (plant, run.strategy) {
                    (OFF, Strategy::VelocityFeedforward) => 20e-3,
                    (_, Strategy::VelocityFeedforward) => 10e-3,
                    (_, Strategy::SimulationFeedforwardOpenLoop) => 1e-3,
                    (_, Strategy::BenchmarkClosedLoop) => 2e-3,
                    _ => 3e-3,
                };
                for sample in &mut run.samples {
                    sample.signals.stroke = sample.reference.position + off;
                    sample.truth.outputs.stroke = sample.reference.position + 2.0 * off;
                }
                runs.push((plant.to_string(), run));
            }
        }
        let of = |papers| claims(&shown(&runs, model.numbers.fast, papers));
        let [eigen, _, position, _, open, _, closed] = &of(true)[..] else {
            panic!("another number")
        };
        let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-9, "{a} for {b}");
        let off = |claim: &Claim| claim.on(OFF).unwrap().clone();
        close(off(eigen).measured, 100.0 * (1.0 - (1.0 - 3.0 / 3.3) / 3.0));
        assert!(eigen.on(NOMINAL).is_none() && position.on(NOMINAL).is_none());
        // 10 and 20 mm of 500 mm
        close(off(position).measured, 2.0);
        close(off(position).truth, 4.0);
        close(off(open).measured, 95.0);
        close(open.on(NOMINAL).unwrap().truth, 90.0);
        close(closed.on(NOMINAL).unwrap().measured, -50.0);
        assert_eq!((open.worse_on(), closed.worse_on()), (vec![], vec![NOMINAL, OFF]));
        assert_eq!((position.worse_on(), eigen.worse_on()), (vec![OFF], vec![OFF]));
        // a sustained oscillation is not evaluated
        let mut swinging = runs.clone();
        for (_, run) in &mut swinging {
            if run.strategy == Strategy::BenchmarkClosedLoop {
                let oscillation = SustainedOscillation {
                    amplitude_mm: 3.0,
                    frequency_hz: 2.0,
                    motor_at_limit: false,
                };
                run.sustained_oscillation = Some(oscillation);
            }
        }
        let of_swinging = claims(&shown(&swinging, model.numbers.fast, true));
        assert!(of_swinging[6].plants.is_empty() && !of_swinging[4].plants.is_empty());
        // another crane is not compared with the paper
        for claim in of(false) {
            assert_eq!((claim.paper_stated, claim.paper_tables), (None, None), "{claim:?}");
            assert!(claim.worse_on().is_empty());
        }
    }
}
