//! Blocks: named parts of a recorded graph, from which function blocks or sets of functions are generated.

use crate::graph::{Graph, Node};
use hydroboom_description::Description;
use std::collections::HashMap;
use std::rc::Rc;

/// A named quantity of a block.
#[derive(Clone, Debug, PartialEq)]
pub struct Variable {
    /// Name in snake case; for a parameter the crane file's key, with its unit.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Meaning.
    pub meaning: String,
    /// Initial value in this unit.
    pub initial: f64,
}

/// Destination of a result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// Next value of the state with this index.
    State(usize),
    /// Output with this index.
    Output(usize),
}

/// A function of a block: results that are computed in one call.
#[derive(Clone, Debug)]
pub struct Entry {
    /// Name in snake case.
    pub name: String,
    /// Description for the generated comment.
    pub meaning: String,
    /// Results with their destinations.
    pub results: Vec<(Target, Node)>,
}

/// Control period of a block with a fixed step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ControlPeriod {
    /// Length \[s\].
    pub length: f64,
    /// Simulation steps in a control period; 0 for a block without a simulated crane.
    pub steps: u32,
}

impl ControlPeriod {
    /// The control period of a crane file, with or without steps of a simulated crane.
    pub(crate) fn of(description: &Description, simulates: bool) -> Self {
        let n = &description.numbers;
        let steps = (n.control_period / n.simulation_period).round().max(1.0) as u32;
        Self { length: n.control_period, steps: if simulates { steps } else { 0 } }
    }
}

/// A block with states, as generated for every target language.
#[derive(Clone, Debug)]
pub struct Block {
    /// Name in snake case.
    pub name: String,
    /// Description for the generated comment.
    pub meaning: String,
    /// Recorded operations.
    pub graph: Rc<Graph>,
    /// Parameters, constant during operation, with their nodes.
    pub parameters: Vec<(Variable, Node)>,
    /// Inputs of each call, with their nodes.
    pub inputs: Vec<(Variable, Node)>,
    /// States, with the nodes of their current values.
    pub states: Vec<(Variable, Node)>,
    /// Outputs.
    pub outputs: Vec<Variable>,
    /// Functions of the block.
    pub entries: Vec<Entry>,
    /// Control period; `None` for a block whose step is an input.
    pub period: Option<ControlPeriod>,
    /// Names of intermediate results, with a comment: the quantity and its equation.
    pub labels: HashMap<Node, (String, String)>,
}
