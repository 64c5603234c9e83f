//! Loops and tables as recorded, in C beside the Rust that they were recorded from.

use hydroboom_export::c::{Precision, files};
use hydroboom_export::{Block, Count, Entry, Expression, Plan, Target, Variable, record};
use hydroboom_math::Real;
use std::collections::HashMap;
use std::io::Write;
use std::process::{Command, Stdio};
use std::rc::Rc;

const LENGTH: usize = 24;

/// A delay line that is looked up, in a loop within a loop, one of them on a condition: every form that a recording has of them.
fn filtered<T: Real>(line: &[T; LENGTH], input: [T; 2]) -> ([T; LENGTH], [T; 3]) {
    let [x, place] = input;
    let mut next = *line;
    next.copy_within(1.., 0);
    next[LENGTH - 1] = x;
    // what a loop makes is read by the next
    let rows = next.map(|value| [value]);
    let ([sum, _], made) = T::repeat(&rows, [T::zero(), T::one()], |k, [v], [sum, unused]| {
        let scaled = (*v * place).tanh() + k;
        ([sum + scaled, unused + scaled], [scaled, v.square()])
    });
    let made = made.map(|[scaled, _]| scaled);
    let found = T::interpolate(&made, place) + T::interpolate(&next[2..9], place - T::one());
    // a table of numbers, and one within a loop
    let weights: [[T; 1]; LENGTH] =
        std::array::from_fn(|k| [T::lit(0.25 - 0.03 * (k % 12) as f64)]);
    let ([most, least], _) =
        T::repeat_where(sum.lt(x + T::lit(255.0)), &rows, [x, x], |k, [v], now| {
            let inner = T::repeat(&weights, now, |j, [w], [most, least]| {
                let own = [*v, k, most, *w];
                let at = T::interpolate(&own, j + *w + place.sin_cos().0);
                // each needs what the other was
                ([least.max(at), most.min(at) - *w], [])
            });
            (inner.0, [])
        });
    // three rows, which are written out, one after the other
    let factors: [[T; 1]; 3] = [0.5, 0.25, 0.125].map(|w| [T::lit(w)]);
    let ([short], rows) =
        T::repeat_where(x.lt(T::lit(30.0)), &factors, [sum], |k, [factor], [carried]| {
            let next = carried.mul_add(*factor, k * x);
            ([next], [next - carried])
        });
    let made = rows.iter().fold(T::zero(), |sum, [entry]| sum + *entry);
    (next, [found + made, most, least + sum - short])
}

fn variable(name: &str) -> Variable {
    Variable { name: name.into(), unit: "1".into(), meaning: "Number".into(), initial: 0.0 }
}

fn block() -> Block {
    let (graph, mut block) = record(|| {
        let line: [Expression; LENGTH] = std::array::from_fn(|_| Expression::input());
        let input = [Expression::input(), Expression::input()];
        let (next, out) = filtered(&line, input);
        let states = next.iter().enumerate().map(|(k, e)| (Target::State(k), e.node()));
        let outputs = out.iter().enumerate().map(|(k, e)| (Target::Output(k), e.node()));
        Block {
            name: "made".into(),
            meaning: "Made for a test".into(),
            graph: Rc::default(),
            parameters: Vec::new(),
            inputs: vec![(variable("x"), input[0].node()), (variable("place"), input[1].node())],
            states: (0..LENGTH)
                .map(|k| (variable(&format!("line[{k}]")), line[k].node()))
                .collect(),
            outputs: ["found", "most", "least"].map(variable).to_vec(),
            entries: vec![Entry {
                name: "step".into(),
                meaning: "one step".into(),
                results: states.chain(outputs).collect(),
            }],
            period: None,
            labels: HashMap::new(),
        }
    });
    block.graph = Rc::new(graph);
    block
}

const MAIN: &str = r#"
#include "made.h"
#include <stdio.h>
int main(void)
{
    hb_made_state s;
    hb_made_input u;
    hb_made_output y;
    double in[2];
    hb_made_start(&s);
    while (fread(in, sizeof in, 1, stdin) == 1) {
        u.x = in[0];
        u.place = in[1];
        hb_made_step(&s, &u, &y);
        if (fwrite(&s, sizeof s, 1, stdout) != 1 || fwrite(&y, sizeof y, 1, stdout) != 1) {
            return 1;
        }
    }
    return 0;
}
"#;

#[test]
fn loops_and_tables_in_c_are_those_in_rust_to_the_last_bit() {
    let folder = std::path::PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("c-repeats");
    std::fs::create_dir_all(&folder).unwrap();
    let made = files(&[block()], "made", Precision::Double).unwrap();
    // a delay line is moved on by a loop, not entry by entry
    assert!(!made.source.contains("next_5"), "{}", made.source);
    // tanh, the table's loop and the one within it: what is short has none
    let loops =
        made.source.matches("for (int i").count() - made.source.matches("for (int i =").count();
    assert_eq!(loops, 3, "{}", made.source);
    std::fs::write(folder.join("made.h"), made.header).unwrap();
    std::fs::write(folder.join("made.c"), made.source).unwrap();
    std::fs::write(folder.join("main.c"), MAIN).unwrap();
    let output = Command::new("cc")
        .current_dir(&folder)
        .args(["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O2", "-ffp-contract=off"])
        .args(["-fsanitize=address,undefined", "-fno-sanitize-recover"])
        .args(["made.c", "main.c", "-lm", "-o", "program"])
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));

    let mut line = [0.0; LENGTH];
    let (mut given, mut wanted, mut skipped) = (Vec::new(), Vec::new(), 0);
    for k in 0..500_u32 {
        let t = f64::from(k);
        let x = 40.0 * (0.37 * t).sin() + 20.0;
        let place = match k {
            77 => f64::NAN,
            78 => f64::INFINITY,
            _ => 8.0 * (0.11 * t).cos() + 5.0,
        };
        given.extend([x, place]);
        let (next, out) = filtered(&line, [x, place]);
        skipped += u32::from(out[1] == x);
        line = next;
        wanted.extend(next.into_iter().chain(out));
    }
    assert!((50..450).contains(&skipped), "{skipped}: the condition is never or always met");
    let mut child = Command::new(folder.join("program"))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let bytes: Vec<u8> = given.iter().flat_map(|v| v.to_le_bytes()).collect();
    let mut input = child.stdin.take().unwrap();
    let writing = std::thread::spawn(move || input.write_all(&bytes).unwrap());
    let output = child.wait_with_output().unwrap();
    writing.join().unwrap();
    assert!(output.status.success(), "{:?}", output.status);
    let found: Vec<f64> =
        output.stdout.chunks_exact(8).map(|c| f64::from_le_bytes(c.try_into().unwrap())).collect();
    assert_eq!(found.len(), wanted.len());
    for (k, (found, wanted)) in found.iter().zip(&wanted).enumerate() {
        let equal = found.to_bits() == wanted.to_bits() || found.is_nan() && wanted.is_nan();
        assert!(equal, "number {k}: {found} for {wanted}");
    }
}

/// What is not needed of a loop is not computed, and the rest counts for each row.
#[test]
fn a_loop_counts_for_each_of_its_rows() {
    let block = block();
    let plan = Plan::of(&block).unwrap();
    let count = Count::of(&block.graph, &plan.entries[0]);
    // a hyperbolic tangent a row; a sine before all loops
    assert_eq!(count.functions, LENGTH + 1, "{count:?}");
}
