//! What is told when a bus does not start.

use crate::bench::{Shared, SimulatedLink, segment, table};
use hydroboom_device_simulator::applications::VelocityUnit;
use hydroboom_device_simulator::device::Fault as DeviceFault;
use hydroboom_device_simulator::object_dictionary::{Abort, Mapping, ObjectAccess};
use hydroboom_fieldbus::bus::Bus;
use hydroboom_fieldbus::table::{Sync, Table};

/// Why a table does not start on the devices of the page's table.
fn refusal(change: impl FnOnce(&mut Table)) -> String {
    refusal_of(change, |_| {})
}

fn refusal_of(change: impl FnOnce(&mut Table), act: impl FnOnce(&mut SimulatedLink)) -> String {
    let mut link = SimulatedLink::new(segment(&Shared::default(), |_, _| {}));
    act(&mut link);
    Bus::start(table(change), link).expect_err("it does not start").to_string()
}

fn one_sentence_with(sentence: &str, parts: &[&str]) {
    assert_eq!(sentence.lines().count(), 1, "{sentence}");
    for part in parts {
        assert!(sentence.contains(part), "{part} is not in: {sentence}");
    }
}

#[test]
fn each_mismatch_is_one_sentence_with_what_to_do() {
    one_sentence_with(
        &refusal(|t| t.devices[1].product = 9),
        &["position 1", "drive", "0x00000009", "order"],
    );
    one_sentence_with(
        &refusal(|t| t.devices[2].revision = [5, 6]),
        &["position 2", "0x00000001", "0x00000005", "widen"],
    );
    one_sentence_with(
        &refusal(|t| t.devices.truncate(3)),
        &["4 devices answer", "the table has 3", "cables"],
    );
    let mapping = refusal(|t| {
        t.devices[2].inputs[0].entries.pop();
    });
    one_sentence_with(&mapping, &["inputs (position 2)", "0x1C13", "mapping = \"written\""]);
    let eeprom = refusal(|t| {
        t.devices[3].outputs[0].entries.pop();
    });
    one_sentence_with(&eeprom, &["outputs (position 3)", "correct the table"]);
    let unit = refusal(|t| t.measured[0].scale.factor *= 60.0);
    one_sentence_with(&unit, &["0x606C", "0x60A9", "drive", "drive's unit"]);
    let mode = refusal_of(
        |_| {},
        |link| link.segment.devices_mut()[1].dictionary.set_number((0x6502, 0), 0x01),
    );
    one_sentence_with(&mode, &["drive (position 1)", "0x6502 is 0x00000001", "another drive"]);
}

#[test]
fn an_activation_that_the_device_does_not_have_is_told() {
    let link = SimulatedLink::new(segment(&Shared::default(), |settings, _| {
        settings.synchronisation.has_sync1 = false;
    }));
    let table = table(|t| t.devices[1].sync = Sync::Sync01(1_000_000));
    let told = Bus::start(table, link).unwrap_err().to_string();
    one_sentence_with(&told, &["drive (position 1)", "0x0300", "0x0700", "SYNC0 and SYNC1"]);
}

#[test]
fn units_in_increments_are_read_from_their_objects() {
    let start = |factor: f64, feed: Option<u32>| {
        let mut link = SimulatedLink::new(segment(&Shared::default(), |_, drive| {
            drive.unit =
                VelocityUnit::Increments { per_revolution: 65536, gear: [3, 2], factor: [10, 1] };
        }));
        let dictionary = &mut link.segment.devices_mut()[1].dictionary;
        // feed constant: units of position per revolutions of the shaft
        for (sub, value) in feed.into_iter().flat_map(|feed| [(1, feed), (2, 1)]) {
            let (key, bytes) = ((0x6092, sub), value.to_le_bytes());
            dictionary.add(key, &bytes, ObjectAccess::ReadOnly, Mapping::None);
        }
        let table = table(|t| {
            t.commanded[0].scale.factor = factor;
            t.measured[0].scale.factor = -factor;
        });
        Bus::start(table, link)
    };
    // 1.5 turns of the motor for one of the shaft, tenths of increments
    let right = 1.5 / 10.0 / 65536.0;
    for increments in [None, Some(65536)] {
        assert!(start(right, increments).is_ok());
        let told = start(1.1 * right, increments).unwrap_err().to_string();
        assert_eq!(told.lines().count(), 2, "{told}");
        assert!(told.contains("0x60FF") && told.contains("0x606C"), "{told}");
    }
    // other units of position: the unit of velocity is not stated, and nothing is refused
    assert!(start(1.1 * right, Some(360)).is_ok());
}

#[test]
fn a_refused_sdo_a_stuck_mailbox_and_an_emergency_are_told_with_the_sdo_and_its_reason() {
    let abort = DeviceFault::SdoAbort((0x1c32, 1), Abort::ReadOnly);
    let told = refusal_of(|_| {}, |link| link.segment.devices_mut()[1].inject(abort, 0));
    one_sentence_with(
        &told,
        &["0x1C32:01", "outputs are applied at SYNC0", "drive (position 1)", "read only"],
    );
    let told = refusal_of(
        |_| {},
        |link| link.segment.devices_mut()[1].inject(DeviceFault::MailboxNotServed, 0),
    );
    one_sentence_with(&told, &["0x1C32:01", "drive (position 1)", "timeout"]);
    // ethercrab 0.7.1 panics on these
    for code in [0x3220, 0x7320, 0x5441] {
        let told = refusal_of(|_| {}, |link| link.emergency = Some(code));
        one_sentence_with(&told, &["0x1C32:01", "drive (position 1)", "emergency", "remove"]);
    }
}

#[test]
fn a_device_that_refuses_a_state_is_named_with_its_reason() {
    // without 0x1C32 the drive does not take SYNC0
    let told = refusal(|t| t.devices[1].start_up.retain(|value| value.index != 0x1c32));
    one_sentence_with(&told, &["SAFEOP", "drive (position 1)", "0x0030"]);
    // nothing is there
    let told = refusal_of(|_| {}, |link| link.segment.connect(0));
    assert!(told.contains("cable"), "{told}");
}
