//! Discrete filters.

use hydroboom_math::Real;

/// The high-pass `τ s/(τ s + 1)`, discretised by zero-order hold.
///
/// Its complement, the low-pass `1/(τ s + 1)`, is exact for an input held over the period:
/// `x ← a x + (1 − a) u`, `a = exp(−T/τ)`; the output is `u − x`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HighPass<T> {
    /// What the low-pass keeps over one period, a.
    keep: T,
}

impl<T: Real> HighPass<T> {
    /// A high-pass with the time constant τ \[s\], called every `period` \[s\].
    pub fn new(time_constant: T, period: T) -> Self {
        Self { keep: (-(period / time_constant)).exp() }
    }

    /// The filtered input. `memory` is the low-passed input; starting it at the first input starts
    /// without a bump.
    #[inline(always)]
    pub fn update(&self, memory: &mut T, input: T) -> T {
        let output = input - *memory;
        *memory = self.keep * *memory + (T::one() - self.keep) * input;
        output
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn step_response_decays_with_the_time_constant() {
        let filter = HighPass::new(1.04_f64, 1e-3);
        let mut memory = 0.0;
        assert_eq!(filter.update(&mut memory, 1.0), 1.0);
        let mut output = 0.0;
        for _ in 0..1040 {
            output = filter.update(&mut memory, 1.0);
        }
        let exact = f64::exp(-1.0);
        assert!((output - exact).abs() < 1e-12, "{output} against {exact}");
    }
}
