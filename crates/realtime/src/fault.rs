//! Injected faults of sensors, drive, valve, load, control and operator.

/// Fault of a sensor signal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sensor {
    /// The value at the start of the fault is repeated.
    Stuck,
    /// Step of a tenth of the range (50 mm, 25 bar, 10 rev/s), on and off for 100 periods each.
    Jumping,
    /// Added noise, evenly distributed over ±2 % of the range (±10 mm, ±5 bar, ±2 rev/s).
    Noisy,
    /// The value is NaN.
    NotANumber,
    /// Delay of 50 measurements: 50 ms at a period of 1 ms.
    Delayed,
}

/// Plausible but wrong pressure signal, which range checks do not find.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WrongPressure {
    /// p_A reads 0 bar, with noise.
    LoadZero,
    /// p_A reads 20 bar, with noise.
    Load20Bar,
    /// p_A reads p_PA.
    LoadCopiesPump,
    /// p_A and p_B are exchanged.
    Exchanged,
    /// p_PA reads p_A.
    PumpCopiesLoad,
    /// p_PA reads 66 bar too high.
    PumpHigh,
}

/// Plausible but wrong position signal whose error grows slowly.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WrongPosition {
    /// Drift of 2 mm/s.
    Drift2,
    /// Drift of 20 mm/s.
    Drift20,
    /// The motion since the start of the fault is measured as 1.2 times its value.
    Gain,
    /// The motion since the start of the fault is measured as 1.05 times its value.
    Gain5,
}

/// Injected fault of sensors, drive, valve, load, control or operator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// Sensor fault; the index is the signal's place in a measurement, 0 to 6.
    Sensor(usize, Sensor),
    /// Plausible but wrong pressure signal.
    Pressure(WrongPressure),
    /// Slowly growing error of the position signal.
    Position(WrongPosition),
    /// The machine's process ends.
    MachineKilled,
    /// The machine's process pauses for 100 periods: 100 ms at a period of 1 ms.
    MachinePaused,
    /// The machine's process restarts: its measurements are counted from one again, and it ignores commands for 500
    /// periods.
    MachineRestarted,
    /// The simulation executes half of its steps.
    SimulationSlowed,
    /// The simulation stops.
    SimulationKilled,
    /// The control task is suspended for this time \[ms\] and sends no command meanwhile.
    ControlStopped(u32),
    /// The control task is suspended for 12 of every 13 periods.
    ControlStarved,
    /// The drive is limited to 300 rpm in either direction.
    DriveSaturated,
    /// The drive turns in the opposite direction.
    DriveReversed,
    /// The drive does not turn.
    DriveDead,
    /// The drive turns at 300 rpm in the lifting direction at zero command, and follows any other command.
    DriveLifts,
    /// The same in the lowering direction.
    DriveLowers,
    /// The valve does not open, or closes.
    ValveStuckShut,
    /// The valve does not close.
    ValveStuckOpen,
    /// The payload falls off: its mass is 0 from then on.
    PayloadDropped,
    /// A line on pump side A bursts: a hole of 3 mm, 50 L/min at 70 bar.
    LineBurst,
    /// The operator leaves.
    OperatorGone,
    /// The machine's clock jumps once.
    ClockJump,
    /// The emergency stop is pressed.
    EmergencyStop,
}

/// Names of the sensors, in the order of a reading.
const SENSORS: [&str; 7] = ["position", "p_PA", "p_A", "p_B", "p_PB", "p_acc", "motor speed"];

impl Fault {
    /// All faults of the campaign, in the order of tables.
    pub fn all() -> Vec<Self> {
        use Sensor::{Delayed, Jumping, Noisy, NotANumber, Stuck};
        let mut all = Vec::new();
        for sensor in 0..SENSORS.len() {
            let kinds = [Stuck, Jumping, Noisy, NotANumber, Delayed];
            all.extend(kinds.map(|kind| Self::Sensor(sensor, kind)));
        }
        let pressures = [
            WrongPressure::LoadZero,
            WrongPressure::Load20Bar,
            WrongPressure::LoadCopiesPump,
            WrongPressure::Exchanged,
            WrongPressure::PumpCopiesLoad,
            WrongPressure::PumpHigh,
        ];
        all.extend(pressures.map(Self::Pressure));
        let positions = [
            WrongPosition::Drift2,
            WrongPosition::Drift20,
            WrongPosition::Gain,
            WrongPosition::Gain5,
        ];
        all.extend(positions.map(Self::Position));
        all.extend([
            Self::MachineKilled,
            Self::MachinePaused,
            Self::MachineRestarted,
            Self::SimulationSlowed,
            Self::SimulationKilled,
            Self::ControlStopped(15),
            Self::ControlStopped(60),
            Self::ControlStopped(900),
            Self::ControlStarved,
            Self::DriveSaturated,
            Self::DriveReversed,
            Self::DriveDead,
            Self::DriveLifts,
            Self::DriveLowers,
            Self::ValveStuckShut,
            Self::ValveStuckOpen,
            Self::PayloadDropped,
            Self::LineBurst,
            Self::OperatorGone,
            Self::ClockJump,
            Self::EmergencyStop,
        ]);
        all
    }

    /// Second faults, injected 20 ms after the first one.
    pub fn seconds() -> [Self; 3] {
        [Self::OperatorGone, Self::EmergencyStop, Self::ControlStarved]
    }

    /// Faults of the machine and its connection, which can be injected if the machine is virtual.
    pub fn of_machine() -> Vec<Self> {
        let is_ours = |fault: &Self| {
            matches!(
                fault,
                Self::SimulationSlowed
                    | Self::SimulationKilled
                    | Self::ControlStopped(_)
                    | Self::ControlStarved
                    | Self::OperatorGone
                    | Self::ClockJump
                    | Self::EmergencyStop
            )
        };
        Self::all().into_iter().filter(|fault| !is_ours(fault)).collect()
    }

    /// Name in tables, as a short text.
    pub fn name(self) -> String {
        let name = match self {
            Self::Sensor(sensor, kind) => {
                let how = match kind {
                    Sensor::Stuck => "stuck",
                    Sensor::Jumping => "jumping",
                    Sensor::Noisy => "noisy",
                    Sensor::NotANumber => "not a number",
                    Sensor::Delayed => "50 ms late",
                };
                return format!("{} {how}", SENSORS.get(sensor).unwrap_or(&"sensor"));
            }
            Self::ControlStopped(time) => return format!("control task stopped for {time} ms"),
            Self::Pressure(wrong) => match wrong {
                WrongPressure::LoadZero => "p_A shows 0 bar",
                WrongPressure::Load20Bar => "p_A shows 20 bar",
                WrongPressure::LoadCopiesPump => "p_A shows p_PA",
                WrongPressure::Exchanged => "p_A and p_B exchanged",
                WrongPressure::PumpCopiesLoad => "p_PA shows p_A",
                WrongPressure::PumpHigh => "p_PA 66 bar too high",
            },
            Self::Position(wrong) => match wrong {
                WrongPosition::Drift2 => "position drifts by 2 mm/s",
                WrongPosition::Drift20 => "position drifts by 20 mm/s",
                WrongPosition::Gain => "position 20 % too large",
                WrongPosition::Gain5 => "position 5 % too large",
            },
            Self::MachineKilled => "machine killed",
            Self::MachinePaused => "machine paused for 100 ms",
            Self::MachineRestarted => "machine restarted",
            Self::SimulationSlowed => "simulation slowed",
            Self::SimulationKilled => "simulation killed",
            Self::ControlStarved => "control task starved",
            Self::DriveSaturated => "drive saturated",
            Self::DriveReversed => "drive reversed",
            Self::DriveDead => "drive dead",
            Self::DriveLifts => "drive lifts at zero command",
            Self::DriveLowers => "drive lowers at zero command",
            Self::ValveStuckShut => "valve stuck shut",
            Self::ValveStuckOpen => "valve stuck open",
            Self::PayloadDropped => "payload dropped",
            Self::LineBurst => "line burst",
            Self::OperatorGone => "operator gone",
            Self::ClockJump => "clock jump",
            Self::EmergencyStop => "emergency stop",
        };
        name.into()
    }
}
