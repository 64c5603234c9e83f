//! What the supervisor promises, whatever it is shown and asked.

use hydroboom_control::{
    Cause, Decision, Limits, Observation, Reading, Request, State, Supervisor,
};
use proptest::prelude::*;

const LIMITS: Limits = Limits {
    period: 1e-3,
    stroke: 0.5,
    margin: 0.01,
    speed: 0.12,
    pressure: 200e5,
    creep: 3e-3,
    motor_speed: 50.0,
    motor_slew: 500.0,
    drive_deviation: (5.0, 0.1),
    stale: 5e-3,
    stuck: 0.2,
    scatter: (1e-4, 2e5),
    pressure_step: 30e5,
    overruns: 5,
    preload: 1e5,
    preload_time: 10.0,
    valve_time: 0.06,
};

/// A machine that is well, its drive turning as told, its signals alive; pre-loaded or not.
fn well(now: &Decision, k: u32, preloaded: bool) -> Observation {
    let alive = f64::from(k % 7) - 3.0;
    Observation {
        reading: Reading {
            stroke: 0.2 + 1e-6 * alive,
            pressure_pump_a: if preloaded { 68e5 } else { 5e5 } + 100.0 * alive,
            pressure_a: 68e5 - 90.0 * alive,
            pressure_b: 3e5 + 80.0 * alive,
            pressure_pump_b: 3e5 - 70.0 * alive,
            pressure_accumulator: 2.5e5 + 60.0 * alive,
            motor_speed: now.command.motor_speed,
        },
        age: 1e-3,
        new_readings: 1,
        reference: 0.2,
        tracking: 0.1,
        wanted: 3.0,
        course_over: false,
        overruns: 0,
        attended: true,
        clock_jumped: false,
    }
}

/// A supervisor that has come as far as `state`, from what [`well`] shows.
fn brought_to(state: State) -> (Supervisor, Decision) {
    let mut supervisor = Supervisor::new(LIMITS);
    let mut decision = supervisor.advance(&idle_sight(), Request::None);
    for k in 0..2000 {
        if decision.state == state && (state != State::Moving || decision.controls) {
            return (supervisor, decision);
        }
        let request = match decision.state {
            State::Idle => Request::Enable,
            State::Ready => Request::Hold,
            State::Holding => Request::Start,
            State::Moving if state == State::Stopping => Request::Stop,
            _ => Request::None,
        };
        decision = supervisor.advance(&well(&decision, k, true), request);
    }
    panic!("never {state:?}, but {decision:?}");
}

fn idle_sight() -> Observation {
    let nothing = hydroboom_control::Command { motor_speed: 0.0, holding_valve: 0.0 };
    let decision = Decision { command: nothing, state: State::Idle, cause: None, controls: false };
    well(&decision, 0, false)
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
        9 => seen.overruns = 9,
        10 => seen.attended = false,
        11 => seen.clock_jumped = true,
        12 => seen.reading.motor_speed += 30.0,
        13 => seen.reading.pressure_a += 40e5,
        14 => seen.course_over = true,
        15 => seen.wanted = -200.0,
        16 => seen.new_readings = 0,
        _ => seen.reading.pressure_pump_a = 3e5,
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
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    /// Stretches of anything: how long, what is asked, what is wrong.
    #[test]
    fn whatever_happens_the_load_is_let_go_in_moving_only_and_a_fault_ends_by_reset_only(
        stretches in prop::collection::vec((1_u32..400, 0_usize..7, 0_u8..40), 1..40)
    ) {
        let mut supervisor = Supervisor::new(LIMITS);
        let mut now = supervisor.advance(&idle_sight(), Request::None);
        let mut k = 0;
        let mut faulty_for = 0.0;
        for (length, request, wrong) in stretches {
            for first in [true].into_iter().chain(std::iter::repeat(false)).take(length as usize) {
                k += 1;
                let mut seen = well(&now, k, true);
                spoil_if(&mut seen, wrong);
                let request = if first { REQUESTS[request] } else { Request::None };
                let next = supervisor.advance(&seen, request);

                let slew = (next.command.motor_speed - now.command.motor_speed).abs();
                prop_assert!(slew <= LIMITS.motor_slew * LIMITS.period * (1.0 + 1e-9));
                prop_assert!(next.command.motor_speed.abs() <= LIMITS.motor_speed);
                let open = next.command.holding_valve > 0.0;
                prop_assert!(next.state != State::Moving || open, "moving with a closed valve");
                let may = matches!(next.state, State::Moving | State::Stopping | State::Fault);
                prop_assert!(!open || may, "open in {:?}", next.state);
                prop_assert!((next.state == State::Fault) == next.cause.is_some());
                if now.state == State::Fault && next.state != State::Fault {
                    prop_assert!(request == Request::Reset && next.state == State::Ready);
                }
                if next.state == State::Fault && now.state != State::Fault {
                    faulty_for = 0.0;
                }
                faulty_for += LIMITS.period;
                if next.state == State::Fault && faulty_for > supervisor.bound() {
                    prop_assert!(!open && next.command.motor_speed == 0.0, "{next:?}");
                }
                // nothing acts before it has been asked for
                if matches!(next.state, State::Idle) {
                    prop_assert!(next.command.motor_speed == 0.0 && !open);
                }
                now = next;
            }
        }
    }
}

fn spoil_if(seen: &mut Observation, how: u8) {
    if how < 18 {
        spoil(seen, how);
    }
}

#[test]
fn every_fault_has_a_cause_a_person_understands_and_reaches_the_safe_state_in_time() {
    for state in [State::Ready, State::Holding, State::Moving, State::Stopping] {
        for how in (0..7).chain([9, 10, 11, 12]) {
            let (mut supervisor, mut now) = brought_to(state);
            let mut periods = 0;
            let mut k = 1000;
            while now.state != State::Fault && periods < 300 {
                let mut seen = well(&now, k, true);
                spoil(&mut seen, how);
                now = supervisor.advance(&seen, Request::None);
                (periods, k) = (periods + 1, k + 1);
            }
            let watched = match how {
                // nobody is there, and nothing moves: the drive goes off, and that is all
                10 => !matches!(state, State::Ready | State::Holding),
                12 => state != State::Ready,
                _ => true,
            };
            assert_eq!(now.state == State::Fault, watched, "{state:?} {how}");
            let Some(cause) = now.cause else {
                assert!(how != 10 || now.state == State::Ready);
                continue;
            };
            assert!(!cause.code().is_empty() && cause.advice().len() > 20);
            let bound = (supervisor.bound() / LIMITS.period).ceil() as u32;
            for _ in 0..bound {
                k += 1;
                now = supervisor.advance(&well(&now, k, true), Request::None);
            }
            assert_eq!(now.command.holding_valve, 0.0, "{cause:?}");
            assert_eq!(now.command.motor_speed, 0.0, "{cause:?}");
            assert_eq!(now.state, State::Fault, "{cause:?} went away by itself");
            // asked to move it stays, reset it is ready
            now = supervisor.advance(&well(&now, k + 1, true), Request::Start);
            assert_eq!(now.state, State::Fault);
            now = supervisor.advance(&well(&now, k + 2, true), Request::Reset);
            assert_eq!(now.state, State::Ready, "{cause:?}");
        }
    }
}

#[test]
fn the_load_is_not_let_go_onto_an_empty_pump_side() {
    let mut supervisor = Supervisor::new(LIMITS);
    let mut now = supervisor.advance(&idle_sight(), Request::Enable);
    for k in 0..400 {
        now = supervisor.advance(&well(&now, k, false), Request::Hold);
    }
    for k in 400..9_400 {
        now = supervisor.advance(&well(&now, k, false), Request::Start);
        assert_eq!((now.state, now.command.holding_valve), (State::Holding, 0.0));
        assert!(now.command.motor_speed > 0.0 || k == 400, "it pumps");
    }
    for k in 9_400..12_400 {
        now = supervisor.advance(&well(&now, k, false), Request::Start);
    }
    assert_eq!(now.cause, Some(Cause::NoPreload));
}

#[test]
fn a_signal_that_stands_still_or_scatters_is_noticed() {
    let (mut supervisor, mut now) = brought_to(State::Moving);
    for k in 0..150 {
        let mut seen = well(&now, k, true);
        seen.reading.pressure_a = 68e5;
        now = supervisor.advance(&seen, Request::None);
    }
    assert_eq!(now.state, State::Moving);
    for k in 150..300 {
        let mut seen = well(&now, k, true);
        seen.reading.pressure_a = 68e5;
        now = supervisor.advance(&seen, Request::None);
    }
    assert_eq!(now.cause, Some(Cause::SensorStuck));

    let (mut supervisor, mut now) = brought_to(State::Moving);
    for k in 0..300 {
        let mut seen = well(&now, k, true);
        seen.reading.pressure_a += 8e5 * (f64::from(k) * 2.3).sin();
        now = supervisor.advance(&seen, Request::None);
    }
    assert_eq!(now.cause, Some(Cause::SensorNoisy));
}

#[test]
fn a_load_that_still_swings_is_held_once_it_rests() {
    let mut supervisor = Supervisor::new(LIMITS);
    let mut now = supervisor.advance(&idle_sight(), Request::Enable);
    // 3 Hz, 4 mm, as after an emergency stop; it dies out with 0.7 s
    let swing = |k: u32| {
        let t = f64::from(k) * LIMITS.period;
        4e-3 * (-t / 0.7).exp() * (std::f64::consts::TAU * 3.0 * t).sin()
    };
    let mut held_from = None;
    for k in 0..5000 {
        let mut seen = well(&now, k, false);
        seen.reading.stroke += swing(k);
        now = supervisor.advance(&seen, Request::Hold);
        assert_eq!(now.cause, None, "after {k} periods");
        if now.state == State::Holding {
            held_from.get_or_insert(k);
        }
    }
    let from = held_from.expect("it is held in the end");
    assert!((from..5000).all(|k| swing(k).abs() < 1.5e-3), "held while it swung, after {from}");
}

#[test]
fn readings_that_were_missed_make_no_piston_run_away() {
    let (mut supervisor, mut now) = brought_to(State::Moving);
    // the piston moves at its largest speed; of twelve readings eleven are missed, again and again
    let (mut k, mut read) = (1000, 1000);
    for _ in 0..2000 {
        k += 1;
        let mut seen = well(&now, k, true);
        let missed = k % 24 < 12 && k % 12 != 0;
        seen.new_readings = if missed { 0 } else { k - read };
        read = if missed { read } else { k };
        seen.reading.stroke = 0.2 + LIMITS.speed * LIMITS.period * f64::from(read - 1000);
        seen.reference = seen.reading.stroke;
        now = supervisor.advance(&seen, Request::None);
        assert_eq!(now.cause, None, "at {k}");
    }
}
