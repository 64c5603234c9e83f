//! Structured Text compiled by external compilers, if they are installed.

use hydroboom_description::Description;
use hydroboom_export::structured_text::{Unit, function_block, units};
use hydroboom_export::{blocks, controller, simulation_feedforward_controller};
use std::path::PathBuf;
use std::process::Command;

/// Compiles each function block in its own file, and all units with their configuration in one; `arguments` are the
/// compiler's for a file. Without the compiler the test prints that it is skipped.
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
        let printed = [output.stdout, output.stderr].concat();
        let printed = String::from_utf8_lossy(&printed);
        assert!(output.status.success(), "{compiler}, {name}: {printed}");
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

/// matiec; `MATIEC_INCLUDE_PATH` is the folder of its standard functions.
#[test]
fn matiec_takes_every_function_block_and_the_whole() {
    compiled("iec2c", |file| {
        let out = file.with_extension("matiec");
        std::fs::create_dir_all(&out).unwrap();
        // arrays of equal length are of one anonymous type
        let mut all = vec!["-l".into(), "-T".into(), out.display().to_string()];
        if let Ok(library) = std::env::var("MATIEC_INCLUDE_PATH") {
            all.extend(["-I".into(), library]);
        }
        all.push(file.display().to_string());
        all
    });
}
