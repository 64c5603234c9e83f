//! Fourier transforms of real sequences, padded with zeros so that products of spectra are linear convolutions.

use realfft::num_complex::Complex;
use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};
use std::sync::Arc;

/// Half of the spectrum of a real, zero-padded sequence.
pub(super) type Spectrum = Vec<Complex<f64>>;

/// Fourier transforms of sequences padded with zeros to at least twice their length.
pub(super) struct Transforms {
    forward: Arc<dyn RealToComplex<f64>>,
    inverse: Arc<dyn ComplexToReal<f64>>,
}

impl Transforms {
    /// Transforms of sequences of a length.
    pub(super) fn new(length: usize) -> Self {
        let padded = (2 * length).next_power_of_two().max(2);
        let mut planner = RealFftPlanner::<f64>::new();
        Self {
            forward: planner.plan_fft_forward(padded),
            inverse: planner.plan_fft_inverse(padded),
        }
    }

    /// Spectrum of zeros.
    pub(super) fn zeros(&self) -> Spectrum {
        self.forward.make_output_vec()
    }

    /// Spectrum of a sequence; none if all its values are zero.
    pub(super) fn spectrum<'a>(&self, course: impl Iterator<Item = &'a f64>) -> Option<Spectrum> {
        let mut padded = self.forward.make_input_vec();
        padded.iter_mut().zip(course).for_each(|(to, from)| *to = *from);
        padded.iter().any(|v| *v != 0.0).then(|| self.forward_transform(&mut padded))
    }

    /// Spectrum of a padded sequence.
    pub(super) fn forward_transform(&self, padded: &mut [f64]) -> Spectrum {
        let mut found = self.zeros();
        // cannot fail: the lengths are those of the transform
        let _ = self.forward.process(padded, &mut found);
        found
    }

    /// Padded sequence of a spectrum.
    pub(super) fn inverse_transform(&self, mut spectrum: Spectrum) -> Vec<f64> {
        let mut course = self.inverse.make_output_vec();
        let scale = 1.0 / course.len() as f64;
        // the ends of the spectrum of a real sequence are real except for rounding
        for end in [0, spectrum.len() - 1] {
            spectrum[end].im = 0.0;
        }
        let _ = self.inverse.process(&mut spectrum, &mut course);
        course.iter_mut().for_each(|v| *v *= scale);
        course
    }
}
