//! Retuned benchmark: the published controller with the gains of `hydroboom design --benchmark`, which a
//! machine gets without further cost. Optionally with an input shaper.

use crate::LabError;
use crate::eigenfrequency::locked_mode;
use hydroboom_control::command::Command;
use hydroboom_control::controller::{Controller, ControllerStatus, SimulatedState};
use hydroboom_control::feedback::benchmark::{Benchmark, BenchmarkInput, BenchmarkMemory};
use hydroboom_control::measurement::Measurement;
use hydroboom_control::reference::input_shaper::InputShaper;
use hydroboom_control::reference::preview::Preview;
use hydroboom_description::Description;
use hydroboom_design::benchmark_design::Gains;

/// Benchmark controller with the retuned gains.
pub(super) struct RetunedBenchmark {
    law: Benchmark<f64>,
    shaper: Option<InputShaper>,
    /// Rod-side area over piston area.
    area_ratio: f64,
    memory: BenchmarkMemory<f64>,
}

impl RetunedBenchmark {
    pub(super) fn new(model: &Description, gains: &Gains) -> Self {
        let law = gains.put(model).benchmark();
        let area_ratio = model.cylinder().area_ratio();
        Self { law, shaper: None, area_ratio, memory: BenchmarkMemory::default() }
    }

    /// The same with a reference shaped for the boom's lowest mode at locked cylinder (ZVD). The reference
    /// is known ahead and is advanced by the shaper's mean delay.
    pub(super) fn shaped(model: &Description, gains: &Gains) -> Result<Self, LabError> {
        let n = &model.numbers;
        let mode = locked_mode(model, 0.5 * (n.motion_start + n.motion_end))?;
        let natural_hz = mode.frequency_hz / (1.0 - mode.damping_ratio.powi(2)).sqrt();
        let shaper = InputShaper::zvd(natural_hz, mode.damping_ratio);
        Ok(Self { shaper: Some(shaper), ..Self::new(model, gains) })
    }

    fn input(&self, measurement: &Measurement) -> BenchmarkInput<f64> {
        BenchmarkInput::of(&measurement.axes[0].signals, self.area_ratio)
    }
}

impl Controller for RetunedBenchmark {
    fn start(&mut self, measurement: &Measurement, _delay_cycles: u32) {
        self.memory = self.law.start(&self.input(measurement));
    }

    fn update(
        &mut self,
        measurement: &Measurement,
        preview: &Preview<f64>,
        _simulated: Option<&SimulatedState>,
    ) -> Command {
        let set_point = match &self.shaper {
            None => preview.now(),
            Some(shaper) => shaper.shaped(|after| preview.at(after + shaper.mean_delay())),
        };
        let input = self.input(measurement);
        let feedforward = self.law.velocity_feedforward(&set_point);
        Command::released([self.law.update(&mut self.memory, &set_point, &input, feedforward)])
    }

    fn status(&self) -> ControllerStatus {
        ControllerStatus { is_closed_loop: true, ..ControllerStatus::default() }
    }
}
