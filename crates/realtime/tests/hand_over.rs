//! Hand-overs to and from the scheduled LQR in motion, and beginnings of its estimator: without a jump of the command, and with the piston near its course.
//!
//! The supervisor limits every command to the motor's slew, which would hide a jump behind a ramp; so what is looked at is how far the command moves
//! within a few periods, beside what each strategy's own command moves within as many.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up has failed")]

use hydroboom_control::strategy::Strategy;
use hydroboom_control::supervision::supervisor::State;
use hydroboom_description::Description;
use hydroboom_realtime::control_task::Record;
use hydroboom_realtime::course::Course;
use hydroboom_realtime::lockstep::{Disturbance, Lockstep, Undisturbed};
use hydroboom_realtime::machine::Incoming;
use hydroboom_realtime::operator::Operator;
use hydroboom_realtime::session::Order;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;

const LQR: Strategy = Strategy::ScheduledLqr;
/// Times of the course \[s\]: in a ramp, at speed, on the way back.
const MOMENTS: [f64; 3] = [2.5, 4.0, 13.5];
/// The command is looked at for so long after a hand-over \[s\], and its changes over so many periods.
const LOOKED_AT: f64 = 0.1;
const PERIODS: usize = 5;
/// Change of the command that the motor's slew limit allows in a period \[rev/s\].
const SLEW: f64 = 0.5;

/// A period, and how far the piston truly was from the reference \[m\].
type Seen = (Record, f64);

fn lockstep(strategy: Strategy) -> Lockstep {
    let model = Description::uia_single_boom().unwrap();
    let crane = Description::uia_virtual().unwrap();
    let motion = crane.motion(model.numbers.fast);
    Lockstep::new(&model, &crane, motion, strategy).unwrap()
}

/// Goes on to the end of a course under strategies by the course's time.
fn go_on(
    run: &mut Lockstep,
    operator: &mut Operator,
    strategy: impl Fn(f64) -> Strategy,
    disturbance: &mut dyn Disturbance,
) -> Vec<Seen> {
    let mut seen: Vec<Seen> = Vec::new();
    while !operator.is_done() && seen.len() < 60_000 {
        let time = seen.last().and_then(|(r, _)| r.course_time).unwrap_or(0.0);
        let record = run.disturbed_period(operator, strategy(time), disturbance).unwrap();
        seen.push((record, run.truth().outputs.stroke - record.reference.position));
    }
    let end = seen[seen.len() - 1].0.decision;
    assert_eq!((end.state, end.cause), (State::Holding, None));
    seen
}

fn course(strategy: impl Fn(f64) -> Strategy, disturbance: &mut dyn Disturbance) -> Vec<Seen> {
    let mut run = lockstep(strategy(0.0));
    go_on(&mut run, &mut Operator::automatic(1e-3), strategy, disturbance)
}

/// How far the command moves within a few periods at most \[rev/s\], at times of the course \[s\].
fn largest_move(seen: &[Seen], times: Range<f64>) -> f64 {
    let moves = seen.windows(PERIODS + 1).filter_map(|w| {
        let [first, .., last] = w else { return None };
        let is_there = |(r, _): &Seen| r.course_time.is_some_and(|time| times.contains(&time));
        let speed = |(r, _): &Seen| r.decision.command.motor_speed;
        (is_there(first) && is_there(last)).then(|| (speed(last) - speed(first)).abs())
    });
    moves.fold(0.0, f64::max)
}

fn largest_error(seen: &[Seen], from: f64) -> f64 {
    largest_error_in(seen, from..f64::INFINITY)
}

fn largest_error_in(seen: &[Seen], times: Range<f64>) -> f64 {
    let is_there = |(r, _): &&Seen| r.course_time.is_some_and(|time| times.contains(&time));
    let errors = seen.iter().filter(is_there);
    errors.fold(0.0, |most, (_, error)| most.max(error.abs()))
}

/// The promise of a hand-over between the scheduled LQR and any other strategy, in motion:
///
/// - In the period of the hand-over the command stays where it is. In the 20 ms after it the command moves no further within five periods than both strategies'
///   own commands together, in which their noise and the ramp's slope are, and the slew limit of one period.
/// - The piston is off by no more than a tenth more than at the hand-over and 1.2 times what the new strategy ever leaves; in open loop, twice that, as its
///   error may have been on the other side.
/// - Three seconds after it took over the scheduled LQR leaves no more than it ever leaves alone.
#[test]
fn a_hand_over_in_motion_moves_neither_the_command_nor_the_piston() {
    let alone: Vec<Vec<Seen>> =
        Strategy::ALL.par_iter().map(|s| course(|_| *s, &mut Undisturbed)).collect();
    let own = |strategy: Strategy| {
        let place = Strategy::ALL.iter().position(|s| *s == strategy);
        &alone[place.unwrap()]
    };
    let others = Strategy::ALL.into_iter().filter(|s| *s != LQR);
    let cases: Vec<_> = others
        .flat_map(|other| [(other, LQR), (LQR, other)])
        .flat_map(|(first, then)| MOMENTS.map(|at| (first, then, at)))
        .collect();
    cases.into_par_iter().for_each(|(first, then, at)| {
        let seen = course(|time| if time >= at { then } else { first }, &mut Undisturbed);
        let case = format!("{} to {} at {at} s", first.name(), then.name());
        let changed = seen.windows(2).find(|w| w[0].0.strategy == first && w[1].0.strategy == then);
        let [before, after] = changed.expect("it was handed over") else { unreachable!() };
        let speed = |(r, _): &Seen| r.decision.command.motor_speed;
        let jump = speed(after) - speed(before);
        assert!(jump.abs() < 1e-9, "{case}: a jump of {jump} rev/s");

        let moved = largest_move(&seen, at - 0.01..at + 0.02);
        let moves = [first, then].map(|s| largest_move(own(s), at - 0.01..at + LOOKED_AT));
        let most = moves[0] + moves[1] + SLEW;
        assert!(moved < most, "{case}: the command moves by {moved} rev/s, alone by {moves:?}");

        let taken_over = after.1.abs();
        let peak = largest_error(own(then), 0.0);
        let most = 1.1 * taken_over + if then.measures() { 1.2 } else { 2.0 } * peak;
        let off = largest_error(&seen, at);
        assert!(off < most, "{case}: {off} m off, {taken_over} m at the hand-over, {peak} m alone");
        let later = largest_error(&seen, at + 3.0);
        assert!(then != LQR || later <= peak, "{case}: {later} m off in the end");
    });
}

/// Readings that do not arrive for some periods of the course.
struct Lost {
    from: f64,
    periods: u32,
    time: f64,
    lost: u32,
}

impl Disturbance for Lost {
    fn reading(&mut self, incoming: Incoming) -> Option<Incoming> {
        self.time += 1e-3;
        let is_lost = self.time >= self.from && self.lost < self.periods;
        self.lost += u32::from(is_lost);
        (!is_lost).then_some(incoming)
    }
}

/// The filter goes on by its model while readings are missing, and takes the next one in: the command moves as it does in every other period. Eight periods are
/// longer than a reading counts as fresh, and shorter than the supervisor bears.
#[test]
fn lost_readings_move_neither_the_command_nor_the_piston() {
    let alone = course(|_| LQR, &mut Undisturbed);
    for (at, periods) in [(4.0, 1), (4.0, 8), (13.5, 8)] {
        let begin = alone.iter().find(|(r, _)| r.course_time.is_some_and(|time| time >= at));
        let from = begin.unwrap().0.time;
        let mut lost = Lost { from, periods, time: 0.0, lost: 0 };
        let seen = course(|_| LQR, &mut lost);
        assert_eq!(lost.lost, periods);
        let window = at - 0.1..at + LOOKED_AT;
        let [moved, most] = [&seen, &alone].map(|s| largest_move(s, window.clone()));
        assert!(moved < 1.5 * most, "{periods} lost at {at} s: {moved} rev/s, alone {most}");
        let [off, most] = [&seen, &alone].map(|s| largest_error_in(s, at..at + 1.0));
        assert!(off < most + 0.1e-3, "{periods} lost at {at} s: {off} m off, alone {most} m");
    }
}

/// A course from the held load, a stop in motion, and once the boom has come to rest another course from there.
fn stopped_and_begun_again(strategy: Strategy) -> Vec<Seen> {
    let mut run = lockstep(strategy);
    let mut operator = Operator::automatic(1e-3);
    let (mut last, mut held) = (None, 0);
    while held < 5000 {
        let record = run.period(&mut operator, strategy).unwrap();
        operator.stop |= record.course_time.is_some_and(|time| time > 4.0);
        held += u32::from(operator.is_done());
        last = Some(record);
    }
    let stopped = last.unwrap();
    assert_eq!((stopped.decision.state, stopped.decision.cause), (State::Holding, None));
    let model = Description::uia_single_boom().unwrap();
    let crane = Description::uia_virtual().unwrap();
    let path = Arc::new(crane.motion(model.numbers.fast));
    run.take(Order::Course(Course::from_stroke(path, stopped.signals().stroke)));
    go_on(&mut run, &mut Operator::automatic(1e-3), |_| strategy, &mut Undisturbed)
}

/// Every release begins with a new estimator, the first one as well as that after a stop in motion. The strategy's first command is the speed that the release
/// ended with. What it does then, while the load settles on the pump, leaves the piston no farther off than the benchmark does.
#[test]
fn a_release_begins_without_a_jump_also_after_a_stop() {
    let first = |strategy: Strategy| course(|_| strategy, &mut Undisturbed);
    for (name, begin) in [("first", &first as &dyn Fn(_) -> _), ("next", &stopped_and_begun_again)]
    {
        let [off, benchmark_off] = [LQR, Strategy::BenchmarkClosedLoop].map(|strategy| {
            let seen: Vec<Seen> = begin(strategy);
            let at = seen.iter().position(|(r, _)| r.course_time.is_some()).unwrap();
            let speed = |k: usize| seen[k].0.decision.command.motor_speed;
            let jump = speed(at) - speed(at - 1);
            assert!(strategy != LQR || jump.abs() < 1e-9, "{name} course: a jump of {jump} rev/s");
            let begun = seen[at].0.course_time.unwrap();
            largest_error_in(&seen, begun..begun + 0.5)
        });
        assert!(off < 1.5 * benchmark_off, "{name} course: {off} m off, benchmark {benchmark_off}");
    }
}
