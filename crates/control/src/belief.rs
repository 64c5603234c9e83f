//! Numbers of which every observation is a weighted sum: what is believed of them, by Bayes' rule.

use crate::out_of_range::OutOfRange;
use hydroboom_math::Real;

/// What is off by more than so many standard deviations counts as that much: a model is never right to the last.
pub(crate) const FARTHEST: f64 = 3.0;

/// What is read back has standard deviations within these limits, over those known before: forgetting ends at those,
/// and is unstable far beyond; and what is certain to a millionth of them was not learned.
const DEVIATIONS: [f64; 2] = [1e-6, 4.0];
/// At least this share of a number's variance is its own, and not told by the numbers before it.
const OWN: f64 = 1e-9;

/// What is believed of `N` numbers: normally distributed about an estimate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Belief<const N: usize> {
    pub(crate) estimate: [f64; N],
    pub(crate) covariance: [[f64; N]; N],
}

/// How far an observation was off, and the variance that was expected of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Off {
    pub(crate) off: f64,
    pub(crate) variance: f64,
}

impl<const N: usize> Belief<N> {
    /// Before anything is seen: each number by itself, with its standard deviation, which is not zero.
    pub(crate) fn new(estimate: [f64; N], deviations: &[f64; N]) -> Self {
        let mut belief = Self { estimate, covariance: [[0.0; N]; N] };
        for (k, deviation) in deviations.iter().enumerate() {
            belief.covariance[k][k] = deviation.square();
        }
        belief
    }

    /// A number is something else from now on, known by its standard deviation: nothing that was seen tells of it.
    pub(crate) fn replace(&mut self, k: usize, value: f64, deviation: f64) {
        self.estimate[k] = value;
        for i in 0..N {
            (self.covariance[i][k], self.covariance[k][i]) = (0.0, 0.0);
        }
        self.covariance[k][k] = deviation.square();
    }

    /// Loses a share of all that is certain beyond what was known before (standard deviations `before`, of the first numbers, as many as it has),
    /// never more: P + share (P − P P_0⁻¹ P).
    pub(crate) fn forget(&mut self, share: f64, before: &[f64]) {
        let p = self.covariance;
        for i in 0..before.len() {
            for j in 0..before.len() {
                let lasting: f64 =
                    before.iter().enumerate().map(|(k, b)| p[i][k] * p[k][j] / b.square()).sum();
                self.covariance[i][j] += share * (p[i][j] - lasting);
            }
        }
    }

    /// How far something seen is off, the sum of the numbers weighted by `weights`, seen with a variance of its own.
    pub(crate) fn off(&self, weights: &[f64; N], seen: f64, own: f64) -> Off {
        let lever = self.lever(weights);
        Off { off: seen - sum(&self.estimate, weights), variance: own + sum(&lever, weights) }
    }

    /// Learns of it; how far it was off, as far as that counted.
    pub(crate) fn learn(&mut self, weights: &[f64; N], seen: f64, own: f64) -> Off {
        let Off { off, variance } = self.off(weights, seen, own);
        let most = FARTHEST * Real::sqrt(variance);
        let off = Real::clamp(off, -most, most);
        let lever = self.lever(weights);
        for i in 0..N {
            self.estimate[i] += lever[i] * off / variance;
            for j in 0..N {
                self.covariance[i][j] -= lever[i] * lever[j] / variance;
            }
        }
        Off { off, variance }
    }

    /// Learns of what lies between two things that are read wrongly by an amount each, one after the other: the last number is what the first was misread by,
    /// with a weight of -1, and then what the second was, which has the variance `misread`. `own` is the variance of what comes between.
    pub(crate) fn learn_between(
        &mut self,
        weights: &[f64; N],
        seen: f64,
        own: f64,
        misread: f64,
    ) -> Off {
        let lever = self.lever(weights);
        let found = self.learn(weights, seen, own + misread);
        let share = misread / found.variance;
        let last = N - 1;
        for i in 0..last {
            (self.covariance[i][last], self.covariance[last][i]) =
                (-lever[i] * share, -lever[i] * share);
        }
        self.estimate[last] = share * found.off;
        self.covariance[last][last] = misread * (1.0 - share);
        found
    }

    /// Each estimate, brought back into its range.
    pub(crate) fn keep_within(&mut self, ranges: &[[f64; 2]]) {
        for (estimate, [lowest, highest]) in self.estimate.iter_mut().zip(ranges) {
            *estimate = Real::clamp(*estimate, *lowest, *highest);
        }
    }

    /// Refuses what cannot have been learned: an estimate beyond its range, a variance beyond what the standard deviations
    /// known `before` allow, a covariance with which the matrix is not positive definite. Fields count the estimates, then
    /// the upper triangle of the covariance, row by row.
    ///
    /// Covariances are checked by Cholesky's decomposition of the correlations, so that units do not matter: beside
    /// those before it, each has a range.
    ///
    /// # Errors
    ///
    /// The first number that is not within its range.
    pub(crate) fn check(
        &self,
        ranges: &[[f64; 2]; N],
        before: &[f64; N],
    ) -> Result<(), OutOfRange> {
        let field = |i: usize, j: usize| N + i * N - i * (i + 1) / 2 + j;
        for k in 0..N {
            OutOfRange::check(k, self.estimate[k], ranges[k])?;
        }
        for (k, before) in before.iter().enumerate() {
            let range = DEVIATIONS.map(|deviations| (deviations * before).square());
            OutOfRange::check(field(k, k), self.covariance[k][k], range)?;
        }
        let deviations: [f64; N] = core::array::from_fn(|k| Real::sqrt(self.covariance[k][k]));
        let mut root = [[0.0; N]; N];
        for i in 0..N {
            let mut own = 1.0;
            for j in 0..i {
                let scale = deviations[i] * deviations[j];
                let told: f64 = (0..j).map(|k| root[i][k] * root[j][k]).sum();
                let most = root[j][j] * Real::sqrt((own - OWN).max(0.0));
                let range = [told - most, told + most].map(|correlation| scale * correlation);
                OutOfRange::check(field(j, i), self.covariance[j][i], range)?;
                root[i][j] = (self.covariance[j][i] / scale - told) / root[j][j];
                own -= root[i][j].square();
            }
            root[i][i] = Real::sqrt(own.max(OWN));
        }
        Ok(())
    }

    fn lever(&self, weights: &[f64; N]) -> [f64; N] {
        core::array::from_fn(|i| sum(&self.covariance[i], weights))
    }
}

fn sum<const N: usize>(numbers: &[f64; N], weights: &[f64; N]) -> f64 {
    numbers.iter().zip(weights).map(|(number, weight)| number * weight).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One after the other or all at once: the same normal equations, by elimination.
    #[test]
    fn it_believes_what_least_squares_say() {
        let seen: [([f64; 2], f64); 4] =
            [([1.0, 2.0], 5.2), ([1.0, -1.0], -0.9), ([0.5, 0.3], 1.4), ([2.0, 1.0], 4.3)];
        let (deviations, own) = ([10.0, 4.0], 0.25);
        let mut belief = Belief::new([0.5, 0.2], &deviations);
        let mut normal = [[1.0 / 100.0, 0.0], [0.0, 1.0 / 16.0]];
        let mut right = [0.5 / 100.0, 0.2 / 16.0];
        for (weights, value) in &seen {
            belief.learn(weights, *value, own);
            for i in 0..2 {
                right[i] += weights[i] * value / own;
                for j in 0..2 {
                    normal[i][j] += weights[i] * weights[j] / own;
                }
            }
        }
        let determinant = normal[0][0] * normal[1][1] - normal[0][1] * normal[1][0];
        let wanted = [
            (right[0] * normal[1][1] - right[1] * normal[0][1]) / determinant,
            (right[1] * normal[0][0] - right[0] * normal[1][0]) / determinant,
        ];
        for (found, wanted) in belief.estimate.iter().zip(wanted) {
            assert!((found - wanted).abs() < 1e-12, "{found} for {wanted}");
        }
        let variance = belief.covariance[0][0];
        assert!((variance * determinant / normal[1][1] - 1.0).abs() < 1e-9, "{variance}");
    }

    /// Certainty beyond what was known before fades as an exponential, and leaves that.
    #[test]
    fn what_is_forgotten_ends_at_what_was_known_before() {
        let (before, share) = ([3.0], 1e-3);
        let mut belief = Belief::new([0.0], &before);
        belief.learn(&[1.0], 2.0, 1e-2);
        let certainty = |belief: &Belief<1>| 1.0 / belief.covariance[0][0] - 1.0 / 9.0;
        let learned = certainty(&belief);
        for k in 1..=20_000 {
            belief.forget(share, &before);
            let fading = learned * (-share * f64::from(k)).exp();
            let left = certainty(&belief);
            // steps of a thousandth follow an exponential to a few of them
            assert!(left > 0.0 && (left - fading).abs() < 1e-2 * learned, "{k}: {left}");
        }
        assert!((belief.covariance[0][0] - 9.0).abs() < 1e-3, "{belief:?}");
        assert!((belief.estimate[0] - 2.0).abs() < 0.01, "{belief:?}");
    }

    /// Each of three things is misread by an amount of its own: by what lies between them as by all their differences at once, which are correlated.
    #[test]
    fn what_is_misread_once_ends_one_thing_and_begins_the_next() {
        let (weights, seen) = ([1.0, 2.0, 0.5], [1.3, 1.6, 0.9]);
        let (before, own, misread) = (10.0, 0.04, [0.3, 0.5, 0.2, 0.4]);
        let mut belief = Belief::new([0.0, 0.0], &[before, Real::sqrt(misread[0])]);
        for k in 0..3 {
            belief.learn_between(&[weights[k], -1.0], seen[k], own, misread[k + 1]);
        }
        // the same at once: covariance of the three differences, inverted by elimination
        let mut rows = [[0.0; 5]; 3];
        for k in 0..3 {
            rows[k][k] = own + misread[k] + misread[k + 1];
            if k > 0 {
                (rows[k][k - 1], rows[k - 1][k]) = (-misread[k], -misread[k]);
            }
            (rows[k][3], rows[k][4]) = (weights[k], seen[k]);
        }
        for pivot in 0..3 {
            let row = rows[pivot].map(|entry| entry / rows[pivot][pivot]);
            rows[pivot] = row;
            for other in (0..3).filter(|other| *other != pivot) {
                let by = rows[other][pivot];
                for (entry, of) in rows[other].iter_mut().zip(row) {
                    *entry -= by * of;
                }
            }
        }
        let [known, towards] = [3, 4].map(|column| {
            let products = weights.iter().zip(rows).map(|(weight, row)| weight * row[column]);
            products.sum::<f64>()
        });
        let certainty = known + 1.0 / (before * before);
        let [found, variance] = [belief.estimate[0], belief.covariance[0][0]];
        assert!((found - towards / certainty).abs() < 1e-12, "{found}");
        assert!((variance * certainty - 1.0).abs() < 1e-12, "{variance}");
    }

    #[test]
    fn nothing_is_known_of_a_number_that_was_replaced() {
        let mut belief = Belief::new([1.0, 1.0], &[2.0, 0.5]);
        belief.learn(&[1.0, 1.0], 3.0, 1e-2);
        let other = belief.estimate[1];
        belief.replace(0, 7.0, 2.0);
        assert_eq!((belief.estimate, belief.covariance[0]), ([7.0, other], [4.0, 0.0]));
    }

    const BEFORE: [f64; 3] = [2.0, 1e-6, 30.0];
    const RANGES: [[f64; 2]; 3] = [[-1.0, 9.0], [0.0, 1e-5], [-100.0, 100.0]];

    /// What has been learned of three numbers of very different units.
    fn learned() -> Belief<3> {
        let mut belief = Belief::new([1.0, 1e-6, 5.0], &BEFORE);
        belief.learn(&[1.0, 1e6, 0.1], 3.0, 0.01);
        belief.learn(&[1.0, -2e6, 0.2], 0.5, 0.1);
        belief
    }

    fn refused(change: impl Fn(&mut Belief<3>)) -> Option<usize> {
        let mut belief = learned();
        change(&mut belief);
        belief.check(&RANGES, &BEFORE).err().map(|wrong| wrong.field)
    }

    #[test]
    fn what_cannot_have_been_learned_is_refused_by_its_field() {
        assert_eq!(refused(|_| {}), None);
        assert_eq!(refused(|b| b.estimate[2] = 101.0), Some(2));
        assert_eq!(refused(|b| b.estimate[0] = f64::NAN), Some(0));
        for (k, field) in [3, 6, 8].into_iter().enumerate() {
            for value in [0.0, -1e-9, 5e-324, f64::MAX, f64::INFINITY, f64::NAN] {
                assert_eq!(refused(|b| b.covariance[k][k] = value), Some(field), "{value}");
            }
        }
        for (i, j, field) in [(0, 1, 4), (0, 2, 5), (1, 2, 7)] {
            for times in [1.001, -1.001, 1e9, f64::INFINITY, f64::NAN] {
                let wholly = |b: &Belief<3>| Real::sqrt(b.covariance[i][i] * b.covariance[j][j]);
                let refused = refused(|b| b.covariance[i][j] = times * wholly(b));
                assert_eq!(refused, Some(field), "{i} {j} {times}");
            }
        }
    }

    /// Within the range that is told the determinants of all leading blocks are above zero, and beyond it not.
    #[test]
    fn the_range_that_is_told_is_where_a_covariance_is_positive_definite() {
        let mut belief = learned();
        belief.covariance[1][2] = 1.0;
        let OutOfRange { range, .. } = belief.check(&RANGES, &BEFORE).unwrap_err();
        let determinant = |covariance: f64| {
            let [[a, b, c], [_, d, _], [.., f]] = belief.covariance;
            let e = covariance;
            (a * (d * f - e * e) - b * (b * f - e * c) + c * (b * e - d * c)) / (a * d * f)
        };
        let width = range[1] - range[0];
        for (end, inwards) in range.into_iter().zip([1.0, -1.0]) {
            assert!(determinant(end + 1e-6 * inwards * width) > 0.0);
            assert!(determinant(end - 1e-6 * inwards * width) < 0.0);
        }
    }
}
