//! Structured Text, read by compilers that are no part of the project, where they are on the PATH.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up has failed")]

use hydroboom_description::Description;
use hydroboom_export::structured_text::{Unit, function_block, units};
use hydroboom_export::{blocks, controller, simulation_feedforward_controller};
use std::path::PathBuf;
use std::process::Command;

/// Each function block in a file of its own, and all units with their configuration in one; what a compiler is told to do with a
/// file. Where the compiler is not here that is said, and nothing is tried.
fn compiled(compiler: &str, arguments: impl Fn(&PathBuf) -> Vec<String>) {
    if Command::new(compiler).arg("--version").output().is_err() {
        eprintln!("skipped: {compiler} is not on the PATH");
        return;
    }
    let crane = Description::uia_single_boom().unwrap();
    let [hydraulics, boom] = blocks(&crane).unwrap();
    let framed = [controller(&crane).unwrap(), simulation_feedforward_controller(&crane).unwrap()];
    let blocks = [hydraulics, boom].into_iter().chain(framed);
    let mut texts: Vec<(String, String)> = Vec::new();
    for block in blocks {
        let unit = function_block(&block).unwrap();
        texts.push((unit.name.clone(), unit.text()));
    }
    let all: Vec<String> = units(&crane).unwrap().iter().map(Unit::text).collect();
    texts.push(("all".into(), all.join("\n")));
    for (name, text) in texts {
        let file = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("{compiler}-{name}.st"));
        std::fs::write(&file, text).unwrap();
        let output = Command::new(compiler).args(arguments(&file)).output().unwrap();
        let said = [output.stdout, output.stderr].concat();
        let said = String::from_utf8_lossy(&said);
        assert!(output.status.success(), "{compiler}, {name}: {said}");
    }
}

#[test]
fn ironplc_takes_every_function_block_and_the_whole() {
    compiled("ironplcc", |file| vec!["check".into(), file.display().to_string()]);
}

#[test]
fn strucpp_takes_every_function_block_and_the_whole() {
    compiled("strucpp", |file| {
        let out = file.with_extension("cpp");
        vec![file.display().to_string(), "-o".into(), out.display().to_string()]
    });
}

/// matiec; its folder of standard functions is where `MATIEC_INCLUDE_PATH` says.
#[test]
fn matiec_takes_every_function_block_and_the_whole() {
    compiled("iec2c", |file| {
        let out = file.with_extension("matiec");
        std::fs::create_dir_all(&out).unwrap();
        // arrays of the same length are of one type, without a name of that
        let mut all = vec!["-l".into(), "-T".into(), out.display().to_string()];
        if let Ok(library) = std::env::var("MATIEC_INCLUDE_PATH") {
            all.extend(["-I".into(), library]);
        }
        all.push(file.display().to_string());
        all
    });
}
