//! A controller as exported: called once a control period, with numbers in and numbers out.

use hydroboom_control::estimation::retained_parameters::RetainedParameters;
use hydroboom_control::reference::preview::PreviewAhead;
use hydroboom_control::reference::profile::SetPoint;
use hydroboom_control::supervision::frame::{FrameInput, FrameOutput, FrameState};
use hydroboom_control::supervision::framed::{
    FramedBenchmark, FramedBenchmarkState, FramedSimulationFeedforward, FramedSimulationState,
    SimulatedCrane,
};
use hydroboom_control::supervision::framed_scheduled_lqr::{
    EstimatorRequest, FramedScheduledLqr, FramedScheduledLqrInput, FramedScheduledLqrOutput,
    FramedScheduledLqrState,
};
use hydroboom_description::Description;
use hydroboom_design::{
    DesignError, framed_benchmark, framed_scheduled_lqr, framed_simulation_feedforward,
};
use hydroboom_model::stepping::published;
use hydroboom_model::{Crane, CraneState, Input};

/// Why a target could not be made, or did not answer.
#[derive(Debug, thiserror::Error)]
pub enum TargetError {
    /// No limits for the crane.
    #[error(transparent)]
    Design(#[from] DesignError),
    /// The crane is not exported.
    #[error(transparent)]
    Export(#[from] crate::ExportError),
    /// A compiler or a program of the target failed.
    #[error("{target}: {reason}")]
    Program {
        /// Which target.
        target: String,
        /// Why.
        reason: String,
    },
}

/// A controller as exported.
pub trait Target {
    /// Its name in tables.
    fn name(&self) -> &'static str;

    /// Before a control period: the reference so long \[s\] after it, for who looks ahead.
    fn look_ahead(&mut self, _at: &dyn Fn(f64) -> SetPoint<f64>) {}

    /// One control period, with a factor on the proportional gain.
    ///
    /// # Errors
    ///
    /// [`TargetError`] when it does not answer.
    fn period(
        &mut self,
        input: &FrameInput<f64>,
        gain: f64,
    ) -> Result<FrameOutput<f64>, TargetError>;
}

/// A target that keeps what goes in and what comes out, to compare others with.
pub struct Recorder {
    /// The target.
    pub inner: Box<dyn Target>,
    /// Inputs and outputs of each period.
    pub rows: Vec<(FrameInput<f64>, FrameOutput<f64>)>,
}

impl Recorder {
    /// Of a target, with nothing recorded yet.
    pub fn new(inner: Box<dyn Target>) -> Self {
        Self { inner, rows: Vec::new() }
    }
}

impl Target for Recorder {
    fn name(&self) -> &'static str {
        self.inner.name()
    }

    fn look_ahead(&mut self, at: &dyn Fn(f64) -> SetPoint<f64>) {
        self.inner.look_ahead(at);
    }

    fn period(
        &mut self,
        input: &FrameInput<f64>,
        gain: f64,
    ) -> Result<FrameOutput<f64>, TargetError> {
        let output = self.inner.period(input, gain)?;
        self.rows.push((*input, output));
        Ok(output)
    }
}

/// The benchmark within the frame, as Rust runs it: what the exported ones are compared with.
pub struct RustBenchmark {
    controller: FramedBenchmark<f64>,
    state: FramedBenchmarkState<f64>,
    proportional: f64,
}

impl RustBenchmark {
    /// Of a crane.
    ///
    /// # Errors
    ///
    /// [`TargetError`] where there are no limits for it.
    pub fn new(model: &Description) -> Result<Self, TargetError> {
        Ok(Self {
            controller: framed_benchmark(model)?,
            state: FramedBenchmarkState::default(),
            proportional: model.numbers.proportional,
        })
    }
}

impl Target for RustBenchmark {
    fn name(&self) -> &'static str {
        "Rust, benchmark"
    }

    fn period(
        &mut self,
        input: &FrameInput<f64>,
        gain: f64,
    ) -> Result<FrameOutput<f64>, TargetError> {
        self.controller.benchmark.proportional = gain * self.proportional;
        let (state, output) = self.controller.advance(&self.state, input);
        self.state = state;
        Ok(output)
    }
}

/// The scheduled LQR within the frame, as Rust runs it.
pub struct RustScheduledLqr {
    controller: FramedScheduledLqr<f64>,
    state: FramedScheduledLqrState<f64>,
    /// Control periods that it looks ahead at most.
    length: usize,
    /// What it is given beside the frame's input.
    input: FramedScheduledLqrInput<f64>,
}

impl RustScheduledLqr {
    /// Of a crane, with a preview of so many control periods.
    ///
    /// # Errors
    ///
    /// [`TargetError`] where there are no limits or no reduced model for it.
    pub fn new(model: &Description, length: usize) -> Result<Self, TargetError> {
        let controller = framed_scheduled_lqr(model)?;
        let state = FramedScheduledLqrState {
            frame: FrameState::default(),
            controller: controller.start(),
        };
        let input = FramedScheduledLqrInput {
            frame: FrameInput::default(),
            request: EstimatorRequest::default(),
            retained: RetainedParameters::default(),
            ahead: PreviewAhead::unknown(),
        };
        Ok(Self { controller, state, length, input })
    }

    /// What it is given in the coming period, but for the frame's input.
    pub fn input(&mut self) -> &mut FramedScheduledLqrInput<f64> {
        &mut self.input
    }

    /// What it remembers.
    pub fn state(&self) -> &FramedScheduledLqrState<f64> {
        &self.state
    }

    /// One control period, with everything that it shows.
    pub fn advance(&mut self, input: &FrameInput<f64>) -> FramedScheduledLqrOutput<f64> {
        self.input.frame = *input;
        let (state, output) = self.controller.advance(&self.state, &self.input);
        self.state = state;
        output
    }
}

impl Target for RustScheduledLqr {
    fn name(&self) -> &'static str {
        "Rust, scheduled LQR"
    }

    fn look_ahead(&mut self, at: &dyn Fn(f64) -> SetPoint<f64>) {
        self.input.ahead = PreviewAhead::new(self.controller.law.period, self.length, at);
    }

    fn period(
        &mut self,
        input: &FrameInput<f64>,
        _gain: f64,
    ) -> Result<FrameOutput<f64>, TargetError> {
        Ok(self.advance(input).frame)
    }
}

/// Segments of the simulated crane.
const SEGMENTS: usize = crate::crane::SEGMENTS;

/// The benchmark with simulation feedforward within the frame, as Rust runs it.
pub struct RustSimulationFeedforward {
    controller: FramedSimulationFeedforward<f64>,
    state: FramedSimulationState<f64>,
    crane: Crane<f64, SEGMENTS>,
    simulated: CraneState<f64, SEGMENTS>,
    step: f64,
    steps: u32,
    proportional: f64,
}

impl RustSimulationFeedforward {
    /// Of a crane.
    ///
    /// # Errors
    ///
    /// [`TargetError`] where there are no limits for it, or it is not exported.
    pub fn new(model: &Description) -> Result<Self, TargetError> {
        let n = &model.numbers;
        let mut state = FramedSimulationState::default();
        state.alignment.position = n.motion_start;
        let crane = model.crane::<SEGMENTS>().map_err(crate::ExportError::from)?;
        Ok(Self {
            controller: framed_simulation_feedforward(model)?,
            state,
            simulated: crate::crane::resting(model)?,
            crane,
            step: n.simulation_period,
            proportional: n.proportional,
            steps: (n.control_period / n.simulation_period).round().max(1.0) as u32,
        })
    }
}

impl Target for RustSimulationFeedforward {
    fn name(&self) -> &'static str {
        "Rust, simulation feedforward"
    }

    fn period(
        &mut self,
        input: &FrameInput<f64>,
        gain: f64,
    ) -> Result<FrameOutput<f64>, TargetError> {
        self.controller.benchmark.proportional = gain * self.proportional;
        let outputs = self.crane.outputs(&self.simulated);
        let cylinder = &self.crane.cylinder;
        let shown = SimulatedCrane {
            stroke: outputs.stroke,
            velocity: outputs.velocity,
            load_pressure: cylinder.load_pressure(outputs.pressure_a, outputs.pressure_b),
        };
        let (state, output) = self.controller.advance(&self.state, input, &shown);
        self.state = state;
        let moves = Input { pump_speed: state.alignment.motor, holding_valve: 1.0 };
        for _ in 0..self.steps {
            published(&self.crane, &mut self.simulated, &moves, self.step);
        }
        Ok(output)
    }
}
