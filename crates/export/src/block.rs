//! Parts of what was recorded, with names: what a function block or a set of functions is made of.

use crate::graph::{Graph, Node};
use hydroboom_description::Description;
use std::collections::HashMap;
use std::rc::Rc;

/// Something with a name.
#[derive(Clone, Debug, PartialEq)]
pub struct Variable {
    /// Name in snake case; a parameter's is that of the crane file, with its unit.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Meaning.
    pub meaning: String,
    /// Value to begin with, in this unit.
    pub initial: f64,
}

/// What a result is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// The next value of a state.
    State(usize),
    /// An output.
    Output(usize),
}

/// What is computed at once.
#[derive(Clone, Debug)]
pub struct Entry {
    /// Name in snake case.
    pub name: String,
    /// What it does.
    pub meaning: String,
    /// The results.
    pub results: Vec<(Target, Node)>,
}

/// Control period of a block whose steps are fixed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ControlPeriod {
    /// Length \[s\].
    pub length: f64,
    /// Steps of the simulated crane in it; 0 where nothing is simulated.
    pub steps: u32,
}

impl ControlPeriod {
    /// That of a crane file, with the steps of its simulated crane or without.
    pub(crate) fn of(description: &Description, simulates: bool) -> Self {
        let n = &description.numbers;
        let steps = (n.control_period / n.simulation_period).round().max(1.0) as u32;
        Self { length: n.control_period, steps: if simulates { steps } else { 0 } }
    }
}

/// A part with a memory of its own.
#[derive(Clone, Debug)]
pub struct Block {
    /// Name in snake case.
    pub name: String,
    /// What it is.
    pub meaning: String,
    /// What was recorded.
    pub graph: Rc<Graph>,
    /// Numbers that do not change while it runs.
    pub parameters: Vec<(Variable, Node)>,
    /// What comes from outside at each call.
    pub inputs: Vec<(Variable, Node)>,
    /// What it remembers.
    pub states: Vec<(Variable, Node)>,
    /// What it shows.
    pub outputs: Vec<Variable>,
    /// What it does.
    pub entries: Vec<Entry>,
    /// Its control period; none where it goes on by a step of its own.
    pub period: Option<ControlPeriod>,
    /// Names of what is in between, with a comment: the quantity, its equation.
    pub labels: HashMap<Node, (String, String)>,
}
