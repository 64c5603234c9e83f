//! Generated C compared with the Rust from which it was recorded.

use crate::course::inputs;
use hydroboom_description::Description;
use hydroboom_description::schema::Numbers;
use hydroboom_export::c::{Precision, Prefix, files, prefixed_files};
use hydroboom_export::{blocks, controller, crane_model, simulation_feedforward};
use hydroboom_model::stepping::published;
use hydroboom_model::{Crane, CraneState, Input};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

const STEP: f64 = 50e-6;

fn folder(name: &str) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).unwrap();
    path
}

/// Compiles sources with warnings treated as errors.
fn compiled(folder: &Path, sources: &[&str], options: &[&str]) -> PathBuf {
    let program = folder.join("program");
    let output = Command::new("cc")
        .current_dir(folder)
        .args(["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O2", "-ffp-contract=off"])
        .args(options)
        .args(sources)
        .args(["-lm", "-o", "program"])
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    program
}

/// Runs a program with numbers as input; returns the numbers that it prints.
fn answered(program: &Path, numbers: &[f64]) -> Vec<f64> {
    let mut child =
        Command::new(program).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    let mut input = child.stdin.take().unwrap();
    let bytes: Vec<u8> = numbers.iter().flat_map(|v| v.to_le_bytes()).collect();
    let writing = std::thread::spawn(move || input.write_all(&bytes).unwrap());
    let output = child.wait_with_output().unwrap();
    writing.join().unwrap();
    assert!(output.status.success(), "{:?}", output.status);
    let eight = |c: &[u8]| f64::from_le_bytes(c.try_into().unwrap());
    output.stdout.chunks_exact(8).map(eight).collect()
}

fn flat(state: &CraneState<f64, 3>) -> Vec<f64> {
    let boom = &state.boom;
    let nodes = state.circuit.nodes.to_array();
    [&boom.angle[..], &boom.angular_velocity, &[state.bristle], &nodes, &[state.circuit.gas_volume]]
        .concat()
}

/// States of the Rust model after every step.
fn in_rust(description: &Description, inputs: &[Input<f64>]) -> Vec<Vec<f64>> {
    let crane = description.crane::<3>().unwrap();
    let n = &description.numbers;
    let mut state = crane.at_rest(&description.start_over(n, n.motion_start)).unwrap();
    inputs
        .iter()
        .map(|input| {
            published(&crane, &mut state, input, STEP);
            let mut row = flat(&state);
            let seen = crane.outputs(&state);
            row.extend(seen.to_array());
            row.push(crane.cylinder.load_pressure(seen.pressure_a, seen.pressure_b));
            row
        })
        .collect()
}

/// The largest difference relative to the largest value of its column.
fn apart(rust: &[Vec<f64>], other: &[f64]) -> f64 {
    let width = rust[0].len();
    assert_eq!(other.len(), rust.len() * width);
    let largest = |column: usize| rust.iter().map(|row| row[column].abs()).fold(1e-300, f64::max);
    let scale: Vec<f64> = (0..width).map(largest).collect();
    let pairs = rust.iter().flatten().zip(other).enumerate();
    pairs
        .map(|(k, (a, b))| (a - b).abs() / scale[k % width])
        .fold(0.0, |most, v| if v > most || v.is_nan() { v } else { most })
}

const MODEL: &str = r#"
#include "crane.h"
#include <stdio.h>
int main(void)
{
    hb_model_parameters p;
    hb_model_prepared c;
    hb_model_state s;
    hb_model_input u;
    hb_model_output y;
    double in[2];
    hb_model_describe(&p);
    hb_model_prepare(&p, &c);
    hb_model_start(&s);
    u.step = STEP;
    while (fread(in, sizeof in, 1, stdin) == 1) {
        u.pump_speed = (hb_real)in[0];
        u.holding_valve = (hb_real)in[1];
        hb_model_step(&c, &s, &u);
        hb_model_see(&c, &s, &y);
        {
            const hb_real *parts[2];
            size_t counts[2];
            size_t k;
            size_t i;
            parts[0] = (const hb_real *)&s;
            parts[1] = (const hb_real *)&y;
            counts[0] = sizeof s / sizeof(hb_real);
            counts[1] = sizeof y / sizeof(hb_real);
            for (k = 0; k < 2; k++) {
                for (i = 0; i < counts[k]; i++) {
                    const double value = (double)parts[k][i];
                    if (fwrite(&value, sizeof value, 1, stdout) != 1) {
                        return 1;
                    }
                }
            }
        }
    }
    return 0;
}
"#;

fn written(name: &str, description: &Description, precision: Precision) -> PathBuf {
    let folder = folder(name);
    let made = files(&[crane_model(description).unwrap()], "crane", precision).unwrap();
    std::fs::write(folder.join("crane.h"), made.header).unwrap();
    std::fs::write(folder.join("crane.c"), made.source).unwrap();
    std::fs::write(folder.join("main.c"), MODEL.replace("STEP", "(hb_real)50e-6")).unwrap();
    folder
}

#[test]
fn ten_thousand_steps_in_c_are_those_in_rust_to_the_last_bit() {
    let inputs = inputs(10_000);
    let numbers: Vec<f64> = inputs.iter().flat_map(|i| i.to_array()).collect();
    for description in [Description::uia_single_boom().unwrap(), lugre()] {
        let folder = written("c-model", &description, Precision::Double);
        let rust = in_rust(&description, &inputs);
        for options in [
            &[][..],
            &["-DHB_SOFT_FMA"],
            &["-fsanitize=address,undefined", "-fno-sanitize-recover"],
        ] {
            let program = compiled(&folder, &["crane.c", "main.c"], options);
            let off = apart(&rust, &answered(&program, &numbers));
            assert_eq!(off, 0.0, "with {options:?}");
        }
    }
}

/// Products whose exact value is close to the middle of two doubles, where double rounding is wrong, and ordinary ones.
#[test]
fn a_fused_product_without_an_instruction_for_it_rounds_once() {
    let description = Description::uia_single_boom().unwrap();
    let folder = written("c-fma", &description, Precision::Double);
    let main = r#"
#define HB_SOFT_FMA
#include "crane.c"
#include <stdio.h>
int main(void)
{
    double in[3];
    while (fread(in, sizeof in, 1, stdin) == 1) {
        const double out = hb_fma(in[0], in[1], in[2]);
        if (fwrite(&out, sizeof out, 1, stdout) != 1) {
            return 1;
        }
    }
    return 0;
}
"#;
    std::fs::write(folder.join("fma.c"), main).unwrap();
    let program = compiled(&folder, &["fma.c"], &[]);
    let mut triples = Vec::new();
    for k in 1..53 {
        // (1 + 2^-k)(1 + 2^(k - 53)) ends in half of a last digit
        let (a, b) = (1.0 + 0.5_f64.powi(k), 1.0 + 0.5_f64.powi(53 - k));
        for tiny in [1e-40, -1e-40, 3e-25, -3e-25, 0.0] {
            triples.extend([[a, b, tiny], [-a, b, tiny], [1e7 * a, b, tiny]]);
        }
    }
    for k in 0..20_000_u32 {
        let of = |seed: f64| {
            (f64::from(k) * seed).sin() * 10.0_f64.powf(6.0 * (f64::from(k) * 0.37).cos())
        };
        triples.push([of(12.9898), of(78.233), of(37.719)]);
        triples.push([of(12.9898), of(78.233), -of(12.9898) * of(78.233)]);
    }
    let once = answered(&program, &triples.concat());
    let mut twice_differs = 0;
    for ([a, b, c], found) in triples.iter().zip(once) {
        assert_eq!(found, a.mul_add(*b, *c), "{a:?} {b:?} {c:?}");
        twice_differs += u32::from(a * b + c != found);
    }
    assert!(twice_differs > 1000, "{twice_differs}: nothing was asked of it");
}

/// The paper's crane with the LuGre friction law.
fn lugre() -> Description {
    let text = hydroboom_description::UIA_SINGLE_BOOM.replace("\"stribeck\"", "\"lugre\"");
    Description::parse("lugre", &text).unwrap()
}

#[test]
fn single_precision_stays_near_double() {
    let description = Description::uia_single_boom().unwrap();
    let inputs = inputs(10_000);
    let numbers: Vec<f64> = inputs.iter().flat_map(|i| i.to_array()).collect();
    let folder = written("c-single", &description, Precision::Single);
    let program = compiled(&folder, &["crane.c", "main.c"], &[]);
    let single = answered(&program, &numbers);
    let rust = in_rust(&description, &inputs);
    // half a second: the piston's position to a tenth of a millimetre
    let width = rust[0].len();
    let stroke = flat_len();
    let off = (single[single.len() - width + stroke] - rust[rust.len() - 1][stroke]).abs();
    assert!(off < 1e-4, "{off} m");
}

fn flat_len() -> usize {
    13
}

#[test]
fn hydraulics_and_boom_blocks_together_simulate_the_crane() {
    let description = Description::uia_single_boom().unwrap();
    let folder = folder("c-blocks");
    let [hydraulics, boom] = blocks(&description).unwrap();
    let made = files(&[hydraulics, boom], "crane", Precision::Double).unwrap();
    std::fs::write(folder.join("crane.h"), made.header).unwrap();
    std::fs::write(folder.join("crane.c"), made.source).unwrap();
    let main = r#"
#include "crane.h"
#include <stdio.h>
int main(void)
{
    hb_hydraulic_model_parameters hp;
    hb_hydraulic_model_prepared hc;
    hb_hydraulic_model_state hs;
    hb_hydraulic_model_input hu;
    hb_hydraulic_model_output hy;
    hb_flexible_boom_parameters bp;
    hb_flexible_boom_prepared bc;
    hb_flexible_boom_state bs;
    hb_flexible_boom_input bu;
    hb_flexible_boom_output by;
    double in[2];
    hb_hydraulic_model_describe(&hp);
    hb_hydraulic_model_prepare(&hp, &hc);
    hb_hydraulic_model_start(&hs);
    hb_flexible_boom_describe(&bp);
    hb_flexible_boom_prepare(&bp, &bc);
    hb_flexible_boom_start(&bs);
    hu.step = 50e-6;
    bu.step = 50e-6;
    /* at rest: a step of no length shows where the piston is */
    bu.cylinder_force = 0.0;
    bu.step = 0.0;
    hb_flexible_boom_step(&bc, &bs, &bu, &by);
    bu.step = 50e-6;
    while (fread(in, sizeof in, 1, stdin) == 1) {
        double out[3];
        hu.pump_speed = in[0];
        hu.holding_valve = in[1];
        hu.stroke = by.stroke;
        hu.velocity = by.velocity;
        hb_hydraulic_model_step(&hc, &hs, &hu, &hy);
        bu.cylinder_force = hy.cylinder_force;
        hb_flexible_boom_step(&bc, &bs, &bu, &by);
        out[0] = by.stroke;
        out[1] = hy.pressure_a;
        out[2] = by.tip_y;
        if (fwrite(out, sizeof out, 1, stdout) != 1) {
            return 1;
        }
    }
    return 0;
}
"#;
    std::fs::write(folder.join("main.c"), main).unwrap();
    let program = compiled(&folder, &["crane.c", "main.c"], &[]);
    let inputs = inputs(10_000);
    let numbers: Vec<f64> = inputs.iter().flat_map(|i| i.to_array()).collect();
    let places = [13, 16, 26];
    let rust = in_rust(&description, &inputs);
    let rust: Vec<Vec<f64>> = rust.iter().map(|row| places.map(|k| row[k]).to_vec()).collect();
    let off = apart(&rust, &answered(&program, &numbers));
    assert_eq!(off, 0.0);
}

/// Two cranes with different headers and different floating-point types.
#[test]
fn two_cranes_fit_into_one_program_in_cpp() {
    if Command::new("g++").arg("--version").output().is_err() {
        eprintln!("skipped: g++ is not on the PATH");
        return;
    }
    let folder = folder("c-two");
    let light = Description::uia_single_boom().unwrap();
    let mut heavy = lugre();
    heavy.set("payload.mass_kg=340").unwrap();
    for (crane, prefix, precision) in
        [(&light, "light_", Precision::Double), (&heavy, "my_", Precision::Single)]
    {
        let prefix = Prefix::new(prefix).unwrap();
        let [hydraulics, boom] = blocks(crane).unwrap();
        let all = [
            crane_model(crane).unwrap(),
            hydraulics,
            boom,
            controller(crane).unwrap(),
            simulation_feedforward(crane).unwrap(),
        ];
        let name = format!("{}crane", prefix.as_str());
        let made = prefixed_files(&all, &name, precision, &prefix).unwrap();
        for text in [&made.header, &made.source] {
            assert!(!text.contains("hb_real") && !text.contains("hb_model"));
        }
        assert!(!made.header.contains("hb_") && !made.header.contains("HB_"));
        std::fs::write(folder.join(format!("{name}.h")), made.header).unwrap();
        std::fs::write(folder.join(format!("{name}.c")), made.source).unwrap();
    }
    let main = r#"
#include "light_crane.h"
#include "my_crane.h"
#include "light_crane.h"
#include <cstdio>

int main()
{
    light_model_parameters lp;
    light_model_prepared lc;
    light_model_state ls;
    light_model_input lu = { 10.0, 1.0, 50e-6 };
    light_model_output ly;
    my_model_parameters mp;
    my_model_prepared mc;
    my_model_state ms;
    my_model_input mu = { 10.0f, 1.0f, 50e-6f };
    my_model_output my;
    light_model_describe(&lp);
    light_model_prepare(&lp, &lc);
    light_model_start(&ls);
    my_model_describe(&mp);
    my_model_prepare(&mp, &mc);
    my_model_start(&ms);
    for (int k = 0; k < 200; k++) {
        light_model_step(&lc, &ls, &lu);
        my_model_step(&mc, &ms, &mu);
    }
    light_model_see(&lc, &ls, &ly);
    my_model_see(&mc, &ms, &my);
    std::printf("%.17g %.17g\n", ly.pressure_a, static_cast<double>(my.pressure_a));
    return 0;
}
"#;
    std::fs::write(folder.join("main.cpp"), main).unwrap();
    let strict = ["-Wall", "-Wextra", "-Werror", "-pedantic", "-O2", "-ffp-contract=off"];
    let run = |program: &str, arguments: &[&str]| {
        let output = Command::new(program).current_dir(&folder).args(arguments).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    };
    for name in ["light_crane", "my_crane"] {
        let source = format!("{name}.c");
        run("cc", &[&["-std=c99"], &strict[..], &["-c", &source]].concat());
    }
    let linked = ["-std=c++11", "main.cpp", "light_crane.o", "my_crane.o", "-lm", "-o", "program"];
    run("g++", &[&strict[..], &linked].concat());
    let printed = run("./program", &[]);
    let found: Vec<f64> = printed.split_whitespace().map(|v| v.parse().unwrap()).collect();
    let inputs = [Input { pump_speed: 10.0, holding_valve: 1.0 }; 200];
    let seen = |crane: &Description| in_rust(crane, &inputs)[199][flat_len() + 3];
    assert_eq!(found[0], seen(&light));
    // in float
    assert!((found[1] - seen(&heavy)).abs() < 1e-3 * found[1], "{found:?}");
}

#[test]
fn a_prefix_that_cannot_begin_a_name_is_refused() {
    let long = "a".repeat(Prefix::LONGEST + 1);
    for wrong in ["", "1st_", "_x", "__", "a-b", "a b", "\u{e4}_", "a;", "a\n", &long] {
        assert!(Prefix::new(wrong).is_err(), "{wrong:?}");
    }
    for right in ["my_", "A", "crane_2_", Prefix::default().as_str()] {
        assert_eq!(Prefix::new(right).unwrap().as_str(), right);
    }
}

/// Parameter values for the tests: name in C, value of the key in the file's unit, and its effect in SI units.
type Changed = (&'static str, f64, fn(&mut Numbers<f64>));

const CHANGED: [Changed; 8] = [
    ("payload_mass_kg", 500.0, |n| n.payload = 500.0),
    ("payload_mass_kg", 0.0, |n| n.payload = 0.0),
    ("payload_x_mm", 2500.0, |n| n.payload_x = 2500.0 * 1e-3),
    ("motion_start_mm", 0.0, |n| n.motion_start = 0.0 * 1e-3),
    ("motion_start_mm", 500.0, |n| n.motion_start = 500.0 * 1e-3),
    ("start_rod_side_bar", 30.0, |n| n.rod_side = 30.0 * 1e5),
    ("boom_youngs_modulus_gpa", 20.0, |n| n.youngs_modulus = 20.0 * 1e9),
    ("start_preload_percent", 40.0, |n| n.preload = 40.0 * 1e-2),
];

/// Newton steps; after a few of them only rounding changes the result.
const ROUNDS: usize = 12;

/// The crane with a changed number, and its states in the Newton steps from the described equilibrium.
fn balancing(description: &Description, change: fn(&mut Numbers<f64>)) -> Vec<CraneState<f64, 3>> {
    let n = &description.numbers;
    let rest = description.crane::<3>().unwrap();
    let mut state = rest.at_rest(&description.start_over(n, n.motion_start)).unwrap();
    let mut n = *n;
    change(&mut n);
    let crane: Crane<f64, 3> = description.crane_over(&n).unwrap();
    let start = description.start_over(&n, n.motion_start);
    let round = |_| {
        state = crane.balanced(&start, &state);
        state
    };
    let rounds: Vec<CraneState<f64, 3>> = (0..ROUNDS).map(round).collect();
    // the solution with pivoting, which Rust uses for all initial states
    let wanted = flat(&crane.at_rest(&start).unwrap());
    for (k, (found, wanted)) in flat(&rounds[ROUNDS - 1]).iter().zip(&wanted).enumerate() {
        let close = (found - wanted).abs() <= 1e-10 * wanted.abs().max(1e-3);
        assert!(close, "state {k}: {found} for {wanted}");
    }
    let settled = flat(&rounds[6]);
    for (found, wanted) in settled.iter().zip(&wanted) {
        assert!((found - wanted).abs() <= 1e-9 * wanted.abs().max(1e-3), "not after seven rounds");
    }
    rounds
}

#[test]
fn a_changed_crane_starts_in_equilibrium_in_c_as_in_rust() {
    for description in [Description::uia_single_boom().unwrap(), lugre()] {
        for (name, value, change) in CHANGED {
            let folder = written("c-balance", &description, Precision::Double);
            let main = r#"
#include "crane.h"
#include <stdio.h>
int main(void)
{
    hb_model_parameters p;
    hb_model_prepared c;
    hb_model_state s;
    hb_model_input u = { 0.0, 0.0, 50e-6 };
    int k;
    hb_model_describe(&p);
    p.NAME = VALUE;
    hb_model_prepare(&p, &c);
    hb_model_start(&s);
    for (k = 0; k < ROUNDS; k++) {
        hb_model_balance(&c, &s);
        if (fwrite(&s, sizeof s, 1, stdout) != 1) {
            return 1;
        }
    }
    /* the load is held: a tenth of a second */
    for (k = 0; k < 2000; k++) {
        hb_model_step(&c, &s, &u);
    }
    return fwrite(&s, sizeof s, 1, stdout) != 1;
}
"#;
            let main = main.replace("NAME", name).replace("VALUE", &format!("{value:?}"));
            let main = main.replace("ROUNDS", &ROUNDS.to_string());
            std::fs::write(folder.join("main.c"), main).unwrap();
            let found = answered(&compiled(&folder, &["crane.c", "main.c"], &[]), &[]);
            let rounds = balancing(&description, change);
            let wanted: Vec<f64> = rounds.iter().flat_map(flat).collect();
            let (balanced, held) = found.split_at(wanted.len());
            assert_eq!(balanced, wanted, "{name} = {value}");
            let (before, after) = (flat(&rounds[ROUNDS - 1])[8], held[8]);
            // leakage through closed valves and cavities of an unloaded pump side do not affect the piston side
            assert!((before - after).abs() < 0.05e5, "{name} = {value}: {before} to {after} Pa");
        }
    }
}
