//! One trial of an exported controller on the virtual crane.

use super::case::{Case, Disturbed, Moment, TRAVEL};
use super::target::{Target, TargetError};
use hydroboom_control::command::AxisCommand;
use hydroboom_control::measurement::AxisSignals;
use hydroboom_control::reference::profile::{OutAndBack, RampShape, SetPoint};
use hydroboom_control::supervision::frame::{
    FrameInput, FrameOutput, STATUS_FALLBACK, STATUS_FAULT, frame_phase,
};
use hydroboom_control::supervision::oscillation_detector::{OscillationDetector, OscillationState};
use hydroboom_description::Description;
use hydroboom_model::SimulationError;
use hydroboom_plant::PlantError;
use hydroboom_virtual_crane::VirtualCrane;

/// Outcome of a trial, from the true motion of the machine.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// Largest lift during the hold and the balance test \[m\].
    pub lifted: f64,
    /// Largest drop below the held position until control begins \[m\].
    pub dropped: f64,
    /// Largest piston movement from the energising of the load-holding valve to the beginning of the course \[m\].
    pub engaged: f64,
    /// Duration of the release \[s\]; `None` if the load was not released.
    pub release_time: Option<f64>,
    /// Largest slew rate of the commanded motor speed, except at the beginning of a stop \[rev/s²\].
    pub motor_slew: f64,
    /// Largest commanded motor speed \[rev/s\].
    pub motor_speed: f64,
    /// Status at the end: a phase of the frame, or a fault code (`frame_phase`, `STATUS_FAULT`).
    pub status: f64,
    /// Amplitude \[m\] and frequency \[Hz\] of a detected sustained oscillation; zeros if none was detected.
    pub oscillation: [f64; 2],
    /// Whether any output was NaN or infinite.
    pub is_not_finite: bool,
    /// Largest deviation from the reported reference, from the beginning of the disturbance until a stop \[m\].
    pub strayed: f64,
    /// Stopping distance of the piston \[m\].
    pub stopped_in: f64,
    /// Largest magnitude of the true tracking error over the course \[m\].
    pub error: f64,
    /// RMS true tracking error over the course \[m\].
    pub rms: f64,
    /// True piston position in each control period of the course \[m\], for comparison with the undisturbed course.
    pub course: Vec<f64>,
    /// Error that ended the simulation of the machine; none if it ran to the end.
    pub broke: Option<SimulationError>,
}

impl Outcome {
    /// Largest difference of the piston position to another trial \[m\], over their common control periods: zero
    /// without any. A period in which a position is NaN does not count.
    pub fn off(&self, other: &Self) -> f64 {
        let apart = self.course.iter().zip(&other.course).map(|(a, b)| (a - b).abs());
        apart.fold(0.0, f64::max)
    }

    /// Whether the controller was active to the end, with normal or fallback gains.
    pub fn is_controlled(&self) -> bool {
        [frame_phase::CONTROLLING, STATUS_FALLBACK].contains(&self.status)
    }

    /// Peak-to-peak piston motion \[m\] in the last 1.25 s of standstill after the course; 0 if the course is shorter.
    /// `period` is the control period \[s\].
    pub fn swing(&self, period: f64) -> f64 {
        let count = (SWING_TIME / period) as usize;
        let Some(begin) = self.course.len().checked_sub(count) else { return 0.0 };
        let last = &self.course[begin..];
        let most = last.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let least = last.iter().copied().fold(f64::INFINITY, f64::min);
        most - least
    }

    /// Whether a sustained oscillation was detected: in the true motion, or by the frame, which then uses fallback
    /// gains.
    pub fn oscillates(&self) -> bool {
        self.oscillation[0] > 0.0
    }
}

/// Reason why a trial cannot be run.
#[derive(Debug, thiserror::Error)]
pub enum TrialError {
    /// The machine cannot be built.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// The controller failed.
    #[error(transparent)]
    Target(#[from] TargetError),
}

/// Time limit for a release \[s\].
const RELEASED_WITHIN: f64 = 60.0;
/// Duration of engagement after the takeover \[s\].
const ENGAGED: f64 = 1.0;
/// Time after the course \[s\].
const AFTER: f64 = 2.5;
/// Evaluated interval of the residual oscillation \[s\]: half of the standstill after the course.
const SWING_TIME: f64 = 1.25;
/// Additional time for a possible oscillation to be confirmed \[s\].
const LONGER: f64 = 5.0;
/// Integration step of the simulated machine \[s\].
const MACHINE_STEP: f64 = 1e-3;

/// Simulates a trial: hold, release, engagement, motion and disturbance of the test case. `model` is the crane that
/// the controller was designed for, `machine` the simulated crane, whose payload is that of the case.
///
/// # Errors
///
/// [`TrialError::Plant`] if the machine cannot be built, [`TrialError::Target`] if the controller fails. A simulation
/// that fails is no error: it ends the trial and is in [`Outcome::broke`].
pub fn run(
    model: &Description,
    machine: &Description,
    case: &Case,
    target: &mut dyn Target,
) -> Result<Outcome, TrialError> {
    let n = &model.numbers;
    let mut description = machine.clone();
    description.numbers.payload = case.payload;
    description.numbers.virtual_step = MACHINE_STEP;
    let mut start = description.start(case.stroke);
    start.preload = 0.0;
    let mut crane = VirtualCrane::new(&description, &start)?;
    let period = n.control_period;
    let course = course(model, case);
    let travel = course.travel_time();
    let length = if case.moves { case.rest + travel + AFTER } else { case.rest };
    let mut outcome = Outcome::default();
    let mut seen = Evaluation { period, held_at: case.stroke, ..Evaluation::default() };
    let mut injection = Injection::default();
    let longest = ((case.held + RELEASED_WITHIN + length + LONGER) / period) as u32;
    for k in 0..longest {
        let time = f64::from(k) * period;
        let course_time = seen.controls_since.map(|since| f64::from(k - since) * period);
        let moved = course_time.filter(|_| case.moves);
        let asked = |after: f64| {
            let time = moved.map_or(0.0, |moved| moved + after);
            course.reference(time.min(case.rest + travel + 0.5 * AFTER))
        };
        let reference = asked(0.0);
        target.look_ahead(&asked);
        let mut input = frame_input(&crane.signals(), &reference, time >= case.held);
        let has_begun = |moment: Moment| {
            course_time.is_some_and(|time| time >= begins(moment, case.rest, travel))
        };
        if let Some(disturbed) = case.disturbed.filter(|of| has_begun(of.moment)) {
            seen.disturbed = true;
            input = injection.disturbed(&disturbed, &input);
        }
        let gain = match case.gain {
            Some((factor, when)) if has_begun(when) => factor,
            _ => 1.0,
        };
        let output = target.period(&input, gain)?;
        outcome.is_not_finite |= output.to_array().iter().any(|value| !value.is_finite());
        let command =
            AxisCommand { motor_speed: output.motor_speed, holding_valve: output.holding_valve };
        if let Err(error) = crane.advance(&command) {
            outcome.broke = Some(error);
            break;
        }
        let stroke = crane.truth().outputs.stroke;
        seen.take_motor_speed(&mut outcome, &output);
        let shown = match (0.0..=n.stroke).contains(&input.reference_position) {
            true => input.reference_position,
            false => reference.position,
        };
        let shown = shown + output.reference_offset;
        let rests = reference.velocity == 0.0;
        let longer = course_time.is_some_and(|time| time > length);
        seen.detect_oscillation(&mut outcome, &output, shown - stroke, rests);
        if longer {
            if !seen.may_oscillate() || course_time.is_some_and(|time| time > length + LONGER) {
                break;
            }
            continue;
        }
        seen.take(&mut outcome, case, &output, stroke, (k, time), shown);
        if seen.is_over(k) {
            break;
        }
    }
    Ok(outcome)
}

/// Course of a trial: out and back at the fast speed, towards the middle of the stroke.
fn course(model: &Description, case: &Case) -> OutAndBack<f64> {
    let n = &model.numbers;
    let up = case.stroke < 0.5 * n.stroke;
    let travel = TRAVEL * n.stroke;
    OutAndBack {
        start: case.stroke,
        end: case.stroke + if up { travel } else { -travel },
        speed: n.fast,
        ramp: n.ramp,
        dwell: AFTER,
        rest: case.rest,
        profile: RampShape::Trapezoidal,
    }
}

/// Inputs of the frame, enabled, on a machine without a position switch at its valve.
fn frame_input(
    reading: &AxisSignals<f64>,
    reference: &SetPoint<f64>,
    starts: bool,
) -> FrameInput<f64> {
    FrameInput {
        enable: 1.0,
        valve_state: -1.0,
        start: f64::from(u8::from(starts)),
        reference_position: reference.position,
        reference_velocity: reference.velocity,
        stroke: reading.stroke,
        pressure_pump_a: reading.pressure_pump_a,
        pressure_a: reading.pressure_a,
        pressure_b: reading.pressure_b,
        pressure_pump_b: reading.pressure_pump_b,
        motor_speed_read: reading.motor_speed,
        ..FrameInput::default()
    }
}

/// Injection of a disturbance: periods in which the input was wrong, and the inputs when it began.
#[derive(Default)]
struct Injection(Option<(u32, [f64; FrameInput::NAMES.len()])>);

impl Injection {
    /// Inputs of a control period with the disturbance, while it lasts.
    fn disturbed(&mut self, disturbed: &Disturbed, given: &FrameInput<f64>) -> FrameInput<f64> {
        let (count, before) = self.0.get_or_insert((0, given.to_array()));
        if *count >= disturbed.periods {
            return *given;
        }
        *count += 1;
        let mut array = given.to_array();
        let place = disturbed.input;
        array[place] = disturbed.bad.of(array[place], before[place]);
        FrameInput::from_array(array)
    }
}

/// Beginning of the disturbance, as time of the course \[s\].
fn begins(moment: Moment, rest: f64, travel: f64) -> f64 {
    match moment {
        Moment::Rest => 0.5 * rest,
        Moment::Motion => rest + 0.5 * travel,
    }
}

/// State of a trial's evaluation.
#[derive(Default)]
struct Evaluation {
    /// Control period \[s\].
    period: f64,
    held_at: f64,
    /// Motor speed commanded last \[rev/s\].
    commanded: f64,
    /// Sum of the squared tracking errors over the course \[m²\].
    squares: f64,
    energised_at: Option<f64>,
    controls_since: Option<u32>,
    disturbed: bool,
    /// Period and position at the beginning of a stop, after which the reference rests.
    stopped: Option<(u32, f64)>,
    /// Detector of sustained oscillation, fed with the true piston position.
    oscillation: OscillationState<f64>,
}

/// Evaluated periods after a stop.
const EVALUATED: u32 = 1500;

impl Evaluation {
    /// Checks the deviation of the piston from its reference \[m\] for a sustained oscillation, during active control.
    fn detect_oscillation(
        &mut self,
        outcome: &mut Outcome,
        output: &FrameOutput<f64>,
        off: f64,
        rests: bool,
    ) {
        let has_load = [frame_phase::CONTROLLING, STATUS_FALLBACK].contains(&output.status);
        let detector = OscillationDetector::POSITIONING;
        if detector.update(&mut self.oscillation, off, rests && has_load, self.period) {
            let found = detector.amplitude_and_frequency(&self.oscillation);
            if found[0] > outcome.oscillation[0] {
                outcome.oscillation = found;
            }
        }
    }

    /// Slew rate and size of the commanded motor speed.
    fn take_motor_speed(&mut self, outcome: &mut Outcome, output: &FrameOutput<f64>) {
        // a stop begins at the current motor speed, which may be a step of the command
        let is_held = output.status != frame_phase::CONTROLLING;
        let stops = is_held && self.controls_since.is_some() && self.stopped.is_none();
        let change = (output.motor_speed - self.commanded).abs();
        let slew = if stops { 0.0 } else { change / self.period };
        self.commanded = output.motor_speed;
        outcome.motor_slew = outcome.motor_slew.max(slew);
        outcome.motor_speed = outcome.motor_speed.max(output.motor_speed.abs());
    }

    /// Whether the amplitude of the last half-cycles did not decay.
    fn may_oscillate(&self) -> bool {
        self.stopped.is_none() && self.oscillation.half_cycles > 0.5
    }

    fn take(
        &mut self,
        outcome: &mut Outcome,
        case: &Case,
        output: &FrameOutput<f64>,
        stroke: f64,
        (k, time): (u32, f64),
        reference: f64,
    ) {
        outcome.status = output.status;
        if output.status == STATUS_FALLBACK && outcome.oscillation[0] == 0.0 {
            outcome.oscillation = [output.oscillation_amplitude, output.oscillation_frequency];
        }
        if self.controls_since.is_none() {
            outcome.lifted = outcome.lifted.max(stroke - self.held_at);
            outcome.dropped = outcome.dropped.max(self.held_at - stroke);
        }
        if output.holding_valve > 0.5 && self.energised_at.is_none() {
            self.energised_at = Some(stroke);
            outcome.release_time = Some(time - case.held);
        }
        if output.status >= frame_phase::CONTROLLING && self.controls_since.is_none() {
            self.controls_since = (output.status < STATUS_FAULT).then_some(k);
        }
        if let Some(at) = self.energised_at.filter(|_| !self.disturbed) {
            let begun = self.controls_since.map_or(0, |since| k - since);
            if f64::from(begun) * self.period < ENGAGED {
                outcome.engaged = outcome.engaged.max((stroke - at).abs());
            }
        }
        if self.controls_since.is_some() {
            outcome.course.push(stroke);
            outcome.error = outcome.error.max((stroke - reference).abs());
            self.squares += (stroke - reference).powi(2);
            outcome.rms = (self.squares / outcome.course.len() as f64).sqrt();
        }
        // the stop shows at once in the valve, or else in the status or the phase
        let is_stopped = output.holding_valve < 0.5 || output.status == frame_phase::STOPPING;
        if output.status >= STATUS_FAULT || (self.controls_since.is_some() && is_stopped) {
            self.stopped.get_or_insert((k, stroke));
        }
        match self.stopped {
            Some((_, at)) => outcome.stopped_in = outcome.stopped_in.max((stroke - at).abs()),
            None if self.disturbed => {
                outcome.strayed = outcome.strayed.max((stroke - reference).abs());
            }
            None => {}
        }
    }

    fn is_over(&self, k: u32) -> bool {
        self.stopped.is_some_and(|(since, _)| k - since > EVALUATED)
    }
}
