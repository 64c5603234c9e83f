//! JSON of the commands and its schemas, docs/reference/json.
//!
//! Every test that parses a command's JSON compares it with the schema. Here are the commands whose JSON no other test
//! parses, and those that take long, which are ignored:
//!
//! ```sh
//! cargo test -p hydroboom --test integration json_schemas -- --include-ignored
//! ```

use crate::support::command::{files, folder, hydroboom, parsed};
use crate::support::json_schema::{COMMAND, Shape, file, is_writing, known};
use crate::support::short_crane::short_crane;
use serde_json::{Value, json};
use std::collections::BTreeSet;

/// Commands with `--json`, as the program's help lists them, below these words.
fn commands_with_json(words: &[&str]) -> Vec<String> {
    let help = hydroboom(&[words, &["--help"]].concat());
    let help = String::from_utf8(help.stdout).unwrap();
    let list = help.lines().skip_while(|line| *line != "Commands:").skip(1);
    // a name has two spaces before it, further lines of its description have more
    let names: Vec<&str> = list
        .take_while(|line| !line.is_empty())
        .filter_map(|line| line.strip_prefix("  "))
        .filter(|line| !line.starts_with(' '))
        .filter_map(|line| line.split_whitespace().next())
        .filter(|name| *name != "help")
        .collect();
    let is_with_json = help.lines().any(|line| line.trim_start().starts_with("--json"));
    let below = names.iter().flat_map(|name| commands_with_json(&[words, &[*name]].concat()));
    is_with_json.then(|| words.join(" ")).into_iter().chain(below).collect()
}

#[test]
fn every_command_with_json_has_a_schema_and_a_row_on_the_page() {
    // other tests are writing them
    if is_writing() {
        return;
    }
    let commands = commands_with_json(&[]);
    for wanted in ["check", "log inspect", "export closed-loop", "run"] {
        assert!(commands.iter().any(|command| command == wanted), "{wanted}: {commands:?}");
    }
    let page = include_str!("../../../../docs/reference/json.md");
    let mut schemas = BTreeSet::new();
    for command in &commands {
        let name = file(command).file_name().unwrap().to_str().unwrap().to_string();
        let row = format!("| `{command}` | [{name}](json/{name}) |");
        assert!(page.contains(&row), "docs/reference/json.md lacks the row {row}");
        let schema = known(command);
        let title = schema.as_ref().map(|schema| schema["title"].clone());
        let wanted = Value::String(format!("hydroboom {command} --json"));
        assert_eq!(title, Some(wanted), "no schema {name}. This writes all:\n{COMMAND}");
        schemas.insert(name);
    }
    let folder = file("any").parent().unwrap().to_path_buf();
    let written = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name());
    let written: BTreeSet<String> = written.map(|name| name.into_string().unwrap()).collect();
    assert_eq!(written, schemas, "schemas of commands that there are not");
}

#[test]
fn a_schema_refuses_other_types_and_missing_and_new_keys() {
    let shape = Shape::of(&json!({ "rms_mm": [0.5], "count": 3, "note": null, "rows": [] }))
        .merged(Shape::of(
            &json!({ "rms_mm": [], "count": 4, "note": null, "rows": [], "more": "a" }),
        ));
    assert_eq!(Shape::read(&shape.schema("")), shape);
    let refused = |value: Value| shape.refuses(&Shape::of(&value), "$");
    // a number that is not finite is printed as null; of what was always null or empty nothing is known
    let fits = json!({ "rms_mm": [1.5, null], "count": 0, "note": "new", "rows": [true] });
    assert!(refused(fits.clone()).is_empty(), "{:?}", refused(fits));
    let other = json!({ "rms_mm": ["0.5"], "count": 0.5, "note": null, "rows": [], "unit": 1 });
    let found = refused(other);
    for wanted in ["$.rms_mm[] is string", "$.count is number", "$ has a new key unit"] {
        assert!(found.iter().any(|line| line == wanted), "{wanted}: {found:?}");
    }
    let lacks = refused(json!({ "count": 0, "note": null, "rows": [] }));
    assert_eq!(lacks, ["$ has no rms_mm"]);
    let schema = shape.schema("");
    assert_eq!(schema["properties"]["rms_mm"]["items"]["unit"], "mm");
    assert_eq!(schema["required"], json!(["count", "note", "rms_mm", "rows"]));
}

#[test]
fn commands_on_a_crane_file_print_what_their_schemas_state() {
    let path = files("json-crane");
    let [crane, lift] = ["crane.toml", "lift.toml"].map(&path);
    assert_eq!(parsed(&["new", &crane, "--json"])["written"], crane);
    parsed(&["new", &lift, "--circuit", "valve-controlled", "--json"]);
    parsed(&["simulate", "--hold-s", "0.3", "--json"]);
    parsed(&["simulate", "--hold-s", "0.3", "--log", &path("log.csv"), "--json"]);
    parsed(&["energy", "--step-us", "1000", "--json"]);
    parsed(&["supervision", "--json"]);
    parsed(&["virtual", "--survey", &path("survey.csv"), "--json"]);
    let machine = ["--machine", "virtual", "--simulated-time", "--record", &path("record.toml")];
    parsed(&[&["commission"], &machine[..], &["--json"]].concat());
    let examined = parsed(&["doctor", "--json"]);
    assert!(!examined["findings"].as_array().unwrap().is_empty(), "{examined}");
}

#[test]
fn the_log_of_a_run_is_written_as_csv_with_json() {
    let folder = folder("json-run");
    let crane = short_crane(&folder);
    let log = folder.join("run.mcap").display().to_string();
    let run = ["run", "--auto", "--simulated-time", "--crane", &crane, "--log", &log, "--json"];
    parsed(&run);
    let converted = parsed(&["log", "to-csv", &log, "--json"]);
    assert!(converted["rows"].as_u64().unwrap() > 100, "{converted}");
}

#[test]
#[ignore = "campaign"]
fn campaign_long_commands_print_what_their_schemas_state() {
    let folder = folder("json-long");
    let crane = short_crane(&folder);
    let path = |name: &str| folder.join(name).display().to_string();
    let on_short = |arguments: &[&str]| {
        let printed = parsed(&[arguments, &["--crane", &crane, "--json"]].concat());
        assert!(!printed.is_null(), "{arguments:?}");
    };
    on_short(&["ablate", "--family", "1", "--scenario", "small-moves"]);
    on_short(&["bounds"]);
    on_short(&["design", "--family", "2"]);
    on_short(&["design", "--observability"]);
    on_short(&["design", "--benchmark", "--crane-out", &path("tuned.toml")]);
    on_short(&["estimator", "--family", "1", "--course", "small-moves"]);
    on_short(&["faults", "--healthy", "1"]);
    on_short(&["learn", "--family", "2"]);
    on_short(&["motion", "--family", "2"]);
    on_short(&["motion", "--family", "1", "--baselines"]);
    on_short(&["run", "--auto"]);
    on_short(&["scenarios", "reversal"]);
    on_short(&["sensitivity", "--keys", "payload.mass_kg", "--rows", "4"]);
    on_short(&["supervision", "--reactions"]);
    on_short(&["tip", "--family", "2"]);
    on_short(&["trials", "robustness"]);
    on_short(&["virtual", "--dataset", &path("dataset")]);
    parsed(&["bench", "--json"]);
    parsed(&["calibrate", "--trade-off", "friction.coulomb_n=300,787", "--json"]);
    let effort = ["--generations", "1", "--population", "4", "--iterations", "0"];
    let calibrated = path("calibrated.toml");
    parsed(&[&["calibrate", "--out", &calibrated, "--json"], &effort[..]].concat());
}
