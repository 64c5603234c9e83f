//! What feedback of a deviation reckons with at a piston position: the oil spring there, and how fast and how strongly what differs is answered on oil
//! that may be softer, or stiffer, than it is thought to be.

use crate::boom::Boom;
use crate::deviation::{DeviationDesign, DeviationFeedback};
use crate::deviation_memory::DeviationMemory;
use crate::oil_spring::{Gains, OilSpring};
use crate::pushed::{Pushed, scatters};
use crate::station::Station;
use hydroboom_math::Real;

/// How stiff the oil may be at a station, as shares of stiff oil's bulk modulus.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MayBe<T> {
    /// As the pressure dips in motion.
    pub dipped: T,
    /// No stiffer than this, most likely.
    pub likely: T,
    /// No stiffer than this, almost certainly.
    pub possible: T,
}

impl<T: Copy> MayBe<T> {
    /// The same, whatever happens.
    pub fn known(share: T) -> Self {
        Self { dipped: share, likely: share, possible: share }
    }
}

/// What feedback reckons with at a piston position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reckoned<T> {
    /// Oil and boom: what the load rings on.
    pub spring: OilSpring<T>,
    /// How much farther out the piston is than the load for each load pressure \[m/Pa\].
    pub give: T,
    /// What the piston's travel makes of the load pressure by the oil alone \[Pa/m\].
    pub pressure_by_travel: T,
    /// Of a deviation; the integral is the observer's.
    pub gains: Gains<T>,
    /// What of a believed push, of one that is believed sooner, and of a believed rate is kept in a period.
    pub keeps: [T; 3],
    /// What a scatter of the position makes of the motor by what is believed sooner \[rev/(s m)\].
    pub speed_by_scatter: T,
    /// What of a position is read from the load pressure, 0 to 1.
    pub by_pressure: T,
    /// Mean square by which such a position scatters at least \[m²\].
    pub scatter: T,
    /// How stiff the oil may possibly be, as a share of stiff oil's bulk modulus.
    pub stiff: T,
    /// Frequency at which the crane most likely rings on its oil \[rad/s\]: a piston that was torn far off is brought back by that.
    pub ring: T,
}

impl<T: Real> Reckoned<T> {
    /// By how much the piston is off \[m\].
    #[inline(always)]
    pub(crate) fn piston(&self, off: &DeviationMemory<T>) -> T {
        self.give.mul_add(off.load_pressure, off.stroke)
    }

    /// By how much it will be once the boom has come to rest, and the load pressure holds what pushes \[m\].
    #[inline(always)]
    pub(crate) fn settles(&self, off: &Pushed<T>) -> T {
        off.stroke - self.give * off.push / self.spring.acceleration_by_pressure
    }
}

impl<T: Real> DeviationFeedback<T> {
    /// What feedback reckons with at a station.
    ///
    /// On oil that is softer than the softest the pump is to make up for it, and what it is asked for has to be right: too much of it rings in oil
    /// that is stiffer. Such oil has to be so almost certainly; else damping is that of stiffer oil, and the position waits for it.
    #[inline(always)]
    pub fn reckons(&self, station: &Station<T>, oil: &MayBe<T>) -> Reckoned<T> {
        let DeviationDesign { quicker, damping, share, softest, by_pressure: reads, .. } =
            self.design;
        let boom = self.boom(station);
        let rings = |stiffness: T| boom.in_series(&station.spring(stiffness)).ring();
        let most = oil.likely.max(oil.possible.min(softest));
        let least = oil.dipped.max(softest * oil.likely / most);
        let pressure_by_travel = station.spring(most).pressure_by_velocity;
        let spring = boom.in_series(&station.spring(most));
        let raised = rings(most.max(softest));
        // damping that is meant for stiffer oil is as much too weak: the position has to wait for it
        let bandwidth = share * rings(least).square() / raised;
        let gains = spring.proportional_gains(quicker * raised, damping, bandwidth);
        let believes = (self.design.push * rings(T::one())).sqrt();
        let ring = rings(oil.likely);
        let sooner = self.design.sooner.frequency(believes, ring, self.design.lag.max(self.period));
        let keeps = [believes, sooner, self.design.rate * bandwidth]
            .map(|frequency| (-frequency * self.period).exp());
        let [velocity, push] = scatters(sooner, self.period);
        let held = (gains.pressure - boom.give * gains.position) / spring.acceleration_by_pressure;
        let speed_by_scatter = gains.velocity.abs() * velocity + held * push;
        let by_pressure = reads.share(pressure_by_travel);
        let scatter = reads.scatter(by_pressure);
        Reckoned {
            spring,
            give: boom.give,
            pressure_by_travel,
            gains,
            keeps,
            speed_by_scatter,
            by_pressure,
            scatter,
            stiff: oil.possible,
            ring,
        }
    }

    /// The boom at a station, as far as feedback reckons with its bending.
    #[inline(always)]
    pub(crate) fn boom(&self, station: &Station<T>) -> Boom<T> {
        station.boom.share(self.design.bends, &Boom::rigid(&station.stiff))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::deviation::tests::{feedback, station};

    /// Frequency at which the load rings where the oil is so stiff \[rad/s\].
    fn rings(stiffness: f64) -> f64 {
        feedback().reckons(&station(), &MayBe::known(stiffness)).ring
    }

    #[test]
    fn soft_oil_is_fed_back_to_gently() {
        let law = feedback::<f64>();
        let at = |stiffness: f64| law.reckons(&station(), &MayBe::known(stiffness));
        // a deviation of the position asks for as much less as the crane rings slower
        let (soft, stiff) = (at(0.25), at(1.0));
        let ratio = soft.gains.position / stiff.gains.position;
        let slower = soft.ring / stiff.ring;
        assert!((ratio / slower - 1.0).abs() < 1e-12 && slower < 0.6, "{ratio}");
    }

    /// The characteristic polynomial of what is fed back to is the same for all oil that is softer than the softest.
    #[test]
    fn softer_oil_than_the_softest_is_made_as_stiff_by_the_pump() {
        let law = feedback::<f64>();
        let polynomial = |stiffness: f64| {
            let Reckoned { spring, gains, .. } = law.reckons(&station(), &MayBe::known(stiffness));
            let [_, a_v, a_p, _, c_v, _, b] = spring.to_array();
            let kept = b * gains.pressure;
            let ringing = a_p * (b * gains.velocity - c_v) - kept * a_v;
            [kept - a_v, ringing, a_p * b * gains.position]
        };
        let [softest, softer] = [0.1, 0.0125].map(polynomial);
        for (a, b) in softest.iter().zip(softer) {
            assert!((a / b - 1.0).abs() < 1e-12, "{softest:?} and {softer:?}");
        }
        assert!(polynomial(0.2)[1] > 1.5 * softest[1]);
    }

    #[test]
    fn where_the_oil_is_not_known_it_is_damped_as_stiff_and_brought_back_as_soft() {
        let law = feedback::<f64>();
        let at = |dipped, likely| {
            law.reckons(&station(), &MayBe { dipped, likely, possible: likely }).gains
        };
        let (known, unknown) = (at(1.0, 1.0), at(0.2, 1.0));
        let slower = (rings(0.2) / rings(1.0)).powi(2);
        let ratio = unknown.position / known.position / slower;
        assert!((ratio - 1.0).abs() < 1e-12, "{unknown:?}");
        // soft oil that is known to be soft is damped more
        assert!(unknown.pressure < known.pressure && at(0.2, 0.2).pressure > known.pressure);
    }

    /// Where it may be stiffer the pump would be asked for too much: damping is that of oil as stiff as it may be, and the position waits as much longer.
    #[test]
    fn the_pump_makes_stiffer_only_what_is_soft_almost_certainly() {
        let law = feedback::<f64>();
        let (soft, softest) = (0.0125, 0.1);
        let at = |possible| {
            let oil = MayBe { dipped: soft, likely: soft, possible };
            law.reckons(&station(), &oil).gains
        };
        let known = |share| law.reckons(&station(), &MayBe::known(share)).gains;
        for doubted in [softest, 0.4, 1.0].map(at) {
            // a slower position takes less damping
            assert!(doubted.pressure < known(softest).pressure, "{doubted:?}");
            let slower = (rings(soft) / rings(softest)).powi(2);
            let ratio = doubted.position / known(softest).position / slower;
            assert!((ratio - 1.0).abs() < 1e-12, "{doubted:?}");
        }
        assert_eq!(at(soft), known(soft));
        // what is likely stiffer than that is in no doubt of this kind
        let likely = |possible| {
            let oil = MayBe { dipped: soft, likely: 0.3, possible };
            law.reckons(&station(), &oil).gains
        };
        assert_eq!(likely(0.3), likely(1.0));
    }
}
