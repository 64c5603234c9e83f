//! What commands print of cranes that differ from the paper's, read as a sceptical engineer would.

#[path = "support/command.rs"]
mod command;

use command::{hydroboom, parsed};

/// What it prints, as text; it has to succeed.
fn said(arguments: &[&str]) -> String {
    let output = hydroboom(arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

#[test]
fn the_papers_columns_stand_beside_no_crane_with_other_values() {
    assert!(said(&["eigen", "--stroke-mm", "200"]).contains("paper measured"));
    assert!(said(&["eigen", "--stroke-mm", "200", "--set", "boom.segments=5"]).contains("paper"));
    for other in ["payload.mass_kg=60", "cylinder.piston_mm=100", "payload.x_mm=9000"] {
        let text = said(&["eigen", "--stroke-mm", "200", "--set", other]);
        assert!(!text.contains("paper") && !text.contains("Table 5"), "{other}: {text}");
    }
}

/// The simulation feedforward of a light load on a plant with a heavy one runs into the end stop; the others do not.
#[test]
fn a_run_that_stops_is_a_row_that_says_so_and_the_rest_stands() {
    let arguments = [
        "motion",
        "--gains-as-given",
        "--set",
        "payload.mass_kg=60",
        "--plant-set",
        "payload.mass_kg=316",
    ];
    let text = said(&arguments);
    let row = |strategy: &str| text.lines().find(|line| line.starts_with(strategy)).unwrap();
    assert_eq!(row("simulation-feedforward-open-loop").matches("stopped").count(), 2, "{text}");
    assert!(!row("benchmark-closed-loop").contains("stopped"), "{text}");
    let remark = "simulation-feedforward-open-loop on changed at 25 mm/s: STOPPED: at t = ";
    assert!(text.contains(remark) && text.contains("a pressure rose above 1000 bar"), "{text}");
    assert!(!text.contains("NaN") && !text.contains("inf "), "{text}");
    let json = parsed(&[&arguments[..], &["--json"]].concat());
    let rows = json["motion"].as_array().unwrap();
    assert_eq!(rows.len(), 10);
    for row in rows {
        let stopped = !row["stopped"].is_null();
        assert_eq!(row["rms_true_mm"].is_null(), stopped, "{row}");
        assert!(!stopped || row["stable"] == false, "{row}");
    }
    assert!(rows.iter().any(|row| !row["stopped"].is_null()));
}
