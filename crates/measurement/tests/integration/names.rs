//! Names of columns: several that are the same, and those that people give.

use crate::temporary::folder;
use hydroboom_measurement::{Mapping, Measurement, Signal, Signals, read};

fn log(name: &str, content: &str) -> Measurement {
    let path = folder(module_path!()).join(name);
    std::fs::write(&path, content).unwrap();
    read(&path, None).unwrap()
}

const THRICE: &str =
    "time_s,stroke_mm,pressure,pressure,pressure\n0,50,69,3,70\n1,51,68,2,71\n2,52,69,3,70\n";

#[test]
fn columns_of_the_same_name_are_selected_by_their_number() {
    let log = log("thrice.csv", THRICE);
    assert_eq!(log.headings(), "stroke_mm, pressure#1, pressure#2, pressure#3");
    let text = "[log]\npressure_a = \"pressure#1\"\npressure_b = \"pressure#2\"\npressure_pump_a = \"pressure#3\"\n";
    let mapping = Mapping::parse("map.toml", text).unwrap().completed(&log).unwrap();
    let signals = Signals::of(&log, &mapping).unwrap();
    let at = |signal| signals.get(signal).unwrap().at(1.0).unwrap() * 1e-5;
    assert_eq!(
        [Signal::PressureA, Signal::PressureB, Signal::PressurePumpA].map(at).map(f64::round),
        [68.0, 2.0, 71.0]
    );
    // the written mapping names the same columns
    let again = Mapping::parse("again", &mapping.to_toml()).unwrap().completed(&log).unwrap();
    assert_eq!(Signals::of(&log, &again).unwrap(), signals);
}

#[test]
fn an_ambiguous_mapping_is_refused() {
    let log = log("several.csv", THRICE);
    let message = |column: &str| {
        let text = format!("[log]\npressure_b = \"{column}\"\n");
        Mapping::parse("map.toml", &text).unwrap().completed(&log).unwrap_err().to_string()
    };
    let text = message("pressure");
    assert!(text.contains("3 columns are called"), "{text}");
    assert!(text.contains("\"pressure#1\", \"pressure#2\", \"pressure#3\""), "{text}");
    assert!(
        message("pressure#4").contains("there are: stroke_mm, pressure#1"),
        "{}",
        message("pressure#4")
    );
    assert!(message("pressure#0").contains("there are"));
}

#[test]
fn columns_of_the_same_name_are_not_guessed() {
    let two = log("two.csv", "time_s,x_cyl_mm,p_A_bar,p_A_bar\n0,1,69,3\n1,2,68,2\n2,3,67,1\n");
    let mapping = Mapping::default().completed(&two).unwrap();
    assert!(!mapping.entries.contains_key(&Signal::PressureA));
    let message = mapping.assumptions(&two).join("\n");
    assert!(message.contains("none is taken for p_A of p_A_bar#1, p_A_bar#2"), "{message}");
    // twice the same is no choice
    let same =
        log("same.csv", "time_s,x_cyl_mm,p_A_bar,p_A_bar\n0,1,69,69\n1,2,68,68\n2,3,67,67\n");
    let mapping = Mapping::default().completed(&same).unwrap();
    assert_eq!(mapping.entries[&Signal::PressureA].column, "p_A_bar#1");
}

#[test]
fn the_papers_symbols_are_known() {
    let log = log(
        "paper.csv",
        "t,x_cyl,n,p_PA,p_A,p_B,p_PB,p_acc\n0,50,100,69,68,3,4,2\n0.01,51,200,69,68,3,4,2\n0.02,52,300,69,68,3,4,2\n",
    );
    let mapping = Mapping::default().completed(&log).unwrap();
    let taken: Vec<(&str, &str)> =
        mapping.entries.iter().map(|(s, e)| (s.key(), e.column.as_str())).collect();
    assert_eq!(
        taken,
        [
            ("stroke", "x_cyl"),
            ("pressure_pump_a", "p_PA"),
            ("pressure_a", "p_A"),
            ("pressure_b", "p_B"),
            ("pressure_pump_b", "p_PB"),
            ("pressure_accumulator", "p_acc"),
            ("motor_speed", "n"),
        ]
    );
    // on small letters and in capitals alike
    for (heading, signal) in [
        ("p_pa", Signal::PressurePumpA),
        ("P_PA", Signal::PressurePumpA),
        ("u_V", Signal::ValveCommand),
    ] {
        let log =
            self::log(&format!("{heading}.csv"), &format!("t,{heading}\n0,1\n0.01,2\n0.02,3\n"));
        assert!(Mapping::guess(&log).entries.contains_key(&signal), "{heading}");
    }
}
