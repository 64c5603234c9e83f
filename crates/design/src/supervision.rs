//! Supervision derived from a crane file: limits, monitors, and the release of the load.

use crate::DesignError;
use crate::linearised_plant::LinearisedPlant;
use crate::scheduled_lqr::{designed, known_delay};
use hydroboom_control::supervision::deadline_monitor::WINDOW as DEADLINE_WINDOW;
use hydroboom_control::supervision::drive_monitor::DriveMonitor;
use hydroboom_control::supervision::flow_monitor::{FlowMonitor, Range};
use hydroboom_control::supervision::frame::Frame;
use hydroboom_control::supervision::framed::{FramedBenchmark, FramedSimulationFeedforward};
use hydroboom_control::supervision::framed_scheduled_lqr::FramedScheduledLqr;
use hydroboom_control::supervision::limits::Limits;
use hydroboom_control::supervision::release::Release;
use hydroboom_description::schema::{DeliveryChoice, HoldingCheckChoice};
use hydroboom_description::{Description, Numbers};
use hydroboom_model::Scheme;
use hydroboom_model::hydraulics::Oil;
use hydroboom_plant::plant;
use std::f64::consts::TAU;

/// Positions over the stroke at which the load pressure is computed.
const POSITIONS: [f64; 5] = [0.0, 0.25, 0.5, 0.75, 1.0];
/// Averaging window of the position during a release, in periods of control.
const WINDOW_PERIODS: f64 = 20.0;
/// Rate at which the pump side's pressure is held during the proof \[1/s\]: slow against the drive.
const HOLDING_RATE: f64 = 10.0;
/// Largest proving motion with a noisy position, over that with a quiet one.
const LARGEST_MOTION: f64 = 5.0;
/// Fast filling, far below the load's pressure, over slow filling.
const FAST: f64 = 4.0;
/// Standard deviations of the encoder's noise that are no motion.
const NOISE: f64 = 6.0;
/// Deviation of the motor from the slowest drive's response that is not following, of the largest speed; its
/// ripple is some hundredths.
const DRIVE_DEVIATION: f64 = 0.1;
/// Time for which it must last \[s\].
const DRIVE_DEVIATION_TIME: f64 = 0.1;
/// Speed beyond the command that is uncommanded, of the largest speed.
const DRIVE_UNCOMMANDED: f64 = 0.04;
/// Overshoot of a speed loop damped with 0.6 to 0.8, besides, of the commanded speed.
const DRIVE_OVERSHOOT: f64 = 0.1;
/// Time for which it must last \[s\]: with the valve's closing time far below 50 ms.
const DRIVE_UNCOMMANDED_TIME: f64 = 0.01;
/// Share of missed periods in the deadline monitor's window that is borne.
const MISSED: f64 = 0.25;
/// Largest constant error of a pressure transducer where the file states none, of span: data sheets,
/// 0.25 to 0.5 %.
const TRANSDUCER_ERROR: f64 = 5e-3;

/// Load-carrying chamber and its gauge pressure at rest, over the stroke and the ranges of a crane file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoadPressure {
    /// +1 where the piston side carries the load, −1 where the rod side does.
    pub direction: f64,
    /// Smallest gauge pressure of that side \[Pa\].
    pub least: f64,
    /// Gauge pressure with the crane file's values in the middle of the stroke \[Pa\].
    pub nominal: f64,
    /// Largest gauge pressure of that side \[Pa\].
    pub most: f64,
}

/// A crane file's values and ranges, with what derives from them.
struct Derivation {
    model: Description,
    low: Numbers<f64>,
    high: Numbers<f64>,
    /// Period of the load mode \[s\].
    swing: f64,
    load: LoadPressure,
}

/// Limits and monitors of a crane for a course with a largest piston speed \[m/s\].
///
/// Typical equipment stands in where the file leaves out drive, valve, sensors or fieldbus.
///
/// # Errors
///
/// [`DesignError::Plant`] if the crane cannot rest, [`DesignError::Eigenvalues`] if its modes cannot be computed,
/// [`DesignError::NoMode`] if it has no load mode in the middle of its stroke.
pub fn limits(model: &Description, speed: f64) -> Result<Limits, DesignError> {
    Ok(Derivation::of(model)?.limits(speed))
}

/// Benchmark controller within the frame, for courses up to the crane file's fast speed.
///
/// # Errors
///
/// As [`limits`].
pub fn framed_benchmark(model: &Description) -> Result<FramedBenchmark<f64>, DesignError> {
    let n = &model.numbers;
    let cylinder = model.cylinder();
    Ok(FramedBenchmark {
        frame: Frame::new(&limits(model, n.fast)?, n.supervision_tracking),
        benchmark: model.benchmark(),
        area_ratio: cylinder.area_ratio(),
    })
}

/// Benchmark controller with simulation feedforward within the frame, for courses up to the crane file's fast speed.
///
/// # Errors
///
/// As [`limits`].
pub fn framed_simulation_feedforward(
    model: &Description,
) -> Result<FramedSimulationFeedforward<f64>, DesignError> {
    let FramedBenchmark { frame, benchmark, area_ratio } = framed_benchmark(model)?;
    Ok(FramedSimulationFeedforward { frame, benchmark, area_ratio })
}

/// Scheduled LQR and state estimator within the frame, with the crane file's fieldbus delay.
///
/// # Errors
///
/// As [`limits`], and if there is no reduced model.
pub fn framed_scheduled_lqr(model: &Description) -> Result<FramedScheduledLqr<f64>, DesignError> {
    let FramedBenchmark { frame, area_ratio, .. } = framed_benchmark(model)?;
    let (estimator, law) = designed(model, known_delay(model) as usize)?;
    Ok(FramedScheduledLqr { frame, estimator, law, area_ratio })
}

/// Load pressure of the crane at rest, over its stroke and ranges.
///
/// # Errors
///
/// [`DesignError::Plant`] if the crane cannot rest at one of the positions and payloads.
pub fn load_pressure(model: &Description) -> Result<LoadPressure, DesignError> {
    let ranges = model.ranges();
    weigh(model, &ranges.low, &ranges.high)
}

/// Force on the piston at rest \[N\], positive where it pushes, under a payload \[kg\].
fn load_force(model: &Description, payload: f64, stroke: f64) -> Result<f64, DesignError> {
    let mut loaded = model.divided(1);
    loaded.numbers.payload = payload;
    // a rod side with some pressure, so that a load that pulls has a state of rest too
    loaded.numbers.rod_side = loaded.numbers.rod_side.max(100e5);
    let crane = plant(&loaded, &loaded.start(stroke), Scheme::Implicit, 1e-3)?;
    let outputs = crane.outputs();
    let cylinder = model.cylinder();
    Ok(outputs.pressure_a * cylinder.piston_area - outputs.pressure_b * cylinder.rod_side_area)
}

fn weigh(
    model: &Description,
    low: &Numbers<f64>,
    high: &Numbers<f64>,
) -> Result<LoadPressure, DesignError> {
    let cylinder = model.cylinder();
    let force = |payload: f64| {
        POSITIONS
            .iter()
            .map(|share| load_force(model, payload, share * model.numbers.stroke))
            .collect::<Result<Vec<f64>, _>>()
    };
    let nominal = load_force(model, model.numbers.payload, 0.5 * model.numbers.stroke)?;
    let direction = if nominal < 0.0 { -1.0 } else { 1.0 };
    let friction = high.coulomb + high.stiction;
    let forces =
        [force(low.payload)?, force(model.numbers.payload)?, force(high.payload)?].concat();
    let against: Vec<f64> = forces.iter().map(|force| direction * force).collect();
    let least = against.iter().copied().fold(f64::INFINITY, f64::min);
    let most = against.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    // the trapped pressure of the other chamber acts against it
    let (area, other) = match direction > 0.0 {
        true => (cylinder.piston_area, cylinder.rod_side_area),
        false => (cylinder.rod_side_area, cylinder.piston_area),
    };
    let pressure =
        |force: f64, behind: f64, friction: f64| (force + behind * other + friction) / area;
    Ok(LoadPressure {
        direction,
        least: pressure(least, 0.0, -friction).max(0.0),
        nominal: pressure(direction * nominal, model.numbers.rod_side, 0.0).max(1e5),
        most: pressure(most, high.rod_side, friction).max(1e5),
    })
}

impl Derivation {
    fn of(model: &Description) -> Result<Self, DesignError> {
        let (model, _) = model.virtual_crane();
        let ranges = model.ranges();
        let lifting = LinearisedPlant::new(&model, 0.5 * model.numbers.stroke)?;
        let swing = 1.0 / lifting.load_frequency()?;
        let load = weigh(&model, &ranges.low, &ranges.high)?;
        Ok(Self { low: ranges.low, high: ranges.high, swing, load, model })
    }

    /// Time from the pump's motion to its measurement, with an averaging window \[s\].
    fn reaction_time(&self) -> f64 {
        let n = &self.model.numbers;
        WINDOW_PERIODS * n.control_period
            + 2.0 * self.high.fieldbus_delay * n.control_period
            + self.drive_response()
    }

    /// Dead time and time constant of the slowest drive \[s\].
    fn drive_response(&self) -> f64 {
        let n = &self.model.numbers;
        self.high.drive_dead_time
            + 2.0 * n.drive_damping / (TAU * self.low.drive_bandwidth.max(1.0))
    }

    /// Time from the command of the valve until it has switched at the latest \[s\].
    fn valve_time(&self) -> f64 {
        let n = &self.model.numbers;
        // three time constants of the pilot lines; the fieldbus there and back
        self.high.valve_delay
            + 3.0 * self.high.pilot_line
            + 2.0 * self.high.fieldbus_delay * n.control_period
    }

    fn oil(&self, transition: f64) -> Oil<f64> {
        let n = &self.model.numbers;
        Oil {
            bulk_modulus_max: n.bulk_modulus_max,
            bulk_modulus_min: n.bulk_modulus_min,
            transition_pressure: transition,
            transition_slope: 1.0 / n.transition_width,
            vapour_pressure: n.vapour_pressure,
        }
    }

    /// The stiffest oil and the softest.
    fn oils(&self) -> [Oil<f64>; 2] {
        [self.oil(self.low.transition - self.high.air_shift), self.oil(self.high.transition)]
    }

    /// Volume that arrives for each displaced one, smallest and largest, over the described displacement.
    fn gain(&self) -> Range {
        let (n, low, high) = (&self.model.numbers, &self.low, &self.high);
        let [_, soft] = self.oils();
        let gains = match self.model.choices.delivery {
            DeliveryChoice::Published => [low.flow_gain, high.flow_gain],
            DeliveryChoice::Computed => [(-soft.compression(self.load.most)).exp(), 1.0],
        };
        Range {
            low: gains[0] * low.displacement / n.displacement,
            high: gains[1] * high.displacement / n.displacement,
        }
    }

    /// Leakage of the pump side that carries the load at a pressure \[m³/s\].
    fn leakage(&self, n: &Numbers<f64>, pressure: f64) -> f64 {
        let case = if self.load.direction > 0.0 { n.case_leakage_a } else { n.case_leakage_b };
        (n.internal_leakage + case) * pressure.max(0.0).sqrt() + n.slip_at_rest * pressure
    }

    fn drive(&self) -> DriveMonitor<f64> {
        let n = &self.model.numbers;
        let bus = 2.0 * self.high.fieldbus_delay * n.control_period;
        DriveMonitor {
            slew: n.motor_slew,
            torque: self.low.drive_torque,
            inertia: self.high.drive_inertia,
            displacement: self.high.displacement,
            // a second-order lag stays behind longer than its first-order part
            response: 1.5 * self.drive_response() + bus + n.control_period,
            deviation: DRIVE_DEVIATION * n.motor_speed,
            deviation_time: DRIVE_DEVIATION_TIME,
            uncommanded: DRIVE_UNCOMMANDED * n.motor_speed,
            overshoot: DRIVE_OVERSHOOT,
            uncommanded_time: DRIVE_UNCOMMANDED_TIME,
        }
    }

    fn transducer_error(&self) -> f64 {
        let n = &self.model.numbers;
        n.pressure_span * n.pressure_error.max(TRANSDUCER_ERROR)
    }

    fn flow(&self, speed: f64) -> FlowMonitor {
        let n = &self.model.numbers;
        let cylinder = self.model.cylinder();
        let side_a = self.load.direction > 0.0;
        let described = (n.internal_leakage
            + if side_a { n.case_leakage_a } else { n.case_leakage_b })
            * self.load.nominal.sqrt();
        let of = |n: &Numbers<f64>| match described > 0.0 {
            true => self.leakage(n, self.load.nominal) / described,
            false => 1.0,
        };
        // readings of speed and position are apart by the fieldbus and the sensors' lag
        let lag = if n.sensor_bandwidth > 0.0 { 1.0 / (TAU * n.sensor_bandwidth) } else { 0.0 };
        let delay = 2.0 * n.control_period + lag;
        FlowMonitor {
            area: if side_a { cylinder.piston_area } else { cylinder.rod_side_area },
            direction: self.load.direction,
            displacement: n.displacement,
            gain: self.gain(),
            leakage: Range { low: of(&self.low), high: of(&self.high) },
            slip: Range { low: self.low.slip_per_speed, high: self.high.slip_per_speed },
            internal_leakage: n.internal_leakage,
            case_leakage: if side_a { n.case_leakage_a } else { n.case_leakage_b },
            pump_volume: if side_a { n.volume_pump_a } else { n.volume_pump_b },
            dead_volume: if side_a { n.dead_volume_a } else { n.dead_volume_b },
            stroke: n.stroke,
            oils: self.oils(),
            air_shift: self.high.air_shift,
            tolerance: NOISE * n.position_noise
                + n.position_resolution
                + speed * delay
                + 0.5 * n.supervision_creep,
        }
    }

    fn release(&self) -> Release<f64> {
        let (n, low, high) = (&self.model.numbers, &self.low, &self.high);
        let LoadPressure { direction, least, nominal, most } = self.load;
        let side_a = direction > 0.0;
        let cylinder = self.model.cylinder();
        let (area, dead, pump) = match side_a {
            true => (cylinder.piston_area, n.dead_volume_a, n.volume_pump_a),
            false => (cylinder.rod_side_area, n.dead_volume_b, n.volume_pump_b),
        };
        let other = cylinder.piston_area + cylinder.rod_side_area - area;
        let [stiff, soft] = self.oils();
        let gain = self.gain();
        // friction has to be turned round before the piston moves, and the valve to be cracked
        let to_move = 2.0 * (high.coulomb + high.stiction) / area + high.holding_opening;
        let compressed =
            |oil: &Oil<f64>, from: f64, to: f64| oil.compression(to) - oil.compression(from);
        let chamber = dead + area * n.stroke;
        let into_chamber = chamber * compressed(&soft, least, least + to_move);
        let filled = pump * compressed(&soft, 0.0, most + to_move) + into_chamber;
        let leaks = self.leakage(high, most);
        let delivery_low = gain.low * n.displacement;
        let of_piston = |speed: f64| speed * area / delivery_low;
        let reaction = self.reaction_time();
        // twice the leakage at least, or nothing would move
        let leakage_speed = leaks / delivery_low;
        let slow = of_piston(n.proving_motion / reaction).max(2.0 * leakage_speed);
        let fast = FAST * slow;
        let limit = 0.5 * n.motor_speed;
        let (slow, fast) = (slow.min(limit), fast.min(limit));
        let net = (slow * delivery_low - leaks).max(0.1 * slow * delivery_low);
        let filling = filled / net;
        Release {
            period: n.control_period,
            direction,
            window: WINDOW_PERIODS * n.control_period,
            observation: self.swing,
            rest_drift: 0.25 * n.proving_motion,
            proving_motion: n.proving_motion,
            largest_motion: LARGEST_MOTION * n.proving_motion,
            stroke: n.stroke,
            end_zone: n.supervision_creep,
            delivery: gain.high.min(1.0) * n.displacement,
            fast,
            slow,
            approach: to_move + 2.0 * self.transducer_error(),
            slew: n.motor_slew,
            leakage: self.leakage(n, nominal) / (0.5 * (gain.low + gain.high) * n.displacement),
            holding_gain: HOLDING_RATE * pump / (n.bulk_modulus_max * delivery_low),
            nominal_pressure: nominal,
            least_pressure: least,
            most_pressure: most - high.rod_side * other / area,
            pressure_tolerance: 2.0 * self.transducer_error() + 2.0 * high.holding_opening,
            pressure_response: 2.0 * self.transducer_error(),
            least_compression: compressed(&stiff, 0.0, least),
            pump_volume: pump,
            largest_volume: (filled + leaks * filling) * gain.high / gain.low * 1.2,
            largest_duration: n.release_time.min(1.2 * filling + 3.0 * self.swing + 1.0),
            check_function: match self.model.choices.holding_check {
                HoldingCheckChoice::Check => 1.0,
                HoldingCheckChoice::None => 0.0,
            },
            largest_compliance: 1.0 / low.bulk_modulus_min,
            bulk_modulus: n.bulk_modulus_max,
            transition: high.transition,
            transition_slope: 1.0 / n.transition_width,
            area,
            other_area: other,
            dead_volume: dead,
            largest_spring: n.supervision_spring,
        }
    }

    fn limits(&self, speed: f64) -> Limits {
        let n = &self.model.numbers;
        let flow = n.motor_speed * n.displacement;
        let drop = (flow / self.low.holding_coefficient).powi(2) + self.high.holding_opening;
        let swing_speed = 0.25 * n.supervision_creep * TAU / self.swing;
        Limits {
            period: n.control_period,
            stroke: n.stroke,
            margin: n.supervision_end_margin,
            speed,
            speed_per_motor_speed: self.gain().high * n.displacement / self.flow(speed).area,
            pressure: n.supervision_pressure,
            creep: n.supervision_creep,
            motor_speed: n.motor_speed,
            motor_slew: n.motor_slew,
            stop_time: n.supervision_stop,
            watchdog: n.supervision_watchdog,
            still: (swing_speed, self.swing),
            wait_time: n.supervision_wait,
            stale: n.supervision_watchdog,
            stuck: if self.model.has_sensor_noise() { n.supervision_stuck } else { 0.0 },
            scatter: (n.supervision_position_scatter, n.supervision_pressure_scatter),
            pressure_step: n.supervision_pressure_step,
            pressure_agreement: (2.0 * (drop + 2.0 * self.transducer_error()), 0.1),
            missed: (MISSED * f64::from(DEADLINE_WINDOW)) as u32,
            valve_time: self.valve_time(),
            drive: self.drive(),
            flow: self.flow(speed),
            release: self.release(),
        }
    }
}
