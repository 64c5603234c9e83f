//! First-order lag, discretised exactly for inputs that are constant over a step.

/// `τ y' + y = u`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lag {
    /// Gain of one step, 1 − exp(−step/τ).
    share: f64,
    output: f64,
}

impl Lag {
    /// A lag with time constant and step \[s\], in steady state at `output`. A time constant of zero gives no lag.
    pub(crate) fn new(time_constant: f64, step: f64, output: f64) -> Self {
        let share = match time_constant > 0.0 {
            true => -(-step / time_constant).exp_m1(),
            false => 1.0,
        };
        Self { share, output }
    }

    /// Advances by one step with the given input; returns the output.
    pub(crate) fn advance(&mut self, input: f64) -> f64 {
        // a gain of one returns the input, to the last bit
        self.output = match self.share < 1.0 {
            true => self.output + self.share * (input - self.output),
            false => input,
        };
        self.output
    }

    /// Current output.
    pub(crate) fn output(&self) -> f64 {
        self.output
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_step_response_is_exponential_at_any_step_size() {
        for step in [1e-4, 3e-3, 0.05] {
            let mut lag = Lag::new(0.02, step, 1.0);
            let count = (0.1_f64 / step).round();
            for _ in 0..count as usize {
                lag.advance(3.0);
            }
            let exact = 3.0 - 2.0 * (-count * step / 0.02).exp();
            assert!((lag.output() - exact).abs() < 1e-12, "{} against {exact}", lag.output());
        }
    }
}
