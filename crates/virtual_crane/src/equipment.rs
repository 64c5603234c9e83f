//! Equipment between controller and plant: drive, pump shaft, valve, sensors, fieldbus, and the oil's temperature
//! and air.

use crate::air::Air;
use crate::drive::Shaft;
use crate::fieldbus::Fieldbus;
use crate::pump::PumpShaft;
use crate::sensor::{Sensor, SensorData};
use crate::signals::Truth;
use crate::temperature::Temperature;
use crate::valve::SwitchingValve;
use hydroboom_control::actuator_limits::ActuatorLimits;
use hydroboom_control::command::AxisCommand;
use hydroboom_control::measurement::{AxisSignals, Measurement};
use hydroboom_control::supervision::limits::ValveState;
use hydroboom_description::schema::PositionSwitchChoice;
use hydroboom_description::{Description, Numbers};
use hydroboom_model::drive::{DeadTime, Drive};
use hydroboom_model::{Input, Nodes, Outputs, Scheme, Start};
use rand::{Rng, RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use std::collections::VecDeque;

/// Control periods between two updates of the slow states, oil temperature and dissolved air.
const SLOW_EVERY: u64 = 20;

/// Dead time of the drive: a queue of commanded motor speeds.
#[derive(Clone)]
struct CommandDelay {
    dead_time: DeadTime<f64>,
    /// Commands \[rev/s\], latest first.
    sent: VecDeque<f64>,
}

impl CommandDelay {
    /// A dead time and control period \[s\], with all earlier commands zero.
    fn new(time: f64, period: f64) -> Self {
        let dead_time = DeadTime::of(time, period);
        Self { dead_time, sent: std::iter::repeat_n(0.0, dead_time.reach() + 1).collect() }
    }

    /// Adds a command and returns the delayed one of the same period.
    fn exchange(&mut self, speed: f64) -> f64 {
        self.sent.pop_back();
        self.sent.push_front(speed);
        self.dead_time.arrived(|ago| self.sent.get(ago).copied().unwrap_or(0.0))
    }
}

/// Integration method and step size of the plant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Stepping {
    pub scheme: Scheme,
    /// Step size \[s\].
    pub step: f64,
    /// Steps in a control period.
    pub count: u32,
}

impl Stepping {
    /// The description's step size, reduced so that a whole number of steps fills a control period.
    pub(crate) fn of(description: &Description) -> Self {
        let n = &description.numbers;
        let (scheme, wanted) = match n.virtual_step > 0.0 {
            true => (Scheme::Implicit, n.virtual_step),
            false => (Scheme::Published, n.simulation_period),
        };
        let count = (n.control_period / wanted * (1.0 - 1e-12)).ceil().max(1.0);
        // keeps a step size that already fits, to the last bit
        let step = match (count * wanted / n.control_period - 1.0).abs() < 1e-12 {
            true => wanted,
            false => n.control_period / count,
        };
        Self { scheme, step, count: count as u32 }
    }
}

/// Equipment of one crane. It receives the plant's outputs and returns the plant's inputs.
#[derive(Clone)]
pub(crate) struct Equipment {
    period: f64,
    /// `None`: the motor follows without lag, within its limits, as in the published model.
    drive: Option<Drive<f64>>,
    /// Dead time before the drive's lag; `None` for zero.
    dead_time: Option<CommandDelay>,
    limits: ActuatorLimits<f64>,
    shaft: Shaft,
    pump: PumpShaft,
    /// `None`: the valve switches without delay.
    valve: Option<SwitchingValve>,
    pilot: f64,
    has_position_switch: bool,
    temperature: Temperature,
    air: Option<Air>,
    /// Power dissipated as heat \[W\].
    heat: f64,
    /// Sensors of position, then of the five pressures in the order of [`AxisSignals`].
    sensors: [Sensor; 6],
    /// Whether a sensor has a lag, so that it needs the value of every step and not only samples.
    sensors_lag: bool,
    to_crane: Fieldbus<AxisCommand<f64>>,
    to_controller: Fieldbus<AxisSignals<f64>>,
    signals: AxisSignals<f64>,
    random: Pcg64Mcg,
    periods: u64,
}

/// Sensors of position, then of the five pressures in the order of [`AxisSignals`]; `random` gives their constant
/// errors.
fn sensors(
    n: &Numbers<f64>,
    outputs: &Outputs<f64>,
    step: f64,
    random: &mut Pcg64Mcg,
) -> [Sensor; 6] {
    let position = SensorData {
        error: 0.0,
        noise: n.position_noise,
        resolution: n.position_resolution,
        range: [f64::NEG_INFINITY, f64::INFINITY],
    };
    let resolution = match n.pressure_bits >= 1.0 {
        true => n.pressure_span / n.pressure_bits.exp2(),
        false => 0.0,
    };
    // a transducer without error, noise and resolution passes the pressure itself, below zero gauge too
    let ideal = n.pressure_error + n.pressure_noise + resolution == 0.0;
    let range = match ideal {
        true => [f64::NEG_INFINITY, f64::INFINITY],
        false => [-0.1 * n.pressure_span, n.pressure_span],
    };
    let mut transducer = |value: f64| {
        let error = n.pressure_error * n.pressure_span * random.random_range(-1.0..=1.0);
        let noise = n.pressure_noise * n.pressure_span;
        let data = SensorData { error, noise, resolution, range };
        Sensor::new(data, n.sensor_bandwidth, step, value)
    };
    [
        Sensor::new(position, n.sensor_bandwidth, step, outputs.stroke),
        transducer(outputs.pressure_pump_a),
        transducer(outputs.pressure_a),
        transducer(outputs.pressure_b),
        transducer(outputs.pressure_pump_b),
        transducer(outputs.pressure_accumulator),
    ]
}

impl Equipment {
    /// The equipment of a plant with initial `outputs`, integrated in steps of `step` \[s\]. The 3/2 valve is energised
    /// unless the pump sides carry no load.
    pub(crate) fn new(
        description: &Description,
        start: &Start,
        outputs: &Outputs<f64>,
        step: f64,
    ) -> Self {
        let n = &description.numbers;
        let pilot = f64::from(u8::from(start.preload > 0.0));
        let drive = (n.drive_bandwidth > 0.0).then_some(Drive {
            frequency: std::f64::consts::TAU * n.drive_bandwidth,
            damping: n.drive_damping,
            torque: n.drive_torque,
            inertia: n.drive_inertia,
            largest_speed: n.motor_speed,
            slew: n.motor_slew,
        });
        let valve = (n.valve_delay + n.pilot_line > 0.0)
            .then(|| SwitchingValve::new(n.valve_delay, n.pilot_line, step, pilot));

        let mut random = Pcg64Mcg::seed_from_u64(n.seed as u64);
        let sensors = sensors(n, outputs, step, &mut random);
        let reading = sampled(&sensors, 0.0, &mut random);
        let cycles = n.fieldbus_delay.round() as usize;
        let still = AxisCommand { motor_speed: 0.0, holding_valve: pilot };
        Self {
            period: n.control_period,
            drive,
            dead_time: (n.drive_dead_time > 0.0)
                .then(|| CommandDelay::new(n.drive_dead_time, n.control_period)),
            limits: ActuatorLimits { speed: n.motor_speed, slew: n.motor_slew },
            shaft: Shaft::still(),
            pump: PumpShaft {
                displacement: n.displacement,
                pistons: n.pistons,
                ripple: n.ripple,
                loss: n.torque_loss,
                loss_share: n.torque_loss_share,
                loss_speed: n.torque_loss_speed,
            },
            valve,
            pilot,
            has_position_switch: description.choices.position_switch
                == PositionSwitchChoice::Fitted,
            temperature: Temperature::new(description),
            air: Air::new(description, &pressures(outputs)),
            heat: 0.0,
            sensors,
            sensors_lag: n.sensor_bandwidth > 0.0,
            to_crane: Fieldbus::new(cycles, still),
            to_controller: Fieldbus::new(cycles, reading),
            signals: reading,
            random,
            periods: 0,
        }
    }

    /// The crane's description at the oil's initial temperature.
    pub(crate) fn warmed(description: &Description) -> Description {
        Temperature::new(description).description()
    }

    /// Signals that have arrived at the controller over the fieldbus.
    pub(crate) fn signals(&self) -> AxisSignals<f64> {
        self.signals
    }

    /// The same signals with their sequence number and sampling time.
    pub(crate) fn measurement(&self) -> Measurement {
        let late = self.to_controller.cycles() as u64;
        let time = self.periods.saturating_sub(late) as f64 * self.period;
        Measurement::new(self.periods + 1, time, [self.signals])
    }

    /// State of the load-holding valve by its position switch; `None` without a switch.
    pub(crate) fn valve_state(&self) -> Option<ValveState> {
        self.has_position_switch.then_some(match self.pilot > 0.5 {
            true => ValveState::Open,
            false => ValveState::Shut,
        })
    }

    /// True quantities, without sensor errors and delay.
    pub(crate) fn truth(&self, outputs: &Outputs<f64>) -> Truth {
        Truth {
            outputs: *outputs,
            motor_speed: self.shaft.motor.speed,
            motor_torque: self.torque(outputs),
            pilot: self.pilot,
            oil_temperature: self.temperature.oil(),
            heat: self.heat,
            transition_pressure: self.temperature.transition_pressure()
                - self.dissolved().map_or(0.0, |shift| shift.a),
        }
    }

    /// Time since the start \[s\].
    pub(crate) fn time(&self) -> f64 {
        self.periods as f64 * self.period
    }

    /// Control period \[s\].
    pub(crate) fn period(&self) -> f64 {
        self.period
    }

    /// Replaces the payload \[kg\]; returns the new description at the oil's temperature.
    pub(crate) fn with_payload(&mut self, mass: f64) -> Description {
        self.temperature.with_payload(mass)
    }

    /// Replaces the description; returns it at the oil's temperature.
    pub(crate) fn with_description(&mut self, description: &Description) -> Description {
        self.temperature.with_description(description)
    }

    /// Removes the drive's dead time from now on.
    pub(crate) fn remove_dead_time(&mut self) {
        self.dead_time = None;
    }

    /// Begins a control period with the controller's command. Returns the command that arrives at the crane, or
    /// `None` if it is not a finite number.
    pub(crate) fn begin(&mut self, command: &AxisCommand<f64>) -> Option<AxisCommand<f64>> {
        let mut command = self.to_crane.exchange(*command);
        if !(command.motor_speed.is_finite() && command.holding_valve.is_finite()) {
            return None;
        }
        if let Some(dead_time) = &mut self.dead_time {
            command.motor_speed = dead_time.exchange(command.motor_speed);
        }
        if self.drive.is_none() {
            self.shaft.motor.speed =
                self.limits.follow(self.shaft.motor.speed, command.motor_speed, self.period);
        }
        if self.valve.is_none() {
            self.pilot = command.holding_valve;
        }
        Some(command)
    }

    /// Whether the plant's input is constant over a control period.
    pub(crate) fn is_steady(&self) -> bool {
        self.drive.is_none() && self.valve.is_none() && !self.sensors_lag && self.pump.ripple == 0.0
    }

    /// Plant input for a whole period with constant input.
    pub(crate) fn input(&self) -> Input<f64> {
        Input { pump_speed: self.shaft.motor.speed, holding_valve: self.pilot }
    }

    /// Plant input for the next step of `step` \[s\].
    pub(crate) fn step(
        &mut self,
        command: &AxisCommand<f64>,
        outputs: &Outputs<f64>,
        step: f64,
    ) -> Input<f64> {
        let angle = self.shaft.angle;
        let mean_speed = match self.drive {
            Some(drive) => {
                let load = self.torque(outputs);
                self.shaft.drive(&drive, command.motor_speed, load, step)
            }
            None => {
                self.shaft.turn(step);
                self.shaft.motor.speed
            }
        };
        if let Some(valve) = &mut self.valve {
            self.pilot = valve.advance(command.holding_valve);
        }
        // ripple at the middle of the step
        let delivery = self.pump.delivery(angle + 0.5 * step * mean_speed);
        Input { pump_speed: mean_speed * delivery, holding_valve: self.pilot }
    }

    /// Updates the sensors with the outputs after a step.
    pub(crate) fn see(&mut self, outputs: &Outputs<f64>) {
        if self.sensors_lag {
            self.show(outputs);
        }
    }

    /// Ends a control period: samples the sensors and sends the readings to the controller.
    pub(crate) fn end(&mut self, outputs: &Outputs<f64>) {
        self.periods += 1;
        if !self.sensors_lag {
            self.show(outputs);
        }
        let sent = sampled(&self.sensors, self.shaft.motor.speed, &mut self.random);
        self.signals = self.to_controller.exchange(sent);
    }

    fn torque(&self, o: &Outputs<f64>) -> f64 {
        self.pump.torque(o.pressure_pump_a - o.pressure_pump_b, self.shaft.motor.speed)
    }

    fn show(&mut self, o: &Outputs<f64>) {
        let seen = [
            o.stroke,
            o.pressure_pump_a,
            o.pressure_a,
            o.pressure_b,
            o.pressure_pump_b,
            o.pressure_accumulator,
        ];
        self.sensors.iter_mut().zip(seen).for_each(|(sensor, value)| sensor.follow(value));
    }

    /// Whether the slow states are to be updated in the current period.
    pub(crate) fn slow_is_due(&self) -> bool {
        (self.periods + 1).is_multiple_of(SLOW_EVERY)
    }

    /// Heats the oil by the plant's losses \[W\]. Returns the new description if the temperature has changed by more
    /// than the update threshold.
    pub(crate) fn warm(&mut self, losses: f64, o: &Outputs<f64>) -> Option<Description> {
        let difference = o.pressure_pump_a - o.pressure_pump_b;
        self.heat = losses + self.pump.heat(difference, self.shaft.motor.speed);
        self.temperature.advance(self.heat, self.period * SLOW_EVERY as f64)
    }

    /// Integrates the dissolved air since the last update. Returns the shift of the transition pressure of every node
    /// \[Pa\]; `None` if the crane has no dissolved air.
    pub(crate) fn dissolve(&mut self, outputs: &Outputs<f64>) -> Option<Nodes<f64>> {
        let time = self.period * SLOW_EVERY as f64;
        let air = self.air.as_mut()?;
        air.advance(&pressures(outputs), time);
        Some(air.shift())
    }

    /// Current shift of the transition pressure by dissolved air \[Pa\].
    pub(crate) fn dissolved(&self) -> Option<Nodes<f64>> {
        self.air.as_ref().map(Air::shift)
    }
}

fn pressures(outputs: &Outputs<f64>) -> Nodes<f64> {
    Nodes {
        pump_a: outputs.pressure_pump_a,
        a: outputs.pressure_a,
        b: outputs.pressure_b,
        pump_b: outputs.pressure_pump_b,
        accumulator: outputs.pressure_accumulator,
    }
}

fn sampled(sensors: &[Sensor; 6], motor_speed: f64, random: &mut impl Rng) -> AxisSignals<f64> {
    let [stroke, pressure_pump_a, pressure_a, pressure_b, pressure_pump_b, pressure_accumulator] =
        sensors.each_ref().map(|sensor| sensor.sample(random));
    AxisSignals {
        stroke,
        pressure_pump_a,
        pressure_a,
        pressure_b,
        pressure_pump_b,
        pressure_accumulator,
        motor_speed,
    }
}
