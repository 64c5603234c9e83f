//! Virtual crane as a machine with a stop circuit, a state and a watchdog, for commissioning in simulated time.

use super::step::Prompt;
use crate::machine::{Incoming, Machine, Outgoing};
use hydroboom_control::command::AxisCommand;
use hydroboom_control::measurement::{AxisMeasurement, AxisSignals, Measurement};
use hydroboom_control::supervision::limits::MachineStatus;
use hydroboom_description::Description;
use hydroboom_model::SimulationError;
use hydroboom_plant::PlantError;
use hydroboom_virtual_crane::VirtualCrane;

/// Code of the fault of an open stop circuit: that of the same fault on EtherCAT (`safe-torque-off`).
const STOP_CIRCUIT: u16 = 6;
/// Load held, motor at zero.
const HELD: AxisCommand<f64> = AxisCommand { motor_speed: 0.0, holding_valve: 0.0 };
/// Time that the simulated operator takes to follow a prompt \[s\].
const REACTION: f64 = 0.5;

/// Mistakes of wiring and set-up that commissioning is to find; the default has none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mistakes {
    /// Factor of the motor's command \[1\], 1 by default; negative for a reversed motor.
    pub motor: f64,
    /// Factor of the measured motor speed \[1\], 1 by default.
    pub motor_reading: f64,
    /// Whether the position counts from the other end of the stroke.
    pub is_position_reversed: bool,
    /// Scale of the position about its value at the begin \[1\], 1 by default.
    pub position_scale: f64,
    /// Two signals that are swapped, by their places in a measurement, from 0; `None` by default.
    pub swapped: Option<(usize, usize)>,
    /// A signal that is not a number, by its place in a measurement, from 0; `None` by default.
    pub not_a_number: Option<usize>,
    /// Whether the stop circuit does nothing.
    pub is_stop_circuit_stuck: bool,
    /// Whether the watchdog is off.
    pub is_watchdog_off: bool,
}

impl Default for Mistakes {
    fn default() -> Self {
        Self {
            motor: 1.0,
            motor_reading: 1.0,
            is_position_reversed: false,
            position_scale: 1.0,
            swapped: None,
            not_a_number: None,
            is_stop_circuit_stuck: false,
            is_watchdog_off: false,
        }
    }
}

/// The virtual crane with stop circuit, state and watchdog.
pub struct SimulatedMachine {
    crane: VirtualCrane,
    mistakes: Mistakes,
    stroke: f64,
    begin: f64,
    command: AxisCommand<f64>,
    is_enabled: bool,
    fault: u16,
    is_stop_open: bool,
    /// Periods without a command, and after how many the watchdog acts.
    silent: u32,
    watchdog: u32,
    /// Whether the watchdog has stopped it.
    is_stopped: bool,
    number: u64,
    /// For how long the present prompt has been shown \[s\].
    asked: f64,
}

impl SimulatedMachine {
    /// A crane with its load held and its pump without pressure.
    ///
    /// # Errors
    ///
    /// [`PlantError`] if the crane cannot be built.
    pub fn new(crane: &Description, mistakes: Mistakes) -> Result<Self, PlantError> {
        let n = &crane.numbers;
        let mut start = crane.start(n.motion_start);
        start.preload = 0.0;
        let machine = VirtualCrane::new(crane, &start)?;
        let begin = machine.truth().outputs.stroke;
        Ok(Self {
            crane: machine,
            mistakes,
            stroke: n.stroke,
            begin,
            command: HELD,
            is_enabled: false,
            fault: 0,
            is_stop_open: false,
            silent: 0,
            watchdog: (n.supervision_watchdog / n.control_period).round() as u32,
            is_stopped: false,
            number: 1,
            asked: 0.0,
        })
    }

    /// Virtual crane behind the wiring, with its true state.
    pub fn crane(&self) -> &VirtualCrane {
        &self.crane
    }

    /// True displacement of the piston since the begin \[m\], positive outwards.
    pub fn moved(&self) -> f64 {
        self.crane.truth().outputs.stroke - self.begin
    }

    /// Advances the crane by one control period. The command acts only while drives are enabled and the watchdog has
    /// not expired; otherwise the motor is at zero and the load is held.
    ///
    /// # Errors
    ///
    /// [`SimulationError`] if the simulation fails.
    pub fn advance(&mut self) -> Result<(), SimulationError> {
        self.silent = self.silent.saturating_add(1);
        if self.silent > self.watchdog && !self.mistakes.is_watchdog_off {
            self.is_stopped = true;
        }
        if self.is_stop_open && !self.mistakes.is_stop_circuit_stuck {
            self.fault = STOP_CIRCUIT;
        }
        if self.fault != 0 {
            self.is_enabled = false;
        }
        let acts = self.is_enabled && !self.is_stopped;
        let command = if acts { self.command } else { HELD };
        let motor_speed = command.motor_speed * self.mistakes.motor;
        self.number += 1;
        self.crane.advance(&AxisCommand { motor_speed, ..command })
    }

    /// The simulated operator follows the prompt; returns whether the operator confirms it.
    pub fn answer(&mut self, prompt: Option<Prompt>) -> bool {
        let Some(prompt) = prompt else {
            self.asked = 0.0;
            return false;
        };
        self.asked += self.crane.period();
        if self.asked < REACTION {
            return false;
        }
        match prompt {
            Prompt::OpenStopCircuit => self.is_stop_open = true,
            Prompt::CloseStopCircuit | Prompt::ResetAfterWatchdog | Prompt::ResetAgain => {
                (self.is_stop_open, self.fault, self.asked) = (false, 0, 0.0);
            }
            Prompt::StartWatchdog | Prompt::StartPolarity | Prompt::StartRelease => {}
        }
        prompt.is_confirmed()
    }

    fn signals(&self) -> AxisSignals<f64> {
        let mut signals = self.crane.signals();
        let m = &self.mistakes;
        signals.stroke = self.begin + m.position_scale * (signals.stroke - self.begin);
        if m.is_position_reversed {
            signals.stroke = self.stroke - signals.stroke;
        }
        signals.motor_speed *= m.motor_reading;
        let mut values = signals.to_array();
        if let Some((one, other)) = m.swapped
            && one.max(other) < values.len()
        {
            values.swap(one, other);
        }
        if let Some(value) = m.not_a_number.and_then(|signal| values.get_mut(signal)) {
            *value = f64::NAN;
        }
        AxisSignals::from_array(values)
    }
}

impl Machine for SimulatedMachine {
    fn read(&mut self) -> Option<Incoming> {
        let time = self.crane.measurement().time;
        let axes = [AxisMeasurement::new(self.signals())];
        let measurement = Measurement { number: self.number, time, axes };
        let status = match (self.fault, self.is_enabled) {
            (0, true) => MachineStatus::Enabled,
            (0, false) => MachineStatus::Ready,
            (code, _) => MachineStatus::Fault { code },
        };
        Some(Incoming { status: Some(status), ..Incoming::new(measurement, self.crane.valve()) })
    }

    fn write(&mut self, _: u64, outgoing: &Outgoing) {
        let [command] = outgoing.command.axes;
        self.silent = 0;
        self.command = command;
        self.is_enabled = outgoing.is_enabled && self.fault == 0;
        if command == HELD {
            self.is_stopped = false;
        }
    }
}
