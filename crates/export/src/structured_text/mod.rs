//! IEC 61131-3 Structured Text: a function block for each block.
//!
//! A block starts from its initial values at its first call and whenever `bReset` is set. It recomputes the values
//! derived from its parameters whenever `bPrepare` is set. Most blocks consist of assignments to `LREAL`s, calls of
//! the standard's functions, and comments in `(* *)`. Only the scheduled LQR has arrays, `FOR` loops and units of its
//! own. A fused product is written as product and sum, and functions are those of the PLC: the last digits may differ
//! from Rust.

mod bench;
mod calls;
mod composed;
mod dialect;
mod function_block;
mod identifier;
mod lines;
pub mod plcopen;
mod replays;
mod single;
pub mod twincat;
mod unit;

pub use function_block::{block_units, function_block};
pub use identifier::{block_name, edge_name, switch_name};
pub use single::in_single_precision;
pub use unit::{Declared, Form, Kind, Section, Task, Unit};

use crate::controller::{controller, scheduled_lqr_controller, simulation_feedforward_controller};
use crate::crane::blocks;
use crate::error::ExportError;
use crate::statement::broken;
use dialect::literal;
use hydroboom_description::Description;

/// Largest line width.
const WIDTH: usize = 110;

/// Name of the list of global variables; in TwinCAT also the prefix of each.
const GLOBALS: &str = "GVL_Hydroboom";

/// All program organisation units of a PLC project with simulation feedforward: the recorded blocks, units composed of
/// them, programs, and the tasks that call them. Each comes after those that it uses.
///
/// # Errors
///
/// [`ExportError::Segments`], [`ExportError::Step`] or [`ExportError::Build`] if the crane cannot be exported,
/// [`ExportError::Design`] if no controller can be designed. [`ExportError::Machine`] or [`ExportError::Simulation`]
/// if the crane of the test bench cannot be simulated. [`ExportError::Foreign`] or [`ExportError::Constant`] if a
/// block cannot be written in the language.
pub fn units(description: &Description) -> Result<Vec<Unit>, ExportError> {
    let [hydraulics, boom] = blocks(description)?;
    let n = &description.numbers;
    let steps = (n.control_period / n.simulation_period).round().max(1.0) as u32;
    let mut all = Vec::new();
    let benchmark = function_block(&controller(description)?)?;
    let feedforward = function_block(&simulation_feedforward_controller(description)?)?;
    for block in [hydraulics, boom] {
        all.push(function_block(&block)?);
    }
    all.extend([benchmark.clone(), feedforward.clone()]);
    let step = literal(n.simulation_period);
    all.push(composed::simulation_feedforward(&feedforward, steps, &step));
    all.extend(block_units(&scheduled_lqr_controller(description)?)?);
    all.push(composed::control_task(&benchmark, n.control_period));
    all.extend([bench::comparison(), bench::test_bench(&replays::replays(description)?)]);
    // last, since it names the programs: some tools resolve only names read before
    all.push(composed::globals(&benchmark, n.control_period));
    Ok(all)
}

/// A comment broken into indented lines.
fn broken_comment(text: &str) -> String {
    broken(&format!("   {text}"), WIDTH)
}

fn line(text: &str, depth: usize) -> String {
    let indent = "    ".repeat(depth);
    broken(&format!("{indent}{text}"), WIDTH) + "\n"
}
