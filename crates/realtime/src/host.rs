//! The machine's side of the shared memory: a virtual crane that plays the machine in real time.

use crate::lockstep::Disturbance;
use crate::machine::Incoming;
use crate::posix::{now, pin_to, run_first, wait_until};
use crate::shared::Shared;
use crate::trouble::Trouble;
use hydroboom_control::command::AxisCommand;
use hydroboom_control::measurement::Measurement;
use hydroboom_description::Description;
use hydroboom_model::SimulationError;
use hydroboom_virtual_crane::VirtualCrane;

/// Without one for so long its process ends \[s\].
const ABANDONED: f64 = 10.0;

/// Core and priority of the machine's process.
const CORE: usize = 0;
const PRIORITY: i32 = 60;

/// Plays the machine, a crane as described, until nobody commands it any more.
///
/// # Errors
///
/// [`SimulationError`] when the crane breaks.
pub fn host(
    mut crane: VirtualCrane,
    description: &Description,
    shared: &Shared,
) -> Result<(), SimulationError> {
    // a machine waits for nobody: as far as the system lets it, it comes before ordinary processes, and
    // after the control task, whose core it shares
    let _ = pin_to(CORE).and_then(|()| run_first(PRIORITY));
    let period = (crane.period() * 1e9).round() as u64;
    let held = AxisCommand { motor_speed: 0.0, holding_valve: 0.0 };
    let mut trouble = Trouble::new(description);
    let mut command = held;
    let (mut number, mut age, mut abandoned, mut last, mut done) = (0, 0.0, 0.0, 0, 0);
    let mut release = now();
    while abandoned < ABANDONED {
        number += 1;
        if let Some((order, what)) = shared.tampering().filter(|(order, _)| *order != done) {
            done = order;
            trouble.tamper(what);
        }
        let measurement = Measurement { number, ..crane.measurement() };
        let incoming = Incoming::new(measurement, crane.valve());
        if let Some(shown) = trouble.reading(incoming) {
            shared.show(&shown);
        }
        release += period;
        wait_until(release, 0);
        match shared.command() {
            Some((order, newest)) if order != last => {
                (last, abandoned) = (order, 0.0);
                let [newest] = newest.axes;
                match trouble.command(newest) {
                    Some(arrived) => (command, age) = (arrived, 0.0),
                    None => age += crane.period(),
                }
            }
            _ => {
                age += crane.period();
                abandoned += crane.period();
            }
        }
        if age > description.numbers.supervision_watchdog {
            command = held;
        }
        // what was asked for cannot be built: then nothing is done to it
        let _ = trouble.machine(&mut crane);
        trouble.pass();
        crane.advance(&trouble.drive(command))?;
        // a machine that fell far behind goes on from now, as after a pause
        let behind = now().saturating_sub(release);
        if behind > 100 * period {
            release += behind;
        }
    }
    Ok(())
}
