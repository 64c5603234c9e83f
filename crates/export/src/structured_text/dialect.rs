//! Structured Text as a dialect: reserved words, literals and operations.

use super::lines::COUNTER;
use crate::graph::Op;
use crate::name::Names;
use crate::statement::{Dialect, Precedence, Text, arithmetic, call, clear_infix};

/// Keywords of the second and third edition, standard types, functions and function blocks, and names that some tools
/// reserve.
const RESERVED: &str = "\
    abs abstract acos action add adr and and_then any any_bit any_date any_derived any_elementary any_int any_magnitude any_num \
    any_real any_string array asin at atan atan2 bit bitadr bool by byte cal calc calcn case char class concat configuration \
    constant continue cos ctd ctu ctud date date_and_time delete dint div do ds dt dword else elsif en end_action end_case \
    end_class end_configuration end_for end_function end_function_block end_if end_interface end_method end_namespace \
    end_program end_property end_repeat end_resource end_step end_struct end_transition end_type end_var end_while eno eq \
    exit exp expt extends f_edge f_trig false final find for from function function_block ge gt if implements in indexof ini \
    initial_step insert int interface internal interval jmp jmpc jmpcn ld ldate ldn ldt le left len limit lint ln log lower_bound \
    lreal lt ltime ltod lword max method mid min mod move mul mux namespace ne non_retain not null of on or or_else overlap \
    override persistent pi plc pointer priority private program property protected public pvoid r r_edge r_trig read_only \
    read_write real ref ref_to reference repeat replace resource ret retain return right rol ror rs s sel sema shl shr sin single \
    sint sizeof sqrt sr st step stn string struct sub super tan task test then this time time_of_day to tod tof ton tp transition \
    true trunc type udint uint ulint union until upper_bound using usint uxint var var_access var_config var_external var_global \
    var_in_out var_input var_output var_temp wchar while with word wstring xint xor xorn xword";

/// IEC 61131-3 Structured Text.
pub(super) struct StructuredText;

impl Dialect for StructuredText {
    fn names(&self) -> Names {
        let reserved: Vec<&str> = RESERVED.split_whitespace().chain([COUNTER]).collect();
        Names::new(&reserved)
    }

    fn has_parts(&self) -> bool {
        false
    }

    /// Not used in this language.
    fn part(&self, array: &str, _first: usize) -> String {
        array.into()
    }

    fn constant(&self, value: f64) -> Text {
        let text = literal(value);
        let binding = if text.starts_with('-') { Precedence::Sign } else { Precedence::Whole };
        Text::new(text, binding)
    }

    fn has_pairs(&self) -> bool {
        false
    }

    fn row(&self, counter: &str) -> Text {
        Text::whole(format!("DINT_TO_LREAL({counter})"))
    }

    fn operation(&self, op: Op, x: &[Text]) -> Text {
        use Precedence::*;
        if let Some(text) = arithmetic(op, x) {
            return text;
        }
        match op {
            // a sign before a bracket or a number only: tools differ in the precedence of other operands
            Op::Neg(_) => Text::new(format!("-{}", x[0].inside(Sign)), Sum),
            Op::MulAdd(..) => {
                let product = format!("{} * {}", x[0].within(Product), x[1].inside(Product));
                Text::new(format!("{product} + {}", x[2].inside(Sum)), Sum)
            }
            Op::Sqrt(_) => call(x, "SQRT"),
            Op::Exp(_) => call(x, "EXP"),
            Op::Ln(_) => call(x, "LN"),
            // clamped to ±20, where tanh is ±1 in double precision: the exponential cannot overflow
            Op::Tanh(_) => Text::new(
                format!(
                    "1.0E0 - 2.0E0 / (EXP(2.0E0 * LIMIT(-2.0E1, {}, 2.0E1)) + 1.0E0)",
                    x[0].text
                ),
                Sum,
            ),
            // sine and cosine are separate functions: the pair is represented by its angle
            Op::SinCos(_) => x[0].clone(),
            Op::Sin(_) => call(x, "SIN"),
            Op::Cos(_) => call(x, "COS"),
            Op::Select(..) => {
                // an expression of two literals has no definite type: not every tool takes the widest
                let of = |k: usize| x[k].text.as_str();
                let bare = [1, 2].iter().all(|k| of(*k).parse::<f64>().is_ok());
                let kind = if bare { "LREAL#" } else { "" };
                Text::whole(format!("SEL({}, {kind}{}, {kind}{})", of(0), of(2), of(1)))
            }
            Op::And(..) => clear_infix(x, "AND", And),
            Op::Or(..) => clear_infix(x, "OR", Or),
            Op::Not(_) => Text::new(format!("NOT {}", x[0].inside(Sign)), Sign),
            _ => Text::whole("0.0E0"),
        }
    }
}

/// A literal that every tool accepts: with a point and an exponent.
pub(super) fn literal(value: f64) -> String {
    let text = format!("{value:E}");
    match text.split_once('E') {
        Some((digits, exponent)) if !digits.contains('.') => format!("{digits}.0E{exponent}"),
        _ => text,
    }
}
