//! The library called from C and from Python gives the results of the Rust model.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up has failed")]

use hydroboom_description::Description;
use hydroboom_model::{Input, Outputs, Scheme};
use hydroboom_plant::plant;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The folder of the library that cargo has built, the parent of this test's.
fn built() -> PathBuf {
    std::env::current_exe().unwrap().parent().unwrap().to_path_buf()
}

fn wanted() -> [f64; Outputs::NAMES.len()] {
    let description = Description::uia_single_boom().unwrap();
    let n = &description.numbers;
    let start = description.start(n.motion_start);
    let mut crane = plant(&description, &start, Scheme::Published, n.simulation_period).unwrap();
    for _ in 0..500 {
        crane.advance(&Input { pump_speed: 10.0, holding_valve: 1.0 }, 20).unwrap();
    }
    crane.outputs().to_array()
}

fn run(command: &mut Command) -> String {
    let output = command.output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command:?}: {} {message}", output.status);
    String::from_utf8(output.stdout).unwrap()
}

fn agree(printed: &str) {
    let found: Vec<f64> =
        printed.lines().map(|line| line.split_once(' ').unwrap().1.parse().unwrap()).collect();
    assert_eq!(found, wanted());
}

#[test]
fn a_c_program_moves_cranes_as_rust_does_and_gets_error_messages() {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let program = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("live");
    run(Command::new("cc")
        .args(["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-I"])
        .arg(here.join("include"))
        .arg(here.join("tests/live.c"))
        .arg("-L")
        .arg(built())
        .args(["-lhydroboom_live", "-o"])
        .arg(&program));
    agree(&run(Command::new(&program).env("LD_LIBRARY_PATH", built())));
}

fn python() -> bool {
    let is_here = Command::new("python3").arg("--version").output().is_ok();
    if !is_here {
        eprintln!("skipped: python3 is not on the PATH");
    }
    is_here
}

/// The example of docs/how-to/live-library.md, in a folder laid out like the project.
#[test]
fn the_example_in_python_prints_numbers() {
    if !python() {
        return;
    }
    let text = include_str!("../../../docs/how-to/live-library.md");
    let script = text.split_once("```python\n").unwrap().1.split_once("```").unwrap().0;
    let place = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("example");
    let _ = std::fs::remove_dir_all(&place);
    std::fs::create_dir_all(place.join("target/release")).unwrap();
    let library = "libhydroboom_live.so";
    std::os::unix::fs::symlink(built().join(library), place.join("target/release").join(library))
        .unwrap();
    std::fs::write(place.join("my-crane.toml"), hydroboom_description::UIA_SINGLE_BOOM).unwrap();
    let printed = run(Command::new("python3").arg("-c").arg(script).current_dir(&place));
    let mut description = Description::uia_single_boom().unwrap();
    description.set("payload.mass_kg=250").unwrap();
    let n = &description.numbers;
    let start = description.start(n.motion_start);
    let mut crane = plant(&description, &start, Scheme::Published, n.simulation_period).unwrap();
    let mut wanted = Vec::new();
    for _ in 0..5 {
        crane.advance(&Input { pump_speed: 10.0, holding_valve: 1.0 }, 2000).unwrap();
        let seen = crane.outputs();
        wanted.push(format!(
            "{:.1} s: {:.1} mm, {:.1} bar",
            crane.time(),
            seen.stroke * 1e3,
            seen.pressure_a * 1e-5
        ));
    }
    let lines: Vec<&str> = printed.lines().collect();
    assert_eq!(lines[..5], wanted);
    let all: Vec<&str> = lines[5..].iter().map(|line| line.split_once(' ').unwrap().0).collect();
    assert_eq!(all[..Outputs::NAMES.len()], Outputs::NAMES);
    assert_eq!(all[Outputs::NAMES.len()..], crane.state_names());
    assert!(lines[5..].iter().all(|l| l.split(' ').nth(1).unwrap().parse::<f64>().is_ok()));
}

#[test]
fn python_moves_a_crane_as_rust_does() {
    if !python() {
        return;
    }
    let script = r#"
import ctypes, sys
lib = ctypes.CDLL(sys.argv[1])
lib.hydroboom_open.restype = ctypes.c_void_p
lib.hydroboom_output_count.restype = ctypes.c_size_t
lib.hydroboom_output_name.restype = ctypes.c_char_p
lib.hydroboom_advance.argtypes = [ctypes.c_void_p] + 3 * [ctypes.c_double]
lib.hydroboom_read.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t]
crane = lib.hydroboom_open(None, None, None, 0)
for _ in range(500):
    assert lib.hydroboom_advance(crane, 10.0, 1.0, 1e-3) == 0
seen = (ctypes.c_double * lib.hydroboom_output_count())()
assert lib.hydroboom_read(crane, seen, len(seen)) == 0
for k, value in enumerate(seen):
    print(lib.hydroboom_output_name(k).decode(), repr(value))
"#;
    let library = built().join("libhydroboom_live.so");
    agree(&run(Command::new("python3").arg("-c").arg(script).arg(library)));
}
