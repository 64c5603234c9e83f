//! The virtual crane, one control period at a time.

use crate::air::Air;
use crate::drive::{Drive, DriveState};
use crate::fieldbus::Fieldbus;
use crate::pump::PumpShaft;
use crate::sensor::{Sensor, SensorData};
use crate::temperature::Temperature;
use crate::valve::SwitchingValve;
use hydroboom_control::{Measured, MotorLimits};
use hydroboom_description::Description;
use hydroboom_math::record;
use hydroboom_model::hydraulics::Cylinder;
use hydroboom_model::{Input, Nodes, Outputs, Scheme, SimulationError, Start};
use hydroboom_plant::{Plant, PlantError, plant};
use rand::{Rng, RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

record! {
    /// What a controller sends.
    pub struct Command<T> {
        /// Motor speed asked for
        #[unit = "rev/s"]
        pub motor_speed: T,
        /// 3/2 valve: 1 energised (load released), 0 not (load held)
        #[unit = "1"]
        pub holding_valve: T,
    }
}

record! {
    /// What a real crane's data acquisition would see.
    pub struct Reading<T> {
        /// Piston position
        #[unit = "m"]
        pub stroke: T,
        /// Pressure on pump side A
        #[unit = "Pa"]
        pub pressure_pump_a: T,
        /// Pressure on the piston side
        #[unit = "Pa"]
        pub pressure_a: T,
        /// Pressure on the rod side
        #[unit = "Pa"]
        pub pressure_b: T,
        /// Pressure on pump side B
        #[unit = "Pa"]
        pub pressure_pump_b: T,
        /// Pressure in the accumulator
        #[unit = "Pa"]
        pub pressure_accumulator: T,
        /// Motor speed, from the drive's encoder
        #[unit = "rev/s"]
        pub motor_speed: T,
    }
}

/// What no data acquisition would see.
#[derive(Clone, Copy, Debug)]
pub struct Truth {
    /// The crane itself.
    pub outputs: Outputs<f64>,
    /// Motor speed \[rev/s\].
    pub motor_speed: f64,
    /// Torque the pump asks of the motor \[N·m\].
    pub motor_torque: f64,
    /// Position of the pilots, 0 to 1.
    pub pilot: f64,
    /// Oil temperature \[°C\].
    pub oil_temperature: f64,
    /// Power lost as heat \[W\].
    pub heat: f64,
}

impl Truth {
    /// Names of what stands beside the outputs.
    pub const NAMES: [&str; 5] =
        ["motor_speed", "motor_torque_nm", "pilot", "oil_temperature_c", "heat_w"];
    /// Their units, where the name does not say.
    pub const UNITS: [&str; 5] = ["rev/s", "", "", "", ""];

    /// What they mean.
    pub const MEANINGS: [&str; 5] = [
        "Motor speed",
        "Torque the pump asks of the motor",
        "Position of the load-holding valves' pilots, 0 to 1",
        "Oil temperature",
        "Power lost as heat",
    ];

    /// What stands beside the outputs, in the order of [`NAMES`](Self::NAMES).
    pub fn beside_outputs(&self) -> [f64; 5] {
        [self.motor_speed, self.motor_torque, self.pilot, self.oil_temperature, self.heat]
    }
}

/// Control periods between two looks at what changes slowly, the oil's heat and air.
const SLOW_EVERY: u64 = 20;

/// A crane with all that stands between it and a controller.
pub struct VirtualCrane {
    plant: Box<dyn Plant>,
    /// Of the plant, now.
    outputs: Outputs<f64>,
    /// Steps in a control period.
    steps: u32,
    period: f64,
    /// None: the motor follows at once, within its limits, as the model's does.
    drive: Option<Drive>,
    limits: MotorLimits<f64>,
    motor: DriveState,
    shaft: PumpShaft,
    /// None: the valve switches at once.
    valve: Option<SwitchingValve>,
    pilot: f64,
    temperature: Temperature,
    air: Option<Air>,
    /// Power that is lost as heat \[W\].
    heat: f64,
    /// Of position, then of the five pressures in the order of [`Reading`].
    sensors: [Sensor; 6],
    /// Whether a sensor must be shown every step, not only what it samples.
    sensors_lag: bool,
    to_crane: Fieldbus<Command<f64>>,
    to_controller: Fieldbus<Reading<f64>>,
    reading: Reading<f64>,
    random: Pcg64Mcg,
    periods: u64,
    /// For its areas.
    cylinder: Cylinder<f64>,
}

impl VirtualCrane {
    /// A crane at rest at `start`, 3/2 valve energised unless the pump sides have no load at all.
    ///
    /// # Errors
    ///
    /// [`PlantError`] when the description gives no model or its steps do not suit each other.
    pub fn new(description: &Description, start: &Start) -> Result<Self, PlantError> {
        let n = &description.numbers;
        let period = n.control_period;
        let (scheme, wanted) = match n.virtual_step > 0.0 {
            true => (Scheme::Implicit, n.virtual_step),
            false => (Scheme::Published, n.simulation_period),
        };
        // a whole number of steps in a control period
        let steps = (period / wanted * (1.0 - 1e-12)).ceil().max(1.0);
        // a step that fits already stays as it is, to the last bit
        let step = match (steps * wanted / period - 1.0).abs() < 1e-12 {
            true => wanted,
            false => period / steps,
        };
        let temperature = Temperature::new(description);
        let mut plant = plant(&temperature.description(), start, scheme, step)?;
        let air = Air::new(description, &pressures(&plant.outputs()));
        if let Some(air) = &air {
            plant.set_dissolved_air(air.shift());
        }
        let pilot = f64::from(u8::from(start.preload > 0.0));

        let drive = (n.drive_bandwidth > 0.0).then_some(Drive {
            frequency: std::f64::consts::TAU * n.drive_bandwidth,
            damping: n.drive_damping,
            torque: n.drive_torque,
            inertia: n.drive_inertia,
            limits: MotorLimits { speed: n.motor_speed, slew: n.motor_slew },
        });
        let valve = (n.valve_delay + n.pilot_line > 0.0)
            .then(|| SwitchingValve::new(n.valve_delay, n.pilot_line, step, pilot));

        let mut random = Pcg64Mcg::seed_from_u64(n.seed as u64);
        let outputs = plant.outputs();
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
        // without any of a transducer's effects it reads the pressure itself, suction included
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
        let sensors = [
            Sensor::new(position, n.sensor_bandwidth, step, outputs.stroke),
            transducer(outputs.pressure_pump_a),
            transducer(outputs.pressure_a),
            transducer(outputs.pressure_b),
            transducer(outputs.pressure_pump_b),
            transducer(outputs.pressure_accumulator),
        ];
        let reading = sampled(&sensors, 0.0, &mut random);
        let cycles = n.fieldbus_delay.round() as usize;
        let still = Command { motor_speed: 0.0, holding_valve: pilot };
        Ok(Self {
            plant,
            outputs,
            steps: steps as u32,
            period,
            drive,
            limits: MotorLimits { speed: n.motor_speed, slew: n.motor_slew },
            motor: DriveState::default(),
            shaft: PumpShaft {
                displacement: n.displacement,
                pistons: n.pistons,
                ripple: n.ripple,
                loss: n.torque_loss,
                loss_share: n.torque_loss_share,
                loss_speed: n.torque_loss_speed,
            },
            valve,
            pilot,
            temperature,
            air,
            heat: 0.0,
            sensors,
            sensors_lag: n.sensor_bandwidth > 0.0,
            to_crane: Fieldbus::new(cycles, still),
            to_controller: Fieldbus::new(cycles, reading),
            reading,
            random,
            periods: 0,
            cylinder: Cylinder::from_diameters(
                n.piston,
                n.rod,
                n.stroke,
                n.dead_volume_a,
                n.dead_volume_b,
            ),
        })
    }

    /// What has arrived at the controller.
    pub fn reading(&self) -> Reading<f64> {
        self.reading
    }

    /// What the benchmark controller makes of it.
    pub fn measured(&self) -> Measured<f64> {
        let r = &self.reading;
        Measured {
            stroke: r.stroke,
            load_pressure: self.cylinder.load_pressure(r.pressure_a, r.pressure_b),
        }
    }

    /// What nobody sees.
    pub fn truth(&self) -> Truth {
        Truth {
            outputs: self.outputs,
            motor_speed: self.motor.speed,
            motor_torque: self.torque(),
            pilot: self.pilot,
            oil_temperature: self.temperature.oil(),
            heat: self.heat,
        }
    }

    /// The model inside.
    pub fn plant(&self) -> &dyn Plant {
        self.plant.as_ref()
    }

    /// Time since the start \[s\].
    pub fn time(&self) -> f64 {
        self.periods as f64 * self.period
    }

    /// Lifts the whole boom by an angle \[rad\] with the oil in both chambers locked in, so that it
    /// will drop onto its cylinder.
    ///
    /// # Errors
    ///
    /// [`SimulationError`] when the lifted state is not valid.
    pub fn lift(&mut self, angle: f64) -> Result<(), SimulationError> {
        self.plant.lift(angle)?;
        self.outputs = self.plant.outputs();
        Ok(())
    }

    /// Control period \[s\].
    pub fn period(&self) -> f64 {
        self.period
    }

    /// Hangs another payload \[kg\] on the boom, at the same place.
    ///
    /// # Errors
    ///
    /// [`PlantError`] when there is no crane with such a payload.
    pub fn set_payload(&mut self, mass: f64) -> Result<(), PlantError> {
        let heavier = self.temperature.with_payload(mass);
        self.plant.set_parameters(&heavier)?;
        self.dissolve(0.0);
        Ok(())
    }

    /// One control period under a command.
    ///
    /// # Errors
    ///
    /// [`SimulationError`] when the crane leaves what the model holds for.
    pub fn advance(&mut self, command: &Command<f64>) -> Result<(), SimulationError> {
        let command = self.to_crane.exchange(*command);
        if !(command.motor_speed.is_finite() && command.holding_valve.is_finite()) {
            return Err(SimulationError::Input { time: self.time() });
        }
        if self.drive.is_none() {
            self.motor.speed =
                self.limits.follow(self.motor.speed, command.motor_speed, self.period);
        }
        let equipped = self.drive.is_some()
            || self.valve.is_some()
            || self.sensors_lag
            || self.shaft.ripple > 0.0;
        if equipped {
            for _ in 0..self.steps {
                self.step(&command)?;
            }
        } else {
            self.pilot = command.holding_valve;
            self.plant.advance(&self.input(self.motor.speed), self.steps)?;
            self.outputs = self.plant.outputs();
        }
        self.periods += 1;
        if self.periods.is_multiple_of(SLOW_EVERY) {
            self.warm();
            self.dissolve(self.period * SLOW_EVERY as f64);
        }

        if !self.sensors_lag {
            self.show();
        }
        let sent = sampled(&self.sensors, self.motor.speed, &mut self.random);
        self.reading = self.to_controller.exchange(sent);
        Ok(())
    }

    /// One step of plant and equipment.
    fn step(&mut self, command: &Command<f64>) -> Result<(), SimulationError> {
        let step = self.plant.step();
        let angle = self.motor.angle;
        let mean_speed = match self.drive {
            Some(drive) => {
                let load = self.torque();
                drive.advance(&mut self.motor, command.motor_speed, load, step)
            }
            None => {
                self.motor.angle = (angle + step * self.motor.speed).rem_euclid(1.0);
                self.motor.speed
            }
        };
        self.pilot = match &mut self.valve {
            Some(valve) => valve.advance(command.holding_valve),
            None => command.holding_valve,
        };
        // the ripple in the middle of the step
        let delivery = self.shaft.delivery(angle + 0.5 * step * mean_speed);
        self.plant.advance(&self.input(mean_speed * delivery), 1)?;
        self.outputs = self.plant.outputs();
        if self.sensors_lag {
            self.show();
        }
        Ok(())
    }

    fn input(&self, pump_speed: f64) -> Input<f64> {
        Input { pump_speed, holding_valve: self.pilot }
    }

    fn torque(&self) -> f64 {
        let difference = self.outputs.pressure_pump_a - self.outputs.pressure_pump_b;
        self.shaft.torque(difference, self.motor.speed)
    }

    /// Shows the sensors what they follow.
    fn show(&mut self) {
        let o = &self.outputs;
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

    /// Lets the oil's air dissolve or come out for `time` \[s\].
    fn dissolve(&mut self, time: f64) {
        if let Some(air) = &mut self.air {
            air.advance(&pressures(&self.outputs), time);
            self.plant.set_dissolved_air(air.shift());
        }
    }

    /// Gathers what is lost as heat, and warms the oil with it.
    fn warm(&mut self) {
        let difference = self.outputs.pressure_pump_a - self.outputs.pressure_pump_b;
        self.heat = self.plant.power(&self.input(self.motor.speed)).losses()
            + self.shaft.heat(difference, self.motor.speed);
        let time = self.period * SLOW_EVERY as f64;
        if let Some(warmer) = self.temperature.advance(self.heat, time) {
            // the number of segments is what it was, and so the type has room for them
            self.plant.set_parameters(&warmer).expect("as many segments as at the start");
        }
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

fn sampled(sensors: &[Sensor; 6], motor_speed: f64, random: &mut impl Rng) -> Reading<f64> {
    let [stroke, pressure_pump_a, pressure_a, pressure_b, pressure_pump_b, pressure_accumulator] =
        sensors.each_ref().map(|sensor| sensor.sample(random));
    Reading {
        stroke,
        pressure_pump_a,
        pressure_a,
        pressure_b,
        pressure_pump_b,
        pressure_accumulator,
        motor_speed,
    }
}
