//! Connection of the FMI layer to a block, in C.

use super::bounds;
use crate::block::{Block, ControlPeriod, Variable};
use std::fmt::Write;

fn has_balance(block: &Block) -> bool {
    block.entries.iter().any(|entry| entry.name == "balance")
}

/// The functions of Newton's method to equilibrium, for a block that has them.
pub(super) fn balanced(block: &Block, parameters: &[&Variable]) -> String {
    if !has_balance(block) {
        return String::new();
    }
    let prefix = format!("hb_{}", block.name);
    let vapour = parameters.iter().find(|v| v.name == "oil_vapour_pressure_bar");
    let vapour = vapour
        .and_then(|v| bounds::key(&v.name))
        .map_or("0.0".into(), |key| format!("{:?} * n->p.oil_vapour_pressure_bar", key.factor));
    format!(
        "\nstatic void hb_restart({prefix}_state *s)\n{{\n    {prefix}_start(s);\n}}\n\n\
         static void hb_balance(hb_numbers *n)\n{{\n    {prefix}_balance(&n->c, &n->s);\n}}\n\n\
         static int hb_pulls(const hb_numbers *n)\n{{\n    return n->s.pressure_a < {vapour};\n}}\n"
    )
}

/// Connection of the FMI layer to a block: definitions before it, functions after it.
pub(super) fn connection(
    block: &Block,
    slopes: Option<&Block>,
    counts: [usize; 4],
    arrays: usize,
    inputs: &[&Variable],
    token: &str,
) -> [String; 2] {
    let prefix = format!("hb_{}", block.name);
    let [parameters, given, states, outputs] = counts;
    let rates = if slopes.is_some() { states } else { 0 };
    let balances = u8::from(has_balance(block));
    let framed = u8::from(block.period.is_some());
    let before = format!(
        "#define HB_TOKEN \"{token}\"\n#define HB_PARAMETERS {parameters}u\n#define HB_INPUTS {given}u\n#define HB_STATES {states}u\n\
         #define HB_OUTPUTS {outputs}u\n#define HB_RATES {rates}u\n#define HB_BALANCES {balances}\n#define HB_FRAMED {framed}\n#define HB_ARRAYS {arrays}\n#define HB_TYPE(part) {prefix}_##part\n"
    );
    let mut fill = String::new();
    // all other members are zero
    for v in inputs.iter().filter(|v| v.initial != 0.0) {
        let _ = writeln!(fill, "    n->u.{} = {:?};", v.name, v.initial);
    }
    let (one, show, period) = match block.period {
        None => (
            format!("    {prefix}_step(&n->c, &n->s, &n->u);"),
            format!("    {prefix}_see(&n->c, &n->s, &n->y);"),
            "n->u.step".to_string(),
        ),
        Some(ControlPeriod { length, steps }) => {
            let prepared = if parameters > 0 { "&n->c, " } else { "" };
            let mut one = format!("    {prefix}_update({prepared}&n->s, &n->u, &n->y);");
            if steps > 0 {
                one += &format!(
                    "\n    {{\n        int steps = {steps};\n        while (steps-- > 0) {{\n            \
                     {prefix}_step(&n->s);\n        }}\n    }}"
                );
            }
            (one, "    (void)n;".to_string(), format!("{length:?}"))
        }
    };
    let (describe, prepare) = match parameters {
        0 => (String::new(), "    (void)n;".to_string()),
        _ => (
            format!("    {prefix}_describe(&n->p);\n"),
            format!("    {prefix}_prepare(&n->p, &n->c);"),
        ),
    };
    let after = format!(
        "\n/* ---- the block ---- */\n\nstatic void hb_fill(hb_numbers *n)\n{{\n{describe}    {prefix}_start(&n->s);\n\
         {fill}}}\n\nstatic void hb_prepare(hb_numbers *n)\n{{\n{prepare}\n}}\n\n\
         static void hb_one(hb_numbers *n)\n{{\n{one}\n}}\n\nstatic void hb_show(hb_numbers *n)\n{{\n{show}\n}}\n\n\
         static double hb_period(const hb_numbers *n)\n{{\n    (void)n;\n    return {period};\n}}\n\n\
         static double hb_inner(const hb_numbers *n)\n{{\n    (void)n;\n    return 1.0;\n}}\n"
    );
    let seen = slopes.map_or(String::new(), |slopes| {
        let name = format!("hb_{}", slopes.name);
        format!(
            "\nstatic void hb_slopes(const double given[], double seen[])\n{{\n    {name}_input u;\n    {name}_output y;\n    \
             memcpy(&u, given, sizeof u);\n    {name}_see(&u, &y);\n    memcpy(seen, &y, sizeof y);\n}}\n"
        )
    });
    [before, after + &seen]
}
