//! Order of computation of a block, divided into values derived from parameters and values of each call.

use crate::block::{Block, Target};
use crate::error::ExportError;
use crate::graph::{Node, Op};
use std::collections::{HashMap, HashSet};

/// Order of computation of a block: values that follow from the parameters, computed once, and values of each call.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Indices of the parameters on which a result depends.
    pub parameters: Vec<usize>,
    /// Nodes that depend on parameters only, in topological order: computed when parameters change.
    pub preparing: Vec<Node>,
    /// Those nodes of `preparing`, and parameters, that the entries need: the values to be stored.
    pub prepared: Vec<Node>,
    /// For each entry the nodes to be computed in a call, in topological order.
    pub entries: Vec<Vec<Node>>,
}

impl Plan {
    /// Order of computation of a block.
    ///
    /// # Errors
    ///
    /// [`ExportError::Foreign`] if a result depends on a quantity that is no input, state or parameter of the block.
    pub fn of(block: &Block) -> Result<Self, ExportError> {
        let graph = &block.graph;
        let given: HashSet<Node> =
            block.inputs.iter().chain(&block.states).map(|(_, node)| *node).collect();
        let parameters: HashMap<Node, usize> =
            block.parameters.iter().enumerate().map(|(k, (_, node))| (*node, k)).collect();
        // whether a node depends on inputs or states
        let mut moves = vec![false; graph.len()];
        for node in graph.nodes() {
            let op = graph.op(node);
            let is_input = matches!(op, Op::Input(_)) && !parameters.contains_key(&node);
            moves[node.0 as usize] = given.contains(&node)
                || is_input
                || matches!(op, Op::Row(_) | Op::Read(..) | Op::Carry(..) | Op::Loop(_))
                || graph.operands(node).into_iter().any(|operand| moves[operand.0 as usize]);
        }
        let stays = |node: Node| !moves[node.0 as usize];
        let is_number = |node: Node| {
            let op = graph.op(node);
            !op.is_condition() && !matches!(op, Op::SinCos(_) | Op::Constant(_) | Op::Table(_))
        };

        let mut prepared: HashSet<Node> = HashSet::new();
        let mut entries = Vec::new();
        for entry in &block.entries {
            let mut seen: HashSet<Node> = HashSet::new();
            let mut open: Vec<(Node, Target)> =
                entry.results.iter().map(|(target, node)| (*node, *target)).collect();
            while let Some((node, target)) = open.pop() {
                if given.contains(&node) || seen.contains(&node) {
                    continue;
                }
                if stays(node) && is_number(node) {
                    prepared.insert(node);
                    continue;
                }
                seen.insert(node);
                let op = graph.op(node);
                if matches!(op, Op::Input(_)) {
                    let result = block.result_name(target);
                    return Err(ExportError::Foreign { block: block.name.clone(), result });
                }
                open.extend(graph.operands(node).into_iter().map(|operand| (operand, target)));
            }
            entries.push(sorted(seen.into_iter().filter(|n| graph.constant(*n).is_none())));
        }
        let mut preparing: HashSet<Node> = HashSet::new();
        let mut open: Vec<Node> = prepared.iter().copied().collect();
        while let Some(node) = open.pop() {
            if preparing.insert(node) {
                open.extend(graph.operands(node));
            }
        }
        let used: HashSet<usize> =
            preparing.iter().filter_map(|node| parameters.get(node)).copied().collect();
        let is_computed =
            |n: &Node| graph.constant(*n).is_none() && !matches!(graph.op(*n), Op::Input(_));
        Ok(Self {
            parameters: sorted(used),
            preparing: sorted(preparing.into_iter().filter(is_computed)),
            prepared: sorted(prepared),
            entries,
        })
    }
}

impl Block {
    fn result_name(&self, target: Target) -> String {
        match target {
            Target::State(k) => self.states[k].0.name.clone(),
            Target::Output(k) => self.outputs[k].name.clone(),
        }
    }
}

fn sorted<T: Ord>(of: impl IntoIterator<Item = T>) -> Vec<T> {
    let mut all: Vec<T> = of.into_iter().collect();
    all.sort_unstable();
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::block::{Entry, Variable};
    use crate::expression::{Expression, record};
    use std::rc::Rc;

    fn variable(name: &str) -> Variable {
        Variable { name: name.into(), unit: "1".into(), meaning: String::new(), initial: 0.0 }
    }

    /// y = p² x + z, with or without z as an input.
    fn block(has_z: bool) -> (Block, [Node; 3]) {
        let (graph, (nodes, results)) = record(|| {
            let (p, x, z) = (Expression::input(), Expression::input(), Expression::input());
            let square = p * p;
            let product = square * x;
            ([p, x, z].map(Expression::node), [square, product, product + z].map(Expression::node))
        });
        let [p, x, z] = nodes;
        let mut inputs = vec![(variable("x"), x)];
        inputs.extend(has_z.then(|| (variable("z"), z)));
        let block = Block {
            name: "made".into(),
            meaning: String::new(),
            graph: Rc::new(graph),
            parameters: vec![(variable("p"), p)],
            inputs,
            states: Vec::new(),
            outputs: vec![variable("y")],
            entries: vec![Entry {
                name: "step".into(),
                meaning: "made".into(),
                results: vec![(Target::Output(0), results[2])],
            }],
            period: None,
            labels: HashMap::new(),
        };
        (block, results)
    }

    #[test]
    fn parameter_expressions_are_computed_once_and_others_at_each_call() {
        let (block, [square, product, sum]) = block(true);
        let plan = Plan::of(&block).unwrap();
        assert_eq!((plan.preparing, plan.prepared), (vec![square], vec![square]));
        assert_eq!(plan.entries, [vec![product, sum]]);
    }

    #[test]
    fn a_result_that_depends_on_a_foreign_input_is_refused_by_name() {
        let message = Plan::of(&block(false).0).unwrap_err().to_string();
        assert!(message.contains("made: y depends"), "{message}");
    }
}
