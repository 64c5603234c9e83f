//! Blocks: named parts of a recorded graph, from which function blocks or sets of functions are generated.

use crate::graph::{Graph, Node};
use hydroboom_description::Description;
use std::collections::HashMap;
use std::rc::Rc;

/// Named quantity of a block: parameter, input, state or output.
#[derive(Clone, Debug, PartialEq)]
pub struct Variable {
    /// Name in snake case; for a parameter the crane file's key, with its unit.
    pub name: String,
    /// Unit as text, as `Pa`; `0/1` for a Boolean quantity, `code` for a status, empty or `1` for a dimensionless one.
    pub unit: String,
    /// Description for the comment of the generated declaration.
    pub meaning: String,
    /// Initial or default value, in the unit of the variable.
    pub initial: f64,
}

/// Destination of a result that an entry computes.
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
    /// Name in snake case, which becomes the end of the function's name.
    pub name: String,
    /// Description for the generated comment.
    pub meaning: String,
    /// Results: destination, and the node of the graph that gives its value.
    pub results: Vec<(Target, Node)>,
}

/// Control period of a block that is called at a fixed rate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ControlPeriod {
    /// Control period \[s\].
    pub length: f64,
    /// Integration steps of the simulated crane in a control period; 0 for a block without a simulated crane.
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

/// A recorded function block with parameters, inputs, states and outputs, from which every target language is
/// generated. It is a discrete-time system: each entry computes outputs and next states from inputs and states.
#[derive(Clone, Debug)]
pub struct Block {
    /// Name in snake case, from which the names of the generated types and functions are formed.
    pub name: String,
    /// Description for the generated comment.
    pub meaning: String,
    /// Graph of the recorded operations.
    pub graph: Rc<Graph>,
    /// Parameters, constant during operation, with the nodes of their values.
    pub parameters: Vec<(Variable, Node)>,
    /// Inputs of each call, with the nodes of their values.
    pub inputs: Vec<(Variable, Node)>,
    /// States, which are kept from call to call, with the nodes of their current values.
    pub states: Vec<(Variable, Node)>,
    /// Outputs, to which [`Target::Output`] refers by index.
    pub outputs: Vec<Variable>,
    /// Entries, each a function of the generated code.
    pub entries: Vec<Entry>,
    /// Control period; none for a block whose integration step is an input.
    pub period: Option<ControlPeriod>,
    /// Names of intermediate results, with a comment: the quantity and its equation.
    pub labels: HashMap<Node, (String, String)>,
}
