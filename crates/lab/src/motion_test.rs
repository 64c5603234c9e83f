//! Tests 1 to 3 of section 5.3: four strategies, two speeds, on a plant that may differ from the
//! model.

use crate::scenario::Course;
use crate::{LabError, Plant, paper, plant};
use hydroboom_control::{Benchmark, BenchmarkMemory, Measured, Motion, Reference};
use hydroboom_description::Description;
use hydroboom_model::{Input, Scheme, SimulationError};
use hydroboom_virtual_crane::{Command, Reading, Truth, VirtualCrane};
use serde::Serialize;

/// How the motor's speed is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Strategy {
    /// u_FF alone, without any feedback (test 1).
    VelocityFeedforward,
    /// The speed that the benchmark controller gives the simulated crane (tests 1 and 2).
    SimulationFeedforwardOpenLoop,
    /// The benchmark controller (tests 2 and 3).
    BenchmarkClosedLoop,
    /// The benchmark controller with the simulation's speed in the place of u_FF (test 3).
    SimulationFeedforwardClosedLoop,
}

impl Strategy {
    /// All strategies, in the paper's order.
    pub const ALL: [Self; 4] = [
        Self::VelocityFeedforward,
        Self::SimulationFeedforwardOpenLoop,
        Self::BenchmarkClosedLoop,
        Self::SimulationFeedforwardClosedLoop,
    ];

    /// Name in commands, tables and JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::VelocityFeedforward => "velocity-feedforward",
            Self::SimulationFeedforwardOpenLoop => "simulation-feedforward-open-loop",
            Self::BenchmarkClosedLoop => "benchmark-closed-loop",
            Self::SimulationFeedforwardClosedLoop => "simulation-feedforward-closed-loop",
        }
    }

    fn simulates(self) -> bool {
        matches!(self, Self::SimulationFeedforwardOpenLoop | Self::SimulationFeedforwardClosedLoop)
    }

    fn measures(self) -> bool {
        matches!(self, Self::BenchmarkClosedLoop | Self::SimulationFeedforwardClosedLoop)
    }
}

/// One control period of a run.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// Time \[s\].
    pub time: f64,
    /// Where the piston should be.
    pub reference: Reference<f64>,
    /// What the controller sees of the plant.
    pub reading: Reading<f64>,
    /// The plant itself.
    pub truth: Truth,
    /// What the plant is told for the next period.
    pub command: Command<f64>,
}

impl Sample {
    /// Tracking error x − x_ref \[m\], as the controller sees it.
    pub fn error(&self) -> f64 {
        self.reading.stroke - self.reference.position
    }
}

/// One strategy at one speed on one plant.
#[derive(Clone, Debug)]
pub struct Run {
    /// The strategy.
    pub strategy: Strategy,
    /// Speed of the motion \[m/s\].
    pub speed: f64,
    /// Every control period.
    pub samples: Vec<Sample>,
}

impl Run {
    /// Root mean square of the tracking error over the whole motion, rests included \[m\].
    pub fn rms(&self) -> f64 {
        let sum: f64 = self.samples.iter().map(|s| s.error().powi(2)).sum();
        (sum / self.samples.len().max(1) as f64).sqrt()
    }

    /// The error of largest magnitude, with its sign \[m\].
    pub fn peak(&self) -> f64 {
        let errors = self.samples.iter().map(Sample::error);
        errors.fold(0.0, |peak: f64, e| if e.abs() > peak.abs() { e } else { peak })
    }
}

/// One row of the tables.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// Name of the plant, `nominal` for the model itself.
    pub plant: String,
    /// The strategy.
    pub strategy: Strategy,
    /// Speed of the motion.
    pub speed_mm_s: f64,
    /// RMS error here.
    pub rms_mm: f64,
    /// Peak error here.
    pub peak_mm: f64,
    /// RMS error of the paper, measured on the real crane, where its speed was this.
    pub paper_rms_mm: Option<f64>,
    /// Peak error of the paper.
    pub paper_peak_mm: Option<f64>,
}

impl Row {
    /// The row of a run on the named plant.
    pub fn of(plant: &str, run: &Run) -> Self {
        let speed_mm_s = run.speed * 1e3;
        let column = paper::SPEEDS_MM_S.iter().position(|v| (v - speed_mm_s).abs() < 1e-6);
        let row = Strategy::ALL.iter().position(|s| *s == run.strategy);
        let printed = column.zip(row).map(|(c, r)| {
            let (rms, peak) = paper::TRACKING_MM[r];
            (rms[c], peak[c])
        });
        Self {
            plant: plant.into(),
            strategy: run.strategy,
            speed_mm_s,
            rms_mm: run.rms() * 1e3,
            peak_mm: run.peak() * 1e3,
            paper_rms_mm: printed.map(|p| p.0),
            paper_peak_mm: printed.map(|p| p.1),
        }
    }
}

/// The simulated crane beside the machine, under the benchmark controller.
struct Simulated {
    plant: Box<dyn Plant>,
    controller: Benchmark<f64>,
    memory: BenchmarkMemory<f64>,
    motor: f64,
    /// Steps in a control period.
    count: u32,
}

impl Simulated {
    fn new(model: &Description, controller: Benchmark<f64>, start: f64) -> Result<Self, LabError> {
        let step = model.numbers.simulation_period;
        let plant = plant(model, &model.start(start), Scheme::Published, step)?;
        let count = (controller.period / step).round() as u32;
        let memory = controller.start(&measured(plant.as_ref()));
        Ok(Self { plant, controller, memory, motor: 0.0, count })
    }

    /// The speed \[rev/s\] that the controller gives the simulated crane, which moves on with it.
    fn advance(&mut self, reference: &Reference<f64>) -> Result<f64, SimulationError> {
        let controller = &self.controller;
        let feedforward = controller.velocity_feedforward(reference);
        let seen = measured(self.plant.as_ref());
        let wanted = controller.update(&mut self.memory, reference, &seen, feedforward);
        self.motor = controller.limits.follow(self.motor, wanted, controller.period);
        let input = Input { pump_speed: self.motor, holding_valve: 1.0 };
        self.plant.advance(&input, self.count)?;
        Ok(self.motor)
    }
}

fn measured(plant: &dyn Plant) -> Measured<f64> {
    Measured { stroke: plant.outputs().stroke, load_pressure: plant.load_pressure() }
}

/// Runs one strategy: controllers every control period, cranes every simulation period.
///
/// The controller, and the simulation beside the machine, know the `model` only; what they steer
/// is the `plant`, seen through its sensors, along the plant's motion.
///
/// # Errors
///
/// [`LabError`] when either crane cannot be built or leaves what the model holds for.
pub fn run(
    model: &Description,
    plant: &Description,
    strategy: Strategy,
    speed: f64,
) -> Result<Run, LabError> {
    let motion = plant.motion(speed);
    let mut samples =
        Vec::with_capacity((motion.duration() / model.numbers.control_period) as usize + 2);
    steer(model, plant, strategy, &motion, |sample| {
        samples.push(*sample);
        Ok(())
    })?;
    Ok(Run { strategy, speed, samples })
}

/// The same along any course, each control period shown to `observe`, which may stop it.
///
/// # Errors
///
/// [`LabError`] when either crane cannot be built or leaves what the model holds for, or from
/// `observe`.
pub fn steer(
    model: &Description,
    plant: &Description,
    strategy: Strategy,
    course: &dyn Course,
    mut observe: impl FnMut(&Sample) -> Result<(), LabError>,
) -> Result<(), LabError> {
    let controller = model.benchmark();
    let start = course.reference(0.0).position;
    let mut real = VirtualCrane::new(plant, &plant.start(start))?;
    let mut memory = controller.start(&real.measured());
    let mut simulated = match strategy.simulates() {
        true => Some(Simulated::new(model, controller, start)?),
        false => None,
    };
    let period = controller.period;
    let periods = (course.duration() / period).round() as u64;
    let mut loads = course.loads().iter().peekable();
    let during = format!("{} at {:.0} mm/s", strategy.name(), course.speed() * 1e3);

    for k in 0..=periods {
        let time = k as f64 * period;
        while let Some(load) = loads.next_if(|load| load.time <= time) {
            real.set_payload(load.mass)?;
        }
        let reference = course.reference(time);
        let feedforward = match &mut simulated {
            Some(crane) => crane
                .advance(&reference)
                .map_err(LabError::during(&format!("{during}, the simulated crane")))?,
            None => controller.velocity_feedforward(&reference),
        };
        let wanted = match strategy.measures() {
            true => controller.update(&mut memory, &reference, &real.measured(), feedforward),
            false => feedforward,
        };
        let command = Command { motor_speed: wanted, holding_valve: 1.0 };
        observe(&Sample {
            time,
            reference,
            reading: real.reading(),
            truth: real.truth(),
            command,
        })?;
        if k < periods {
            real.advance(&command).map_err(LabError::during(&during))?;
        }
    }
    Ok(())
}

/// The frequency \[Hz\] at which p_A rings after the start of the cruise, from a velocity
/// feedforward run.
///
/// # Errors
///
/// [`LabError::NoOscillation`] when fewer than two periods can be seen.
pub fn pressure_oscillation(motion: &Motion<f64>, run: &Run) -> Result<f64, LabError> {
    let from = motion.rest + motion.ramp;
    let to = motion.rest + motion.travel_time() - motion.ramp;
    let (times, values): (Vec<f64>, Vec<f64>) = run
        .samples
        .iter()
        .filter(|s| (from..=to).contains(&s.time))
        .map(|s| (s.time, s.truth.outputs.pressure_a))
        .unzip();
    crate::eigenfrequency::frequency(&times, &values)
}
