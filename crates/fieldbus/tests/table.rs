//! The table: the page's example is right, and what is wrong is told with its place.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up has failed")]

use hydroboom_fieldbus::table::Table;

const PAGE: &str = include_str!("../../../docs/reference/ethercat-table.md");

fn example() -> &'static str {
    PAGE.split_once("```toml\n").unwrap().1.split_once("```").unwrap().0
}

/// What is told of the example with a replacement, which is on a line of it.
fn told(from: &str, to: &str) -> (String, String) {
    let at = example().find(from).unwrap_or_else(|| panic!("{from} is in the example"));
    let line = example()[..at].lines().count() + usize::from(example()[..at].ends_with('\n'));
    let text = example().replacen(from, to, 1);
    let error = Table::parse("bus.toml", &text).unwrap_err();
    (error.to_string(), format!("bus.toml:{line}: "))
}

#[test]
fn the_pages_example_is_right_and_its_places_and_delay_are_as_they_stand_there() {
    let table = Table::parse("bus.toml", example()).unwrap();
    assert_eq!(table.bus.delay(), 1);
    let sizes: Vec<_> = table.devices.iter().map(|d| (d.output_bytes(), d.input_bytes())).collect();
    assert_eq!(sizes, [(0, 0), (7, 13), (0, 24), (1, 0)]);
    let pressure = table.measured.iter().find(|row| row.signal == 2).unwrap();
    assert_eq!((pressure.place.bit, pressure.scale.value(0)), (80, -1e5));
    assert!((pressure.scale.value(32767) - 249e5).abs() < 1.0);
    let drive = &table.drives[0];
    assert_eq!((drive.target.bit, drive.error.map(|place| place.bit)), (16, Some(56)));
}

#[test]
fn each_problem_is_told_with_line_key_what_was_read_and_what_is_allowed() {
    for (from, to, parts) in [
        ("period_us       = 1000", "period_us = 100", ["bus.period_us", "100", "250 to 10000"]),
        ("exchanges       = 2", "exchanges = 3", ["bus.exchanges", "3", "1 to 2"]),
        ("send_us         = 700", "send_us = 100", ["bus.send_us", "100", "101 to 999"]),
        (
            "watchdog_ms  = 20",
            "watchdog_ms = 1",
            ["device[2].watchdog_ms", "1 was read", "2 to 6500"],
        ),
        ("revision     = [1, 3]", "revision = [3, 1]", ["device[2].revision", "3 to 1", "lowest"]),
        (
            "value = 2, reason",
            "value = 70000, reason",
            ["device[2].sdo[1].value", "70000", "0 to 65535"],
        ),
        (
            "device     = \"drive\"",
            "device = \"drvie\"",
            ["commanded[1].device", "drvie", "coupler, drive"],
        ),
        (
            "entry      = [0x60ff, 0]",
            "entry = [0x60fe, 0]",
            ["commanded[1].entry", "0x60FE:00", "PDOs of drive"],
        ),
        ("type       = \"bool\"", "type = \"u8\"", ["commanded[2].type", "8 bit", "1 bit"]),
        (
            "factor     = 1.6666666666666667e-5",
            "factor = -1.0",
            ["commanded[1].factor", "-1", "`sign`"],
        ),
        (
            "range      = [-80.0, 80.0]",
            "range = [80.0, -80.0]",
            ["measured[1].range", "80 to -80", "lowest"],
        ),
        (
            "signal     = \"stroke_m\"",
            "signal = \"stroke\"",
            ["measured[2].signal", "stroke", "stroke_m"],
        ),
        (
            "name         = \"drive\"",
            "name = \"coupler\"",
            ["device[2].name", "coupler", "no device before"],
        ),
    ] {
        let (error, place) = told(from, to);
        let first = error.lines().find(|line| line.starts_with(&place));
        let line = first.unwrap_or_else(|| panic!("{place} is not in: {error}"));
        for part in parts {
            assert!(line.contains(part), "{part} is not in: {line}");
        }
    }
}

#[test]
fn the_same_table_is_read_from_a_crane_file_which_stays_one_and_problems_have_their_lines() {
    let crane = hydroboom_description::UIA_SINGLE_BOOM;
    let inside = format!("\n{}", example())
        .replace("\n[[", "\n[[machine.ethercat.")
        .replace("\n[bus]", "\n[machine.ethercat.bus]");
    let text = format!("{crane}\n{inside}");
    let read = Table::parse_in_crane_file("crane.toml", &text).unwrap();
    assert_eq!(read, Some(Table::parse("bus.toml", example()).unwrap()));
    assert_eq!(Table::parse_in_crane_file("crane.toml", crane).unwrap(), None);
    let described = hydroboom_description::Description::parse("crane.toml", &text).unwrap();
    assert_eq!(
        described.digest(),
        hydroboom_description::Description::uia_single_boom().unwrap().digest()
    );
    let wrong = text.replace("exchanges       = 2", "exchanges = 3");
    let line = 1 + wrong.split_once("exchanges = 3").unwrap().0.matches('\n').count();
    let told = Table::parse_in_crane_file("crane.toml", &wrong).unwrap_err().to_string();
    assert!(
        told.starts_with(&format!("crane.toml:{line}: machine.ethercat.bus.exchanges: 3 was read")),
        "{told}"
    );
}

#[test]
fn what_toml_does_not_have_is_told_with_its_line() {
    for (from, to, part) in [
        ("sync     = \"none\"", "sync = \"sync2\"", "sync01"),
        ("vendor   = 0x0fff", "vendor = \"Maker\"", "u32"),
        ("vendor   = 0x0fff", "vendro = 1", "vendor"),
    ] {
        let (error, place) = told(from, to);
        let line = place.trim_start_matches("bus.toml:").trim_end_matches(": ");
        assert!(error.starts_with("bus.toml: "), "{error}");
        assert!(error.contains(&format!("line {line}")) && error.contains(part), "{error}");
    }
}

#[test]
fn a_signal_that_no_controller_can_do_without_is_missed() {
    let (error, _) = told("signal     = \"pressure_a_pa\"", "signal = \"holding_valve_open\"");
    assert!(error.contains("pressure_a_pa of axis 0 is missing"), "{error}");
}
