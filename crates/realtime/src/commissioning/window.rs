//! Mean, deviation and drift of a signal over a window.

/// Sums of a signal over a window of evenly spaced values, counted from its first value so that they stay small.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Window {
    origin: f64,
    count: f64,
    sum: f64,
    squares: f64,
    /// Sum of value times place: the slope follows from it.
    weighted_sum: f64,
}

impl Window {
    /// Takes the next value, in the unit of the signal. After a NaN mean and drift are NaN, and both deviations 0.
    pub fn add(&mut self, value: f64) {
        if self.count == 0.0 {
            self.origin = value;
        }
        let off = value - self.origin;
        self.weighted_sum += self.count * off;
        self.count += 1.0;
        self.sum += off;
        self.squares += off * off;
    }

    /// Number of values.
    pub fn count(&self) -> f64 {
        self.count
    }

    /// Mean, in the unit of the signal; NaN of an empty window.
    pub fn mean(&self) -> f64 {
        self.origin + self.sum / self.count
    }

    /// Standard deviation √(Σ(x − x̄)² / n), in the unit of the signal; 0 of an empty window.
    pub fn deviation(&self) -> f64 {
        let mean = self.sum / self.count;
        (self.squares / self.count - mean * mean).max(0.0).sqrt()
    }

    /// Standard deviation about the least-squares line through all values, in the unit of the signal; 0 below two
    /// values.
    ///
    /// √(σ² − d² (n + 1) / (12 (n − 1))), with the deviation σ, the drift d and the number of values n.
    pub fn residual_deviation(&self) -> f64 {
        let (n, ramp) = (self.count, self.drift());
        let of_line = ramp * ramp * (n + 1.0) / (12.0 * (n - 1.0));
        (self.deviation().powi(2) - of_line).max(0.0).sqrt()
    }

    /// Change from the first value to the last one of the least-squares line through all of them, in the unit of the
    /// signal; NaN below two values.
    ///
    /// (n − 1) Σ(k − k̄) x_k / (n (n² − 1) / 12), with the place k = 0 … n − 1.
    pub fn drift(&self) -> f64 {
        let n = self.count;
        let spread = n * (n * n - 1.0) / 12.0;
        (n - 1.0) * (self.weighted_sum - 0.5 * (n - 1.0) * self.sum) / spread
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_has_its_drift_and_an_alternating_signal_none() {
        let mut ramp = Window::default();
        (0..101).for_each(|k| ramp.add(0.3 + 1e-3 * f64::from(k)));
        assert!((ramp.drift() - 0.1).abs() < 1e-12 && (ramp.mean() - 0.35).abs() < 1e-12);
        let mut alternating = Window::default();
        (0..1000).for_each(|k| alternating.add(if k % 2 == 0 { 1.0 } else { -1.0 }));
        assert!((alternating.deviation() - 1.0).abs() < 1e-12);
        assert!(alternating.drift().abs() < 0.01);
        assert!((alternating.residual_deviation() - 1.0).abs() < 1e-3);
        assert!(ramp.residual_deviation() < 1e-6);
        assert!(Window::default().mean().is_nan() && Window::default().drift().is_nan());
    }
}
