//! Result of a step: what was measured, what was expected, and what to do.

use hydroboom_control::supervision::fault::Cause;
use std::fmt::{self, Display, Formatter};

const BAR: f64 = 1e5;
const MM: f64 = 1e-3;
const RPM: f64 = 1.0 / 60.0;

/// Signals in the order of a measurement, as in messages.
pub const SIGNALS: [&str; 7] = [
    "stroke_m",
    "pressure_pump_a_pa",
    "pressure_a_pa",
    "pressure_b_pa",
    "pressure_pump_b_pa",
    "pressure_accumulator_pa",
    "motor_speed_rev_per_s",
];

/// Result of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// What was measured is what was expected.
    Passed,
    /// It could not be done.
    Skipped(Reason),
    /// Something else was measured.
    Failed(Finding),
}

impl Outcome {
    /// Name in records and messages.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Passed => "passed",
            Self::Skipped(_) => "skipped",
            Self::Failed(_) => "failed",
        }
    }
}

/// Why a step was skipped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reason {
    /// The machine reports no state, so that an open stop circuit cannot be detected.
    NoState,
    /// The pump side's pressure is too close below the load's \[Pa\]: measured, and the margin that is needed.
    PressureMarginTooSmall([f64; 2]),
}

impl Display for Reason {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoState => f.write_str(
                "the machine reports no state, so that an open stop circuit is not detected: test it by hand before \
                 the load is released",
            ),
            Self::PressureMarginTooSmall([pump, needed]) => write!(
                f,
                "the pump-side pressure ({:.1} bar) is within {:.1} bar of the load pressure, so this test could lift \
                 the load; a wrong delivery direction is detected in `release`",
                pump / BAR,
                needed / BAR
            ),
        }
    }
}

/// What went wrong in a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Finding {
    /// The operator aborted it.
    Ended,
    /// No measurement for this time \[s\].
    Silent(f64),
    /// A signal is not a number, or is marked as absent.
    NotANumber(usize),
    /// A signal \[its unit\] is out of its range.
    OutOfRange(usize, [f64; 3]),
    /// A signal is constant to the last bit.
    Stuck(usize),
    /// A signal scatters \[its unit\]: measured, allowed.
    Noisy(usize, [f64; 2]),
    /// The position drifts at rest \[m\]: measured, allowed.
    Drifts([f64; 2]),
    /// The motor turns at rest \[rev/s\].
    Turns(f64),
    /// The load's pressure is implausible \[Pa\]: measured, lowest, highest.
    LoadPressure([f64; 3]),
    /// The pump side is above the load's pressure at rest \[Pa\]: both.
    PumpAboveLoad([f64; 2]),
    /// No room for the travel \[m\]: position, lowest, highest.
    NoStroke([f64; 3]),
    /// The position switch shows an open valve.
    ValveOpen,
    /// The machine did not become ready.
    NotReady,
    /// The machine did not enable its drives, or disabled them.
    NotEnabled,
    /// The machine follows commands although it was not asked to.
    EnabledByItself,
    /// The machine has a fault of this code.
    MachineFault(u16),
    /// No open stop circuit was reported within this time \[s\].
    StopCircuitNotSeen(f64),
    /// The machine was not reset within this time \[s\].
    NotReset(f64),
    /// The operator did not start the motion within this time \[s\].
    NotStarted(f64),
    /// Commands came too late, and the connection to the machine has stopped the motor.
    CommandsLate,
    /// A held load moved \[m\]: measured, allowed.
    Moved([f64; 2]),
    /// The motor turns against its command \[rev/s\]: measured, commanded.
    MotorReversed([f64; 2]),
    /// The motor does not follow its command \[rev/s\]: measured, commanded.
    MotorDoesNotFollow([f64; 2]),
    /// The motor still turned without commands: speed \[rev/s\], time since the last command \[s\].
    NoWatchdog([f64; 2]),
    /// The pump's other side rose \[Pa\] in place of the one that carries the load: that, the other.
    OtherSideRose([f64; 2]),
    /// The cylinder's pressure rose \[Pa\] in place of the pump side's: the pump side's, the cylinder's.
    LoadRose([f64; 2]),
    /// The pump side's pressure did not rise \[Pa\]: measured, expected.
    NoRise([f64; 2]),
    /// A pressure is above what is allowed \[Pa\]: measured, allowed.
    Pressure(usize, [f64; 2]),
    /// The position moved against the lift \[m\].
    PositionReversed(f64),
    /// The supervisor stopped it; the position had moved \[m\].
    Supervisor(Cause, f64),
    /// The position left the travel \[m\]: measured, expected, allowed deviation.
    LeftTravel([f64; 3]),
    /// Travel by position over travel by pump volume \[1\]: measured, allowed deviation.
    Scale([f64; 2]),
    /// The delay \[cycles\]: measured, largest.
    Delay([f64; 2]),
    /// The stopping distance \[m\]: measured, largest.
    StopDistance([f64; 2]),
    /// The machine does not report its identity.
    Identity,
}

/// A value of a signal, in the units of messages.
fn of_signal(signal: usize, value: f64) -> String {
    match signal {
        0 => format!("{:.2} mm", value / MM),
        6 => format!("{:.1} rpm", value / RPM),
        _ => format!("{:.2} bar", value / BAR),
    }
}

fn name(signal: usize) -> &'static str {
    SIGNALS.get(signal).copied().unwrap_or("a signal")
}

impl Display for Finding {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Ended => f.write_str("aborted by the operator"),
            Self::Silent(time) => write!(
                f,
                "no measurement for {time:.3} s: check the machine's program, its cable and its supply"
            ),
            Self::NotANumber(signal) => write!(
                f,
                "{} is not a number or absent: check its sensor, its cable and its row of the table",
                name(signal)
            ),
            Self::OutOfRange(signal, [value, low, high]) => write!(
                f,
                "{} is {}, expected from {} to {}: check sign, factor and offset of the signal, and its sensor",
                name(signal),
                of_signal(signal, value),
                of_signal(signal, low),
                of_signal(signal, high)
            ),
            Self::Stuck(signal) => write!(
                f,
                "{} is constant to the last bit: check its sensor and its row of the table; sensors without \
                 noise need supervision.stuck_ms = 0",
                name(signal)
            ),
            Self::Noisy(signal, [measured, allowed]) => write!(
                f,
                "{} scatters by {} at rest, allowed {}: check shield and supply of its sensor, or correct \
                 supervision.position_scatter_mm or pressure_scatter_bar",
                name(signal),
                of_signal(signal, measured),
                of_signal(signal, allowed)
            ),
            Self::Drifts([measured, allowed]) => write!(
                f,
                "the position drifts by {:.3} mm at rest, allowed {:.3} mm: wait until the load rests, check the \
                 load-holding valve for leakage, and the sensor",
                measured / MM,
                allowed / MM
            ),
            Self::Turns(speed) => write!(
                f,
                "the motor turns at {:.1} rpm by its speed signal, expected rest: check the drive and this signal",
                speed / RPM
            ),
            Self::LoadPressure([measured, low, high]) => write!(
                f,
                "the load's pressure is {:.1} bar, expected {:.1} to {:.1} bar: are the pressure sensors swapped, \
                 does the load rest on something, is payload.mass_kg of the crane file right?",
                measured / BAR,
                low / BAR,
                high / BAR
            ),
            Self::PumpAboveLoad([pump, load]) => write!(
                f,
                "the pump side ({:.1} bar) is above the load ({:.1} bar) behind a shut valve: are pump-side and \
                 cylinder sensors swapped?",
                pump / BAR,
                load / BAR
            ),
            Self::NoStroke([position, low, high]) => write!(
                f,
                "the piston is at {:.1} mm, and the travel needs {:.1} to {:.1} mm: bring the load there with \
                 the machine's manual control, then begin again",
                position / MM,
                low / MM,
                high / MM
            ),
            Self::ValveOpen => f.write_str(
                "the load-holding valve is reported open, commanded shut: check the valve and its position switch",
            ),
            Self::NotReady => f.write_str(
                "the machine did not report that it is ready: read its own display, and reset its fault there",
            ),
            Self::NotEnabled => f.write_str(
                "the machine did not enable its drives, or disabled them: check its stop circuit, main contactor \
                 and the drive's display",
            ),
            Self::EnabledByItself => f.write_str(
                "the drives are enabled without a request of this program: check what else enables them",
            ),
            Self::MachineFault(code) => write!(
                f,
                "the machine reports fault code {code} ({code:#06x}): see docs/reference/ethercat-table.md for a bus, \
                 the machine's manual for another machine; remove the cause, and reset the machine"
            ),
            Self::StopCircuitNotSeen(time) => write!(
                f,
                "no open stop circuit was reported within {time:.0} s: does it cut the drive's torque (safe torque \
                 off), and is it reported (stop_circuit of the table, state 4 of the interface)?"
            ),
            Self::NotReset(time) => {
                write!(f, "the machine was not ready again within {time:.0} s: reset it, then begin again")
            }
            Self::NotStarted(time) => {
                write!(f, "the motion was not started within {time:.0} s: begin again")
            }
            Self::CommandsLate => f.write_str(
                "no command came for two periods, and the connection has stopped the motor: reduce the load on \
                 this computer, and see `hydroboom doctor`",
            ),
            Self::Moved([measured, allowed]) => write!(
                f,
                "the position moved by {:.2} mm, allowed {:.2} mm: does the load-holding valve hold, is the position \
                 signal right?",
                measured / MM,
                allowed / MM
            ),
            Self::MotorReversed([measured, commanded]) => write!(
                f,
                "the measured motor speed is {:.1} rpm, commanded {:.1} rpm: correct the sign of the command or of \
                 the speed signal",
                measured / RPM,
                commanded / RPM
            ),
            Self::MotorDoesNotFollow([measured, commanded]) => write!(
                f,
                "the measured motor speed is {:.1} rpm, commanded {:.1} rpm: check the drive, its factor, and its \
                 torque limit",
                measured / RPM,
                commanded / RPM
            ),
            Self::NoWatchdog([speed, time]) => write!(
                f,
                "{:.0} ms after the last command the motor still turned at {:.1} rpm, expected rest: switch the \
                 machine's watchdog on (supervision.watchdog_ms of the crane file)",
                time * 1e3,
                speed / RPM
            ),
            Self::OtherSideRose([pump, other]) => write!(
                f,
                "the pump side that carries the load changed by {:+.1} bar, the other one by {:+.1} bar: correct the \
                 sign of the motor's command, swap the pump's lines, or swap the sensors of both pump sides",
                pump / BAR,
                other / BAR
            ),
            Self::LoadRose([pump, load]) => write!(
                f,
                "the pump side changed by {:+.1} bar, the cylinder by {:+.1} bar: are pump-side and cylinder sensors \
                 swapped, or is the load-holding valve not shut?",
                pump / BAR,
                load / BAR
            ),
            Self::NoRise([measured, expected]) => write!(
                f,
                "the pump side changed by {:+.1} bar, expected {:+.1} bar: is the pump's polarity reversed (sign of \
                 the command, lines), is the sensor at another port, or does the pump side leak to tank (open valve, \
                 relief valve)?",
                measured / BAR,
                expected / BAR
            ),
            Self::Pressure(signal, [measured, allowed]) => write!(
                f,
                "{} is {:.1} bar, allowed {:.1} bar: check its sensor and supervision.pressure_bar",
                name(signal),
                measured / BAR,
                allowed / BAR
            ),
            Self::PositionReversed(moved) => write!(
                f,
                "the position moved by {:+.2} mm opposite to the pump flow: correct the sign of the position (key \
                 `sign` of its row of the table)",
                moved / MM
            ),
            Self::Supervisor(cause, moved) => write!(
                f,
                "the supervisor stopped it ({}) after {:+.2} mm: {}",
                cause.code(),
                moved / MM,
                cause.advice()
            ),
            Self::LeftTravel([measured, expected, allowed]) => write!(
                f,
                "the position had changed by {:+.2} mm, expected {:+.2} mm within {:.2} mm: check scale and sign of \
                 the position, and displacement and leakage of the pump",
                measured / MM,
                expected / MM,
                allowed / MM
            ),
            Self::Scale([ratio, allowed]) => write!(
                f,
                "the travel by position is {ratio:.3} of that by the pump's volume, expected 1 within {allowed:.3}: \
                 correct the factor of the position or of the motor's speed, or pump.displacement_cm3 and \
                 the cylinder's diameters"
            ),
            Self::Delay([measured, largest]) => write!(
                f,
                "the delay is {measured:.2} cycles, expected 0 to {largest:.0}: check the machine's cycle and its \
                 buffers"
            ),
            Self::StopDistance([measured, largest]) => write!(
                f,
                "the stop took {:.2} mm, expected at most {:.2} mm: check the load-holding valve's closing time and \
                 the drive's ramp",
                measured / MM,
                largest / MM
            ),
            Self::Identity => f.write_str("the machine does not report its identity: correct its program"),
        }
    }
}
