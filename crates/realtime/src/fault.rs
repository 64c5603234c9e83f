//! What can go wrong.

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

/// What can go wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// A sensor, by its place in a reading.
    Sensor(usize, Sensor),
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
    /// The control task misses deadlines.
    ControlLate,
    /// The drive gives a tenth of its speed at most.
    DriveSaturated,
    /// The drive turns the other way.
    DriveReversed,
    /// The drive does not turn.
    DriveDead,
    /// The valve does not open, or falls shut.
    ValveStuckShut,
    /// The valve does not shut any more.
    ValveStuckOpen,
    /// The load falls off.
    PayloadDropped,
    /// A line on pump side A bursts.
    LineBurst,
    /// Nobody attends any more.
    OperatorGone,
    /// The clock jumps.
    ClockJump,
    /// Somebody presses the button.
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
        all.extend([
            Self::MachineKilled,
            Self::MachinePaused,
            Self::MachineRestarted,
            Self::SimulationSlowed,
            Self::SimulationKilled,
            Self::ControlLate,
            Self::DriveSaturated,
            Self::DriveReversed,
            Self::DriveDead,
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

    /// Those of the machine and the way to it, which can be injected where the machine is virtual.
    pub fn of_machine() -> Vec<Self> {
        let is_ours = |fault: &Self| {
            matches!(
                fault,
                Self::SimulationSlowed
                    | Self::SimulationKilled
                    | Self::ControlLate
                    | Self::OperatorGone
                    | Self::ClockJump
                    | Self::EmergencyStop
            )
        };
        Self::all().into_iter().filter(|fault| !is_ours(fault)).collect()
    }

    /// Name in tables.
    pub fn name(self) -> String {
        match self {
            Self::Sensor(sensor, kind) => {
                let how = match kind {
                    Sensor::Stuck => "stuck",
                    Sensor::Jumping => "jumping",
                    Sensor::Noisy => "noisy",
                    Sensor::NotANumber => "not a number",
                    Sensor::Delayed => "50 ms late",
                };
                format!("{} {how}", SENSORS[sensor])
            }
            Self::MachineKilled => "machine killed".into(),
            Self::MachinePaused => "machine paused for 100 ms".into(),
            Self::MachineRestarted => "machine restarted".into(),
            Self::SimulationSlowed => "simulation slowed".into(),
            Self::SimulationKilled => "simulation killed".into(),
            Self::ControlLate => "control task late".into(),
            Self::DriveSaturated => "drive saturated".into(),
            Self::DriveReversed => "drive reversed".into(),
            Self::DriveDead => "drive dead".into(),
            Self::ValveStuckShut => "valve stuck shut".into(),
            Self::ValveStuckOpen => "valve stuck open".into(),
            Self::PayloadDropped => "payload dropped".into(),
            Self::LineBurst => "line burst".into(),
            Self::OperatorGone => "operator gone".into(),
            Self::ClockJump => "clock jump".into(),
            Self::EmergencyStop => "emergency stop".into(),
        }
    }
}
