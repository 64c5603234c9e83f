//! Discrete filters.

use hydroboom_math::{Real, record};

/// The high-pass `τ s/(τ s + 1)`, discretised by zero-order hold.
///
/// Its complement, the low-pass `1/(τ s + 1)`, is exact for an input held over the period:
/// `x ← a x + (1 − a) u`, `a = exp(−T/τ)`; the output is `u − x`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HighPass<T> {
    /// Coefficient of the low-pass over one period, a.
    keep: T,
}

impl<T: Real> HighPass<T> {
    /// High-pass with the time constant τ \[s\], sampled every `period` \[s\], both positive.
    pub fn new(time_constant: T, period: T) -> Self {
        Self { keep: (-(period / time_constant)).exp() }
    }

    /// High-pass filtered input, in the unit of the input. `memory` is the low-pass filtered input; start it at the
    /// first input for bumpless transfer.
    #[inline(always)]
    pub fn update(&self, memory: &mut T, input: T) -> T {
        let output = input - *memory;
        *memory = self.keep * *memory + (T::one() - self.keep) * input;
        output
    }
}

record! {
    /// State of a notch filter (transposed direct form II).
    pub struct NotchMemory<T> {
        /// First delayed sum
        #[unit = "of the input"]
        pub next: T,
        /// Second delayed sum
        #[unit = "of the input"]
        pub after: T,
    }
}

/// Notch filter `(s² + 2 ζ_n ω s + ω²)/(s² + 2 ζ_d ω s + ω²)`, discretised by the bilinear transform with prewarping
/// at ω.
///
/// Low frequencies pass unchanged; a sine of angular frequency ω is attenuated to ζ_n/ζ_d.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Notch<T> {
    /// Shares of the input now and two samples ago.
    now: T,
    before: T,
    /// Share of the last input, and of the last output, which are the same.
    last: T,
    /// Share of the output two samples ago.
    fed_back: T,
}

impl<T: Real> Notch<T> {
    /// Notch filter at ω \[rad/s\], below half the sampling frequency, with damping ratios `[ζ_n, ζ_d]` \[1\],
    /// sampled every `period` \[s\].
    pub fn new(frequency: T, [deep, wide]: [T; 2], period: T) -> Self {
        let (one, two) = (T::one(), T::lit(2.0));
        let (sine, cosine) = (frequency * period / two).sin_cos();
        let (tangent, square) = (sine / cosine, (sine / cosine).square());
        let [n, d] = [deep, wide].map(|zeta| two * zeta * tangent);
        let whole = one + d + square;
        Self {
            now: (one + n + square) / whole,
            last: two * (square - one) / whole,
            before: (one - n + square) / whole,
            fed_back: (one - d + square) / whole,
        }
    }

    /// State in equilibrium with a constant input: the output equals the input.
    #[inline(always)]
    pub fn steady(&self, input: T) -> NotchMemory<T> {
        let after = (self.before - self.fed_back) * input;
        NotchMemory { next: after, after }
    }

    /// Filtered input, in the unit of the input.
    #[inline(always)]
    pub fn update(&self, memory: &mut NotchMemory<T>, input: T) -> T {
        let output = self.now * input + memory.next;
        memory.next = self.last * (input - output) + memory.after;
        memory.after = self.before * input - self.fed_back * output;
        output
    }

    /// Coefficients of z⁰, z⁻¹ and z⁻²: numerator (of the input), then denominator (of the output).
    pub fn coefficients(&self) -> [[T; 3]; 2] {
        [[self.now, self.last, self.before], [T::one(), self.last, self.fed_back]]
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

    #[test]
    fn a_notch_attenuates_its_frequency_and_passes_low_frequencies() {
        let (frequency, period) = (50.0, 1e-3);
        let notch = Notch::new(frequency * core::f64::consts::TAU, [0.1, 0.7], period);
        // after a constant input the output has no step
        let mut memory = notch.steady(3.0);
        assert!((notch.update(&mut memory, 3.0) - 3.0).abs() < 1e-12);
        let largest = |hz: f64| {
            let mut memory = NotchMemory::default();
            let output = |k: i32| {
                let time = f64::from(k) * period;
                notch.update(&mut memory, (core::f64::consts::TAU * hz * time).sin())
            };
            (0..2000).map(output).skip(1000).fold(0.0, f64::max)
        };
        assert!((largest(frequency) - 0.1 / 0.7).abs() < 1e-3, "{}", largest(frequency));
        assert!((largest(1.0) - 1.0).abs() < 2e-3, "{}", largest(1.0));
    }
}
