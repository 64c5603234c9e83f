//! Variance-based global sensitivity (Sobol indices): the share of an output's variance due to each key, alone and
//! including interactions.

use crate::case::Case;
use crate::error::SensitivityError;
use hydroboom_description::schema::Numbers;
use hydroboom_identify::{Free, prior};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

/// Bootstrap resamples for the bounds.
const RESAMPLES: usize = 400;
/// Share of the resamples outside the bounds, on either side: 95 % intervals.
const OUTSIDE: f64 = 0.025;

/// Sample of a global sensitivity study.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Study {
    /// Number of rows of the sample matrices A and B; each takes two simulations, and one more for every key.
    pub rows: usize,
    /// Seed of the pseudo-random sample points; the same seed gives the same result.
    pub seed: u64,
}

/// Sobol index \[-\] with its 95 % bootstrap interval. The exact index is between 0 and 1; its estimate may lie
/// outside. It is zero for an output that does not vary.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Index {
    /// Estimate \[-\].
    pub value: f64,
    /// Lower end of the interval \[-\].
    pub low: f64,
    /// Upper end of the interval \[-\].
    pub high: f64,
}

/// Sobol indices of all keys for one output, with the output's mean and standard deviation.
#[derive(Clone, Debug, PartialEq)]
pub struct Sobol {
    /// Mean of the output in its SI unit.
    pub mean: f64,
    /// Standard deviation of the output in its SI unit.
    pub deviation: f64,
    /// First-order indices \[-\]: the share of the variance due to each key alone, in the order of the keys.
    pub first: Vec<Index>,
    /// Total-effect indices \[-\]: the share of the variance that remains if all other keys are fixed, in the order of
    /// the keys.
    pub total: Vec<Index>,
}

/// Outputs of one row: at A, at B, and at A with each key of B, as `f[point][output]`.
type Row = Vec<Vec<f64>>;

/// Sobol indices for each output of a case, and the number of rows in which all simulations succeeded. Each key θ is
/// uniformly distributed in ln θ, with the standard deviation of its provenance ([`prior()`]). `go_on` is called before
/// each row; if it returns false, the row is skipped and the result comes from the rows done. Values beyond a key's
/// bounds are clipped to them.
///
/// Estimators: Saltelli et al. 2010 (doi:10.1016/j.cpc.2009.09.018) for the first order, E\[f(B) (f(A_B) − f(A))\]/V.
/// Jansen 1999 (doi:10.1016/S0010-4655(98)00154-4) for the total, E\[(f(A) − f(A_B))²\]/(2 V). A_B is A with the key's
/// values from B, V the variance; bounds are by bootstrap over rows.
///
/// # Errors
///
/// [`SensitivityError::Nothing`] if fewer than two rows could be simulated.
pub fn sobol(
    case: &Case,
    free: &[Free],
    study: Study,
    go_on: &(dyn Fn() -> bool + Sync),
) -> Result<(Vec<Sobol>, usize), SensitivityError> {
    let origins: Vec<String> =
        case.description.entries().map(|(_, _, o)| o.provenance.clone()).collect();
    // a uniform distribution of half-width √3 σ has standard deviation σ
    let widths: Vec<f64> =
        free.iter().map(|key| 3.0_f64.sqrt() * prior(&origins[key.place])).collect();
    let rows: Vec<Row> = (0..study.rows)
        .into_par_iter()
        .filter_map(|row| {
            if !go_on() {
                return None;
            }
            // each row has its own random stream, so that rows can be drawn in any order
            let stream = study.seed ^ (row as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            let mut random = Pcg64Mcg::seed_from_u64(stream);
            let mut point = || -> Vec<f64> {
                widths.iter().map(|w| random.random_range(-1.0..=1.0) * w).collect()
            };
            let (a, b) = (point(), point());
            let mut points = vec![a.clone(), b.clone()];
            for k in 0..free.len() {
                let mut mixed = a.clone();
                mixed[k] = b[k];
                points.push(mixed);
            }
            points.iter().map(|shift| evaluated(case, free, shift)).collect::<Option<Row>>()
        })
        .collect();
    if rows.len() < 2 {
        return Err(SensitivityError::Nothing { asked: study.rows });
    }
    let mut random = Pcg64Mcg::seed_from_u64(study.seed);
    let draws: Vec<Vec<usize>> = (0..RESAMPLES)
        .map(|_| (0..rows.len()).map(|_| random.random_range(0..rows.len())).collect())
        .collect();
    let found = (0..case.outputs.len()).map(|output| indices(&rows, free.len(), output, &draws));
    Ok((found.collect(), rows.len()))
}

/// The outputs with the keys moved by `shift` in ln θ; `None` where the machine cannot be built or simulated.
fn evaluated(case: &Case, free: &[Free], shift: &[f64]) -> Option<Vec<f64>> {
    let mut numbers = case.description.numbers.to_array();
    for (key, shift) in free.iter().zip(shift) {
        let (low, high) = key.bounds();
        numbers[key.place] = (numbers[key.place] * shift.exp()).clamp(low, high);
    }
    let values = case.evaluate(&Numbers::from_array(numbers)).ok()?;
    values.iter().all(|v| v.is_finite()).then_some(values)
}

fn indices(rows: &[Row], keys: usize, output: usize, draws: &[Vec<usize>]) -> Sobol {
    let all: Vec<usize> = (0..rows.len()).collect();
    let (mean, deviation) = spread(rows, output, &all);
    let bounded = |of: &dyn Fn(&[usize]) -> f64| {
        let mut drawn: Vec<f64> = draws.iter().map(|draw| of(draw)).collect();
        drawn.sort_by(f64::total_cmp);
        let at = |share: f64| drawn[((drawn.len() - 1) as f64 * share).round() as usize];
        Index { value: of(&all), low: at(OUTSIDE), high: at(1.0 - OUTSIDE) }
    };
    let first = (0..keys).map(|k| bounded(&|draw| first_order(rows, output, k, draw))).collect();
    let total = (0..keys).map(|k| bounded(&|draw| total_order(rows, output, k, draw))).collect();
    Sobol { mean, deviation, first, total }
}

/// Mean and standard deviation of an output over both halves of some rows.
fn spread(rows: &[Row], output: usize, draw: &[usize]) -> (f64, f64) {
    let values = || draw.iter().flat_map(|r| [rows[*r][0][output], rows[*r][1][output]]);
    let count = 2.0 * draw.len() as f64;
    let mean = values().sum::<f64>() / count;
    let square = values().map(|v| (v - mean).powi(2)).sum::<f64>() / count;
    (mean, square.sqrt())
}

/// S = E[f(B) (f(A with B's key) − f(A))]/V. Subtracting the mean from f(B) only reduces the estimator's variance.
fn first_order(rows: &[Row], output: usize, key: usize, draw: &[usize]) -> f64 {
    let (mean, deviation) = spread(rows, output, draw);
    let sum: f64 = draw
        .iter()
        .map(|r| {
            let row = &rows[*r];
            (row[1][output] - mean) * (row[2 + key][output] - row[0][output])
        })
        .sum();
    sum / draw.len() as f64 / deviation.powi(2).max(f64::MIN_POSITIVE)
}

/// S_T = E[(f(A) − f(A with B's key))²]/(2 V).
fn total_order(rows: &[Row], output: usize, key: usize, draw: &[usize]) -> f64 {
    let (_, deviation) = spread(rows, output, draw);
    let sum: f64 =
        draw.iter().map(|r| (rows[*r][0][output] - rows[*r][2 + key][output]).powi(2)).sum();
    0.5 * sum / draw.len() as f64 / deviation.powi(2).max(f64::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows of the Ishigami function, whose indices are known in closed form.
    #[test]
    fn indices_of_a_known_function_are_found_within_their_bounds() {
        let (a, b) = (7.0, 0.1);
        let pi = std::f64::consts::PI;
        let f = |x: &[f64; 3]| x[0].sin() + a * x[1].sin().powi(2) + b * x[2].powi(4) * x[0].sin();
        let mut random = Pcg64Mcg::seed_from_u64(5);
        let rows: Vec<Row> = (0..30_000)
            .map(|_| {
                let mut point = || [(); 3].map(|()| random.random_range(-pi..=pi));
                let (x, y) = (point(), point());
                let mut row = vec![vec![f(&x)], vec![f(&y)]];
                for k in 0..3 {
                    let mut mixed = x;
                    mixed[k] = y[k];
                    row.push(vec![f(&mixed)]);
                }
                row
            })
            .collect();
        let draws: Vec<Vec<usize>> = (0..100)
            .map(|_| (0..rows.len()).map(|_| random.random_range(0..rows.len())).collect())
            .collect();
        let found = indices(&rows, 3, 0, &draws);
        let (p4, p8) = (pi.powi(4), pi.powi(8));
        let v1 = 0.5 * (1.0 + b * p4 / 5.0).powi(2);
        let v2 = a * a / 8.0;
        let v13 = b * b * p8 * (1.0 / 18.0 - 1.0 / 50.0);
        let v = v1 + v2 + v13;
        assert!((found.mean - a / 2.0).abs() < 0.1, "{}", found.mean);
        assert!((found.deviation / v.sqrt() - 1.0).abs() < 0.03);
        for (index, exact) in found.first.iter().zip([v1 / v, v2 / v, 0.0]) {
            assert!((index.value - exact).abs() < 0.025, "{index:?} for {exact}");
            assert!(index.low - 0.02 < exact && exact < index.high + 0.02, "{index:?} for {exact}");
        }
        for (index, exact) in found.total.iter().zip([(v1 + v13) / v, v2 / v, v13 / v]) {
            assert!((index.value - exact).abs() < 0.025, "{index:?} for {exact}");
        }
    }
}
