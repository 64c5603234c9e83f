//! The digest of a machine.

use hydroboom_description::{Description, UIA_SINGLE_BOOM};

fn digest(text: &str) -> String {
    Description::parse("test.toml", text).expect("a crane").digest()
}

#[test]
fn a_digest_depends_on_the_machine_and_not_on_its_file() {
    let whole = digest(UIA_SINGLE_BOOM);
    assert!(whole.len() == 64 && whole.chars().all(|c| c.is_ascii_hexdigit()), "{whole}");
    // sections in reverse order, without comments
    let mut sections: Vec<String> = Vec::new();
    for line in UIA_SINGLE_BOOM.lines().filter(|line| !line.starts_with('#')) {
        match (line.starts_with('['), sections.last_mut()) {
            (false, Some(section)) => *section += &format!("{line}\n"),
            (false, None) => {}
            (true, _) => sections.push(format!("{line}\n")),
        }
    }
    sections.reverse();
    assert_eq!(digest(&sections.concat()), whole);
    for (from, to) in [
        ("name = \"UiA single boom\"", "name = \"another\""),
        ("source = \"Table 4, m\"", "source = \"scales\""),
        ("range = [0.0, 370.0], ", ""),
        ("value = 307.0,", "value = 3.07e2,"),
        ("segments           = 3", "segment_lengths_mm = [1200, 1200, 1200]"),
        // an omitted key equals the same key at its default
        ("[motion]", "[supervision]\npressure_bar = 200\n[motion]"),
        ("[crane]", "[circuit]\ntype = \"self-contained\"\n[crane]"),
    ] {
        assert!(UIA_SINGLE_BOOM.contains(from), "{from}");
        assert_eq!(digest(&UIA_SINGLE_BOOM.replacen(from, to, 1)), whole, "{from}");
    }
    assert_eq!(Description::uia_single_boom().unwrap().digest(), whole);
}

#[test]
fn another_machine_has_another_digest() {
    let crane = Description::uia_single_boom().unwrap();
    let mut digests = vec![crane.digest()];
    for assignment in [
        "payload.mass_kg=307.0000001",
        "drive.bandwidth_hz=50",
        "friction.law=lugre",
        "switching_valve.position_switch=fitted",
        "holding_valve.check_function=none",
        "boom.segments=4",
        "boom.segment_lengths_mm=1200,1200,1201",
        "supervision.pressure_bar=210",
    ] {
        let mut changed = crane.clone();
        changed.set(assignment).unwrap();
        digests.push(changed.digest());
    }
    digests.push(Description::uia_virtual().unwrap().digest());
    digests.push(Description::patu_lift().unwrap().digest());
    let count = digests.len();
    digests.sort();
    digests.dedup();
    assert_eq!(digests.len(), count);
}
