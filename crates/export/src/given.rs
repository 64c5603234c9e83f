//! Inputs of a recording: parameters, inputs and states of a block.

use crate::block::Variable;
use crate::expression::Expression;
use crate::graph::Node;
use crate::name::plain;
use hydroboom_description::Description;
use hydroboom_description::schema::{KEYS, Numbers};
use hydroboom_math::Real;

type E = Expression;

/// Every number of a crane file as a parameter, in the file's unit and in SI units.
pub(crate) fn parameters(description: &Description) -> (Vec<(Variable, Node)>, Numbers<E>) {
    let mut variables = Vec::new();
    let mut numbers = Vec::new();
    for (key, value, _) in description.entries() {
        let number = E::input();
        variables.push((
            Variable {
                name: plain(&key.path()),
                unit: key.unit.into(),
                meaning: key.meaning.into(),
                initial: value,
            },
            number.node(),
        ));
        numbers.push(number * E::lit(key.factor));
    }
    let mut numbers = numbers.into_iter();
    let zero = E::zero();
    let array: [E; KEYS.len()] = std::array::from_fn(|_| numbers.next().unwrap_or(zero));
    (variables, Numbers::from_array(array))
}

/// Keys of the benchmark's gains. No other value is derived from them, so they can be tuned during operation.
const TUNABLE: [&str; 4] = [
    "controller.proportional_per_s",
    "controller.integral_per_s2",
    "controller.pressure_feedback_m3_per_spa",
    "controller.high_pass_s",
];

/// The benchmark's gains as parameters, in the file's unit and in SI units; all other numbers are constants from the
/// file.
pub(crate) fn gains(description: &Description) -> (Vec<(Variable, Node)>, Numbers<E>) {
    let mut numbers = description.numbers.to_array().map(E::lit);
    let mut variables = Vec::new();
    for (place, (key, value, _)) in numbers.iter_mut().zip(description.entries()) {
        let path = key.path();
        if TUNABLE.contains(&path.as_str()) {
            let (name, unit, meaning) = (plain(&path), key.unit.into(), key.meaning.into());
            let number = E::input();
            variables.push((Variable { name, unit, meaning, initial: value }, number.node()));
            *place = number * E::lit(key.factor);
        }
    }
    (variables, Numbers::from_array(numbers))
}

/// A quantity as an input of the recording.
pub(crate) fn variable(name: &str, unit: &str, meaning: &str, initial: f64) -> (Variable, E) {
    let (name, unit, meaning) = (name.into(), unit.into(), meaning.into());
    (Variable { name, unit, meaning, initial }, E::input())
}

/// The quantity with the node of its number.
pub(crate) fn noded(of: (Variable, E)) -> (Variable, Node) {
    (of.0, of.1.node())
}

/// States with these names.
pub(crate) fn remembered(
    before: &str,
    names: &[&str],
    units: &[&str],
    meanings: &[&str],
) -> Vec<(Variable, E)> {
    let all = names.iter().zip(units).zip(meanings);
    let of = |((name, unit), meaning): ((&&str, &&str), &&str)| {
        variable(&format!("{before}{name}"), unit, meaning.trim(), 0.0)
    };
    all.map(of).collect()
}
