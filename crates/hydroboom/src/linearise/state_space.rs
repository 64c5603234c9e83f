//! Linear state-space system of a crane, and its files.

use crate::output;
use hydroboom_lab::mat_file::{Matrix, mat_file};
use hydroboom_model::Outputs;
use std::fmt::Write;
use std::ops::Index;
use std::path::Path;

/// System x' = A x + B u, y = C x + D u about an operating point, in SI units. The input u is the pump speed \[rev/s\].
pub struct StateSpace {
    /// Names of the states, with units.
    pub states: Vec<String>,
    /// Names of the outputs, with units.
    pub outputs: Vec<String>,
    /// State matrix, by rows: states by states.
    pub a: Vec<Vec<f64>>,
    /// Input matrix, by rows: states by one.
    pub b: Vec<Vec<f64>>,
    /// Output matrix, by rows: outputs by states.
    pub c: Vec<Vec<f64>>,
    /// Feedthrough matrix, by rows: outputs by one; zero.
    pub d: Vec<Vec<f64>>,
}

impl StateSpace {
    /// Name of the input, with its unit.
    pub const INPUT: &'static str = "pump_speed_rev_s";

    /// System of the Jacobians of a crane: of the state derivatives by state and input, and of the outputs by state.
    pub fn new<M: Index<(usize, usize), Output = f64>>(
        states: Vec<String>,
        a: &M,
        b: &M,
        c: &M,
    ) -> Self {
        let outputs: Vec<String> = Outputs::NAMES.iter().map(ToString::to_string).collect();
        let (n, m) = (states.len(), outputs.len());
        let (a, b, c) = (rows(a, n, n), rows(b, n, 1), rows(c, m, n));
        Self { states, outputs, a, b, c, d: vec![vec![0.0]; m] }
    }

    /// Writes each matrix as CSV, and all as crane.mat with the names of states, outputs and input.
    pub fn write(&self, folder: &Path) {
        let input = [Self::INPUT.to_string()];
        let (states, outputs) = (&self.states[..], &self.outputs[..]);
        let matrices = [
            ("A", &self.a, states, states),
            ("B", &self.b, states, &input[..]),
            ("C", &self.c, outputs, states),
            ("D", &self.d, outputs, &input[..]),
        ];
        for (name, rows, row_names, columns) in &matrices {
            let content = csv(rows, row_names, columns);
            output::file(&folder.join(format!("{name}.csv")), content.as_bytes());
        }
        let variables: Vec<Matrix<'_>> =
            matrices.iter().map(|(name, rows, ..)| Matrix { name, rows }).collect();
        let names = [("states", states), ("outputs", outputs), ("inputs", &input[..])];
        output::file(&folder.join("crane.mat"), &mat_file(&variables, &names));
    }
}

/// Rows of a matrix.
fn rows<M: Index<(usize, usize), Output = f64>>(
    matrix: &M,
    rows: usize,
    columns: usize,
) -> Vec<Vec<f64>> {
    (0..rows).map(|i| (0..columns).map(|j| matrix[(i, j)]).collect()).collect()
}

/// Matrix as CSV, with the names of its rows and columns.
fn csv(rows: &[Vec<f64>], row_names: &[String], columns: &[String]) -> String {
    let mut csv = format!("row,{}\n", columns.join(","));
    for (row, label) in rows.iter().zip(row_names) {
        let cells: Vec<String> = row.iter().map(|v| format!("{v:e}")).collect();
        // writing to a String cannot fail
        let _ = writeln!(csv, "{label},{}", cells.join(","));
    }
    csv
}
