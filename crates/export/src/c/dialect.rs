//! Syntax of C99 expressions.

use super::Precision;
use crate::graph::Op;
use crate::name::Names;
use crate::statement::{Dialect, Precedence, Text, arithmetic, call, clear_infix};

/// Keywords of C and C++, and names used by the generated code.
pub(super) const RESERVED: [&str; 99] = [
    "auto",
    "break",
    "case",
    "char",
    "const",
    "continue",
    "default",
    "do",
    "double",
    "else",
    "enum",
    "extern",
    "float",
    "for",
    "goto",
    "if",
    "inline",
    "int",
    "long",
    "register",
    "restrict",
    "return",
    "short",
    "signed",
    "sizeof",
    "static",
    "struct",
    "switch",
    "typedef",
    "union",
    "unsigned",
    "void",
    "volatile",
    "while",
    "asm",
    "c",
    "p",
    "s",
    "u",
    "y",
    "x",
    "next",
    "errno",
    "signal",
    "turn",
    "i",
    "hb_real",
    // keywords of C++, since the header may be included there
    "alignas",
    "alignof",
    "bitand",
    "bitor",
    "bool",
    "catch",
    "class",
    "compl",
    "concept",
    "const_cast",
    "consteval",
    "constexpr",
    "constinit",
    "co_await",
    "co_return",
    "co_yield",
    "decltype",
    "delete",
    "dynamic_cast",
    "explicit",
    "export",
    "false",
    "friend",
    "mutable",
    "namespace",
    "new",
    "noexcept",
    "not",
    "not_eq",
    "nullptr",
    "operator",
    "or",
    "or_eq",
    "private",
    "protected",
    "public",
    "reinterpret_cast",
    "requires",
    "static_assert",
    "static_cast",
    "template",
    "this",
    "thread_local",
    "throw",
    "true",
    "try",
    "typeid",
    "typename",
    "using",
    "virtual",
    "wchar_t",
    "xor",
];

pub(super) struct C(pub(super) Precision);

impl Dialect for C {
    fn names(&self) -> Names {
        Names::new(&RESERVED)
    }

    fn has_parts(&self) -> bool {
        true
    }

    fn part(&self, array: &str, first: usize) -> String {
        format!("&{array}[{first}]")
    }

    fn constant(&self, value: f64) -> Text {
        let text = match value {
            v if v.is_nan() => "HB_NAN".into(),
            v if v.is_infinite() => {
                if v > 0.0 { "HB_INFINITY" } else { "-HB_INFINITY" }.to_string()
            }
            v => literal(v, self.0),
        };
        let binding = if text.starts_with('-') { Precedence::Sign } else { Precedence::Whole };
        Text::new(text, binding)
    }

    fn has_pairs(&self) -> bool {
        true
    }

    fn row(&self, counter: &str) -> Text {
        let real = if self.0 == Precision::Double { "double" } else { "float" };
        Text::new(format!("({real}){counter}"), Precedence::Sign)
    }

    fn operation(&self, op: Op, x: &[Text]) -> Text {
        use Precedence::*;
        if let Some(text) = arithmetic(op, x) {
            return text;
        }
        match op {
            Op::Neg(_) => Text::new(format!("-{}", x[0].inside(Sign)), Sign),
            Op::MulAdd(..) => call(x, "HB_FMA"),
            Op::Sqrt(_) => call(x, "HB_SQRT"),
            Op::Exp(_) => call(x, "hb_exp"),
            Op::Ln(_) => call(x, "hb_ln"),
            Op::Tanh(_) => call(x, "hb_tanh"),
            Op::SinCos(_) => call(x, "hb_turn_of"),
            Op::Sin(_) => Text::whole(format!("{}.sine", x[0].within(Whole))),
            Op::Cos(_) => Text::whole(format!("{}.cosine", x[0].within(Whole))),
            Op::Select(..) => {
                let [a, b, c] = [0, 1, 2].map(|k| x[k].inside(Choice));
                Text::new(format!("{a} ? {b} : {c}"), Choice)
            }
            Op::And(..) => clear_infix(x, "&&", And),
            Op::Or(..) => clear_infix(x, "||", Or),
            Op::Not(_) => Text::new(format!("!{}", x[0].inside(Sign)), Sign),
            Op::PowerOfTwo(_) => call(x, "hb_power_of_two"),
            Op::TurnedSine(..) => call(x, "hb_turned_sine"),
            Op::TurnedCosine(..) => call(x, "hb_turned_cosine"),
            Op::Mantissa(_) => call(x, "hb_mantissa"),
            Op::Exponent(_) => call(x, "hb_exponent"),
            // constants and inputs have their own text; arithmetic is handled above
            _ => Text::whole("0"),
        }
    }
}

/// The shortest literal with exactly this value.
fn literal(value: f64, precision: Precision) -> String {
    match precision {
        Precision::Double => format!("{value:?}"),
        Precision::Single => format!("{:?}f", value as f32),
    }
}
