//! Feedback of a deviation as what it is where it is not limited: linear.

use hydroboom_control::deviation::{DeviationFeedback, Watched};
use hydroboom_control::deviation_memory::DeviationMemory;
use hydroboom_control::reckoned::Reckoned;
use nalgebra::{Complex, SMatrix, SVector};

/// Numbers of [`DeviationMemory`], and of [`Watched`].
const MEMORY: usize = 16;
const READ: usize = 3;

/// `m(k+1) = A m + B y`, `n = C m + D y`: memory m, readings y of position, load pressure and motor speed, and what is asked of the motor.
#[derive(Clone, Copy, Debug)]
pub struct LinearFeedback {
    a: SMatrix<f64, MEMORY, MEMORY>,
    b: SMatrix<f64, MEMORY, READ>,
    c: SMatrix<f64, 1, MEMORY>,
    d: SMatrix<f64, 1, READ>,
    period: f64,
}

/// Sizes of memory that are alike, so that the matrix that is inverted is well conditioned; and of readings.
const SIZES: [f64; MEMORY] =
    [1e-3, 1e-2, 1e5, 0.1, 1e6, 1.0, 1.0, 1.0, 1.0, 1.0, 1e-3, 1e-2, 0.1, 1.0, 1e-6, 1e5];
const READ_SIZES: [f64; READ] = [1e-3, 1e5, 1.0];

/// What the law is called with is so much smaller: it limits what it asks for. Readings that jump by as much as they move look like pushes.
const SMALL: f64 = 1e-6;

impl LinearFeedback {
    /// Of the law itself, called with one number at a time that is not zero.
    pub(crate) fn new(law: &DeviationFeedback<f64>, with: &Reckoned<f64>, period: f64) -> Self {
        let nothing = (SVector::zeros(), SVector::zeros());
        let mut new = Self {
            a: SMatrix::zeros(),
            b: SMatrix::zeros(),
            c: SMatrix::zeros(),
            d: SMatrix::zeros(),
            period,
        };
        let call = |memory: SVector<f64, MEMORY>, read: SVector<f64, READ>| {
            let mut memory = DeviationMemory::from_array(memory.into());
            let speed = law.update(&mut memory, with, &Watched::from_array(read.into()), 0.0, 0.0);
            (SVector::from(memory.to_array()), speed)
        };
        for k in 0..MEMORY {
            let small = SMALL * SIZES[k];
            let (next, speed) = call(SVector::ith(k, small), nothing.1);
            new.a.set_column(k, &(next / small));
            new.c[k] = speed / small;
        }
        for k in 0..READ {
            let small = SMALL * READ_SIZES[k];
            let (next, speed) = call(nothing.0, SVector::ith(k, small));
            new.b.set_column(k, &(next / small));
            new.d[k] = speed / small;
        }
        new
    }

    /// Time between two readings \[s\].
    pub(crate) fn period(&self) -> f64 {
        self.period
    }

    /// What it asks of the motor \[rev/s\] for readings that ring and grow as e to the s t, s in \[1/s\].
    pub(crate) fn answer(&self, read: [Complex<f64>; READ], s: Complex<f64>) -> Complex<f64> {
        let turned = (s * self.period).exp();
        let complex = |v: f64| Complex::new(v, 0.0);
        let read = SVector::from(read);
        let scale = SMatrix::<f64, MEMORY, MEMORY>::from_diagonal(&SVector::from(SIZES));
        let back =
            SMatrix::<f64, MEMORY, MEMORY>::from_diagonal(&SVector::from(SIZES.map(|s| 1.0 / s)));
        let left = SMatrix::<Complex<f64>, MEMORY, MEMORY>::identity() * turned
            - (back * self.a * scale).map(complex);
        let driven = (back * self.b).map(complex) * read;
        // what the observer holds decays: only an s further to the left leaves nothing to invert
        let answer = left
            .lu()
            .solve(&driven)
            .map(|held| ((self.c * scale).map(complex) * held + self.d.map(complex) * read)[0]);
        answer.unwrap_or(Complex::new(f64::NAN, f64::NAN))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::schedule;
    use hydroboom_control::model_following::ModelFollowing;
    use hydroboom_description::Description;
    use std::f64::consts::TAU;

    /// The law itself is shown sines for so long that only they are left.
    #[test]
    fn it_answers_sines_as_the_law_does() {
        let (heavy, light) = (307.0, 3.0);
        for payload in [heavy, light] {
            let crane = Description::uia_single_boom().unwrap();
            it_answers(&schedule(&crane).unwrap().at(payload));
        }
    }

    fn it_answers(law: &ModelFollowing<f64>) {
        let with = law.reckons_at_rest(0.25);
        let linear = LinearFeedback::new(&law.deviation, &with, law.period);
        let sizes = [1e-5, 1e3, 1e-2];
        for (which, frequency) in [(0, 0.5), (0, 8.0), (1, 3.0), (1, 40.0), (2, 0.5), (2, 5.0)] {
            let turn = TAU * frequency * law.period;
            let mut memory = DeviationMemory::default();
            let mut sum = Complex::new(0.0, 0.0);
            let (settle, count) = (20_000, 20_000);
            for k in 0..settle + count {
                let mut read = [0.0; READ];
                read[which] = sizes[which] * (turn * f64::from(k)).cos();
                let read = Watched::from_array(read);
                let speed = law.deviation.update(&mut memory, &with, &read, 0.0, 0.0);
                if k >= settle {
                    sum += Complex::new(0.0, -turn * f64::from(k)).exp() * speed;
                }
            }
            let found = sum * 2.0 / f64::from(count);
            let mut read = [Complex::new(0.0, 0.0); READ];
            read[which] = Complex::from(sizes[which]);
            let wanted = linear.answer(read, Complex::new(0.0, TAU * frequency));
            assert!((found - wanted).norm() < 1e-6 * wanted.norm(), "{found} for {wanted}");
        }
    }
}
