//! What feedback of a deviation remembers.

use crate::boom::Boom;
use crate::pushed::Pushed;
use hydroboom_math::{Real, record};

record! {
    /// By how much the machine is believed to differ at the coming sample.
    pub struct DeviationMemory<T> {
        /// Position of the load, in the piston's travel
        #[unit = "m"]
        pub stroke: T,
        /// Its velocity
        #[unit = "m/s"]
        pub velocity: T,
        /// Load pressure
        #[unit = "Pa"]
        pub load_pressure: T,
        /// Acceleration by what the simulation does not know of: friction, another load
        #[unit = "m/s²"]
        pub push: T,
        /// Rate of the load pressure by what it does not know of: leakage, a pump that delivers more
        #[unit = "Pa/s"]
        pub rate: T,
        /// What the drive has made of the feedforward by now
        #[unit = "rev/s"]
        pub expected_speed: T,
        /// What is left of the way back of a piston that was torn far off
        #[unit = "m"]
        pub way_back: T,
        /// How much was left of late of one that was torn off above
        #[unit = "m"]
        pub above: T,
        /// How much was left of late of one that was torn off below
        #[unit = "m"]
        pub below: T,
        /// What is remembered of having been on the way, from 0 to 1: a way back is as wary, unless a load was lost
        #[unit = "1"]
        pub on_the_way: T,
        /// By how much what is believed sooner differs from that: position
        #[unit = "m"]
        pub sooner_stroke: T,
        /// Velocity
        #[unit = "m/s"]
        pub sooner_velocity: T,
        /// Push
        #[unit = "m/s²"]
        pub sooner_push: T,
        /// Share of the time in which that was beyond doubt of late
        #[unit = "1"]
        pub of_late: T,
        /// Mean square of what the position is read to be beyond what is believed sooner
        #[unit = "m²"]
        pub scatter: T,
        /// Load pressure that no travel of the piston accounts for
        #[unit = "Pa"]
        pub pumped: T,
    }
}

impl<T: Real> DeviationMemory<T> {
    /// What is believed of the piston; and by how much what is believed sooner differs.
    #[inline(always)]
    pub(crate) fn pushed(&self) -> [Pushed<T>; 2] {
        let Self { stroke, velocity, push, .. } = *self;
        let sooner = [self.sooner_stroke, self.sooner_velocity, self.sooner_push];
        let [more_stroke, more_velocity, more_push] = sooner;
        let more = Pushed { stroke: more_stroke, velocity: more_velocity, push: more_push };
        [Pushed { stroke, velocity, push }, more]
    }

    /// With that.
    #[inline(always)]
    pub(crate) fn with_pushed(self, [now, sooner]: [Pushed<T>; 2]) -> Self {
        Self {
            stroke: now.stroke,
            velocity: now.velocity,
            push: now.push,
            sooner_stroke: sooner.stroke,
            sooner_velocity: sooner.velocity,
            sooner_push: sooner.push,
            ..self
        }
    }

    /// What is on one boom is thought to be on another: as much load pressure holds what pushes, and the piston is where it was.
    pub(crate) fn hangs_on(&mut self, boom: &Boom<T>, before: &Boom<T>) {
        let lighter = boom.acceleration_by_pressure / before.acceleration_by_pressure;
        (self.push, self.sooner_push) = (self.push * lighter, self.sooner_push * lighter);
        self.stroke = self.stroke + (before.give - boom.give) * self.load_pressure;
    }

    /// A piston that is torn off now, or soon, is led back as one that swings, by a share from 0 to 1, unless it is a load that tears it off.
    #[inline(always)]
    pub fn be_wary(&mut self, share: T) {
        self.on_the_way = self.on_the_way.max(share);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Another boom moves neither the piston nor the load pressure that holds what pushes.
    #[test]
    fn what_hangs_on_another_boom_leaves_the_piston_where_it_was() {
        let boom = |acceleration_by_pressure, give| Boom { acceleration_by_pressure, give };
        let (light, heavy) = (boom(1.5e-6, 3e-11), boom(2e-7, 2e-10));
        let before = DeviationMemory {
            stroke: 1e-3,
            load_pressure: -30e5,
            push: 6.0,
            sooner_push: 0.6,
            ..Default::default()
        };
        let mut now = before;
        now.hangs_on(&heavy, &light);
        let piston = |memory: &DeviationMemory<f64>, boom: &Boom<f64>| {
            memory.stroke + boom.give * memory.load_pressure
        };
        assert!((piston(&now, &heavy) - piston(&before, &light)).abs() < 1e-12);
        let held = |push: f64, boom: &Boom<f64>| push / boom.acceleration_by_pressure;
        for [now, before] in [[now.push, before.push], [now.sooner_push, before.sooner_push]] {
            assert!((held(now, &heavy) / held(before, &light) - 1.0).abs() < 1e-12);
        }
    }
}
