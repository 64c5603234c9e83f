//! What the motor keeps in reserve for a piston that is torn far off.
//!
//! A load that is lost while it is lowered tears the piston off, and whoever answers it soon is limited by nothing but the motor. On stiff oil
//! that is more than it takes: the oil itself stops the piston within millimetres. On soft oil it is not, and each of the last revolutions counts, but
//! for a quarter of its swing a load on soft oil moves no otherwise than on stiff. So the last of the motor waits until the piston is farther off than stiff
//! oil lets it go, unless the oil is known to be soft. What motion takes of the motor is no part of that, nor what anybody turns beyond it for a load
//! that is lost: a pump that delivers less turns as much faster, whoever steers it.

use hydroboom_math::Real;

/// On oil that is certainly softer than this share of stiff oil the less waits the softer it is.
const STIFF: f64 = 0.3;

/// A share of the motor that is withheld from pistons that are near where they should be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reserve<T> {
    /// Of the motor's speed.
    pub share: T,
    /// So much beyond what is fed forward is not withheld, as a share of the motor's speed.
    pub beyond: T,
    /// A piston is near that is off by no more than this \[m\].
    pub near: T,
    /// Nothing is withheld from one that is off by this \[m\].
    pub far: T,
}

impl<T: Copy> Reserve<T> {
    /// The same in another scalar.
    pub fn map<U>(&self, to: impl Fn(T) -> U) -> Reserve<U> {
        let [share, beyond, near, far] = [self.share, self.beyond, self.near, self.far].map(to);
        Reserve { share, beyond, near, far }
    }
}

impl<T: Real> Reserve<T> {
    /// The most that a motor of such a speed \[rev/s\] may turn, to either side, for a piston that is off \[m\] on oil that may be so stiff, 0 to 1.
    /// What is fed forward \[rev/s\], and some beyond it, is not withheld.
    #[inline(always)]
    pub fn most(&self, speed: T, feedforward: T, off: T, stiff: T) -> T {
        let Self { share, beyond, near, far } = *self;
        let (zero, one) = (T::zero(), T::one());
        let is_near = ((far - off.abs()) / (far - near)).clamp(zero, one);
        let waits = is_near * (stiff / T::lit(STIFF)).min(one);
        let left = (speed * (one - beyond) - feedforward.abs()).max(zero);
        (speed - waits * left.min(share * speed)).max(feedforward.abs()).min(speed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RESERVE: Reserve<f64> = Reserve { share: 0.1, beyond: 0.2, near: 4e-3, far: 6e-3 };

    #[test]
    fn the_last_of_the_motor_is_for_what_is_far_off() {
        for side in [1.0, -1.0] {
            let most = |off: f64| RESERVE.most(50.0, 30.0 * side, off * side, 1.0);
            assert_eq!([0.0, 4e-3, 6e-3, 0.1].map(most), [45.0, 45.0, 50.0, 50.0]);
            assert!((most(5e-3) - 47.5).abs() < 1e-9);
        }
    }

    #[test]
    fn where_the_oil_is_known_to_be_soft_nothing_waits() {
        let most =
            [0.0, 0.5 * STIFF, STIFF, 1.0].map(|stiff: f64| RESERVE.most(50.0, 30.0, 0.0, stiff));
        assert_eq!(most, [50.0, 47.5, 45.0, 45.0]);
    }

    /// A reference that takes the whole motor gets it.
    #[test]
    fn what_is_fed_forward_is_not_withheld() {
        for side in [1.0, -1.0] {
            let most = [47.0, 50.0, 60.0].map(|fed: f64| RESERVE.most(50.0, fed * side, 0.0, 1.0));
            assert_eq!(most, [50.0; 3]);
            let none_beyond = Reserve { beyond: 0.0, ..RESERVE };
            let most = [47.0, 60.0].map(|fed: f64| none_beyond.most(50.0, fed * side, 0.0, 1.0));
            assert_eq!(most, [47.0, 50.0]);
        }
    }

    /// Two pumps that turn for the same motion, one by 2 rev/s faster: so much more is left to it for a load that is lost.
    #[test]
    fn a_pump_that_delivers_less_turns_as_much_faster() {
        let most = [36.0, 38.0].map(|fed: f64| RESERVE.most(50.0, fed, 0.0, 1.0));
        assert!((most[0] - 46.0).abs() < 1e-9 && (most[1] - most[0] - 2.0).abs() < 1e-9);
    }
}
