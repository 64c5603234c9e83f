//! A cycle as it was commanded and measured.

use hydroboom_control::command::AxisCommand;
use hydroboom_control::measurement::AxisSignals;
use hydroboom_measurement::{Measurement, Signal, Signals, Track};

/// Commands from a rest on, each held for a control period, and the readings at the beginning of each.
#[derive(Clone, Debug, Default)]
pub(crate) struct Record {
    /// Control period \[s\].
    pub period: f64,
    /// Commands.
    pub commands: Vec<AxisCommand<f64>>,
    /// Readings, as many.
    pub readings: Vec<AxisSignals<f64>>,
}

impl Record {
    /// Empty, for a control period \[s\].
    pub(crate) fn new(period: f64) -> Self {
        Self { period, ..Self::default() }
    }

    /// A period more.
    pub(crate) fn push(&mut self, command: AxisCommand<f64>, reading: AxisSignals<f64>) {
        self.commands.push(command);
        self.readings.push(reading);
    }

    /// As a log, which is what models are compared with.
    pub(crate) fn log(&self) -> (Measurement, Signals) {
        let time: Vec<f64> = (0..self.readings.len()).map(|k| k as f64 * self.period).collect();
        let mut signals = Signals::default();
        let of_readings: [(Signal, fn(&AxisSignals<f64>) -> f64); 7] = [
            (Signal::Stroke, |r| r.stroke),
            (Signal::PressurePumpA, |r| r.pressure_pump_a),
            (Signal::PressureA, |r| r.pressure_a),
            (Signal::PressureB, |r| r.pressure_b),
            (Signal::PressurePumpB, |r| r.pressure_pump_b),
            (Signal::PressureAccumulator, |r| r.pressure_accumulator),
            (Signal::MotorSpeed, |r| r.motor_speed),
        ];
        for (signal, of) in of_readings {
            let values: Vec<f64> = self.readings.iter().map(of).collect();
            signals.insert(signal, Track::new(&time, &values));
        }
        let of_commands: [(Signal, fn(&AxisCommand<f64>) -> f64); 2] = [
            (Signal::MotorCommand, |c| c.motor_speed),
            (Signal::HoldingValve, |c| c.holding_valve),
        ];
        for (signal, of) in of_commands {
            let values: Vec<f64> = self.commands.iter().map(of).collect();
            signals.insert(signal, Track::new(&time, &values));
        }
        let name = "cycle".into();
        (Measurement { name, channels: Vec::new(), remarks: Vec::new(), time: None }, signals)
    }
}
