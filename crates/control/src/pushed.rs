//! A load that something pushes: what is believed of it, by where it is read to be.

use hydroboom_math::Real;

/// Where a load is, how fast it moves, and what pushes it that nobody knows of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Pushed<T> {
    /// Position \[m\].
    pub stroke: T,
    /// Velocity \[m/s\].
    pub velocity: T,
    /// Acceleration by what nobody knows of \[m/s²\].
    pub push: T,
}

/// Squares of what noise of the position is worth in velocity and in push, over the noise's square, the period and a power of the poles' frequency ω:
/// ω³ and ω⁵. Integrals of `|s (3 ω² s + ω³)/(s + ω)³|²` and `|ω³ s²/(s + ω)³|²` over all frequencies.
const SCATTER: [f64; 2] = [7.0 / 4.0, 3.0 / 16.0];

impl<T: Real> Pushed<T> {
    /// Once it is read to be farther than it was believed, by an `error` \[m\]. Three poles are where such a share is kept in a period \[s\].
    #[inline(always)]
    pub(crate) fn seen(&self, error: T, keeps: T, period: T) -> Self {
        let one = T::one();
        let lost = one - keeps;
        Self {
            stroke: self.stroke + (one - keeps * keeps * keeps) * error,
            velocity: self.velocity + T::lit(1.5) * lost.square() * (one + keeps) / period * error,
            push: self.push + lost * lost.square() / period.square() * error,
        }
    }

    /// A period later \[s\]: `v' = a_v v + a + d`, a being what else accelerates it \[m/s²\], d the push.
    #[inline(always)]
    pub(crate) fn later(&self, drag: T, acceleration: T, period: T) -> Self {
        let acceleration = drag * self.velocity + acceleration + self.push;
        Self {
            stroke: self.stroke + period * (self.velocity + T::lit(0.5) * period * acceleration),
            velocity: self.velocity + period * acceleration,
            push: self.push,
        }
    }

    /// What it would be by as much more.
    #[inline(always)]
    pub(crate) fn plus(&self, more: &Self) -> Self {
        Self {
            stroke: self.stroke + more.stroke,
            velocity: self.velocity + more.velocity,
            push: self.push + more.push,
        }
    }

    /// What it is more than another.
    #[inline(always)]
    pub(crate) fn less(&self, other: &Self) -> Self {
        Self {
            stroke: self.stroke - other.stroke,
            velocity: self.velocity - other.velocity,
            push: self.push - other.push,
        }
    }
}

/// How far velocity \[1/s\] and push \[1/s²\] scatter for each metre by which the position does, read every period \[s\], with three poles at a
/// frequency \[rad/s\]. They scatter together: of a sum of both, as much as the sum of these.
#[inline(always)]
pub(crate) fn scatters<T: Real>(frequency: T, period: T) -> [T; 2] {
    let (turns, [velocity, push]) = ((frequency * period).sqrt(), SCATTER.map(f64::sqrt));
    [T::lit(velocity) * turns * frequency, T::lit(push) * turns * frequency.square()]
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD: f64 = 1e-3;
    const REST: Pushed<f64> = Pushed { stroke: 0.0, velocity: 0.0, push: 0.0 };

    /// What white noise of 1 m makes of a sum of velocity and push, by adding up the squares of what one reading alone makes of it.
    fn scatter(frequency: f64, [by_velocity, by_push]: [f64; 2]) -> f64 {
        let keeps = (-frequency * PERIOD).exp();
        let (mut believed, mut square) = (REST, 0.0);
        for k in 0..2000 {
            let read = if k == 0 { 1.0 } else { 0.0 };
            believed = believed.seen(read - believed.stroke, keeps, PERIOD);
            let sum = by_velocity * believed.velocity + by_push * believed.push;
            square += sum * sum;
            believed = believed.later(0.0, 0.0, PERIOD);
        }
        Real::sqrt(square)
    }

    #[test]
    fn noise_makes_of_it_what_is_reckoned() {
        for frequency in [20.0, 80.0] {
            let [velocity, push] = scatters(frequency, PERIOD);
            let found = [scatter(frequency, [1.0, 0.0]), scatter(frequency, [0.0, 1.0])];
            let ratios = [found[0] / velocity, found[1] / push];
            // what is reckoned is read all the time: readings a period apart make for a share ω T of it, 0.08 at most, otherwise
            assert!(ratios.iter().all(|ratio| (ratio - 1.0).abs() < 0.1), "{ratios:?}");
            // both at once, each for as much
            let both = scatter(frequency, [1.0 / velocity, 1.0 / push]);
            assert!((both / 2.0 - 1.0).abs() < 0.1, "{both}");
        }
    }

    #[test]
    fn a_push_is_found() {
        let (frequency, push) = (100.0, 0.7);
        let keeps = Real::exp(-frequency * PERIOD);
        let (mut believed, mut is) = (REST, Pushed { push, ..REST });
        for _ in 0..500 {
            believed = believed.seen(is.stroke - believed.stroke, keeps, PERIOD);
            (believed, is) = (believed.later(-0.2, 0.1, PERIOD), is.later(-0.2, 0.1, PERIOD));
        }
        let off = is.less(&believed);
        assert!(off.push.abs() < 1e-9 && off.velocity.abs() < 1e-9, "{off:?}");
        assert!(off.stroke.abs() < 1e-9, "{off:?}");
    }
}
