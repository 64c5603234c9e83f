//! Faults that are injected: of sensors, drive, valve, load, control and people.

/// What a sensor can do wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sensor {
    /// It shows what it showed last.
    Stuck,
    /// It jumps by a tenth of its range.
    Jumping,
    /// It scatters.
    Noisy,
    /// It shows no number.
    NotANumber,
    /// It is 50 ms late.
    Delayed,
}

/// How pressures can be plausible and wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WrongPressure {
    /// p_A shows 0 bar, with noise.
    LoadZero,
    /// p_A shows 20 bar, with noise.
    Load20Bar,
    /// p_A shows p_PA.
    LoadCopiesPump,
    /// p_A and p_B are exchanged.
    Exchanged,
    /// p_PA shows p_A.
    PumpCopiesLoad,
    /// p_PA shows 66 bar too much.
    PumpHigh,
}

/// How a position can be slowly wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WrongPosition {
    /// It drifts by 2 mm/s.
    Drift2,
    /// It drifts by 20 mm/s.
    Drift20,
    /// It shows 1.2 times the motion since the fault began.
    Gain,
    /// It shows 1.05 times the motion since the fault began.
    Gain5,
}

/// What can go wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// A sensor, by its place in a reading.
    Sensor(usize, Sensor),
    /// A pressure that is plausible and wrong.
    Pressure(WrongPressure),
    /// A position that is slowly wrong.
    Position(WrongPosition),
    /// The machine's process is gone.
    MachineKilled,
    /// It stands still for 100 ms.
    MachinePaused,
    /// It begins anew: its readings are counted from one again.
    MachineRestarted,
    /// The simulation gets half of its steps done.
    SimulationSlowed,
    /// The simulation stands still.
    SimulationKilled,
    /// The control task is held up for so many milliseconds, and sends nothing meanwhile.
    ControlStopped(u32),
    /// The control task is held up for 12 of every 13 periods.
    ControlStarved,
    /// The drive gives a tenth of its speed at most.
    DriveSaturated,
    /// The drive turns the other way.
    DriveReversed,
    /// The drive does not turn.
    DriveDead,
    /// The drive turns at 300 rpm to lift when commanded to stand still.
    DriveLifts,
    /// The same to lower.
    DriveLowers,
    /// The valve does not open, or falls shut.
    ValveStuckShut,
    /// The valve does not shut any more.
    ValveStuckOpen,
    /// The load falls off.
    PayloadDropped,
    /// A line on pump side A bursts.
    LineBurst,
    /// No operator is present any more.
    OperatorGone,
    /// The clock jumps.
    ClockJump,
    /// Somebody presses the emergency stop.
    EmergencyStop,
}

/// Names of the sensors, in the order of a reading.
const SENSORS: [&str; 7] = ["position", "p_PA", "p_A", "p_B", "p_PB", "p_acc", "motor speed"];

impl Fault {
    /// All of them.
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

    /// Those that are added to another one, 20 ms later.
    pub fn seconds() -> [Self; 3] {
        [Self::OperatorGone, Self::EmergencyStop, Self::ControlStarved]
    }

    /// Those of the machine and the way to it, which can be injected where the machine is virtual.
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

    /// Name in tables.
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
