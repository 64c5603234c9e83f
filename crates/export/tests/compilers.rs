//! Structured Text, read by compilers that are no part of the project, where they are on the PATH.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up has failed")]

use hydroboom_description::Description;
use hydroboom_export::structured_text::function_block;
use hydroboom_export::{blocks, controller, simulated_motor};
use std::path::PathBuf;
use std::process::Command;

/// Each function block in a file of its own, and what a compiler is told to do with it. Where the compiler is not here that
/// is said, and nothing is tried.
fn compiled(compiler: &str, arguments: impl Fn(&PathBuf) -> Vec<String>) {
    if Command::new(compiler).arg("--version").output().is_err() {
        eprintln!("skipped: {compiler} is not on the PATH");
        return;
    }
    let crane = Description::uia_single_boom().unwrap();
    let [hydraulics, boom] = blocks(&crane).unwrap();
    for block in [hydraulics, boom, controller(&crane), simulated_motor(&crane)] {
        let unit = function_block(&block).unwrap();
        let file =
            PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("{compiler}-{}.st", unit.name));
        std::fs::write(&file, unit.text()).unwrap();
        let output = Command::new(compiler).args(arguments(&file)).output().unwrap();
        let said = [output.stdout, output.stderr].concat();
        let said = String::from_utf8_lossy(&said);
        assert!(output.status.success(), "{compiler}, {}: {said}", unit.name);
    }
}

#[test]
fn ironplc_takes_every_function_block() {
    compiled("ironplcc", |file| vec!["check".into(), file.display().to_string()]);
}

#[test]
fn strucpp_takes_every_function_block() {
    compiled("strucpp", |file| {
        let out = file.with_extension("cpp");
        vec![file.display().to_string(), "-o".into(), out.display().to_string()]
    });
}
