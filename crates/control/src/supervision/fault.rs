//! Fault causes: code, advice, severity, and the reaction of the machine.

use hydroboom_math::Real;

/// What the machine does about a fault (stop categories as in IEC 60204-1).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Reaction {
    /// Controlled stop: the motor is ramped to zero with the valve open, then the valve shuts
    /// (stop category 1).
    ControlledStop,
    /// Immediate stop: the valve shuts at once, the motor is braked as fast as its slew rate allows
    /// (as stop category 0, but that the drive keeps its power to brake).
    ImmediateStop,
}

impl Reaction {
    /// All reactions.
    pub const ALL: [Self; 2] = [Self::ControlledStop, Self::ImmediateStop];

    /// Name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::ControlledStop => "controlled stop",
            Self::ImmediateStop => "immediate stop",
        }
    }
}

/// Severity of a fault; a more severe fault replaces a less severe one at any time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// Drive and valve obey: the load is brought to rest, then held.
    Controlled,
    /// The load is held at once.
    Immediate,
    /// A person has pressed the emergency stop.
    Emergency,
}

macro_rules! causes {
    ($( $(#[doc = $doc:literal])* $Cause:ident: $severity:ident, $code:literal, $advice:literal; )+) => {
        /// Cause of a fault, for which the supervisor brings the machine to its safe state.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Cause { $( $(#[doc = $doc])* $Cause, )+ }

        impl Cause {
            /// All causes.
            pub const ALL: [Self; [$($code),+].len()] = [$(Self::$Cause),+];

            /// Code in logs and messages.
            pub fn code(self) -> &'static str {
                match self { $( Self::$Cause => $code, )+ }
            }

            /// Advice to the operator: where to look for the cause.
            pub fn advice(self) -> &'static str {
                match self { $( Self::$Cause => $advice, )+ }
            }

            /// Severity of the fault.
            pub fn severity(self) -> Severity {
                match self { $( Self::$Cause => Severity::$severity, )+ }
            }
        }
    };
}

causes! {
    /// A reading is not a number.
    NotANumber: Immediate, "not-a-number",
        "a reading is not a number: look at the fieldbus mapping and the sensor";
    /// No new reading for too long: machine, fieldbus or its process.
    MachineLost: Immediate, "machine-lost",
        "no new readings: is the machine's process or its bus alive?";
    /// The piston position is outside what the cylinder has.
    PositionImplausible: Immediate, "position-implausible",
        "position outside the stroke: look at the encoder and its zero";
    /// The piston position changed faster than any piston can.
    PositionJumped: Immediate, "position-jumped",
        "position jumped: look at the encoder's cable and supply";
    /// A signal has not changed at all for too long.
    SensorStuck: Immediate, "sensor-stuck",
        "a signal is frozen: look at its cable and input";
    /// A signal scatters far more than its sensor does.
    SensorNoisy: Immediate, "sensor-noisy",
        "a signal scatters: look at its cable, shield and supply";
    /// A pressure is outside what its transducer or physics allow.
    PressureImplausible: Immediate, "pressure-implausible",
        "a pressure is outside its transducer's range: look at transducer, cable and input";
    /// A pressure changed faster than the oil allows.
    PressureJumped: Immediate, "pressure-jumped",
        "a pressure jumped: look at transducer, hose and line";
    /// Pressures that must agree do not: of pump side and cylinder behind an open valve, of the load
    /// before a release, or with a lift.
    PressureDisagrees: Immediate, "pressure-disagrees",
        "pressures disagree with each other or with the load: look at the transducers p_PA, p_A, p_B and p_PB, and whether cables are exchanged";
    /// A pressure is above the limit.
    OverPressure: Controlled, "over-pressure",
        "pressure above the limit: is the load too heavy, or a valve shut?";
    /// The piston is too near an end of its stroke, and moves towards it.
    EndOfStroke: Controlled, "end-of-stroke",
        "piston near its stop: look at the course and the controller";
    /// The piston is too far from its reference.
    TrackingError: Controlled, "tracking-error",
        "piston far from its reference: look at pump, valves and load";
    /// Piston travel and the pump's delivered volume do not agree.
    PositionFlowDisagree: Controlled, "position-and-flow-disagree",
        "position and delivered flow disagree: one of them is wrong. Look at the encoder, at the pump's leakage and displacement, and at the motor speed";
    /// The position moves although nothing moves the piston.
    PositionNotSteady: Immediate, "position-not-steady",
        "the position changes although the load is held and the pump stands still: look at encoder and load-holding valves, or wait until the load is still";
    /// The piston moves faster than its pump can drive it.
    Runaway: Immediate, "runaway",
        "piston too fast: has a line burst, or is the load lost?";
    /// The load moves although it is held.
    LoadNotHeld: Immediate, "load-not-held",
        "the load moves while held: look at the load-holding valves";
    /// The load still swings, and does not come to rest.
    LoadNotStill: Immediate, "load-not-still",
        "the load does not come to rest: wait, or look at what moves it";
    /// The load sank as the load-holding valve opened.
    LoadSank: Immediate, "load-sank",
        "the load sank when it was released: look at pump, lines and load-holding valves";
    /// The valve's position switch does not show what was commanded.
    ValveNotFollowing: Immediate, "valve-not-following",
        "the load-holding valve does not switch as commanded: look at the valve, its supply and its position switch";
    /// The drive does not turn as commanded.
    DriveNotFollowing: Immediate, "drive-not-following",
        "drive does not follow: look at its state and its limits";
    /// The drive turns against its command, or although commanded to stand still.
    DriveUncommanded: Immediate, "drive-uncommanded",
        "the drive turns without or against a command: cut its power; the supervisor cannot stop it";
    /// Pressure is shut in on the unloaded side of the cylinder.
    TrappedPressure: Immediate, "trapped-pressure",
        "pressure is shut in on the unloaded side: released, the load would spring by more than supervision.spring_mm. Relieve it by hand";
    /// The load needs more pressure than the crane file's loads do.
    LoadTooHeavy: Immediate, "load-too-heavy",
        "the load needs more pressure than payload.mass_kg and its range in the crane file: set part of it down, or correct the file";
    /// The pump delivered all that can be needed, and did not lift the load.
    NoLift: Immediate, "no-lift",
        "the pump does not lift the load: is it heavier than the crane file says? Look at pump, drive, lines and air in the oil";
    /// Too many periods were missed.
    Overruns: Controlled, "overruns",
        "deadlines missed: run `hydroboom doctor`";
    /// Control was interrupted for longer than the drive's watchdog bears.
    WatchdogExpired: Immediate, "watchdog-expired",
        "control was interrupted for longer than the drive's watchdog time, and the drive has stopped by itself: run `hydroboom doctor`";
    /// No operator has been present for too long.
    OperatorLost: Controlled, "operator-lost",
        "no operator is present: connect again, then reset";
    /// Somebody pressed the emergency stop.
    EmergencyStop: Emergency, "emergency-stop",
        "emergency stop: find out why, then reset";
    /// The controller asked for a speed that is not a number, or failed.
    ControllerInvalid: Immediate, "controller-invalid",
        "the controller failed: look at the log";
    /// The clock went back, or far ahead.
    ClockJumped: Immediate, "clock-jumped",
        "the clock jumped: look at the machine's time source";
    /// The motor speed as read is outside what the motor can do.
    MotorSpeedImplausible: Immediate, "motor-speed-implausible",
        "the motor speed as read is outside what the motor can do: look at the drive's telegram and its scaling";
    /// The reference is not a number, outside the stroke, or jumps.
    ReferenceImplausible: Controlled, "reference-implausible",
        "the reference is not a number, outside the stroke, too fast, or jumps: look at the program that gives it";
    /// The machine reports a fault of its own.
    MachineFault: Immediate, "machine-fault",
        "the machine reports a fault, whose code is in the log and on the screen: remove its cause, and reset it at the machine (on a bus: start the run again); then reset here";
    /// The machine does not report that it is ready, or that its drives follow while they are to move the load.
    MachineNotReady: Immediate, "machine-not-ready",
        "the machine is not ready, or its drives went off: look at its state and its stop circuit";
    /// Too many measurements were lost on their way.
    MeasurementsLost: Controlled, "measurements-lost",
        "too many measurements are lost on their way: look at what is counted as dropped, and at the load of this computer";
}

/// Number from which on a cause lets the load be brought to rest first.
const CONTROLLED: f64 = 50.0;

/// Whether a cause of this number has the load held at once; zero is no cause.
pub(crate) fn is_held_at_once<T: Real>(number: T) -> T::Mask {
    T::lit(0.5).lt(number) & number.lt(T::lit(CONTROLLED))
}

impl Cause {
    /// Number of the cause in the status of exported blocks: from 1 on for an immediate stop, from 51 on for a
    /// controlled stop.
    pub fn number(self) -> f64 {
        let place = Self::ALL.iter().take_while(|cause| **cause != self).count() as f64 + 1.0;
        match self.severity() {
            Severity::Controlled => CONTROLLED + place,
            Severity::Immediate | Severity::Emergency => place,
        }
    }

    /// Cause with this number; `None` for a number without a cause.
    pub fn from_number(number: f64) -> Option<Self> {
        Self::ALL.into_iter().find(|cause| cause.number() == number)
    }

    /// Reaction of the machine while its valve is open. Which reaction does less harm is computed by `hydroboom
    /// supervision --reactions` and stands in the table of hazards.
    pub fn reaction(self) -> Reaction {
        match self.severity() {
            Severity::Controlled => Reaction::ControlledStop,
            Severity::Immediate | Severity::Emergency => Reaction::ImmediateStop,
        }
    }

    /// The more severe of two causes; the first one for equal severity.
    pub fn worse(self, other: Self) -> Self {
        if other.severity() > self.severity() { other } else { self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Programs on machines depend on these numbers: a new cause is appended.
    #[test]
    fn status_numbers_of_causes_match_the_documentation() {
        let text = include_str!("../../../../docs/reference/export-controllers.md");
        let mut count = 0;
        for line in text.lines() {
            let cells: Vec<&str> = line.split('|').map(str::trim).collect();
            let status = cells.get(1).and_then(|cell| cell.parse::<f64>().ok());
            let Some(status) = status.filter(|status| *status > 100.0) else { continue };
            let cause = Cause::from_number(status - 100.0).unwrap();
            assert_eq!(cells[2], format!("`{}`", cause.code()), "{status}");
            assert_eq!(cells[3], cause.advice(), "{status}");
            count += 1;
        }
        assert!(count >= 20, "{count} are documented");
        assert!(Cause::ALL.len() < 50, "the numbers run into those of the milder causes");
        let mut numbers = Cause::ALL.map(Cause::number);
        numbers.sort_by(f64::total_cmp);
        assert!(numbers.windows(2).all(|two| two[0] < two[1]));
    }
}
