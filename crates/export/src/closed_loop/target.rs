//! Interface of an exported controller, called once a control period.

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

/// Reason why an exported controller cannot be built or run.
#[derive(Debug, thiserror::Error)]
pub enum TargetError {
    /// No limits can be derived for the crane.
    #[error(transparent)]
    Design(#[from] DesignError),
    /// The crane cannot be exported.
    #[error(transparent)]
    Export(#[from] crate::ExportError),
    /// A compiler or a program of the target failed.
    #[error("{target}: {reason}")]
    Program {
        /// Name of the target.
        target: String,
        /// Reason for the failure.
        reason: String,
    },
}

/// Controller under test, called once a control period with the inputs and outputs of the frame.
pub trait Target {
    /// Name in tables.
    fn name(&self) -> &'static str;

    /// Called before each control period with the reference as a function of the time from now \[s\], for controllers
    /// with preview.
    fn look_ahead(&mut self, _at: &dyn Fn(f64) -> SetPoint<f64>) {}

    /// Executes one control period; the proportional gain is multiplied by the factor.
    ///
    /// # Errors
    ///
    /// [`TargetError`] if the target fails.
    fn period(
        &mut self,
        input: &FrameInput<f64>,
        gain: f64,
    ) -> Result<FrameOutput<f64>, TargetError>;
}

/// Controller under test that records its inputs and outputs, for comparison of languages.
pub struct Recorder {
    /// Controller whose signals are recorded.
    pub inner: Box<dyn Target>,
    /// Inputs and outputs of each control period, oldest first.
    pub rows: Vec<(FrameInput<f64>, FrameOutput<f64>)>,
}

impl Recorder {
    /// Recorder of a controller, without any recorded period.
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

/// Benchmark controller within the frame in Rust, as the reference for exported ones.
pub struct RustBenchmark {
    controller: FramedBenchmark<f64>,
    state: FramedBenchmarkState<f64>,
    proportional: f64,
}

impl RustBenchmark {
    /// Benchmark controller of a crane in its initial state.
    ///
    /// # Errors
    ///
    /// [`TargetError::Design`] if no limits can be derived for the crane.
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

/// Scheduled LQR within the frame in Rust, as the reference for exported ones.
pub struct RustScheduledLqr {
    controller: FramedScheduledLqr<f64>,
    state: FramedScheduledLqrState<f64>,
    /// Length of the preview \[control periods\].
    length: usize,
    /// Inputs besides the frame's.
    input: FramedScheduledLqrInput<f64>,
}

impl RustScheduledLqr {
    /// Scheduled LQR of a crane in its initial state, with a preview of the reference over `length` control periods.
    ///
    /// # Errors
    ///
    /// [`TargetError::Design`] if no limits or no reduced model can be derived for the crane.
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

    /// Inputs of the next period besides those of the frame: estimator requests, retained parameters and preview.
    pub fn input(&mut self) -> &mut FramedScheduledLqrInput<f64> {
        &mut self.input
    }

    /// Present state of frame, estimator and law.
    pub fn state(&self) -> &FramedScheduledLqrState<f64> {
        &self.state
    }

    /// Executes one control period with the inputs of the frame; returns the outputs of frame and estimator.
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

/// Number of segments of the simulated crane.
const SEGMENTS: usize = crate::crane::SEGMENTS;

/// Benchmark controller with simulation feedforward within the frame in Rust, as the reference for exported ones.
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
    /// Benchmark controller with simulation feedforward, and the simulated crane in its initial state.
    ///
    /// # Errors
    ///
    /// [`TargetError::Design`] if no limits can be derived, [`TargetError::Export`] if the crane cannot be exported.
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
