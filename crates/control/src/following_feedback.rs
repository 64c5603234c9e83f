//! Feedback from the machine in model following: its deviation from the simulated crane, at what the oil is there.

use crate::controller::AxisState;
use crate::deviation::Watched;
use crate::deviation_memory::DeviationMemory;
use crate::model_following::{FollowingMemory, ModelFollowing};
use crate::out_of_reach::Led;
use crate::reckoned::{MayBe, Reckoned};
use crate::reference::profile::SetPoint;
use hydroboom_math::Real;

/// Oil is most likely no stiffer than if it stiffened so many standard deviations lower than is thought.
const LIKELY: f64 = 1.3;
/// It is almost certainly no stiffer than if so many.
const POSSIBLE: f64 = 2.0;

impl<T: Real> ModelFollowing<T> {
    /// Begins feedback from the machine where it and the simulated crane are, both at rest.
    pub fn begin(&self, machine: &Watched<T>, seen: &AxisState<T>) -> DeviationMemory<T> {
        let with = self.reckons(seen, machine.load_pressure);
        self.deviation.start(&with, &self.off(machine, seen))
    }

    /// Motor speed \[rev/s\] of the machine for the coming period, the simulated crane's being the feedforward \[rev/s\], and where both are led. On the
    /// way it is their oil that swings them apart, and no load that was hung on: feedback is wary then. Behind a reference that no motor can follow, the
    /// machine is not braked for a simulated crane that swings otherwise.
    #[inline(always)]
    pub fn steer(
        &self,
        memory: &mut DeviationMemory<T>,
        machine: &Watched<T>,
        seen: &AxisState<T>,
        feedforward: T,
        led: &Led<T>,
    ) -> T {
        memory.be_wary(led.on_the_way());
        let speed = self.feedback(memory, machine, seen, feedforward, led.travels);
        let moves = [machine.stroke, seen.velocity + memory.velocity];
        led.not_braked(speed, feedforward, self.limits.speed, moves)
    }

    /// Motor speed \[rev/s\] of the machine for the coming period, the simulated crane's being the feedforward \[rev/s\], wherever that is led. Travel takes so
    /// much of the motor at most \[rev/s\], 0 where nothing is known of that.
    #[inline(always)]
    pub fn feedback(
        &self,
        memory: &mut DeviationMemory<T>,
        machine: &Watched<T>,
        seen: &AxisState<T>,
        feedforward: T,
        travels: T,
    ) -> T {
        let with = self.reckons(seen, machine.load_pressure);
        let off = self.off(machine, seen);
        let wanted = self.deviation.update(memory, &with, &off, feedforward, travels);
        let off = with.piston(memory);
        let most = self.reserve.most(self.limits.speed, feedforward, off, with.stiff);
        wanted.clamp(-most, most)
    }

    /// What feedback reckons with where the simulated crane is, the machine's load pressure being \[Pa\]. Too fast a bandwidth rings in oil that
    /// is softer than it is thought to be, too much damping in oil that is stiffer: bandwidth is told how soft it may be, damping how stiff, which
    /// soft oil becomes within a swing.
    #[inline(always)]
    pub fn reckons(&self, seen: &AxisState<T>, load_pressure: T) -> Reckoned<T> {
        let at = self.station(seen.stroke);
        let low = at.rest.load_pressure.min(seen.load_pressure);
        let high = low.max(load_pressure);
        let doubted = |times: f64| self.stiffness_at(high + T::lit(times) * self.doubt);
        let oil = MayBe {
            dipped: self.stiffness_at(low - self.deviation.dip()),
            likely: doubted(LIKELY),
            possible: doubted(POSSIBLE),
        };
        self.deviation.reckons(&at, &oil)
    }

    /// The same where the crane rests at a position \[m\].
    pub fn reckons_at_rest(&self, stroke: T) -> Reckoned<T> {
        let load_pressure = self.station(stroke).rest.load_pressure;
        self.reckons(&AxisState { stroke, velocity: T::zero(), load_pressure }, load_pressure)
    }

    /// By how much the machine differs from where the simulated crane was a lead ago.
    #[inline(always)]
    fn off(&self, machine: &Watched<T>, seen: &AxisState<T>) -> Watched<T> {
        Watched {
            stroke: machine.stroke - (seen.stroke - self.lead * seen.velocity),
            load_pressure: machine.load_pressure - seen.load_pressure,
            motor_speed: machine.motor_speed,
        }
    }
}

impl<T: Real> FollowingMemory<T> {
    /// What leads the machine to a reference that state feedback was shown, its motor having to turn so much for each revolution of the simulated one. Of how
    /// fast it will yet be led nothing is known.
    #[inline(always)]
    pub fn led(&self, reference: &SetPoint<T>, turns: T) -> Led<T> {
        let motor_speed = turns * self.reference_speed;
        Led { reference: *reference, ahead: self.ahead, motor_speed, travels: T::zero() }
    }
}
