//! Commissioning of the virtual crane in simulated time. Judged on the true piston: whatever mistake the machine has,
//! the step that is to find it fails, and the piston stays within the step's bound.

use hydroboom_control::supervision::limits::MachineStatus;
use hydroboom_description::Description;
use hydroboom_design::limits;
use hydroboom_realtime::commissioning::finding::{Finding, Outcome, Reason};
use hydroboom_realtime::commissioning::record::{self, Basis};
use hydroboom_realtime::commissioning::sequence::{Action, Now, Sequence};
use hydroboom_realtime::commissioning::settings::Settings;
use hydroboom_realtime::commissioning::simulated_machine::{Mistakes, SimulatedMachine};
use hydroboom_realtime::commissioning::step::{Prompt, Step};
use hydroboom_realtime::commissioning::task::{Person, run_simulated};
use hydroboom_realtime::machine::{Incoming, Link, Machine};

/// A sequence at its end, with the largest true way of the piston in each step [m].
struct Ran {
    sequence: Sequence,
    largest: [f64; Step::ALL.len()],
    machine: SimulatedMachine,
}

fn run(mistakes: Mistakes) -> Ran {
    run_with(mistakes, |_| ())
}

fn run_with(mistakes: Mistakes, change: impl Fn(&mut Settings)) -> Ran {
    let model = Description::uia_single_boom().unwrap();
    let crane = Description::uia_virtual().unwrap();
    let mut settings = Settings { listening: 0.5, opening: 3.0, ..Settings::default() };
    change(&mut settings);
    let limits = limits(&model, model.numbers.slow).unwrap();
    let mut sequence = Sequence::new(limits, settings, true);
    let mut machine = SimulatedMachine::new(&crane, mistakes).unwrap();
    let mut largest = [0.0_f64; Step::ALL.len()];
    let person = Person::default();
    run_simulated(&mut sequence, &mut machine, false, &person, &mut |sequence, machine| {
        let of = &mut largest[sequence.step().place()];
        *of = of.max(machine.moved().abs());
    })
    .unwrap();
    // the load is held after it, and stays where it is
    let at = machine.moved();
    (0..500).for_each(|_| machine.advance().unwrap());
    assert!((machine.moved() - at).abs() < 0.5e-3);
    Ran { sequence, largest, machine }
}

impl Ran {
    /// The step that failed, and its finding.
    fn failure(&self) -> (Step, Finding) {
        let step = self.sequence.step();
        match self.sequence.outcomes()[step.place()] {
            Some(Outcome::Failed(finding)) => (step, finding),
            other => panic!("{step:?}: {other:?}, {:?}", self.sequence.quantities()),
        }
    }

    /// Largest true way of the piston over all steps [m].
    fn moved(&self) -> f64 {
        self.largest.iter().copied().fold(0.0, f64::max)
    }
}

#[test]
fn a_sound_machine_passes_every_step_within_its_bound() {
    let ran = run(Mistakes::default());
    let (outcomes, q) = (ran.sequence.outcomes(), ran.sequence.quantities());
    for (step, outcome) in Step::ALL.iter().zip(outcomes) {
        assert_eq!(*outcome, Some(Outcome::Passed), "{step:?}: {q:?}");
    }
    let s = Settings::default();
    let mm = |step: Step| ran.largest[step.place()];
    for step in [Step::Listening, Step::StopCircuit, Step::Watchdog, Step::Polarity] {
        assert!(mm(step) < 0.2e-3, "{step:?} moved the piston by {} m", mm(step));
    }
    assert!(mm(Step::Release) < s.release_movement, "{}", mm(Step::Release));
    let travel = s.release_movement + s.travel + s.travel_deviation;
    assert!(ran.moved() < travel, "{:?}", ran.largest);
    assert!(q.watchdog > 0.015 && q.watchdog < 0.06, "{q:?}");
    assert!(q.motor_reaction > 0.0 && q.motor_reaction < 10.0, "{q:?}");
    assert!(q.stop_circuit_code == 6.0 && q.stop_distance < 2.5e-3, "{q:?}");
    assert!((q.scale - 1.0).abs() < 0.05, "{q:?}");
    assert!(
        (q.travel[0] - s.travel).abs() < 1e-3 && (q.travel[1] + s.travel).abs() < 1e-3,
        "{q:?}"
    );
    let truth = ran.machine.crane().truth();
    assert!(truth.motor_speed.abs() < 1e-3 && truth.pilot < 0.5);
}

/// Name, mistake, the step that finds it, and whether a finding is the expected one.
type Case = (&'static str, Mistakes, Step, fn(&Finding) -> bool);

#[test]
fn each_mistake_fails_in_its_step_and_nothing_moves_before_the_release() {
    let sound = Mistakes::default();
    let cases: [Case; 10] = [
        (
            "pump polarity reversed",
            Mistakes { motor: -1.0, motor_reading: -1.0, ..sound },
            Step::Polarity,
            |f| matches!(f, Finding::NoRise(_) | Finding::OtherSideRose(_)),
        ),
        ("motor reads backwards", Mistakes { motor_reading: -1.0, ..sound }, Step::Watchdog, |f| {
            matches!(f, Finding::MotorReversed(_))
        }),
        (
            "p_PA and p_A swapped",
            Mistakes { swapped: Some((1, 2)), ..sound },
            Step::Listening,
            |f| matches!(f, Finding::LoadPressure(_) | Finding::PumpAboveLoad(_)),
        ),
        (
            "p_A and p_B swapped",
            Mistakes { swapped: Some((2, 3)), ..sound },
            Step::Listening,
            |f| matches!(f, Finding::LoadPressure(_)),
        ),
        (
            "p_PA and p_PB swapped",
            Mistakes { swapped: Some((1, 4)), ..sound },
            Step::Polarity,
            |f| matches!(f, Finding::NoRise(_) | Finding::OtherSideRose(_)),
        ),
        (
            "stop circuit stuck",
            Mistakes { is_stop_circuit_stuck: true, ..sound },
            Step::StopCircuit,
            |f| matches!(f, Finding::StopCircuitNotSeen(_)),
        ),
        ("watchdog off", Mistakes { is_watchdog_off: true, ..sound }, Step::Watchdog, |f| {
            matches!(f, Finding::NoWatchdog(_))
        }),
        (
            "motor reads twice its speed",
            Mistakes { motor_reading: 2.0, ..sound },
            Step::Watchdog,
            |f| matches!(f, Finding::MotorDoesNotFollow(_)),
        ),
        (
            "position is not a number",
            Mistakes { not_a_number: Some(0), ..sound },
            Step::Listening,
            |f| matches!(f, Finding::NotANumber(0)),
        ),
        (
            "motor speed is not a number",
            Mistakes { not_a_number: Some(6), ..sound },
            Step::Listening,
            |f| matches!(f, Finding::NotANumber(6)),
        ),
    ];
    for (name, mistakes, step, is_it) in cases {
        let ran = run(mistakes);
        let (failed, finding) = ran.failure();
        assert!(failed == step && is_it(&finding), "{name}: {failed:?}, {finding:?}");
        assert!(ran.moved() < 0.5e-3, "{name} moved the piston by {} m", ran.moved());
        assert!(!ran.sequence.has_passed() && ran.sequence.is_over(), "{name}");
        // names its quantity and what to do
        assert!(finding.to_string().contains(':') || finding == Finding::NotReady, "{finding}");
    }
}

#[test]
fn a_position_with_a_wrong_sign_is_found_by_the_release_and_a_wrong_scale_by_the_travel() {
    let ran = run(Mistakes { is_position_reversed: true, ..Mistakes::default() });
    let (step, finding) = ran.failure();
    assert_eq!(step, Step::Release, "{finding:?}");
    assert!(matches!(finding, Finding::PositionReversed(_)), "{finding:?}");
    assert!(ran.moved() < Settings::default().release_movement, "{}", ran.moved());
    for position_scale in [0.9, 1.1] {
        let ran = run(Mistakes { position_scale, ..Mistakes::default() });
        let (step, finding) = ran.failure();
        assert!(step == Step::Travel && matches!(finding, Finding::Scale(_)), "{finding:?}");
        let s = Settings::default();
        let bound = s.release_movement + s.travel + s.travel_deviation;
        assert!(ran.moved() < bound, "{}", ran.moved());
    }
}

#[test]
fn without_a_pressure_margin_below_the_load_the_polarity_is_skipped_with_the_reason() {
    let ran = run_with(Mistakes::default(), |s| (s.pressure_margin, s.draining) = (500e5, 0.5));
    let outcome = ran.sequence.outcomes()[Step::Polarity.place()];
    assert!(
        matches!(outcome, Some(Outcome::Skipped(Reason::PressureMarginTooSmall(_)))),
        "{outcome:?}"
    );
    assert!(ran.sequence.has_passed());
}

#[test]
fn the_record_is_valid_for_what_was_commissioned_only() {
    let path = std::env::temp_dir().join(format!("commissioning-{}.toml", std::process::id()));
    let ran = run(Mistakes::default());
    let basis = Basis {
        crane: Description::uia_single_boom().unwrap().digest(),
        bus_table: String::new(),
        devices: Vec::new(),
        version: "0".into(),
        is_simulated: true,
    };
    std::fs::write(&path, record::text(&basis, "virtual", "2026-01-01T00:00:00Z", &ran.sequence))
        .unwrap();
    assert!(record::check(&path, &basis).is_ok());
    let mut other = Description::uia_single_boom().unwrap();
    other.set("payload.mass_kg=300").unwrap();
    let changed = Basis { crane: other.digest(), ..basis.clone() };
    let said = record::check(&path, &changed).unwrap_err().to_string();
    assert!(said.contains("the crane file"), "{said}");
    // of a simulated machine it is no record of a real one
    let real = Basis { is_simulated: false, ..basis.clone() };
    assert!(record::check(&path, &real).unwrap_err().to_string().contains("real"));
    let text = std::fs::read_to_string(&path).unwrap();
    let (_, after) = text.split_once("pressure_rise_bar = ").unwrap();
    let value = after.lines().next().unwrap();
    let found = format!("pressure_rise_bar = {value}");
    assert_eq!(text.matches(&found).count(), 1);
    std::fs::write(&path, text.replace(&found, "pressure_rise_bar = 42.0")).unwrap();
    let said = record::check(&path, &basis).unwrap_err().to_string();
    assert!(said.contains("changed after it was written"), "{said}");
    let failed = run(Mistakes { is_watchdog_off: true, ..Mistakes::default() });
    std::fs::write(&path, record::text(&basis, "virtual", "", &failed.sequence)).unwrap();
    let said = record::check(&path, &basis).unwrap_err().to_string();
    assert!(said.contains("watchdog failed"), "{said}");
    std::fs::remove_file(&path).unwrap();
}

#[test]
fn a_person_ends_it_at_once_and_the_load_is_held() {
    let model = Description::uia_single_boom().unwrap();
    let limits = limits(&model, model.numbers.slow).unwrap();
    for at in [Step::Watchdog, Step::Release, Step::Travel, Step::StopDistance] {
        let mut sequence = Sequence::new(limits, Settings::default(), true);
        let crane = Description::uia_virtual().unwrap();
        let mut machine = SimulatedMachine::new(&crane, Mistakes::default()).unwrap();
        let person = Person::default();
        let mut periods = 0;
        run_simulated(&mut sequence, &mut machine, false, &person, &mut |sequence, _| {
            let is_started = sequence.prompt().is_none();
            periods += u32::from(is_started && sequence.step() == at);
            if periods == 200 {
                person.end();
            }
        })
        .unwrap();
        let outcome = sequence.outcomes()[at.place()];
        assert_eq!(outcome, Some(Outcome::Failed(Finding::Ended)), "{at:?}");
        (0..300).for_each(|_| machine.advance().unwrap());
        let truth = machine.crane().truth();
        assert!(truth.motor_speed.abs() < 1e-3 && truth.pilot < 0.5, "{at:?}");
    }
}

/// A sequence, its machine and the periods since the last reset; none before it.
struct Driven {
    sequence: Sequence,
    machine: SimulatedMachine,
    since_reset: Option<u32>,
    /// Periods for which the present prompt has been shown.
    asked: u32,
    /// Whether the last command turned the motor, and whether it was followed by none.
    is_turning: bool,
    is_withheld: bool,
}

/// Runs a sequence until it is over. `see` may change the measurement of a period, and decides whether the prompt is
/// confirmed in it; none leaves that to the simulated operator.
fn drive(
    change: impl Fn(&mut Settings),
    mut see: impl FnMut(&Driven, &mut Incoming) -> Option<bool>,
) -> Driven {
    let model = Description::uia_single_boom().unwrap();
    let mut settings = Settings { listening: 0.5, ..Settings::default() };
    change(&mut settings);
    let limits = limits(&model, model.numbers.slow).unwrap();
    let crane = Description::uia_virtual().unwrap();
    let mut driven = Driven {
        sequence: Sequence::new(limits, settings, true),
        machine: SimulatedMachine::new(&crane, Mistakes::default()).unwrap(),
        since_reset: None,
        asked: 0,
        is_turning: false,
        is_withheld: false,
    };
    let elapsed = driven.machine.crane().period();
    for number in 1..60_000 {
        let is_answered = driven.machine.answer(driven.sequence.prompt());
        let mut incoming = driven.machine.read().unwrap();
        let is_confirmed = see(&driven, &mut incoming).unwrap_or(is_answered);
        let now =
            Now { elapsed, incoming: Some(incoming), missed: 0, is_confirmed, is_ended: false };
        let prompt = driven.sequence.prompt();
        driven.since_reset = driven.since_reset.map(|periods| periods + 1);
        let sent = match driven.sequence.period(&now) {
            Action::Send(outgoing) => Some(outgoing),
            Action::Withhold => None,
            Action::Reset(outgoing) => {
                driven.since_reset = Some(0);
                driven.machine.reset_by_a_person();
                Some(outgoing)
            }
        };
        driven.asked = if driven.sequence.prompt() == prompt { driven.asked + 1 } else { 0 };
        driven.is_withheld = sent.is_none();
        match sent {
            Some(outgoing) => {
                driven.is_turning = outgoing.command.axes[0].motor_speed != 0.0;
                driven.machine.write(number, &outgoing);
            }
            None => driven.machine.withhold(),
        }
        driven.machine.advance().unwrap();
        if driven.sequence.is_over() {
            break;
        }
    }
    driven
}

#[test]
fn commands_that_the_connection_misses_are_named_and_not_blamed_on_the_drive() {
    let mut turning = 0;
    let driven = drive(
        |_| (),
        |driven, incoming| {
            let is_polarity = driven.sequence.step() == Step::Polarity;
            turning += u32::from(is_polarity && driven.is_turning);
            // the connection stops the motor in the middle of the slow turn, and reports that
            if turning > 50 {
                incoming.link = Some(Link { commands_lost: true, ..Link::default() });
            }
            None
        },
    );
    let failed = driven.sequence.outcomes()[Step::Polarity.place()];
    assert_eq!(failed, Some(Outcome::Failed(Finding::CommandsLate)));
    assert!(driven.machine.moved().abs() < 0.2e-3);
}

#[test]
fn a_wrong_factor_of_the_motors_command_is_found_within_a_few_periods() {
    let model = Description::uia_single_boom().unwrap();
    let settings = Settings { listening: 0.5, ..Settings::default() };
    let limits = limits(&model, model.numbers.slow).unwrap();
    let allowed = (1.0 + settings.speed_tolerance) * limits.release.slow;
    let mut sequence = Sequence::new(limits, settings, true);
    let crane = Description::uia_virtual().unwrap();
    let mistakes = Mistakes { motor: 60.0, ..Mistakes::default() };
    let mut machine = SimulatedMachine::new(&crane, mistakes).unwrap();
    let (mut too_fast, mut moved) = (0, 0.0_f64);
    let person = Person::default();
    run_simulated(&mut sequence, &mut machine, false, &person, &mut |sequence, machine| {
        let is_running = sequence.outcomes()[Step::Watchdog.place()].is_none();
        let speed = machine.crane().truth().motor_speed.abs();
        too_fast += u32::from(is_running && speed > allowed);
        moved = moved.max(machine.moved().abs());
    })
    .unwrap();
    let failed = sequence.outcomes()[Step::Watchdog.place()];
    assert!(matches!(failed, Some(Outcome::Failed(Finding::MotorDoesNotFollow(_)))), "{failed:?}");
    // a measurement is a period of the fieldbus old
    assert!((1..=4).contains(&too_fast), "{too_fast} periods above {allowed} rev/s");
    (0..300).for_each(|_| machine.advance().unwrap());
    assert!(moved.max(machine.moved().abs()) < 0.2e-3, "{moved} m");
    assert!(machine.crane().truth().motor_speed.abs() < 1e-3);
}

#[test]
fn a_reset_starts_no_motion_and_neither_does_its_second_enter() {
    let mut turned = 0;
    let driven = drive(
        |s| s.starting = 2.0,
        |driven, _| {
            turned += u32::from(driven.is_turning);
            // the operator resets, presses Enter again, and starts nothing
            match driven.since_reset {
                None => None,
                Some(periods) => {
                    let is_asked = driven.sequence.prompt().is_some_and(Prompt::is_confirmed);
                    Some(is_asked && periods < 500)
                }
            }
        },
    );
    let failed = driven.sequence.outcomes()[Step::Watchdog.place()];
    assert_eq!(failed, Some(Outcome::Failed(Finding::NotStarted(2.0))));
    assert_eq!(turned, 0, "the motor was commanded after a reset");
    assert!(driven.machine.moved().abs() < 0.2e-3);
}

#[test]
fn each_motion_with_the_valve_shut_and_the_release_are_started_by_the_operator() {
    let mut asked = Vec::new();
    let driven = drive(
        |_| (),
        |driven, _| {
            let prompt = driven.sequence.prompt();
            assert!(prompt.is_none() || !driven.is_turning, "{prompt:?} while the motor turns");
            if let Some(prompt) = prompt
                && !asked.contains(&prompt)
            {
                asked.push(prompt);
            }
            None
        },
    );
    assert!(driven.sequence.has_passed());
    for start in [Prompt::StartWatchdog, Prompt::StartPolarity, Prompt::StartRelease] {
        assert!(asked.contains(&start), "{start:?}: {asked:?}");
    }
}

#[test]
fn measurements_are_checked_while_a_reset_is_awaited_and_while_commands_are_withheld() {
    let move_it = |incoming: &mut Incoming| incoming.measurement.axes[0].signals.stroke += 2e-3;
    let awaiting = drive(
        |_| (),
        |driven, incoming| {
            let is_asked = driven.sequence.prompt() == Some(Prompt::CloseStopCircuit);
            if is_asked && driven.asked > 10 {
                move_it(incoming);
            }
            is_asked.then_some(false)
        },
    );
    let withheld = drive(
        |_| (),
        |driven, incoming| {
            if driven.is_withheld {
                move_it(incoming);
            }
            None
        },
    );
    for (driven, step) in [(awaiting, Step::StopCircuit), (withheld, Step::Watchdog)] {
        let failed = driven.sequence.outcomes()[step.place()];
        assert!(matches!(failed, Some(Outcome::Failed(Finding::Moved(_)))), "{failed:?}");
    }
}

#[test]
fn an_opening_that_the_machine_does_not_explain_is_shown_to_the_operator_with_its_code() {
    let mut shown = None;
    let driven = drive(
        |s| s.resetting = 2.0,
        |driven, incoming| {
            if driven.sequence.prompt() == Some(Prompt::CloseStopCircuit) {
                shown = shown.or(driven.sequence.machine_code());
                // the operator does not confirm that the emergency stop was the cause
                return Some(false);
            }
            if incoming.status == Some(MachineStatus::Fault { code: 6 }) {
                incoming.status = Some(MachineStatus::Fault { code: 5 });
            }
            None
        },
    );
    assert_eq!(shown, Some(5));
    let text = Prompt::CloseStopCircuit.text(shown);
    assert!(text.contains("fault code 5") && text.contains("Was the emergency stop the cause?"));
    let failed = driven.sequence.outcomes()[Step::StopCircuit.place()];
    assert!(matches!(failed, Some(Outcome::Failed(Finding::NotReset(_)))), "{failed:?}");
}
