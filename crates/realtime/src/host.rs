//! The machine's side of the shared memory: a virtual crane that plays the machine in real time.

use crate::posix::{now, pin_to, run_first, wait_until};
use crate::shared::Shared;
use hydroboom_control::Command;
use hydroboom_model::SimulationError;
use hydroboom_virtual_crane::VirtualCrane;

/// Without a new command for so long the machine's own watchdog shuts it down \[s\], as a drive does.
const WATCHDOG: f64 = 0.02;
/// Without one for so long its process ends \[s\].
const ABANDONED: f64 = 10.0;

/// Core and priority of the machine's process.
const CORE: usize = 0;
const PRIORITY: i32 = 60;

/// Plays the machine until nobody commands it any more.
///
/// # Errors
///
/// [`SimulationError`] when the crane breaks.
pub fn host(mut crane: VirtualCrane, shared: &Shared) -> Result<(), SimulationError> {
    // a machine waits for nobody: as far as the system lets it, it comes before ordinary processes, and
    // after the control task, whose core it shares
    let _ = pin_to(CORE).and_then(|()| run_first(PRIORITY));
    let period = (crane.period() * 1e9).round() as u64;
    let held = Command { motor_speed: 0.0, holding_valve: 0.0 };
    let mut command = held;
    let (mut sequence, mut age, mut last) = (0, 0.0, 0);
    let mut release = now();
    while age < ABANDONED {
        sequence += 1;
        shared.show(sequence, &crane.reading());
        release += period;
        wait_until(release, 0);
        match shared.command() {
            Some((number, newest)) if number != last => {
                (command, last, age) = (newest, number, 0.0)
            }
            _ => age += crane.period(),
        }
        if age > WATCHDOG {
            command = held;
        }
        crane.advance(&command)?;
        // a machine that fell far behind goes on from now, as after a pause
        let behind = now().saturating_sub(release);
        if behind > 100 * period {
            release += behind;
        }
    }
    Ok(())
}
