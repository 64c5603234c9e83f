//! What a machine is allowed to do, and what is observed of it in a control period.

use crate::signals::Reading;

/// What is allowed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Control period \[s\].
    pub period: f64,
    /// Length of the stroke \[m\].
    pub stroke: f64,
    /// How near its ends the piston may come while moving towards them \[m\].
    pub margin: f64,
    /// Largest speed of the piston \[m/s\].
    pub speed: f64,
    /// Largest pressure \[Pa\].
    pub pressure: f64,
    /// Largest distance the load may creep while held \[m\].
    pub creep: f64,
    /// Largest motor speed \[rev/s\].
    pub motor_speed: f64,
    /// Largest motor slew \[rev/s²\].
    pub motor_slew: f64,
    /// Largest deviation of the motor from its command, and for how long \[rev/s, s\].
    pub drive_deviation: (f64, f64),
    /// Age of the newest reading \[s\] that is too old.
    pub stale: f64,
    /// A signal that repeats itself to the last bit for so long is stuck \[s\]; zero where sensors have
    /// no noise.
    pub stuck: f64,
    /// Largest scatter from one reading to the next, RMS over 64 of them: of position \[m\], of a
    /// pressure \[Pa\].
    pub scatter: (f64, f64),
    /// Largest step from one reading to the next of a pressure \[Pa\].
    pub pressure_step: f64,
    /// Missed deadlines in a row that are too many.
    pub overruns: u32,
    /// Pump pressure within this of the load's pressure counts as pre-loaded \[Pa\].
    pub preload: f64,
    /// Time that pre-loading may take \[s\].
    pub preload_time: f64,
    /// Time from the valve's command until it has opened \[s\].
    pub valve_time: f64,
}

/// What the supervisor sees in a control period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    /// Newest reading.
    pub reading: Reading<f64>,
    /// Its age \[s\].
    pub age: f64,
    /// Readings that were made since the one seen last: one in good times, none where nothing came, more
    /// where some were missed.
    pub new_readings: u32,
    /// Where the piston should be \[m\]; the position of the start before the course begins.
    pub reference: f64,
    /// How far from it the piston may be under the strategy at work \[m\].
    pub tracking: f64,
    /// Motor speed that the controller asks for \[rev/s\].
    pub wanted: f64,
    /// Whether the course is over.
    pub course_over: bool,
    /// Deadlines missed in a row.
    pub overruns: u32,
    /// Whether somebody attends the machine.
    pub attended: bool,
    /// Whether the clock jumped since the last period.
    pub clock_jumped: bool,
}
