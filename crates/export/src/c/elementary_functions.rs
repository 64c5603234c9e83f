//! Elementary functions and other operations that generated code calls.

use super::Precision;
use super::dialect::C;
use super::lines::{Lines, line};
use crate::expression::{Expression, record};
use crate::graph::Node;
use crate::statement::{Dialect, Text};
use crate::writing::{Source, statements};
use hydroboom_math::elementary;
use std::collections::HashMap;

/// A recorded function of one number.
fn function(
    own: &str,
    name: &str,
    argument: &str,
    of: impl FnOnce(Expression) -> Vec<Expression>,
) -> String {
    let (graph, (x, results)) = record(|| {
        let x = Expression::input();
        let results: Vec<Node> = of(x).into_iter().map(Expression::node).collect();
        (x.node(), results)
    });
    let order: Vec<Node> =
        graph.nodes().filter(|n| graph.constant(*n).is_none() && *n != x).collect();
    let given = HashMap::from([(x, Text::whole(argument))]);
    let from = Source {
        graph: &graph,
        order: &order,
        results: &results,
        given: &given,
        arrays: &HashMap::new(),
        labels: &HashMap::new(),
    };
    let (dialect, mut functions) = (C(Precision::Double), Vec::new());
    let (said, results) = statements(&from, &dialect, &mut dialect.names(), &mut functions);
    let lines = Lines { real: &format!("{own}real"), functions: &functions, names: &[] };
    let body = lines.statements(&said);
    match results.as_slice() {
        [one] => format!(
            "\nstatic double {name}(double {argument})\n{{\n{body}{}}}\n",
            line(&format!("return {};", one.text))
        ),
        both => {
            let texts: Vec<&str> = both.iter().map(|t| t.text.as_str()).collect();
            let result = line(&format!("const hb_turn both = {{ {} }};", texts.join(", ")));
            format!(
                "\nstatic hb_turn {name}(double {argument})\n{{\n{body}{result}    return both;\n}}\n"
            )
        }
    }
}

/// Elementary functions and definitions of the generated code.
pub(super) fn definitions(precision: Precision, own: &str) -> String {
    // no warning about functions that no block calls
    const UNUSED: &str = "#if defined(__GNUC__)\n#define HB_MAYBE_UNUSED __attribute__((unused))\n#else\n#define HB_MAYBE_UNUSED\n#endif\n";
    let real = format!("{own}real");
    let shared = "\n#define HB_INFINITY INFINITY\n#define HB_NAN NAN\n";
    if precision == Precision::Single {
        let text = "#define HB_FMA fmaf\n#define HB_SQRT sqrtf\n#define hb_exp expf\n#define hb_ln logf\n#define hb_tanh tanhf\n\n\
             /* Sine and cosine of an angle [rad]. */\ntypedef struct {\n    hb_real sine;\n    hb_real cosine;\n} hb_turn;\n\n\
             HB_MAYBE_UNUSED static hb_turn hb_turn_of(float angle)\n{\n    const hb_turn both = { sinf(angle), cosf(angle) };\n    return both;\n}\n";
        let interpolated = include_str!("../interpolation.h").replace("HB_REAL", "float");
        return format!("{shared}\n{UNUSED}{text}{interpolated}").replace("hb_real", &real);
    }
    let interpolated = include_str!("../interpolation.h").replace("HB_REAL", "double");
    let bits = include_str!("../bits.h").replace("hb_real", &real);
    let recorded = [
        function(own, "hb_exp", "value", |x| vec![elementary::exp(x)]),
        function(own, "hb_tanh", "value", |x| vec![elementary::tanh(x)]),
        function(own, "hb_ln", "value", |x| vec![elementary::ln(x)]),
        function(own, "hb_turn_of", "angle", |x| {
            let (sin, cos) = elementary::sin_cos(x);
            vec![sin, cos]
        }),
    ];
    let recorded = recorded.concat().replace("\nstatic ", "\nHB_MAYBE_UNUSED static ");
    format!(
        "#include <stdint.h>\n#include <string.h>\n{shared}#define HB_SQRT sqrt\n\n{UNUSED}\n{bits}{recorded}{interpolated}"
    )
}
