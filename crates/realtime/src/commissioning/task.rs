//! Runs a sequence: in a real-time thread at a machine, or with the virtual crane in simulated time.

use super::sequence::{Action, Now, Sequence};
use super::simulated_machine::SimulatedMachine;
use super::step::{Prompt, Step};
use crate::failure::{guarded, hand_panics_on};
use crate::machine::{Machine, Outgoing};
use crate::posix::{lock_memory, now, wait_until};
use crate::real_time_thread::prepare;
use hydroboom_control::measurement::AxisSignals;
use hydroboom_model::SimulationError;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::thread;
use std::time::Duration;

/// SCHED_FIFO priority: that of the control task.
const PRIORITY: i32 = 70;
/// Time before a release that is spent spinning instead of sleeping \[ns\].
const SPIN: u64 = 60_000;
/// Safe commands that are sent after the end \[periods\], so that one of them arrives.
const LAST: u64 = 50;
/// Interval at which step and prompt of the sequence are read.
const LOOK: Duration = Duration::from_millis(20);
/// Longest run in simulated time \[s\].
const LONGEST: f64 = 1800.0;

/// Inputs of the operator at the machine, as atomics that any thread may set.
#[derive(Debug, Default)]
pub struct Person {
    confirmed: AtomicBool,
    ended: AtomicBool,
}

impl Person {
    /// Confirms the prompt.
    pub fn confirm(&self) {
        self.confirmed.store(true, Ordering::Release);
    }

    /// Ends the sequence.
    pub fn end(&self) {
        self.ended.store(true, Ordering::Release);
    }

    /// Whether the sequence is to end.
    pub fn is_ended(&self) -> bool {
        self.ended.load(Ordering::Acquire)
    }
}

/// Event of a running sequence, for the operator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Told {
    /// A step begins.
    Step(Step),
    /// Signals at rest, means over the step `listening`, for comparison with gauges.
    Rest(AxisSignals<f64>),
    /// A prompt begins, with the code of the fault that the machine reports; none where it reports no fault.
    Prompt(Prompt, Option<u16>),
}

/// Present step and prompt of the sequence, as atomics: their indices; and the machine's code.
#[derive(Debug)]
struct Shown {
    step: AtomicUsize,
    prompt: AtomicUsize,
    code: AtomicUsize,
    /// Signals at rest, as bits.
    rest: [AtomicU64; 7],
    is_over: AtomicBool,
}

/// Index for no prompt, and code for no fault.
const NOTHING: usize = usize::MAX;

/// Index of a prompt in [`Prompt::ALL`].
fn place(prompt: Option<Prompt>) -> usize {
    prompt.and_then(|prompt| Prompt::ALL.iter().position(|p| *p == prompt)).unwrap_or(NOTHING)
}

/// Runs a sequence at a machine in real time, on a core; `period` is the control period \[s\]. Returns the sequence at
/// its end and the real-time privileges that the system refused.
///
/// # Errors
///
/// Message of a panic of the thread. The safe command was then sent; where it did not arrive, the machine's watchdog
/// has stopped it.
pub fn run(
    mut sequence: Sequence,
    mut machine: Box<dyn Machine>,
    period: f64,
    core: usize,
    person: &Person,
    tell: &mut dyn FnMut(Told),
) -> Result<(Sequence, Vec<String>), String> {
    let shown = Shown {
        step: AtomicUsize::new(sequence.step().place()),
        prompt: AtomicUsize::new(NOTHING),
        code: AtomicUsize::new(NOTHING),
        rest: std::array::from_fn(|_| AtomicU64::new(f64::NAN.to_bits())),
        is_over: AtomicBool::new(false),
    };
    hand_panics_on();
    let shown = &shown;
    thread::scope(|scope| {
        let task = scope.spawn(move || {
            let mut lost = prepare("commissioning", core, PRIORITY);
            if let Err(error) = lock_memory() {
                lost.push(format!("memory is not locked ({error})"));
            }
            let cycle = guarded(|| steer(&mut sequence, machine.as_mut(), period, person, shown));
            if cycle.is_err() {
                // stops at once; if it does not arrive, the machine's watchdog acts
                let _ = guarded(|| machine.write(u64::MAX, &Outgoing::SAFE));
            }
            shown.is_over.store(true, Ordering::Release);
            cycle.map(|()| (sequence, lost))
        });
        let (mut step, mut prompt) = (NOTHING, NOTHING);
        while !shown.is_over.load(Ordering::Acquire) {
            let now = shown.step.load(Ordering::Acquire);
            if let Some(begun) = Step::ALL.get(now).filter(|_| now != step) {
                if *begun == Step::StopCircuit {
                    let rest = shown.rest.each_ref();
                    let rest = rest.map(|signal| f64::from_bits(signal.load(Ordering::Relaxed)));
                    tell(Told::Rest(AxisSignals::from_array(rest)));
                }
                tell(Told::Step(*begun));
            }
            step = now;
            let asked = shown.prompt.load(Ordering::Acquire);
            if let Some(asked) = Prompt::ALL.get(asked).filter(|_| asked != prompt) {
                let code = u16::try_from(shown.code.load(Ordering::Acquire)).ok();
                tell(Told::Prompt(*asked, code));
            }
            prompt = asked;
            thread::sleep(LOOK);
        }
        task.join().unwrap_or_else(|_| Err("the commissioning task ended by itself".into()))
    })
}

/// The cycle.
fn steer(
    sequence: &mut Sequence,
    machine: &mut dyn Machine,
    period: f64,
    person: &Person,
    shown: &Shown,
) {
    let step = (period * 1e9).round() as u64;
    let first = now();
    let (mut release, mut executed, mut number, mut last) = (first, first, 0, 0);
    while last < LAST {
        release = machine.release(release + step);
        wait_until(release, SPIN);
        let missed = now().saturating_sub(release) / step.max(1);
        release += missed * step;
        let clock = now();
        let elapsed = clock.saturating_sub(executed) as f64 * 1e-9;
        executed = clock;
        // a confirmation before the prompt does not count
        let is_confirmed = person.confirmed.swap(false, Ordering::AcqRel)
            && sequence.prompt().is_some_and(Prompt::is_confirmed);
        let action = sequence.period(&Now {
            elapsed,
            incoming: machine.read(),
            missed: u32::try_from(missed).unwrap_or(u32::MAX),
            is_confirmed,
            is_ended: person.is_ended(),
        });
        number += 1;
        act(machine, number, action);
        for (signal, rest) in shown.rest.iter().zip(sequence.quantities().rest) {
            signal.store(rest.to_bits(), Ordering::Relaxed);
        }
        shown.step.store(sequence.step().place(), Ordering::Release);
        // before the prompt that names it
        let code = sequence.machine_code().map_or(NOTHING, usize::from);
        shown.code.store(code, Ordering::Release);
        shown.prompt.store(place(sequence.prompt()), Ordering::Release);
        last = if sequence.is_over() { last + 1 } else { 0 };
    }
}

/// Hands an action to a machine.
fn act(machine: &mut dyn Machine, number: u64, action: Action) {
    match action {
        Action::Send(outgoing) => machine.write(number, &outgoing),
        Action::Withhold => machine.withhold(),
        Action::Reset(outgoing) => {
            machine.reset_by_a_person();
            machine.write(number, &outgoing);
        }
    }
}

/// Runs a sequence with the virtual crane, whose stop circuit a simulated operator opens; `see` is called
/// after each period. In real time where `is_paced`, else as fast as possible.
///
/// # Errors
///
/// [`SimulationError`] if the simulation fails.
pub fn run_simulated(
    sequence: &mut Sequence,
    machine: &mut SimulatedMachine,
    is_paced: bool,
    person: &Person,
    see: &mut dyn FnMut(&Sequence, &SimulatedMachine),
) -> Result<(), SimulationError> {
    let period = machine.crane().period();
    let begun = now();
    let mut number = 0;
    while !sequence.is_over() && (number as f64) * period < LONGEST {
        let is_confirmed = machine.answer(sequence.prompt());
        let action = sequence.period(&Now {
            elapsed: period,
            incoming: machine.read(),
            missed: 0,
            is_confirmed,
            is_ended: person.is_ended(),
        });
        number += 1;
        act(machine, number, action);
        machine.advance()?;
        see(sequence, machine);
        if is_paced {
            wait_until(begun + (number as f64 * period * 1e9) as u64, 0);
        }
    }
    Ok(())
}
