//! Promises of the supervisor for any observation and any request.

use crate::machine::{Machine, limits};
use hydroboom_control::supervision::fault::Cause;
use hydroboom_control::supervision::fault::Severity;
use hydroboom_control::supervision::limits::Observation;
use hydroboom_control::supervision::supervisor::{Decision, Request, State, Supervisor};
use hydroboom_control::supervision::waiting::Waiting;
use proptest::prelude::*;

/// A supervisor with its machine.
struct Rig {
    supervisor: Supervisor,
    machine: Machine,
    now: Decision,
}

impl Rig {
    fn new() -> Self {
        let supervisor = Supervisor::new(limits());
        Self { supervisor, machine: Machine::at_rest(), now: Decision::IDLE }
    }

    /// One executed period after a time \[s\], with what is observed changed.
    fn step(
        &mut self,
        elapsed: f64,
        request: Request,
        change: impl FnOnce(&mut Observation),
    ) -> Observation {
        self.machine.advance(&self.now.command, elapsed);
        let mut seen = self.machine.observe(elapsed);
        change(&mut seen);
        self.now = self.supervisor.advance(&seen, request);
        seen
    }

    fn well(&mut self, request: Request) {
        self.step(limits().period, request, |_| {});
    }

    /// Comes as far as a state.
    fn brought_to(state: State) -> Self {
        let mut rig = Self::new();
        for _ in 0..6000 {
            if rig.now.state == state && (state != State::Moving || rig.now.controls) {
                return rig;
            }
            rig.well(match rig.now.state {
                State::Idle => Request::Enable,
                State::Ready => Request::Hold,
                State::Holding if !rig.now.releasing => Request::Start,
                State::Moving if state == State::Stopping && rig.now.controls => Request::Stop,
                _ => Request::None,
            });
        }
        panic!("never {state:?}, but {:?}", rig.now);
    }
}

/// What can be wrong with what is seen.
fn spoil(seen: &mut Observation, how: u8) {
    match how {
        0 => seen.reading.stroke = f64::NAN,
        1 => seen.reading.pressure_b = f64::INFINITY,
        2 => seen.age = 0.1,
        3 => seen.reading.stroke = 0.7,
        4 => seen.reading.stroke += 0.05,
        5 => seen.reading.pressure_a = 250e5,
        6 => seen.reading.pressure_pump_b = -10e5,
        7 => seen.wanted = f64::NAN,
        8 => seen.reference += 0.3,
        9 => seen.missed = 200,
        10 => seen.attended = false,
        11 => seen.clock_jumped = true,
        12 => seen.reading.motor_speed += 30.0,
        13 => seen.reading.pressure_a += 40e5,
        14 => seen.course_over = true,
        15 => seen.wanted = -200.0,
        16 => seen.new_readings = 0,
        17 => seen.reading.motor_speed = f64::NAN,
        18 => seen.elapsed = f64::NAN,
        19 => seen.elapsed = -1.0,
        20 => seen.valve = None,
        _ => {}
    }
}

const REQUESTS: [Request; 7] = [
    Request::None,
    Request::Enable,
    Request::Hold,
    Request::Start,
    Request::Stop,
    Request::EmergencyStop,
    Request::Reset,
];

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

    /// Random intervals: duration, request at the beginning and afterwards, fault, and elapsed time per
    /// call.
    #[test]
    fn release_needs_a_proof_and_leaving_a_fault_an_operators_reset(
        stretches in prop::collection::vec(
            (1_u32..900, 0_usize..7, prop::bool::weighted(0.7), 0_u8..60, 0_u8..12), 1..30)
    ) {
        let l = limits();
        let mut rig = Rig::new();
        let mut faulty_for = 0.0;
        for (length, request, goes_on, wrong, pace) in stretches {
            for k in 0..length {
                let request = match k {
                    0 => REQUESTS[request],
                    // as an operator goes on
                    _ if goes_on => match rig.now.state {
                        State::Idle => Request::Enable,
                        State::Ready => Request::Hold,
                        State::Holding if !rig.now.releasing => Request::Start,
                        State::Fault => Request::Reset,
                        _ => Request::None,
                    },
                    _ => Request::None,
                };
                let elapsed = match pace {
                    0 if k == 0 => 0.9,
                    1 if k == 0 => 0.06,
                    2 => 13.0 * l.period,
                    _ => l.period,
                };
                let before = rig.now;
                let seen = rig.step(elapsed, request, |seen| spoil(seen, wrong));
                let now = rig.now;
                let open = now.command.holding_valve > 0.0;
                let was_open = before.command.holding_valve > 0.0;
                prop_assert!(now.command.motor_speed.is_finite());
                prop_assert!(now.command.motor_speed.abs() <= l.motor_speed);
                prop_assert!((now.state == State::Fault) == now.cause.is_some());
                // an emergency stop acts in the period in which it is seen, in every state
                if request == Request::EmergencyStop {
                    prop_assert!(now.state == State::Fault && !open && !now.releasing, "{now:?}");
                    prop_assert_eq!(now.cause, Some(Cause::EmergencyStop));
                }
                // released by a proof that was under way, and by nothing else
                if open && !was_open {
                    prop_assert!(before.releasing && now.state == State::Moving, "{before:?} {now:?}");
                }
                prop_assert!(now.state != State::Moving || open, "moving with a shut valve");
                let may = matches!(now.state, State::Moving | State::Stopping | State::Fault);
                prop_assert!(!open || may, "open in {:?}", now.state);
                // a proof begins by a start of a present operator in Holding, and by nothing else
                if now.releasing && !before.releasing {
                    prop_assert!(request == Request::Start && seen.attended, "{request:?}");
                    prop_assert!(before.state == State::Holding || before.state == State::Ready);
                }
                prop_assert!(!now.releasing || now.state == State::Holding);
                // behind a shut valve the motor turns for the proof, or brakes
                if !open && !now.releasing && now.command.motor_speed != 0.0 {
                    let most = before.command.motor_speed.abs().max(seen.reading.motor_speed.abs());
                    prop_assert!(now.command.motor_speed.abs() <= most, "{before:?} {now:?}");
                    prop_assert!(now.state == State::Fault || now.state == State::Holding);
                }
                // after an interval in which the drive's watchdog has stopped it, the load stays held
                if elapsed > l.watchdog && before.command != Decision::IDLE.command {
                    prop_assert!(now.state == State::Fault && !open, "{now:?}");
                }
                if before.state == State::Fault && now.state != State::Fault {
                    prop_assert!(request == Request::Reset && now.state == State::Ready);
                    prop_assert!(seen.attended && now.is_at_rest());
                }
                if before.state == State::Fault && now.state == State::Fault {
                    let severity = |d: &Decision| d.cause.map(Cause::severity);
                    prop_assert!(severity(&now) >= severity(&before), "a milder fault hides it");
                }
                // an invalid time counts as one period
                let is_valid = seen.elapsed.is_finite() && seen.elapsed >= 0.0;
                faulty_for = match now.cause == before.cause {
                    true => faulty_for + if is_valid { seen.elapsed } else { l.period },
                    false => 0.0,
                };
                if now.state == State::Fault && faulty_for > rig.supervisor.bound() + elapsed {
                    prop_assert!(now.is_at_rest(), "{now:?}");
                }
                if now.state == State::Idle {
                    prop_assert!(now.is_at_rest());
                }
            }
        }
    }
}

#[test]
fn every_fault_has_a_cause_and_reaches_the_safe_state_in_time() {
    let l = limits();
    for state in [State::Ready, State::Holding, State::Moving, State::Stopping] {
        for how in (0..7).chain([9, 10, 11, 12, 17, 18, 19]) {
            let mut rig = Rig::brought_to(state);
            let mut periods = 0;
            while rig.now.state != State::Fault && periods < 300 {
                rig.step(l.period, Request::None, |seen| spoil(seen, how));
                periods += 1;
            }
            // nobody is there, and nothing moves: the drive goes off, and that is all
            let watched = how != 10 || !matches!(state, State::Ready | State::Holding);
            assert_eq!(rig.now.state == State::Fault, watched, "{state:?} {how}");
            let Some(cause) = rig.now.cause else {
                assert_eq!(rig.now.state, State::Ready);
                continue;
            };
            assert!(!cause.code().is_empty() && cause.advice().len() > 20);
            let bound = (rig.supervisor.bound() / l.period).ceil() as u32;
            (0..bound).for_each(|_| rig.well(Request::None));
            assert!(rig.now.is_at_rest(), "{cause:?}");
            assert_eq!(rig.now.state, State::Fault, "{cause:?} went away by itself");
            // asked to move it stays; reset without an operator it stays; missed periods have to pass, and
            // everything has to be well for a while
            rig.well(Request::Start);
            assert_eq!(rig.now.state, State::Fault);
            (0..900).for_each(|_| rig.well(Request::None));
            rig.step(l.period, Request::Reset, |seen| seen.attended = false);
            assert_eq!(rig.now.state, State::Fault, "{cause:?} reset by nobody");
            rig.well(Request::Reset);
            assert_eq!(rig.now.state, State::Ready, "{cause:?}");
        }
    }
}

/// A more severe cause replaces a milder reaction at any time.
#[test]
fn no_fault_hides_a_more_severe_one() {
    let l = limits();
    for delay in [1, 20, 200, 350, 800] {
        for (how, request) in [(0, Request::None), (2, Request::None), (20, Request::EmergencyStop)]
        {
            let mut rig = Rig::brought_to(State::Moving);
            rig.step(l.period, Request::None, |seen| seen.attended = false);
            assert_eq!(rig.now.cause, Some(Cause::OperatorLost));
            assert!(rig.now.command.holding_valve > 0.0, "stopped under control");
            (0..delay).for_each(|_| rig.well(Request::None));
            rig.step(l.period, request, |seen| spoil(seen, how));
            let cause = rig.now.cause.unwrap();
            assert!(cause.severity() > Severity::Controlled, "{cause:?} after {delay} periods");
            assert_eq!(rig.now.command.holding_valve, 0.0);
        }
    }
}

#[test]
fn an_emergency_stop_is_latched_and_not_replaced_by_a_milder_fault() {
    for state in State::ALL {
        let mut rig = match state {
            State::Idle => Rig::new(),
            State::Fault => {
                let mut rig = Rig::brought_to(State::Moving);
                rig.step(1e-3, Request::None, |seen| seen.attended = false);
                rig
            }
            _ => Rig::brought_to(state),
        };
        rig.well(Request::EmergencyStop);
        for _ in 0..2000 {
            rig.step(1e-3, Request::Start, |seen| seen.attended = false);
            assert_eq!((rig.now.state, rig.now.cause), (State::Fault, Some(Cause::EmergencyStop)));
        }
    }
}

#[test]
fn the_load_is_not_released_onto_an_empty_pump_side() {
    let mut rig = Rig::brought_to(State::Holding);
    rig.machine.lifts = false;
    let held = rig.machine.stroke;
    rig.well(Request::Start);
    let mut waited = 0;
    while rig.now.state == State::Holding {
        assert!(rig.now.releasing && rig.now.command.holding_valve == 0.0);
        rig.well(Request::None);
        waited += 1;
    }
    assert_eq!(rig.now.cause, Some(Cause::NoLift));
    assert!(f64::from(waited) * 1e-3 <= limits().release.largest_duration + 0.1);
    assert_eq!(rig.machine.stroke, held);
}

/// A load that would fall onto an empty pump side if released without proof does not fall.
#[test]
fn a_released_load_does_not_fall() {
    let mut rig = Rig::brought_to(State::Holding);
    let held = rig.machine.stroke;
    rig.well(Request::Start);
    let (mut lowest, mut highest) = (held, held);
    while !rig.now.controls {
        rig.well(Request::None);
        (lowest, highest) = (lowest.min(rig.machine.stroke), highest.max(rig.machine.stroke));
    }
    assert!(held - lowest < 1e-4, "fell by {} m", held - lowest);
    assert!(highest - held < 1e-3, "lifted by {} m", highest - held);
}

/// The process was suspended while lowering. The watchdog of the drive has held the load, and it stays
/// held.
#[test]
fn after_a_lost_watchdog_interval_the_load_stays_held() {
    for gap in [0.021, 0.06, 0.3, 0.9] {
        let mut rig = Rig::brought_to(State::Moving);
        for _ in 0..300 {
            rig.step(1e-3, Request::None, |seen| seen.wanted = -20.0);
        }
        assert!(rig.now.command.motor_speed < -19.0, "{:?}", rig.now);
        // the watchdog has shut the valve and stopped the motor
        rig.now.command = Decision::IDLE.command;
        for k in 0..600 {
            let elapsed = if k == 0 { gap } else { 1e-3 };
            rig.step(elapsed, Request::None, |seen| seen.wanted = -20.0);
            assert!(rig.now.is_at_rest(), "acts after {gap} s: {:?}", rig.now);
            assert_eq!(rig.now.cause, Some(Cause::WatchdogExpired));
        }
    }
}

#[test]
fn repeatedly_missed_periods_are_a_fault_and_a_stop_keeps_its_duration() {
    let mut rig = Rig::brought_to(State::Moving);
    let (mut time, mut found) = (0.0, None);
    while time < 2.0 {
        rig.step(13e-3, Request::None, |_| {});
        time += 13e-3;
        if rig.now.cause.is_some() {
            found.get_or_insert(time);
        }
        if rig.now.state == State::Fault && rig.now.is_at_rest() {
            break;
        }
    }
    assert_eq!(rig.now.cause, Some(Cause::Overruns));
    let stopped = time - found.unwrap();
    assert!(stopped < limits().stop_time + 2.0 * 13e-3, "{stopped} s");
}

#[test]
fn every_state_reports_what_it_waits_for_and_times_out() {
    // a transducer below its range at rest: Idle is left by a fault that names it
    let mut rig = Rig::new();
    let mut time = 0.0;
    while rig.now.state == State::Idle && time < 60.0 {
        rig.step(1e-3, Request::Enable, |seen| seen.reading.pressure_b = -5e5);
        if rig.now.state == State::Idle && time > 0.0 {
            assert_eq!(rig.now.waiting, Waiting::Measurements(Cause::PressureImplausible));
            assert!((rig.now.waited - time).abs() < 2e-3, "{} after {time}", rig.now.waited);
        }
        time += 1e-3;
    }
    assert_eq!(rig.now.cause, Some(Cause::PressureImplausible));
    assert!((time - limits().wait_time).abs() < 0.01, "{time}");

    // a load that never comes to rest
    let mut rig = Rig::brought_to(State::Ready);
    let mut time: f64 = 0.0;
    while rig.now.state == State::Ready && time < 60.0 {
        let swing = 2e-3 * (std::f64::consts::TAU * 3.0 * time).sin();
        rig.step(1e-3, Request::Hold, |seen| seen.reading.stroke += swing);
        time += 1e-3;
    }
    assert_eq!(rig.now.cause, Some(Cause::LoadNotStill));

    // a state says from its first period what it waits for
    for (state, waiting) in [
        (State::Ready, Waiting::StillLoad),
        (State::Holding, Waiting::Start),
        (State::Stopping, Waiting::Standstill),
    ] {
        assert_eq!(Rig::brought_to(state).now.waiting, waiting, "{state:?}");
    }

    // nobody there
    let mut rig = Rig::brought_to(State::Ready);
    rig.step(1e-3, Request::None, |seen| seen.attended = false);
    assert_eq!(rig.now.waiting, Waiting::Operator);
}

/// A load that creeps in Fault prevents a reset until it rests, and no longer.
#[test]
fn a_creeping_held_load_prevents_a_reset_until_it_rests() {
    let mut rig = Rig::brought_to(State::Moving);
    rig.well(Request::EmergencyStop);
    (0..2000).for_each(|_| rig.well(Request::None));
    // slower than an oscillating load, 5 mm in a second, with a reset requested in every period
    for _ in 0..1000 {
        rig.machine.stroke -= 5e-6;
        rig.well(Request::Reset);
        if rig.now.state != State::Fault {
            break;
        }
    }
    // it had been well before it crept
    assert_eq!(rig.now.state, State::Ready);
    let mut periods = 0;
    while rig.now.state == State::Ready && periods < 5000 {
        rig.machine.stroke -= 5e-6;
        rig.well(Request::None);
        periods += 1;
    }
    assert_eq!(rig.now.cause, Some(Cause::LoadNotHeld), "nobody says that it creeps");
    (0..1000).for_each(|_| rig.well(Request::None));
    rig.well(Request::Reset);
    assert_eq!(rig.now.state, State::Ready);
}

#[test]
fn a_valve_that_does_not_switch_is_detected_by_its_position_switch() {
    use hydroboom_control::supervision::limits::ValveState;
    for (state, shown) in [(State::Holding, ValveState::Open), (State::Moving, ValveState::Shut)] {
        let mut rig = Rig::brought_to(state);
        let mut periods = 0;
        while rig.now.state != State::Fault && periods < 200 {
            rig.step(1e-3, Request::None, |seen| seen.valve = Some(shown));
            periods += 1;
        }
        assert_eq!(rig.now.cause, Some(Cause::ValveNotFollowing));
    }
}

#[test]
fn uncommanded_rotation_shuts_the_valve_within_50_ms_in_any_state() {
    for state in [State::Ready, State::Holding, State::Moving, State::Stopping] {
        let mut rig = Rig::brought_to(state);
        for _ in 0..50 {
            rig.step(1e-3, Request::None, |seen| {
                seen.wanted = 0.0;
                seen.reading.motor_speed = -10.0;
            });
        }
        assert_eq!(rig.now.cause, Some(Cause::DriveUncommanded), "{state:?}");
        assert_eq!(rig.now.command.holding_valve, 0.0);
    }
}

#[test]
fn a_stuck_or_noisy_sensor_is_detected() {
    let mut rig = Rig::brought_to(State::Moving);
    for k in 0..300 {
        rig.step(1e-3, Request::None, |seen| seen.reading.pressure_a = 68e5);
        assert!(k > 150 || rig.now.state == State::Moving);
    }
    assert_eq!(rig.now.cause, Some(Cause::SensorStuck));

    let mut rig = Rig::brought_to(State::Moving);
    for k in 0..300 {
        rig.step(1e-3, Request::None, |seen| {
            seen.reading.pressure_a += 8e5 * (f64::from(k) * 2.3).sin();
        });
    }
    assert_eq!(rig.now.cause, Some(Cause::SensorNoisy));
}

#[test]
fn an_oscillating_load_is_held_once_it_rests() {
    let mut rig = Rig::new();
    // 3 Hz, 4 mm, as after an emergency stop; it dies out with 0.7 s
    let swing = |k: u32| {
        let t = f64::from(k) * 1e-3;
        4e-3 * (-t / 0.7).exp() * (std::f64::consts::TAU * 3.0 * t).sin()
    };
    let mut held_from = None;
    for k in 0..5000 {
        let request = if rig.now.state == State::Idle { Request::Enable } else { Request::Hold };
        rig.step(1e-3, request, |seen| seen.reading.stroke += swing(k));
        assert_eq!(rig.now.cause, None, "after {k} periods");
        if rig.now.state == State::Holding {
            held_from.get_or_insert(k);
        }
    }
    let from = held_from.expect("it is held in the end");
    assert!((from..5000).all(|k| swing(k).abs() < 1.5e-3), "held while it swung, after {from}");
}

#[test]
fn a_position_with_drift_or_gain_error_disagrees_with_the_flow() {
    // at rest 2 mm/s within 5 s; in motion a fifth too much
    for (wanted, drift, gain) in [(0.0, 2e-3, 0.0), (5.0, 0.0, 0.2)] {
        let mut rig = Rig::brought_to(State::Moving);
        let from = rig.machine.stroke;
        let mut time = 0.0;
        while rig.now.state == State::Moving && time < 20.0 {
            rig.step(1e-3, Request::None, |seen| {
                seen.wanted = wanted;
                let wrong = drift * time + gain * (seen.reading.stroke - from);
                seen.reading.stroke += wrong;
                seen.reference = seen.reading.stroke;
            });
            time += 1e-3;
        }
        assert_eq!(rig.now.cause, Some(Cause::PositionFlowDisagree));
        assert!(time < 5.0, "{time} s");
    }
}

#[test]
fn missed_readings_are_not_taken_for_a_runaway_piston() {
    let mut rig = Rig::brought_to(State::Moving);
    // of twelve readings eleven are missed, again and again
    let (mut k, mut read) = (0_u32, 0_u32);
    let mut last = None;
    for _ in 0..2000 {
        k += 1;
        let missed = k % 24 < 12 && k % 12 != 0;
        let new = if missed { 0 } else { k - read };
        rig.step(1e-3, Request::None, |seen| {
            seen.new_readings = new;
            if missed && let Some(reading) = last {
                seen.reading = reading;
            }
            last = Some(seen.reading);
        });
        read = if missed { read } else { k };
        assert_eq!(rig.now.cause, None, "at {k}");
    }
}

/// A sustained oscillation is reported with amplitude and frequency, and is no fault within the limits.
#[test]
fn an_oscillation_at_rest_is_reported_without_a_fault() {
    let mut rig = Rig::brought_to(State::Moving);
    let (frequency, mut time, mut middle) = (1.0, 0.0, None);
    let (mut low, mut high) = (f64::MAX, f64::MIN);
    for _ in 0..6000 {
        time += limits().period;
        let speed = 6.0 * (core::f64::consts::TAU * frequency * time).cos();
        let seen = rig.step(limits().period, Request::None, |seen| {
            seen.wanted = speed;
            seen.reference = *middle.get_or_insert(seen.reading.stroke);
        });
        (low, high) = (low.min(seen.reading.stroke), high.max(seen.reading.stroke));
    }
    assert_eq!(rig.now.state, State::Moving, "{:?}", rig.now.cause);
    let [amplitude, hz] = rig.now.oscillation.unwrap();
    assert!((hz / frequency - 1.0).abs() < 0.05, "{hz} Hz");
    assert!((2.0 * amplitude / (high - low) - 1.0).abs() < 0.1, "{amplitude} m, {low} to {high}");
    // another course begins without it
    assert_eq!(Rig::brought_to(State::Moving).now.oscillation, None);
}
