//! Virtual crane as the machine in a process of its own, attached through shared memory, in real time.

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

/// Time without a command after which the process ends \[s\].
const ABANDONED: f64 = 10.0;

/// Core and priority of the machine's process.
const CORE: usize = 0;
const PRIORITY: i32 = 60;

/// Simulates the machine in real time and exchanges measurements and commands through shared memory, until commands
/// have ceased for ten seconds.
///
/// Without a command for longer than the watchdog time of the crane file, the motor stops and the load is held. It
/// runs on core 0 with priority 60 (SCHED_FIFO), or at ordinary priority without the privilege.
///
/// # Errors
///
/// [`SimulationError`] if the simulation of the crane fails.
pub fn host(
    mut crane: VirtualCrane,
    description: &Description,
    shared: &Shared,
) -> Result<(), SimulationError> {
    // a machine runs in real time: its priority is above ordinary processes and below the control task,
    // whose core it shares; without privileges it runs at ordinary priority
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
        // a fault that cannot be built has no effect on the machine
        let _ = trouble.machine(&mut crane);
        trouble.pass();
        crane.advance(&trouble.drive(command))?;
        // a machine with a large delay continues from the present time, as after a pause
        let behind = now().saturating_sub(release);
        if behind > 100 * period {
            release += behind;
        }
    }
    Ok(())
}
