//! Prediction error: smallest tracking error under disturbances and incomplete information for a controller
//! with delay.
//!
//! A command that acts on the piston at time k depends on measurements up to k − h only. The variance of
//! the tracking error is therefore at least the variance of the piston position given these measurements.
//! This holds for any linear law, and with Gaussian variables for any law. Minimum variance control attains
//! it if the motor allows:
//!
//! ```text
//! E e_k² ≥ c_k P_{k|k−h} c_kᵀ,    P_{j+1|j} = F_j P_{j|j} F_jᵀ + Q,
//! P_{j|j} = P_{j|j−1} − P_{j|j−1} Hᵀ (H P_{j|j−1} Hᵀ + R)⁻¹ H P_{j|j−1}
//! ```
//!
//! Along a motion this is the Riccati recursion of the Kalman filter for the model linearised along it. At
//! rest it converges to the error of an LQG loop without control cost. More delay, more noise and a larger
//! initial covariance never reduce it.
//!
//! Sources: K. J. Åström, *Introduction to Stochastic Control Theory*, 1970, chapter 6 (minimum variance
//! control); T. J. Harris, *Assessment of control loop performance*, Can. J. Chem. Eng. 67 (1989) 856-861.

use hydroboom_control::estimation::error_covariance::{Covariance, corrected, output_deviation};

/// Linear system along a course with N states.
pub(super) struct LinearCourse<const N: usize> {
    /// State transition matrix F of each period, N × N.
    pub transitions: Vec<[[f64; N]; N]>,
    /// Output rows of the measured signals at each time, one time more than there are periods. The first signal is the
    /// tracked one.
    pub outputs: Vec<[[f64; N]; 2]>,
    /// Process noise: variance that each state gains in a period \[squared state unit\].
    pub process: [f64; N],
}

/// Available information and its delay.
#[derive(Clone, Copy, Debug)]
pub(super) struct Information<const N: usize> {
    /// Error covariance of the state before the first measurement, N × N.
    pub initial: Covariance<f64, N>,
    /// Variances of the measurement noise \[squared unit of the signal\].
    pub noise: [f64; 2],
    /// Delay h from a measurement to the effect of the command that depends on it \[control periods\].
    pub horizon: f64,
}

/// Prediction error at each time.
pub(super) struct PredictionError<const N: usize> {
    /// Error covariance of the state at each time, given the measurements usable by then.
    pub covariances: Vec<Covariance<f64, N>>,
    /// RMS of the tracked output's error over the course, in its unit.
    pub rms: f64,
}

impl<const N: usize> LinearCourse<N> {
    /// Covariance one period later, or a share of it.
    fn predicted(&self, p: &Covariance<f64, N>, k: usize, share: f64) -> Covariance<f64, N> {
        let Some(transition) = self.transitions.get(k).or(self.transitions.last()) else {
            return *p;
        };
        let rows = std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                let same = f64::from(u8::from(i == j));
                same + share * (transition[i][j] - same)
            })
        });
        let mut next = propagate(p, &rows);
        for (i, variance) in self.process.iter().enumerate() {
            next[i][i] += share * variance;
        }
        next
    }

    /// Covariance several periods after time k.
    fn after(
        &self,
        p: &Covariance<f64, N>,
        k: usize,
        periods: usize,
        share: f64,
    ) -> Covariance<f64, N> {
        let whole = (k..k + periods).fold(*p, |p, j| self.predicted(&p, j, 1.0));
        if share > 0.0 { self.predicted(&whole, k + periods, share) } else { whole }
    }

    /// Covariance after the measurement update at time k.
    fn corrected(
        &self,
        mut p: Covariance<f64, N>,
        k: usize,
        noise: [f64; 2],
    ) -> Covariance<f64, N> {
        for (row, variance) in self.outputs[k].iter().zip(noise) {
            let shared: [f64; N] = std::array::from_fn(|i| dot(&p[i], row));
            let s = dot(&shared, row) + variance;
            if s > 0.0 {
                let gain = shared.map(|shared| shared / s);
                corrected(&mut p, &gain, &shared, s);
            }
        }
        p
    }

    /// Error covariances of the state given the usable measurements, and the RMS error of the tracked output.
    pub fn prediction_error(&self, known: &Information<N>) -> PredictionError<N> {
        let times = self.outputs.len();
        let (whole, share) = (known.horizon.floor() as usize, known.horizon.fract());
        let mut covariances = Vec::with_capacity(times);
        // before the first measurement has an effect
        for k in 0..whole.min(times) {
            covariances.push(self.after(&known.initial, 0, k, share));
        }
        let mut before = known.initial;
        for k in 0..times.saturating_sub(whole) {
            let filtered = self.corrected(before, k, known.noise);
            covariances.push(self.after(&filtered, k, whole, share));
            before = self.predicted(&filtered, k, 1.0);
        }
        let variance = |(p, rows): (&Covariance<f64, N>, &[[f64; N]; 2])| {
            output_deviation(p, &rows[0]).powi(2)
        };
        let square: f64 = covariances.iter().zip(&self.outputs).map(variance).sum();
        PredictionError { covariances, rms: (square / times.max(1) as f64).sqrt() }
    }
}

fn dot<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// `F P Fᵀ`.
fn propagate<const N: usize>(p: &Covariance<f64, N>, rows: &[[f64; N]; N]) -> Covariance<f64, N> {
    let left: Covariance<f64, N> = std::array::from_fn(|i| {
        (0..N).fold([0.0; N], |sum, k| std::array::from_fn(|j| sum[j] + rows[i][k] * p[k][j]))
    });
    std::array::from_fn(|i| std::array::from_fn(|j| dot(&left[i], &rows[j])))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_pcg::Pcg64Mcg;

    /// Plant of one measured state; its second output carries no information.
    fn first_order(pole: f64, process: f64, periods: usize) -> LinearCourse<1> {
        LinearCourse {
            transitions: vec![[[pole]]; periods],
            outputs: vec![[[1.0], [0.0]]; periods + 1],
            process: [process],
        }
    }

    fn rms(course: &LinearCourse<1>, noise: f64, horizon: f64) -> f64 {
        let known = Information { initial: [[0.0]], noise: [noise, 1.0], horizon };
        course.prediction_error(&known).rms
    }

    /// Exact measurements that act h periods later: q (1 − a^2h)/(1 − a²), Åström's minimum variance.
    #[test]
    fn delay_costs_the_error_of_minimum_variance_control() {
        let (pole, process) = (0.9_f64, 0.3);
        let course = first_order(pole, process, 20_000);
        for delay in [1, 2, 5] {
            let exact = process * (1.0 - pole.powi(2 * delay)) / (1.0 - pole * pole);
            let found = rms(&course, 0.0, f64::from(delay)).powi(2);
            assert!((found / exact - 1.0).abs() < 1e-3, "{delay}: {found} {exact}");
        }
        assert_eq!(rms(&course, 0.0, 0.0), 0.0);
        let errors = [0.0, 0.5, 1.0, 1.5, 2.0].map(|delay| rms(&course, 0.2, delay));
        assert!(errors.windows(2).all(|pair| pair[0] < pair[1]), "{errors:?}");
    }

    /// Random walk with measurement noise of the same variance as its steps: the filtered variance is the
    /// golden ratio minus one.
    #[test]
    fn noise_costs_the_error_of_the_kalman_filter() {
        let course = first_order(1.0, 1.0, 20_000);
        let golden = 0.5 * (1.0 + 5.0_f64.sqrt());
        let found = rms(&course, 1.0, 0.0).powi(2);
        assert!((found / (golden - 1.0) - 1.0).abs() < 1e-3, "{found}");
        let errors = [0.0, 0.1, 1.0, 10.0].map(|noise| rms(&course, noise, 0.0));
        assert!(errors.windows(2).all(|pair| pair[0] < pair[1]), "{errors:?}");
    }

    /// Double integrator with white disturbance: the variance of its position after h periods is q T² Σ i²,
    /// i from 1 to h − 1.
    #[test]
    fn the_variance_of_a_double_integrator_grows_with_the_delay() {
        let (period, process) = (0.01, 2.0);
        let course = LinearCourse {
            transitions: vec![[[1.0, period], [0.0, 1.0]]; 200],
            outputs: vec![[[1.0, 0.0], [0.0, 1.0]]; 201],
            process: [0.0, process],
        };
        let known = Information { initial: [[0.0; 2]; 2], noise: [0.0; 2], horizon: 4.0 };
        let last = course.prediction_error(&known).covariances[200][0][0];
        let exact = process * period * period * (1.0 + 4.0 + 9.0);
        assert!((last / exact - 1.0).abs() < 1e-12, "{last} {exact}");
    }

    /// Minimum variance control on the filter's prediction attains the bound; proportional control on the
    /// measurement does not.
    #[test]
    fn minimum_variance_control_attains_the_bound_and_another_law_does_not() {
        let (pole, process, noise, delay, periods) = (0.95_f64, 1.0_f64, 0.5_f64, 2_usize, 60_000);
        let bound = rms(&first_order(pole, process, periods), noise, delay as f64);
        // stationary gain of the filter by its recursion
        let p = (0..500).fold(0.0, |p, _| pole * pole * p * noise / (p + noise) + process);
        let gain = p / (p + noise);
        let run = |is_minimum_variance: bool| {
            let mut random = Pcg64Mcg::seed_from_u64(1);
            let mut deviate = move || -> f64 { StandardNormal.sample(&mut random) };
            let (mut x, mut estimate, mut square) = (0.0, 0.0, 0.0);
            // delayed commands, oldest first; with a delay of one, a command acts in its own period
            let mut on_the_way = vec![0.0; delay - 1];
            for _ in 0..periods {
                let read = x + noise.sqrt() * deviate();
                estimate += gain * (read - estimate);
                let predicted = on_the_way.iter().fold(estimate, |z, u| pole * z + u);
                on_the_way.push(if is_minimum_variance { -pole * predicted } else { -0.5 * read });
                let acts = on_the_way.remove(0);
                x = pole * x + acts + process.sqrt() * deviate();
                estimate = pole * estimate + acts;
                square += x * x;
            }
            (square / periods as f64).sqrt()
        };
        let [best, other] = [true, false].map(run);
        assert!((best / bound - 1.0).abs() < 0.02, "{best} {bound}");
        assert!(other > 1.03 * bound, "{other} {bound}");
    }
}
