//! Thread of the simulation: its cycle, and what it shows to the control task.

use super::Between;
use crate::conditions::Conditions;
use crate::failure::{Failure, guarded};
use crate::posix::{now, thread_time, wait_until};
use crate::simulation_task::{AtRest, Simulated, SimulationTask};
use crate::timing::Timing;
use hydroboom_control::controller::{AxisState, SimulatedState};
use rtrb::Consumer;
use std::sync::atomic::Ordering;
use std::sync::mpsc::Sender;

/// Largest number of steps that the simulation catches up at once: 0.1 s.
const CATCH_UP: u64 = 2000;
/// Steps over which the simulation's worst timing is taken: one control period.
const SHOWN: u64 = 20;

/// Timing of the simulation as reported to the control task \[ns\].
#[derive(Clone, Copy, Default)]
pub(super) struct Shown {
    pub(super) late: u64,
    pub(super) execution: u64,
    pub(super) missed: u64,
}

/// Number of words of the control task's request to the simulation: whether it moves, delay of commands \[control
/// periods\], motor speed, payload and transition pressure.
pub(super) const ASKED: usize = 5;
/// Number of words that carry the simulation's state to the control task.
pub(super) const SIMULATED: usize = 12;

pub(super) fn words(simulated: &Simulated, shown: &Shown) -> [u64; SIMULATED] {
    let [inner, middle, outer] = simulated.angle.map(f64::to_bits);
    [
        simulated.steps,
        simulated.epoch,
        simulated.axis().stroke.to_bits(),
        simulated.axis().velocity.to_bits(),
        simulated.axis().load_pressure.to_bits(),
        inner,
        middle,
        outer,
        u64::from(simulated.failed),
        shown.late,
        shown.execution,
        shown.missed,
    ]
}

pub(super) fn from_words(words: &[u64; SIMULATED]) -> (Simulated, Shown) {
    let number = |k: usize| f64::from_bits(words[k]);
    let simulated = Simulated {
        steps: words[0],
        epoch: words[1],
        state: SimulatedState {
            axes: [AxisState { stroke: number(2), velocity: number(3), load_pressure: number(4) }],
        },
        angle: [number(5), number(6), number(7)],
        failed: words[8] != 0,
    };
    (simulated, Shown { late: words[9], execution: words[10], missed: words[11] })
}

/// State of the simulation's thread.
pub(super) struct Simulating {
    pub(super) task: SimulationTask,
    pub(super) states: Consumer<AtRest>,
    pub(super) timing: Timing,
    pub(super) spin: u64,
}

/// Cycle of the simulation. After a panic the simulation is marked as failed and keeps its last state.
pub(super) fn simulate_guarded(
    mut with: Simulating,
    between: &Between,
    failures: &Sender<Failure>,
) -> Timing {
    if let Err(why) = guarded(|| simulate(&mut with, between)) {
        let failed = Simulated { failed: true, ..with.task.simulated() };
        between.simulated.publish(words(&failed, &Shown::default()));
        // an error means that the receiver has ended
        let _ = failures.send(Failure::Simulation(why));
    }
    with.timing
}

/// Cycle of the simulation.
fn simulate(with: &mut Simulating, between: &Between) {
    let Simulating { task, states, timing, spin } = with;
    let first = now();
    let mut release = first;
    let mut pump = None;
    // of the present interval, and of the one before
    let (mut worst, mut shown) = (Shown::default(), Shown::default());
    while !between.ended.load(Ordering::Acquire) {
        release += timing.period;
        wait_until(release, *spin);
        let late = now() - release;
        timing.released(late);
        // missed steps are caught up
        let missed = late / timing.period;
        let steps = 1 + missed.min(CATCH_UP);
        release += missed * timing.period;
        if timing.steps.is_multiple_of(SHOWN) {
            shown = worst;
            worst = Shown::default();
        }
        worst.late = worst.late.max(late);
        shown.missed = timing.missed;
        for _ in 0..steps {
            let clock = now();
            let before = thread_time();
            if let Ok(at) = states.pop() {
                task.synchronise(&at);
            }
            if let Some((_, [moves, delay, numbers @ ..])) = between.asked.read() {
                let [speed, payload, transition_pressure] = numbers.map(f64::from_bits);
                pump = (moves == 1).then_some(speed);
                task.set_conditions(&Conditions { payload, transition_pressure });
                task.set_command_delay(usize::try_from(delay).unwrap_or(usize::MAX));
            }
            if let Some(speed) = pump {
                task.step(speed);
            }
            between.simulated.publish(words(&task.simulated(), &shown));
            let on_processor = thread_time() - before;
            worst.execution = worst.execution.max(on_processor);
            timing.executed(on_processor, now() - clock, clock - first);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::failure::hand_panics_on;
    use crate::slot::Slot;
    use hydroboom_description::Description;
    use rtrb::RingBuffer;
    use std::sync::atomic::{AtomicBool, AtomicU64};
    use std::sync::mpsc::channel;

    #[test]
    fn a_simulation_that_panics_is_shown_as_failed() {
        let between = Between {
            simulated: Slot::default(),
            asked: Slot::default(),
            ended: AtomicBool::new(false),
            dropped: AtomicU64::new(0),
        };
        let task = SimulationTask::new(&Description::uia_single_boom().unwrap(), 0.2).unwrap();
        let rested = task.simulated();
        let mut timing = Timing::new(50_000).unwrap();
        // a zero period makes the task divide by zero and panic
        timing.period = 0;
        let simulating = Simulating { task, states: RingBuffer::new(1).1, timing, spin: 0 };
        let (fails, failures) = channel();
        hand_panics_on();
        simulate_guarded(simulating, &between, &fails);
        let shown = between.simulated.read().map(|(_, words)| from_words(&words).0);
        assert_eq!(shown, Some(Simulated { failed: true, ..rested }));
        let Ok(Failure::Simulation(why)) = failures.try_recv() else { panic!("nobody was told") };
        assert!(why.contains("divide by zero"), "{why}");
    }
}
