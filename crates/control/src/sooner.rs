//! What is believed sooner of what pushes a machine, and heard where it is more than noise.
//!
//! A push shows in the position, and the sooner it is believed the less it has moved. But noise is believed as soon: of the fifth power of how fast a push
//! is believed comes the square of what noise makes of it. So a push is believed twice, slowly, and some times as fast. What the second asks of the
//! motor beyond the first is heard only where it is several times what noise would ask for, and then all of it. How far the position scatters is seen on the way: by as
//! much as it is read to be elsewhere than was believed sooner. What is beyond doubt has but begun: what is believed of a push is behind it, and the
//! motor is behind what it is told. So as it begins more is asked for than what is believed of it takes. Not so of what goes on, for that swings.
//!
//! A crane that rings slowly is answered no sooner, nor one whose motor follows late: what the motor is asked for comes too late there, and swings it.

use hydroboom_math::Real;

/// How much sooner a push is believed, and from when on that is heard.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SoonerDesign<T> {
    /// So many times as fast.
    pub times: T,
    /// What it asks for is heard from so many times what noise would ask for, all of it from half more.
    pub heard_from: T,
    /// Of what is beyond doubt so much more is asked for, as a share.
    pub begun: T,
}

/// All is heard from so many times where it begins to be.
const ALL: f64 = 1.5;
/// And is beyond doubt from so many times.
const BEYOND_DOUBT: f64 = 2.5;
/// A push is believed no sooner than at so many times the frequency at which the crane rings on its oil.
const RINGS: f64 = 8.0;
/// Nor sooner than in the time in which the motor follows, less a quarter: what comes sooner is answered too late.
const LAGS: f64 = 1.3;
/// How long it is remembered that something was beyond doubt \[s\].
const OF_LATE: f64 = 1.0;
/// What was so for such a share of that time does not begin: it swings. One that goes on is in 0.7 s.
const SWINGS: f64 = 0.5;
/// How long what the position scatters by is remembered \[s\].
const REMEMBERED: f64 = 1.0;
/// A single reading counts for no more than so many times of what it has scattered by: a push is no noise.
const COUNTS: f64 = 3.0;

/// What is heard of what is believed sooner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Heard<T> {
    /// What it asks for \[rev/s\].
    pub asks: T,
    /// From 0 to 1, whether it is beyond doubt.
    pub beyond_doubt: T,
}

impl<T: Real> SoonerDesign<T> {
    /// How fast a push is believed sooner that else is believed at `believes` \[rad/s\], of a crane that rings on its oil at `ring` \[rad/s\] and whose
    /// motor is so late \[s\]. Soft oil takes the motor so long to fill, and a slow drive takes it so long to follow, that what comes sooner only
    /// swings it.
    #[inline(always)]
    pub(crate) fn frequency(&self, believes: T, ring: T, lag: T) -> T {
        (self.times * believes).min(T::lit(RINGS) * ring).min(T::lit(LAGS) / lag).max(believes)
    }

    /// Mean square \[m²\] of what the position scatters by, after a period \[s\] in which it is read to be `beyond` what was believed \[m\].
    #[inline(always)]
    pub(crate) fn scatter(&self, before: T, beyond: T, period: T) -> T {
        let most = T::lit(COUNTS).square() * before;
        before + period / T::lit(REMEMBERED) * (beyond.square().min(most) - before)
    }

    /// What is heard of what is asked for \[rev/s\], each metre of scatter making for so much \[rev/(s m)\], with that mean square \[m²\], and with
    /// such a share of the time in which it was beyond doubt of late.
    #[inline(always)]
    pub(crate) fn heard(&self, asks: T, speed_by_scatter: T, scatter: T, of_late: T) -> Heard<T> {
        let from = self.heard_from * speed_by_scatter * scatter.sqrt();
        let over = asks.abs() / from;
        let share = |from: f64, to: f64| {
            ((over - T::lit(from)) / T::lit(to - from)).clamp(T::zero(), T::one())
        };
        let beyond_doubt = share(ALL, BEYOND_DOUBT);
        let begins = (T::one() - of_late / T::lit(SWINGS)).max(T::zero());
        let more = (self.begun * begins).mul_add(beyond_doubt, T::one());
        Heard { asks: asks * share(1.0, ALL) * more, beyond_doubt }
    }

    /// Share of the time in which something was beyond doubt of late, after a period \[s\] in which it was by such a share.
    #[inline(always)]
    pub(crate) fn of_late(&self, before: T, beyond_doubt: T, period: T) -> T {
        before + period / T::lit(OF_LATE) * (beyond_doubt - before)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DESIGN: SoonerDesign<f64> = SoonerDesign { times: 2.5, heard_from: 4.0, begun: 0.5 };

    #[test]
    fn what_noise_asks_for_is_not_heard_a_push_is_heard_whole_and_one_beyond_doubt_as_begun() {
        // an encoder's noise asks for 0.1 rev/s
        let heard = |asks: f64| DESIGN.heard(asks, 1e4, 1e-10, 0.0).asks;
        for side in [1.0, -1.0] {
            assert_eq!(heard(0.39 * side), 0.0);
            assert!((heard(0.6 * side) - 0.6 * side).abs() < 1e-12);
            assert!((heard(1.0 * side) - 1.5 * side).abs() < 1e-12);
        }
        // and nothing jumps in between
        for k in 0..1000 {
            let asks = 1e-3 * f64::from(k);
            assert!((heard(asks + 1e-3) - heard(asks)).abs() < 8e-3);
        }
    }

    /// As a push begins it is asked more for than it takes, and no more once it has gone on, or swung, for ln 2 of what is remembered, 0.7 s.
    #[test]
    fn what_goes_on_is_heard_as_it_is() {
        let mut of_late = 0.0;
        let mut asked = [0.0; 1000];
        for asked in &mut asked {
            let heard = DESIGN.heard(2.0, 1e4, 1e-10, of_late);
            of_late = DESIGN.of_late(of_late, heard.beyond_doubt, 1e-3);
            *asked = heard.asks;
        }
        assert!((asked[0] - 3.0).abs() < 1e-12 && asked[100] > 2.7, "{}", asked[100]);
        assert!(asked.windows(2).all(|pair| pair[1] <= pair[0]));
        assert_eq!(asked[999], 2.0);
    }

    #[test]
    fn on_soft_oil_a_push_is_believed_no_sooner() {
        let frequency = |ring| DESIGN.frequency(60.0, ring, 5e-3);
        assert_eq!((frequency(40.0), frequency(15.0), frequency(5.0)), (150.0, 120.0, 60.0));
    }

    #[test]
    fn a_motor_that_follows_late_is_told_no_sooner() {
        let frequency = |lag| DESIGN.frequency(60.0, 40.0, lag);
        assert_eq!((frequency(5e-3), frequency(40e-3)), (150.0, 60.0));
        assert!((frequency(13e-3) - 100.0).abs() < 1e-9);
    }

    #[test]
    fn noise_is_found_and_a_push_is_not_taken_for_it() {
        let after = |before: f64, periods: u32, beyond: f64| {
            (0..periods).fold(before, |scatter, k| {
                let side = if k % 2 == 0 { 1.0 } else { -1.0 };
                DESIGN.scatter(scatter.max(1e-10), side * beyond, 1e-3)
            })
        };
        // four times an encoder's
        let noisy = after(0.0, 5000, 4e-5);
        assert!((Real::sqrt(noisy) / 4e-5 - 1.0).abs() < 0.05, "{noisy}");
        // it asks for 0.4 rev/s: that is not heard any longer
        assert_eq!(DESIGN.heard(1.5, 1e4, noisy, 0.0).asks, 0.0);
        // a millimetre for 20 ms
        let pushed = after(1e-10, 20, 1e-3);
        assert!(Real::sqrt(pushed) < 1.1e-5, "{pushed}");
    }
}
