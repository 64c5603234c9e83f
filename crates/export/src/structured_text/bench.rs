//! Test bench: a program that replays results of Rust and reports the numerical difference of each block on the PLC.
//!
//! It is generic: each block is a [`Replay`], listed in `replays.rs`.

use super::dialect::literal;
use super::unit::{Declared, Kind, Section, Unit};
use super::{WIDTH, line};
use std::collections::{BTreeMap, HashMap};

/// Number of replayed calls.
pub(super) const CALLS: usize = 300;
/// Control periods in a call, for blocks that are replayed through a release of the load: 6 s at 1 ms.
pub(super) const PERIODS: usize = 20;
/// Allowed difference, as a share of the signal's scale.
const TOLERANCE: f64 = 1e-6;
/// Value reported for a difference that is not finite.
const MOST: f64 = 1e30;
/// Name of the program, and of the function block that compares.
pub(super) const PROGRAM: &str = "PRG_TestBench";
pub(super) const COMPARISON: &str = "FB_WorstDifference";
/// Largest number of changes of a value that is set by single statements; others are stored as an array.
const MOST_CHANGES: usize = CALLS / 8;
/// Decimal digits of compared values, far below the tolerance; this shortens the program. Inputs have all digits, since
/// the hydraulics amplify small differences when a valve opens.
const DIGITS: usize = 10;

/// Recorded values of an input or output, one for each of [`CALLS`] calls.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Values {
    /// `LREAL`
    Numbers(Vec<f64>),
    /// `BOOL`
    Truths(Vec<bool>),
    /// `DINT`
    Counts(Vec<i32>),
    /// `LREAL`, interpolated from one call's value to the next in [`PERIODS`] steps, with a scatter added in every
    /// other one.
    Ramps(Vec<f64>, f64),
}

/// Value of a ramp in a period of a call: between the call's value and the one before.
pub(super) fn ramp(values: &[f64], scatter: f64, call: usize, period: usize) -> f64 {
    let (before, now) = (values[call.saturating_sub(1)], values[call]);
    let share = (period + 1) as f64 / PERIODS as f64;
    before + share * (now - before) + scatter * (period % 2) as f64
}

impl Values {
    fn kind(&self) -> &'static str {
        match self {
            Self::Numbers(_) | Self::Ramps(..) => "LREAL",
            Self::Truths(_) => "BOOL",
            Self::Counts(_) => "DINT",
        }
    }

    /// Values with the digits that are compared.
    fn shortened(&self) -> Self {
        let short = |value: &f64| format!("{value:.DIGITS$e}").parse().unwrap_or(*value);
        match self {
            Self::Numbers(all) => Self::Numbers(all.iter().map(short).collect()),
            other => other.clone(),
        }
    }

    /// Values as literals.
    fn literals(&self) -> Vec<String> {
        let number = |value: &f64| literal(*value);
        let truth = |value: &bool| if *value { "TRUE" } else { "FALSE" }.to_string();
        match self {
            Self::Numbers(all) | Self::Ramps(all, _) => all.iter().map(number).collect(),
            Self::Truths(all) => all.iter().map(truth).collect(),
            Self::Counts(all) => all.iter().map(i32::to_string).collect(),
        }
    }

    /// Converts an expression of this type to `LREAL`.
    fn as_number(&self, expression: &str) -> String {
        match self {
            Self::Numbers(_) | Self::Ramps(..) => expression.into(),
            Self::Truths(_) => format!("SEL({expression}, LREAL#0.0E0, LREAL#1.0E0)"),
            Self::Counts(_) => format!("DINT_TO_LREAL({expression})"),
        }
    }
}

/// Recorded inputs and expected outputs of a block, by name.
///
/// An output's difference is relative to its scale, if it has one. A block that is called in each period of a call is
/// compared in the last period. `bReset` must be set in the first call, so that the bench can be repeated.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Replay {
    /// Name of the function block.
    pub(super) block: &'static str,
    /// Whether it is called in each period of a call; otherwise once a call.
    pub(super) each_period: bool,
    pub(super) inputs: Vec<(&'static str, Values)>,
    /// Outputs with their values and scales.
    pub(super) outputs: Vec<(&'static str, Values, f64)>,
}

/// Storage of the recorded values of all blocks.
#[derive(Default)]
struct Store {
    variables: Vec<Declared>,
    /// Statements that fill the arrays: not every tool accepts a list as the initial value of an array.
    filled: String,
    /// Values that are set in a call.
    set: BTreeMap<usize, String>,
    /// Expressions and indices in `variables` by content: equal values are stored once.
    known: HashMap<(&'static str, Vec<String>), (String, usize)>,
}

impl Store {
    /// Stores values; returns the expression for the value of the current call.
    fn kept(&mut self, what: &str, values: &Values) -> String {
        let literals = values.literals();
        let mut key = (values.kind(), literals.clone());
        if let Values::Ramps(_, scatter) = values {
            key.1.push(format!("ramp {scatter}"));
        }
        if let Some((known, place)) = self.known.get(&key) {
            self.variables[*place].comment += &format!(", {what}");
            return known.clone();
        }
        let is_new = |k: &usize| *k == 0 || literals[*k] != literals[*k - 1];
        let changes: Vec<usize> = (0..literals.len()).filter(is_new).collect();
        let count = self.variables.len() + 1;
        let is_ramp = matches!(values, Values::Ramps(..));
        let is_number = matches!(values, Values::Numbers(_));
        let expression = if is_ramp || is_number && changes.len() > MOST_CHANGES {
            let name = format!("aRecorded{count}");
            let kind = format!("ARRAY[0..{}] OF {}", literals.len() - 1, values.kind());
            self.variables.push(Declared::new(Section::Local, &name, &kind, None, what));
            let mut row = String::new();
            for (k, literal) in literals.iter().enumerate() {
                let next = format!("{name}[{k}] := {literal};");
                if row.len() + next.len() + 5 > WIDTH {
                    self.filled += &line(row.trim_end(), 1);
                    row.clear();
                }
                row += &(next + " ");
            }
            self.filled += &line(row.trim_end(), 1);
            match values {
                Values::Ramps(_, scatter) => format!(
                    "{name}[iBefore] + fShare * ({name}[iCall] - {name}[iBefore]) + {} * fOdd",
                    literal(*scatter)
                ),
                _ => format!("{name}[iCall]"),
            }
        } else {
            let name = format!("vRecorded{count}");
            self.variables.push(Declared::new(Section::Local, &name, values.kind(), None, what));
            for k in changes {
                *self.set.entry(k).or_default() += &line(&format!("{name} := {};", literals[k]), 1);
            }
            name
        };
        self.known.insert(key, (expression.clone(), count - 1));
        expression
    }
}

/// The function block that stores the largest difference.
pub(super) fn comparison() -> Unit {
    let variable = |section, name: &str, kind: &str, comment: &str| {
        Declared::new(section, name, kind, None, comment)
    };
    let most = literal(MOST);
    Unit {
        kind: Kind::FunctionBlock,
        name: COMPARISON.into(),
        comment: format!(
            "Stores the largest difference, as a share of a scale. One that is not finite counts as {most}, and \
             remains the largest."
        ),
        variables: vec![
            variable(Section::Input, "bReset", "BOOL", "Restart"),
            variable(Section::Input, "fFound", "LREAL", "Computed value"),
            variable(Section::Input, "fWanted", "LREAL", "Expected value"),
            Declared::new(
                Section::Input,
                "fScale",
                "LREAL",
                Some("1.0E0"),
                "Scale of the difference",
            ),
            variable(Section::Output, "fWorst", "LREAL", "Worst difference so far"),
            variable(Section::Local, "fDifference", "LREAL", ""),
            variable(Section::Local, "bFinite", "BOOL", ""),
        ],
        body: format!(
            "\
IF bReset THEN
    fWorst := 0.0E0;
END_IF;
fDifference := ABS(fFound - fWanted) / fScale;
(* no comparison holds for what is no number; both ways round, since tools differ on that *)
bFinite := (fDifference < {most}) AND ({most} > fDifference);
IF NOT bFinite THEN
    fDifference := {most};
END_IF;
IF fWorst < fDifference THEN
    fWorst := fDifference;
END_IF;
"
        ),
        tasks: Vec::new(),
    }
}

/// The test bench of these blocks.
pub(super) fn test_bench(replays: &[Replay]) -> Unit {
    let mut bench = Bench::default();
    for replay in replays {
        bench.add(replay);
    }
    Unit {
        kind: Kind::Program,
        name: PROGRAM.into(),
        comment: format!(
            "Replays {CALLS} calls of each block, of controllers {PERIODS} control periods in each, and compares what it shows with what Rust computed. Call it until bDone: bPassed says \
             that all is right, and of each block how far it is off, where less than {} is right.",
            literal(TOLERANCE)
        ),
        body: bench.body(),
        variables: bench.variables(),
        tasks: Vec::new(),
    }
}

/// Variables and statements of the test bench.
#[derive(Default)]
struct Bench {
    store: Store,
    outputs: Vec<Declared>,
    /// Instances of the blocks, and of the comparison of each.
    instances: Vec<Declared>,
    /// Statements that restart the comparisons.
    begins: String,
    /// Calls and comparisons of the blocks that are called once a call.
    calls: String,
    /// Calls of the blocks that are called in each period of a call.
    periods: String,
    /// Their comparisons.
    compares: String,
    /// Statements that judge the worst differences.
    judges: String,
    /// Names of the outputs that say whether a block agrees.
    all_passed: Vec<String>,
}

impl Bench {
    /// Adds the calls and comparisons of a block.
    fn add(&mut self, replay: &Replay) {
        let Replay { block, each_period, inputs, outputs } = replay;
        let name = block.strip_prefix("FB_").unwrap_or(block);
        let (worst, passed) = (format!("fWorst{name}"), format!("bPassed{name}"));
        let (instance, compared) = (format!("fb{name}"), format!("fbWorst{name}"));
        let said = format!("Worst difference of {block}, as a share of each signal's size");
        self.outputs.push(Declared::new(Section::Output, &worst, "LREAL", None, &said));
        let said = format!("{block} agrees with Rust; valid when bDone is set");
        self.outputs.push(Declared::new(Section::Output, &passed, "BOOL", None, &said));
        self.instances.push(Declared::new(Section::Local, &instance, block, None, ""));
        self.instances.push(Declared::new(Section::Local, &compared, COMPARISON, None, ""));
        self.begins += &line(
            &format!(
                "{compared}(bReset := TRUE, fFound := 0.0E0, fWanted := 0.0E0, fScale := 1.0E0);"
            ),
            1,
        );
        let given: Vec<String> = inputs
            .iter()
            .map(|(input, values)| {
                let kept = self.store.kept(&format!("{block}.{input}"), values);
                match (*each_period, *input) {
                    (true, "bReset") => format!("{input} := {kept} AND (iPeriod = 0)"),
                    _ => format!("{input} := {kept}"),
                }
            })
            .collect();
        let called = format!("{instance}({});", given.join(", "));
        match each_period {
            true => self.periods += &line(&called, 1),
            false => self.calls += &line(&called, 2),
        }
        let comparing = if *each_period { &mut self.compares } else { &mut self.calls };
        for (output, values, scale) in outputs {
            let wanted = self.store.kept(&format!("{block}.{output}"), &values.shortened());
            let found = values.as_number(&format!("{instance}.{output}"));
            let (wanted, scale) = (values.as_number(&wanted), literal(*scale));
            *comparing += &line(
                &format!(
                    "{compared}(bReset := FALSE, fFound := {found}, fWanted := {wanted}, fScale := {scale});"
                ),
                2,
            );
        }
        self.judges += &line(&format!("{worst} := {compared}.fWorst;"), 1);
        self.judges +=
            &line(&format!("{passed} := bDone AND ({worst} < {});", literal(TOLERANCE)), 1);
        self.judges +=
            &format!("    IF fWorst < {worst} THEN\n        fWorst := {worst};\n    END_IF;\n");
        self.all_passed.push(passed);
    }

    /// Statements of the program.
    fn body(&self) -> String {
        let Self { store, begins, calls, periods, compares, judges, all_passed, .. } = self;
        let set: String = store
            .set
            .iter()
            .map(|(k, said)| {
                let said = said.replace("    ", "        ");
                format!("    IF iCall = {k} THEN\n{said}    END_IF;\n")
            })
            .collect();
        let periods_in_call = literal(PERIODS as f64);
        let every = line(&format!("bPassed := {};", all_passed.join(" AND ")), 1);
        format!(
            "\
IF NOT bBegun THEN
{begins}{}    iCall := 0;
    iBefore := 0;
    iPeriod := 0;
    bDone := FALSE;
    bBegun := TRUE;
END_IF;
IF NOT bDone THEN
    (* what changes in this call *)
{set}    fShare := DINT_TO_LREAL(iPeriod + 1) / {periods_in_call};
    fOdd := DINT_TO_LREAL(iPeriod MOD 2);
    IF iPeriod = 0 THEN
        (* each block that is called once in a call, and what it shows beside what Rust computed *)
{calls}    END_IF;
    (* each block that is called in every period of a call *)
{periods}    iPeriod := iPeriod + 1;
    IF NOT (iPeriod < {PERIODS}) THEN
{compares}        iPeriod := 0;
        iBefore := iCall;
        iCall := iCall + 1;
    END_IF;
    bDone := NOT (iCall < {CALLS});
    fWorst := 0.0E0;
{judges}{every}END_IF;
",
            store.filled
        )
    }

    /// Variables of the program.
    fn variables(self) -> Vec<Declared> {
        let variable = |section, name: &str, kind: &str, comment: &str| {
            Declared::new(section, name, kind, None, comment)
        };
        let mut variables = vec![
            variable(Section::Output, "bDone", "BOOL", "All calls are done"),
            variable(Section::Output, "bPassed", "BOOL", "Every block agrees with Rust"),
            variable(Section::Output, "fWorst", "LREAL", "Worst difference of all blocks"),
        ];
        variables.extend(self.outputs);
        variables.extend([
            variable(Section::Local, "bBegun", "BOOL", "Set to FALSE to restart"),
            variable(Section::Local, "iCall", "DINT", "Call"),
            variable(Section::Local, "iBefore", "DINT", "Call before"),
            variable(Section::Local, "iPeriod", "DINT", "Control period within the call"),
            variable(Section::Local, "fShare", "LREAL", ""),
            variable(Section::Local, "fOdd", "LREAL", ""),
        ]);
        variables.extend(self.instances);
        variables.extend(self.store.variables);
        variables
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every type of input and output that a block may have.
    #[test]
    fn booleans_and_integers_are_compared_as_numbers() {
        let truths = Values::Truths((0..CALLS).map(|call| call > 2).collect());
        let counts = Values::Counts((0..CALLS).map(|call| call as i32 / 100).collect());
        let ramp = Values::Numbers((0..CALLS).map(|call| call as f64).collect());
        let replay = Replay {
            block: "FB_Framed",
            each_period: false,
            inputs: vec![("bEnable", truths.clone()), ("nMode", counts.clone()), ("xRef", ramp)],
            outputs: vec![("bOn", truths, 1.0), ("nStatus", counts, 1.0)],
        };
        let text = test_bench(&[replay]).text();
        for expected in [
            "fbFramed(bEnable := vRecorded1, nMode := vRecorded2, xRef := aRecorded3[iCall]);",
            "(* FB_Framed.bEnable, FB_Framed.bOn *)\n    vRecorded1 : BOOL;",
            "    IF iCall = 200 THEN\n        vRecorded2 := 2;\n    END_IF;",
            "SEL(fbFramed.bOn, LREAL#0.0E0, LREAL#1.0E0)",
            "DINT_TO_LREAL(fbFramed.nStatus)",
            "bPassed := bPassedFramed;",
        ] {
            assert!(text.contains(expected), "{expected} is not in\n{text}");
        }
        iecst::parse_pou(&text.replace("LREAL#", "")).unwrap();
    }
}
