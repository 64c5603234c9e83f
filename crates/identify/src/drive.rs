//! Inputs of the machine from a log.

use crate::error::IdentifyError;
use crate::experiment::Times;
use hydroboom_description::Description;
use hydroboom_description::schema::CircuitChoice;
use hydroboom_measurement::{Measurement, Signal, Signals, Track};
use hydroboom_model::{Input, ValveInput};

/// Largest acceleration of a steady pump speed \[rev/s²\]; the oil then oscillates freely.
const STEADY_SPEED: f64 = 2.0;
/// Largest rate of a steady valve command \[share of the travel per second\].
const STEADY_TRAVEL: f64 = 0.02;

/// Inputs of a model, one per period.
#[derive(Clone, Debug)]
pub(crate) enum Drive {
    /// Inputs of a self-contained circuit.
    Pump(Vec<Input<f64>>),
    /// Inputs of a valve-controlled circuit, and the command \[V\] of full travel minus that of none.
    Valve(Vec<ValveInput<f64>>, f64),
}

impl Drive {
    /// Signal used as input of the model.
    pub(crate) fn signal(
        model: &Description,
        log: &Measurement,
        signals: &Signals,
        remarks: &mut Vec<String>,
    ) -> Result<Signal, IdentifyError> {
        if model.choices.circuit == CircuitChoice::ValveControlled {
            signals.need(Signal::ValveCommand, log)?;
            return Ok(Signal::ValveCommand);
        }
        if signals.get(Signal::MotorSpeed).is_some() {
            return Ok(Signal::MotorSpeed);
        }
        if signals.get(Signal::MotorCommand).is_none() {
            signals.need(Signal::MotorSpeed, log)?;
        }
        remarks.push(
            "the motor's speed was not measured: the commanded one is the model's input".into(),
        );
        Ok(Signal::MotorCommand)
    }

    /// Inputs from a log, period by period; the driving signal must be there.
    pub(crate) fn new(
        model: &Description,
        driving: Signal,
        signals: &Signals,
        times: &Times,
        remarks: &mut Vec<String>,
    ) -> Self {
        let n = &model.numbers;
        let Times { begin, period, count } = *times;
        let begins = || (0..count).map(|k| begin + k as f64 * period);
        let track = signals.get(driving);
        // value at mid-period; over a gap the last value is held, which a remark reports
        let of = |signal: Signal, time: f64| {
            let track = signals.get(signal)?;
            track.at(time + 0.5 * period).or_else(|| track.held(time))
        };
        let gaps = begins().filter(|time| track.and_then(|t| t.at(*time)).is_none()).count();
        if gaps > 1 {
            remarks.push(format!(
                "for {:.3} s the {} is missing: the last value is used",
                gaps as f64 * period,
                driving.symbol()
            ));
        }
        let lacks = |signal: Signal| signals.get(signal).is_none();
        match model.choices.circuit {
            CircuitChoice::SelfContained => {
                if lacks(Signal::HoldingValve) {
                    remarks.push(
                        "the load-holding valve was not logged: it is assumed to be open".into(),
                    );
                }
                let valve = signals.get(Signal::HoldingValve);
                let inputs = begins().map(|time| Input {
                    pump_speed: of(driving, time).unwrap_or(0.0),
                    holding_valve: valve.and_then(|v| v.held(time)).unwrap_or(1.0),
                });
                Self::Pump(inputs.collect())
            }
            CircuitChoice::ValveControlled => {
                for (signal, value) in [
                    (Signal::PressureSupply, n.supply_pressure),
                    (Signal::PressureTank, n.tank_pressure),
                ] {
                    if lacks(signal) {
                        remarks.push(format!(
                            "{} was not logged: it is assumed to be {:.1} bar",
                            signal.symbol(),
                            value * 1e-5
                        ));
                    }
                }
                // a share of full travel is converted to volts by the crane file's range
                let volts = |value: f64| match track.is_some_and(Track::is_share) {
                    true => n.spool_neutral + value * (n.spool_full - n.spool_neutral),
                    false => value,
                };
                if track.is_some_and(Track::is_share) {
                    remarks.push(format!(
                        "the valve's command is a share: 100 % is taken as the {} V of full travel to lift, 0 % as the {} V of the middle",
                        n.spool_full, n.spool_neutral
                    ));
                }
                let inputs = begins().map(|time| ValveInput {
                    command: of(driving, time).map_or(n.spool_neutral, volts),
                    supply: of(Signal::PressureSupply, time).unwrap_or(n.supply_pressure),
                    tank: of(Signal::PressureTank, time).unwrap_or(n.tank_pressure),
                });
                Self::Valve(inputs.collect(), n.spool_full - n.spool_neutral)
            }
        }
    }

    /// The same with inputs averaged over `periods` periods. An incomplete rest at the end is dropped.
    pub(crate) fn merged(&self, periods: usize) -> Self {
        let share = 1.0 / periods as f64;
        match self {
            Self::Pump(inputs) => {
                let mean = |of: &[Input<f64>]| Input {
                    pump_speed: share * of.iter().map(|input| input.pump_speed).sum::<f64>(),
                    holding_valve: share * of.iter().map(|input| input.holding_valve).sum::<f64>(),
                };
                Self::Pump(inputs.chunks_exact(periods).map(mean).collect())
            }
            Self::Valve(inputs, travel) => {
                let mean = |of: &[ValveInput<f64>]| ValveInput {
                    command: share * of.iter().map(|input| input.command).sum::<f64>(),
                    supply: share * of.iter().map(|input| input.supply).sum::<f64>(),
                    tank: share * of.iter().map(|input| input.tank).sum::<f64>(),
                };
                Self::Valve(inputs.chunks_exact(periods).map(mean).collect(), *travel)
            }
        }
    }

    /// The same with one input advanced by `periods` periods: the true input if the log's is delayed. At
    /// the ends the first or last value is held.
    pub(crate) fn later(&self, signal: Signal, periods: f64) -> Self {
        let last = self.len().saturating_sub(1);
        let at = |k: usize| (k as f64 + periods).clamp(0.0, last as f64);
        let course = |of: &dyn Fn(usize) -> f64, k: usize| {
            let before = at(k) as usize;
            of(before) + at(k).fract() * (of((before + 1).min(last)) - of(before))
        };
        match self {
            Self::Pump(inputs) => {
                let moved = |k: usize| match signal {
                    // a valve is open or shut: no interpolation
                    Signal::HoldingValve => {
                        let holding_valve = inputs[at(k).round() as usize].holding_valve;
                        Input { holding_valve, ..inputs[k] }
                    }
                    Signal::MotorSpeed | Signal::MotorCommand => {
                        Input { pump_speed: course(&|k| inputs[k].pump_speed, k), ..inputs[k] }
                    }
                    _ => inputs[k],
                };
                Self::Pump((0..self.len()).map(moved).collect())
            }
            Self::Valve(inputs, travel) => {
                let moved = |k: usize| match signal {
                    Signal::ValveCommand => {
                        ValveInput { command: course(&|k| inputs[k].command, k), ..inputs[k] }
                    }
                    _ => inputs[k],
                };
                Self::Valve((0..self.len()).map(moved).collect(), *travel)
            }
        }
    }

    /// Whether the load-holding valve opens or closes.
    pub(crate) fn is_switched(&self) -> bool {
        match self {
            Self::Pump(inputs) => {
                inputs.windows(2).any(|w| (w[0].holding_valve < 0.5) != (w[1].holding_valve < 0.5))
            }
            Self::Valve(..) => false,
        }
    }

    /// Number of periods.
    pub(crate) fn len(&self) -> usize {
        match self {
            Self::Pump(inputs) => inputs.len(),
            Self::Valve(inputs, _) => inputs.len(),
        }
    }

    /// Input of a period, scaled so that a steady input changes by less than one per second.
    pub(crate) fn driving(&self, period: usize) -> f64 {
        match self {
            Self::Pump(inputs) => inputs[period].pump_speed / STEADY_SPEED,
            Self::Valve(inputs, travel) => inputs[period].command / (travel * STEADY_TRAVEL),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn merged_inputs_are_means_and_an_incomplete_rest_is_dropped() {
        let input = |k: u32| Input { pump_speed: f64::from(k), holding_valve: 1.0 };
        let Drive::Pump(merged) = Drive::Pump((0..12).map(input).collect()).merged(5) else {
            panic!("the same kind of drive")
        };
        let speeds: Vec<f64> = merged.iter().map(|input| input.pump_speed).collect();
        assert_eq!(merged.len(), 2);
        assert!((speeds[0] - 2.0).abs() < 1e-12 && (speeds[1] - 7.0).abs() < 1e-12, "{speeds:?}");
        assert!(merged.iter().all(|input| (input.holding_valve - 1.0).abs() < 1e-12));
    }
}
