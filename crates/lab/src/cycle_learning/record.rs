//! Commands and measurements of a cycle.

use hydroboom_control::command::AxisCommand;
use hydroboom_control::measurement::AxisSignals;
use hydroboom_measurement::{Measurement, Signal, Signals, Track};

/// Commands from a rest on, each held for a control period, and the measurements at the beginning of each.
#[derive(Clone, Debug, Default)]
pub(crate) struct Record {
    /// Control period \[s\].
    pub period: f64,
    /// Commands, each held for a control period.
    pub commands: Vec<AxisCommand<f64>>,
    /// Measured signals at the beginning of each control period, one for each command.
    pub readings: Vec<AxisSignals<f64>>,
}

impl Record {
    /// Empty record for a control period \[s\].
    pub(crate) fn new(period: f64) -> Self {
        Self { period, ..Self::default() }
    }

    /// Appends a period.
    pub(crate) fn push(&mut self, command: AxisCommand<f64>, reading: AxisSignals<f64>) {
        self.commands.push(command);
        self.readings.push(reading);
    }

    /// The record as a log, the input of the model fit.
    pub(crate) fn log(&self) -> (Measurement, Signals) {
        let time: Vec<f64> = (0..self.readings.len()).map(|k| k as f64 * self.period).collect();
        let mut signals = Signals::default();
        let mut add = |signal: Signal, values: Vec<f64>| {
            signals.insert(signal, Track::new(&time, &values));
        };
        let read = |of: fn(&AxisSignals<f64>) -> f64| self.readings.iter().map(of).collect();
        add(Signal::Stroke, read(|r| r.stroke));
        add(Signal::PressurePumpA, read(|r| r.pressure_pump_a));
        add(Signal::PressureA, read(|r| r.pressure_a));
        add(Signal::PressureB, read(|r| r.pressure_b));
        add(Signal::PressurePumpB, read(|r| r.pressure_pump_b));
        add(Signal::PressureAccumulator, read(|r| r.pressure_accumulator));
        add(Signal::MotorSpeed, read(|r| r.motor_speed));
        let commanded = |of: fn(&AxisCommand<f64>) -> f64| self.commands.iter().map(of).collect();
        add(Signal::MotorCommand, commanded(|c| c.motor_speed));
        add(Signal::HoldingValve, commanded(|c| c.holding_valve));
        let name = "cycle".into();
        (Measurement { name, channels: Vec::new(), remarks: Vec::new(), time: None }, signals)
    }
}
