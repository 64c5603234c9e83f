//! Commissioning over the simulated bus, with the virtual crane behind its devices.

use crate::bench::{Behind, SimulatedLink, segment, table};
use hydroboom_description::Description;
use hydroboom_design::limits;
use hydroboom_device_simulator::applications::SAFE_TORQUE_OFF;
use hydroboom_device_simulator::device::State;
use hydroboom_fieldbus::bus::Bus;
use hydroboom_fieldbus::check::DeviceFacts;
use hydroboom_fieldbus::start_up::InitialState;
use hydroboom_realtime::commissioning::finding::Outcome;
use hydroboom_realtime::commissioning::sequence::{Action, Now, Sequence};
use hydroboom_realtime::commissioning::settings::Settings;
use hydroboom_realtime::commissioning::step::{Prompt, Step};
use hydroboom_realtime::machine::Machine;
use hydroboom_virtual_crane::VirtualCrane;
use std::cell::RefCell;
use std::rc::Rc;

/// Place of the drive on the bus.
const DRIVE: usize = 1;
/// Periods that the operator takes.
const REACTION: u32 = 300;

/// A sequence at its end, and the largest true way of the piston \[m\].
fn commissioned() -> (Sequence, f64) {
    let model = Description::uia_single_boom().unwrap();
    let mut crane = Description::uia_virtual().unwrap();
    crane.set("fieldbus.delay_cycles=0").unwrap();
    let mut start = crane.start(crane.numbers.motion_start);
    start.preload = 0.0;
    let crane = VirtualCrane::new(&crane, &start).unwrap();
    let behind = Rc::new(RefCell::new(Behind { crane: Some(crane), ..Behind::default() }));
    let stroke = || behind.borrow().crane.as_ref().unwrap().truth().outputs.stroke;
    let begin = stroke();
    let link = SimulatedLink::new(segment(&behind, |_, _| {}));
    let mut bus = Bus::start_in(InitialState::SafeOp, table(|_| {}), link).unwrap();
    let mut machine = bus.take_machine().unwrap();
    let settings = Settings { listening: 1.0, ..Settings::default() };
    let limits = limits(&model, settings.travel_speed).unwrap();
    let mut sequence = Sequence::new(limits, settings, !bus.facts().is_empty());
    let (mut number, mut asked, mut largest) = (0, 0, 0.0_f64);
    while !sequence.is_over() {
        if matches!(sequence.step(), Step::Identity | Step::Listening) {
            let devices = bus.link_mut().segment.devices_mut();
            assert!(devices.iter().all(|device| device.state().0 == State::SafeOp));
        }
        bus.measure();
        asked = if sequence.prompt().is_some() { asked + 1 } else { 0 };
        let is_due = asked % REACTION == REACTION - 1;
        let mut open = |value| {
            let drive = &mut bus.link_mut().segment.devices_mut()[DRIVE];
            drive.dictionary.set_number(SAFE_TORQUE_OFF, value);
        };
        match sequence.prompt().filter(|_| is_due) {
            Some(Prompt::OpenStopCircuit) => open(1),
            Some(Prompt::CloseStopCircuit) => open(0),
            // a reset and a start need the confirmation alone
            _ => {}
        }
        let action = sequence.period(&Now {
            elapsed: 1e-3,
            incoming: machine.read(),
            missed: 0,
            is_confirmed: is_due && sequence.prompt().is_some_and(Prompt::is_confirmed),
            is_ended: false,
        });
        number += 1;
        match action {
            Action::Send(outgoing) => machine.write(number, &outgoing),
            Action::Withhold => machine.withhold(),
            Action::Reset(outgoing) => {
                Machine::reset_by_a_person(&mut machine);
                machine.write(number, &outgoing);
            }
        }
        behind.borrow_mut().advance();
        bus.act();
        if bus.is_restart_due() {
            bus = bus.restart_by_a_person().unwrap();
        }
        largest = largest.max((stroke() - begin).abs());
        assert!(number < 60_000, "{:?}: {:?}, {bus:?}", sequence.step(), sequence.prompt());
    }
    (sequence, largest)
}

#[test]
fn the_devices_are_commissioned_with_frames_withheld_and_a_restart_by_a_person() {
    let (sequence, largest) = commissioned();
    let (outcomes, q) = (sequence.outcomes(), sequence.quantities());
    for (step, outcome) in Step::ALL.iter().zip(outcomes) {
        assert_eq!(*outcome, Some(Outcome::Passed), "{step:?}: {q:?}");
    }
    // no frame, no measurement: the first one after the restart shows the motor at rest
    assert!(q.watchdog.is_nan() && q.stop_circuit_code == 6.0, "{q:?}");
    // the table's delay is one period; it is counted from the measurement's SYNC0
    assert!((q.delay - 1.0).abs() < 0.5, "{q:?}");
    let s = Settings::default();
    assert!(largest < s.release_movement + s.travel + s.travel_deviation, "{largest}");
}

#[test]
fn devices_say_that_they_are_simulated_and_which_software_they_have() {
    let behind = Rc::new(RefCell::new(Behind::default()));
    let link = SimulatedLink::new(segment(&behind, |drive, _| drive.software = "2.17".into()));
    let bus = Bus::start(table(|_| {}), link).unwrap();
    assert!(bus.facts().iter().all(DeviceFacts::is_simulated), "{:?}", bus.facts());
    assert_eq!(bus.facts()[DRIVE].software.as_deref(), Some("2.17"));
    assert_eq!(bus.facts()[DRIVE].serial, 7);
    // a coupler has no mailbox
    assert_eq!(bus.facts()[0].software, None);
    let real = DeviceFacts { name: "drive".into(), ..DeviceFacts::default() };
    assert!(!real.is_simulated());
}
