//! A machine in closed form for the supervisor's tests: an incompressible cylinder behind a check
//! valve, on a pump side of constant stiffness.

use hydroboom_control::command::AxisCommand;
use hydroboom_control::measurement::AxisSignals;
use hydroboom_control::supervision::drive_monitor::DriveMonitor;
use hydroboom_control::supervision::flow_monitor::{FlowMonitor, Range};
use hydroboom_control::supervision::limits::ValveState;
use hydroboom_control::supervision::limits::{Limits, Observation};
use hydroboom_control::supervision::release::Release;
use hydroboom_model::hydraulics::Oil;

const PERIOD: f64 = 1e-3;
/// Displacement \[m³/rev\] and piston area \[m²\].
const DISPLACEMENT: f64 = 10e-6;
const AREA: f64 = 3.3e-3;
/// Pressure of the load, and at which the check valve opens beyond it \[Pa\].
const LOAD: f64 = 68e5;
const CRACKING: f64 = 1e5;
/// Pressure gained for each volume \[Pa/m³\].
const STIFFNESS: f64 = 8e11;

/// Stiff oil of constant bulk modulus.
const OIL: Oil<f64> = Oil {
    bulk_modulus_max: 1.6e9,
    bulk_modulus_min: 1.6e9,
    transition_pressure: 0.0,
    transition_slope: 1e-5,
    vapour_pressure: -1e5,
};

/// Limits that suit the machine.
pub fn limits() -> Limits {
    Limits {
        period: PERIOD,
        stroke: 0.5,
        margin: 0.01,
        speed: 0.12,
        speed_per_motor_speed: DISPLACEMENT / AREA,
        pressure: 200e5,
        creep: 3e-3,
        motor_speed: 50.0,
        motor_slew: 500.0,
        stop_time: 0.4,
        watchdog: 0.02,
        still: (0.011, 0.4),
        wait_time: 5.0,
        stale: 5e-3,
        stuck: 0.2,
        scatter: (1e-4, 2e5),
        pressure_step: 30e5,
        pressure_agreement: (10e5, 0.1),
        missed: 64,
        valve_time: 0.06,
        drive: DriveMonitor {
            response: 0.02,
            slew: 500.0,
            torque: 32.0,
            inertia: 0.01,
            displacement: DISPLACEMENT,
            deviation: 5.0,
            deviation_time: 0.1,
            uncommanded: 2.0,
            overshoot: 0.1,
            uncommanded_time: 0.01,
        },
        flow: FlowMonitor {
            area: AREA,
            displacement: DISPLACEMENT,
            gain: Range { low: 0.95, high: 1.05 },
            leakage: Range { low: 0.5, high: 3.0 },
            slip: Range { low: 0.0, high: 0.0 },
            internal_leakage: 0.0,
            case_leakage: 0.0,
            pump_volume: 2e-3,
            dead_volume: 2e-3,
            oils: [OIL; 2],
            air_shift: 0.0,
            stroke: 0.5,
            direction: 1.0,
            tolerance: 2e-3,
        },
        release: Release {
            period: PERIOD,
            direction: 1.0,
            window: 0.02,
            observation: 0.4,
            rest_drift: 5e-5,
            proving_motion: 2e-4,
            largest_motion: 1e-3,
            stroke: 0.5,
            end_zone: 3e-3,
            delivery: DISPLACEMENT,
            fast: 8.0,
            slow: 2.0,
            approach: 10e5,
            slew: 500.0,
            leakage: 0.0,
            holding_gain: 1e-6,
            nominal_pressure: LOAD,
            least_pressure: 10e5,
            most_pressure: 100e5,
            pressure_tolerance: 5e5,
            pressure_response: 3e5,
            least_compression: 0.0,
            pump_volume: 2e-3,
            largest_volume: 40e-6,
            largest_duration: 10.0,
            check_function: 1.0,
            largest_compliance: 1.0 / 1.6e9,
            bulk_modulus: 1.6e9,
            transition: 0.0,
            transition_slope: 1e-5,
            area: AREA,
            other_area: 0.7 * AREA,
            dead_volume: 2e-3,
            largest_spring: 1e-2,
        },
    }
}

/// The machine.
#[derive(Clone, Copy, Debug)]
pub struct Machine {
    /// Piston position \[m\].
    pub stroke: f64,
    /// Pressure of the pump side \[Pa\].
    pub pump: f64,
    /// Whether the pump side holds any pressure.
    pub lifts: bool,
    /// What acts on drive and valve.
    pub command: AxisCommand<f64>,
    /// Readings made.
    readings: u32,
}

impl Machine {
    /// At rest, the load held, the pump side empty.
    pub fn at_rest() -> Self {
        let command = AxisCommand { motor_speed: 0.0, holding_valve: 0.0 };
        Self { stroke: 0.2, pump: 3e5, lifts: true, command, readings: 0 }
    }

    /// Moves for a time \[s\] under a command.
    pub fn advance(&mut self, command: &AxisCommand<f64>, time: f64) {
        self.command = *command;
        let volume = command.motor_speed * DISPLACEMENT * time;
        if command.holding_valve > 0.0 {
            // onto an empty pump side the load falls until it carries
            self.stroke -= (LOAD - self.pump).max(0.0) / STIFFNESS / AREA;
            self.stroke += volume / AREA;
            self.pump = LOAD;
        } else if self.lifts {
            self.pump = (self.pump + volume * STIFFNESS).max(2e5);
            let beyond = (self.pump - LOAD - CRACKING).max(0.0);
            self.stroke += beyond / STIFFNESS / AREA;
            self.pump -= beyond;
        }
    }

    /// What is observed after a time \[s\], everything well.
    pub fn observe(&mut self, elapsed: f64) -> Observation {
        self.readings += 1;
        let alive = f64::from(self.readings % 7) - 3.0;
        let released = self.command.holding_valve > 0.0;
        Observation {
            elapsed,
            reading: AxisSignals {
                stroke: self.stroke + 1e-6 * alive,
                pressure_pump_a: self.pump + 100.0 * alive,
                pressure_a: LOAD - 90.0 * alive,
                pressure_b: 3e5 + 80.0 * alive,
                pressure_pump_b: 3e5 - 70.0 * alive,
                pressure_accumulator: 2.5e5 + 60.0 * alive,
                motor_speed: self.command.motor_speed,
            },
            valve: Some(if released { ValveState::Open } else { ValveState::Shut }),
            machine: None,
            age: 1e-3,
            new_readings: 1,
            lost_readings: 0,
            commands_lost: false,
            reference: self.stroke,
            tracking: 0.1,
            wanted: 3.0,
            course_over: false,
            missed: ((elapsed / PERIOD).round() - 1.0).max(0.0) as u32,
            attended: true,
            clock_jumped: false,
        }
    }
}
