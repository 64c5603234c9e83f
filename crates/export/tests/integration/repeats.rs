//! Recorded loops and tables in C and Structured Text against Rust: loop bodies are functions.

use crate::evaluator::Library;
use hydroboom_description::Description;
use hydroboom_export::c::{Precision, files};
use hydroboom_export::structured_text::{Unit, block_units};
use hydroboom_export::{
    Block, Count, Entry, Expression, Plan, Target, Variable, record, scheduled_lqr_controller,
};
use hydroboom_math::Real;
use std::collections::HashMap;
use std::io::Write;
use std::process::{Command, Stdio};
use std::rc::Rc;

const LENGTH: usize = 24;

/// A delay line with interpolation in nested loops, one of them conditional: all forms that a recording can contain.
fn filtered<T: Real>(line: &[T; LENGTH], input: [T; 2]) -> ([T; LENGTH], [T; 3]) {
    let [x, place] = input;
    let mut next = *line;
    next.copy_within(1.., 0);
    next[LENGTH - 1] = x;
    // the output table of a loop is read by the next
    let rows = next.map(|value| [value]);
    let ([sum, _], made) = T::repeat(&rows, [T::zero(), T::one()], |k, [v], [sum, unused]| {
        let scaled = (*v * place).tanh() + k;
        ([sum + scaled, unused + scaled], [scaled, v.square()])
    });
    let made = made.map(|[scaled, _]| scaled);
    let found = T::interpolate(&made, place) + T::interpolate(&next[2..9], place - T::one());
    // a constant table, and one computed within a loop
    let weights: [[T; 1]; LENGTH] =
        std::array::from_fn(|k| [T::lit(0.25 - 0.03 * (k % 12) as f64)]);
    let ([most, least], _) =
        T::repeat_where(sum.lt(x + T::lit(255.0)), &rows, [x, x], |k, [v], now| {
            let inner = T::repeat(&weights, now, |j, [w], [most, least]| {
                let own = [*v, k, most, *w];
                let at = T::interpolate(&own, j + *w + place.sin_cos().0);
                // each state depends on the other's previous value
                ([least.max(at), most.min(at) - *w], [])
            });
            (inner.0, [])
        });
    // three rows, which are unrolled
    let factors: [[T; 1]; 3] = [0.5, 0.25, 0.125].map(|w| [T::lit(w)]);
    let ([short], rows) =
        T::repeat_where(x.lt(T::lit(30.0)), &factors, [sum], |k, [factor], [carried]| {
            let next = carried.mul_add(*factor, k * x);
            ([next], [next - carried])
        });
    let made = rows.iter().fold(T::zero(), |sum, [entry]| sum + *entry);
    // more outside values than are passed one by one, and several entries of one array
    let around: [T; 10] = std::array::from_fn(|k| x * T::lit(0.1 * k as f64) + place);
    let ([many], _) = T::repeat(&weights, [short], |_, [w], [sum]| {
        let own = around.iter().fold(sum, |sum, a| sum.mul_add(*w, *a));
        let of_line = line.iter().step_by(5).fold(own, |sum, entry| sum.mul_add(*w, *entry));
        ([of_line.tanh()], [])
    });
    (next, [found + made + many, most, least + sum - short])
}

fn variable(name: &str) -> Variable {
    Variable { name: name.into(), unit: "1".into(), meaning: "Number".into(), initial: 0.0 }
}

/// Description of a block.
type Step = fn(&[Expression; LENGTH], [Expression; 2]) -> ([Expression; LENGTH], [Expression; 3]);

fn block() -> Block {
    recorded(filtered)
}

fn recorded(step: Step) -> Block {
    let (graph, mut block) = record(|| {
        let line: [Expression; LENGTH] = std::array::from_fn(|_| Expression::input());
        let input = [Expression::input(), Expression::input()];
        let (next, out) = step(&line, input);
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
    // a delay line is shifted by a loop, not entry by entry
    assert!(!made.source.contains("next_5"), "{}", made.source);
    // tanh, the table's loop and the inner one, many outside values: short loops have no function
    let loops =
        made.source.matches("for (int i").count() - made.source.matches("for (int i =").count();
    assert_eq!(loops, 4, "{}", made.source);
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

/// Unused results of a loop are not computed; the others count for each row.
#[test]
fn operations_of_a_loop_are_counted_for_each_row() {
    let block = block();
    let plan = Plan::of(&block).unwrap();
    let count = Count::of(&block.graph, &plan.entries[0]);
    // a hyperbolic tangent a row; a sine before all loops
    // and one a row in the last loop
    assert_eq!(count.functions, 2 * LENGTH + 1, "{count:?}");
}

/// Relative difference of a fused product from two separate roundings.
#[test]
fn loops_and_tables_in_structured_text_are_those_in_rust() {
    let texts: Vec<String> = block_units(&block()).unwrap().iter().map(Unit::text).collect();
    let mut plc = Library::parse(texts.iter().map(String::as_str)).instance("FB_Made");
    let mut line = [0.0; LENGTH];
    for k in 0..500_u32 {
        let t = f64::from(k);
        let (x, place) = (40.0 * (0.37 * t).sin() + 20.0, 8.0 * (0.11 * t).cos() + 5.0);
        let (next, out) = filtered(&line, [x, place]);
        line = next;
        plc.call(&[("x", x), ("place", place)]);
        for (found, wanted) in plc.shown().iter().zip(out) {
            assert!(
                (found - wanted).abs() <= 1e-12 * wanted.abs().max(1e3),
                "{k}: {found}, {wanted}"
            );
        }
    }
}

/// The same sum over a table five times: of constants, of an input, and twice in each row of another loop; and a
/// different sum.
fn sums(
    line: &[Expression; LENGTH],
    [x, place]: [Expression; 2],
) -> ([Expression; LENGTH], [Expression; 3]) {
    let lit = <Expression as Real>::lit;
    let rows = line.map(|value| [value]);
    let sum = |from: Expression| {
        let ([sum], _) = Expression::repeat(&rows, [lit(0.0)], |_, [value], [sum]| {
            let at = (*value).mul_add(x, from);
            ([sum + at.tanh() + Expression::interpolate(line, at) * lit(0.5)], [])
        });
        sum
    };
    let ([all], _) = Expression::repeat(&rows, [x], |k, [value], [all]| {
        ([all + sum(k * *value) + sum(*value - place)], [])
    });
    let ([other], _) = Expression::repeat(&rows, [x], |_, [value], [other]| {
        ([((other - *value).tanh() * place - *value).tanh()], [])
    });
    (*line, [sum(lit(0.001)) + sum(lit(0.002)), sum(place) + other, all])
}

/// A shared body, with a constant or an outside value as its argument.
#[test]
fn a_repeated_part_is_printed_once_as_a_function() {
    let block = recorded(sums);
    let source = files(std::slice::from_ref(&block), "made", Precision::Double).unwrap().source;
    let defined: Vec<&str> = source
        .lines()
        .filter(|line| line.starts_with("static") && line.contains("hb_repeats_"))
        .collect();
    assert_eq!(defined.len(), 3, "{source}");
    let calls = |name: &str| source.matches(&format!("{name}(")).count() - 1;
    let mut all: Vec<usize> = (1..=3).map(|k| calls(&format!("hb_repeats_{k}"))).collect();
    all.sort_unstable();
    assert_eq!(all, [1, 1, 5], "{source}");

    let units = block_units(&block).unwrap();
    let texts: Vec<String> = units.iter().map(Unit::text).collect();
    let looked_up = texts.iter().filter(|text| text.contains("entries[i]")).count();
    assert_eq!((units.len(), looked_up), (5, 1), "{texts:?}");
    let repeated =
        texts.iter().filter(|text| text.contains(" x1 ") && text.contains("EXP(")).count();
    assert_eq!(repeated, 2, "{texts:?}");
    // a unit comes after those that it calls, and its name begins with the block's
    for (k, unit) in units.iter().enumerate() {
        assert!(unit.name.contains("_Made"), "{}", unit.name);
        let text = unit.text();
        let calls = |other: &&Unit| {
            [format!(": {};", other.name), format!("{}(", other.name)]
                .iter()
                .any(|expected| text.contains(expected))
        };
        let called = units.iter().filter(calls);
        for other in called {
            let place = units.iter().position(|unit| unit == other).unwrap();
            assert!(place < k, "{} calls {}", unit.name, other.name);
        }
    }
}

/// A function's comment states the rows of all loops that call it.
#[test]
fn a_functions_comment_names_the_rows_of_all_loops_that_call_it() {
    let crane = Description::uia_single_boom().unwrap();
    for block in [recorded(sums), scheduled_lqr_controller(&crane).unwrap()] {
        let source = files(std::slice::from_ref(&block), "made", Precision::Double).unwrap().source;
        let named = |text: &str| -> Option<String> {
            let (before, _) = text.split_once('(')?;
            let name = before.rsplit(' ').next()?;
            name.starts_with("hb_").then(|| name.to_string())
        };
        let mut called: std::collections::BTreeMap<String, std::collections::BTreeSet<u32>> =
            std::collections::BTreeMap::new();
        let lines: Vec<&str> = source.lines().collect();
        for (k, line) in lines.iter().enumerate() {
            let Some((_, rest)) = line.trim().split_once("for (int i") else { continue };
            // copy loops have the counter i
            if !rest.starts_with(|c: char| c.is_ascii_digit()) {
                continue;
            }
            let (_, bound) = rest.split_once(" < ").unwrap();
            // a conditional loop counts with all of its rows
            let bound = bound.split_once(" ? ").map_or(bound, |(_, rows)| rows);
            let digits: String = bound.chars().take_while(char::is_ascii_digit).collect();
            let Ok(count) = digits.parse() else { panic!("{line}") };
            let body = lines[k + 1..].iter().take_while(|line| line.trim() != "}");
            if let Some(name) = body.copied().find_map(named) {
                called.entry(name).or_default().insert(count);
            }
        }
        let mut commented = 0;
        for text in source.split("Part of the ").skip(1) {
            let Some((comment, rest)) = text.split_once(" rows.") else { continue };
            let (_, rows) = comment.split_once("for each of ").unwrap();
            let rows = rows.split_whitespace().filter_map(|word| word.parse().ok()).collect();
            let name = named(rest.split_once("static ").unwrap().1).unwrap();
            assert_eq!(called.get(&name), Some(&rows), "{name}: {comment}");
            commented += 1;
        }
        assert_eq!(commented, called.len());
    }
}

/// Lines of a loop's body other than copied entries, the call of a function and its results.
fn in_place_in_c(source: &str) -> Vec<&str> {
    let name = |line: &str| line.split('(').next()?.rsplit(' ').next().map(str::to_string);
    let functions: Vec<String> =
        source.lines().filter(|line| line.starts_with("static")).filter_map(name).collect();
    let mut lines = source.lines();
    let mut found = Vec::new();
    while let Some(line) = lines.next() {
        if !line.trim_start().starts_with("for (") {
            continue;
        }
        let copies = line.contains("(int i = 0");
        let body: Vec<&str> = lines.by_ref().take_while(|line| line.trim() != "}").collect();
        let statements = body.iter().filter(|line| line.trim_end().ends_with(';')).count();
        let text = body.concat();
        let is_copied = copies && !text.contains('(') && !text.contains('*');
        let is_call = |name: &String| {
            let call = format!("{name}(");
            text.trim_start().starts_with(&call) || text.contains(&format!(" = {call}"))
        };
        if statements != 1 || !(is_copied || functions.iter().any(is_call)) {
            found.extend(body);
        }
    }
    found
}

fn in_place_in_text(body: &str) -> Vec<&str> {
    let mut found = Vec::new();
    for inner in body.split("FOR ").skip(1).filter_map(|rest| rest.split_once(" DO\n")) {
        let (head, rest) = inner;
        let Some((body, _)) = rest.split_once("END_FOR;") else { continue };
        for statement in body.split(';').map(str::trim).filter(|statement| !statement.is_empty()) {
            let is_copied = head.starts_with("iEntry") && !statement.contains('(');
            let is_call = statement.starts_with("fb") || statement.contains(":= F_");
            let is_result = statement.contains(":= fb") && !statement.contains('(');
            if !(is_copied || is_call || is_result) {
                found.push(statement);
            }
        }
    }
    found
}

#[test]
fn loop_bodies_are_not_inlined() {
    let crane = Description::uia_single_boom().unwrap();
    for block in [block(), recorded(sums), scheduled_lqr_controller(&crane).unwrap()] {
        for precision in [Precision::Double, Precision::Single] {
            let source = files(std::slice::from_ref(&block), "made", precision).unwrap().source;
            assert!(source.contains(" Repeated parts: "), "nothing is repeated");
            assert_eq!(in_place_in_c(&source), [""; 0]);
        }
        for unit in block_units(&block).unwrap() {
            assert_eq!(in_place_in_text(&unit.body), [""; 0], "{}", unit.name);
        }
    }
}
