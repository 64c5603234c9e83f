//! Condensed quadratic program of a horizon: the states are eliminated, and the unknowns are the commands
//! of the blocks.
//!
//! ```text
//! δz(k+1) = A_k δz(k) + b_k δu_k,  δz(0) = 0
//! minimise ½ Σ_k Σ_j (c_jᵀ δz(k) + d_j δu_k + r_j)² + ½ Σ_k (s_k δu_k + o_k)² + ½ (δz(N) + e)ᵀ P (δz(N) + e)
//! ```
//!
//! Source: H. G. Bock, K. J. Plitt, *A multiple shooting algorithm for direct solution of optimal control
//! problems*, 1984 (condensing).

use super::horizon::BLOCKS;
use super::quadratic_program::QuadraticProgram;
use nalgebra::{SMatrix, SVector};

/// Quantity of a block as an affine function of the state deviation at its start and of its command.
#[derive(Clone, Copy, Debug)]
pub(super) struct Linear<const Z: usize> {
    /// Gradient c_j with respect to the state deviation at the start of the block \[unit of the quantity per state
    /// unit\].
    pub state: SVector<f64, Z>,
    /// Derivative d_j with respect to the command deviation \[unit of the quantity per rev/s\].
    pub command: f64,
    /// Value r_j without a deviation, in the quantity's unit.
    pub value: f64,
}

/// Limit of such a quantity.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limit<const Z: usize> {
    /// Limited quantity as an affine function.
    pub of: Linear<Z>,
    /// Lower and upper limit, in the quantity's unit.
    pub range: [f64; 2],
    /// Price of a violation per unit of the quantity \[cost per unit\]; infinite for a hard limit.
    pub price: f64,
}

/// Block of the horizon, linearised about the present commands: Z states, L limits.
#[derive(Clone, Copy, Debug)]
pub(super) struct Block<const Z: usize, const L: usize> {
    /// State transition matrix A_k, Z × Z.
    pub transition: SMatrix<f64, Z, Z>,
    /// Input vector b_k: effect of the command \[state unit per rev/s\].
    pub input: SVector<f64, Z>,
    /// Weighted residuals at the end of the block, whose squares are the cost \[-\].
    pub residuals: [Linear<Z>; 2],
    /// Weighted residual of the command: derivative s_k \[1/(rev/s)\] and value o_k \[-\].
    pub command_residual: [f64; 2],
    /// Smallest and largest change of the command \[rev/s\].
    pub command_range: [f64; 2],
    /// Limits at the end of the block.
    pub limits: [Limit<Z>; L],
}

/// Sets up the program whose unknowns are the changes of the commands over `scale`. Its R rows are the L
/// limits of each block.
pub(super) fn condense<const Z: usize, const L: usize, const R: usize>(
    program: &mut QuadraticProgram<BLOCKS, R>,
    blocks: &[Block<Z, L>; BLOCKS],
    (cost_to_go, end): (&SMatrix<f64, Z, Z>, &SVector<f64, Z>),
    scale: f64,
) {
    // derivative of this block's δz with respect to the earlier commands
    let mut response = SMatrix::<f64, Z, BLOCKS>::zeros();
    program.hessian.fill(0.0);
    program.slope.fill(0.0);
    for (k, block) in blocks.iter().enumerate() {
        let gradient = |of: &Linear<Z>| {
            let mut gradient = response.tr_mul(&of.state);
            gradient[k] += of.command * scale;
            gradient
        };
        for residual in &block.residuals {
            let gradient = gradient(residual);
            for j in 0..=k {
                for i in 0..=k {
                    program.hessian[(i, j)] += gradient[i] * gradient[j];
                }
            }
            program.slope.axpy(residual.value, &gradient, 1.0);
        }
        let [slope, value] = block.command_residual;
        program.hessian[(k, k)] += (slope * scale) * (slope * scale);
        program.slope[k] += slope * scale * value;
        let [low, high] = block.command_range;
        (program.bounds[0][k], program.bounds[1][k]) = (low / scale, high / scale);
        for (l, limit) in block.limits.iter().enumerate() {
            let row = L * k + l;
            program.rows.set_column(row, &gradient(&limit.of));
            let [low, high] = limit.range;
            program.limits[0][row] = low - limit.of.value;
            program.limits[1][row] = high - limit.of.value;
            program.prices[row] = limit.price;
        }
        response = block.transition * response;
        let mut own = response.column_mut(k);
        own += block.input * scale;
    }
    let weighted = cost_to_go * response;
    program.hessian += response.tr_mul(&weighted);
    program.slope += weighted.tr_mul(end);
}
