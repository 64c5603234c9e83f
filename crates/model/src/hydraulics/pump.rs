//! Axial piston pump with fixed displacement, and its leakage.

use super::Oil;
use hydroboom_math::{Real, record};

/// Flow gain k_flow of the pump: volume delivered to side A, where the oil is compressed, per displaced volume.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Delivery<T> {
    /// As published: the constant k_flow, in both directions of flow.
    Published(
        /// k_flow \[1\], 0.91 (section 3.1.2).
        T,
    ),
    /// From the pressures at every step: k_flow = exp(−∫dp/β) from p_PB to p_PA, the volume that
    /// a unit of oil taken in at p_PB has left at p_PA.
    Computed,
}

record! {
    /// Leakage through the gaps of a pump beyond its published orifice: laminar, hence proportional
    /// to pressure, and growing with speed as the kidney-shaped ports trap and pass oil.
    ///
    /// ```text
    /// Q_slip = (c_0 + c_n |n|) Δp
    /// ```
    ///
    /// Equation: the usual one for axial piston machines (Wilson's model, with a share that grows
    /// with speed).
    pub struct Slip<T> {
        /// Leakage coefficient at rest, c_0
        #[unit = "m³/(s·Pa)"]
        pub at_rest: T,
        /// Increase of the leakage coefficient per speed, c_n
        #[unit = "m³/(rev·Pa)"]
        pub per_speed: T,
    }
}

impl<T: Real> Slip<T> {
    /// Flow \[m³/s\] that a pressure drop \[Pa\] drives through the pump at a speed \[rev/s\].
    #[inline(always)]
    pub fn flow(&self, drop: T, speed: T) -> T {
        (self.at_rest + self.per_speed * speed.abs()) * drop
    }
}

/// Fixed-displacement axial piston pump, driven in both directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pump<T> {
    /// Displacement per revolution, K_VP \[m³/rev\].
    pub displacement: T,
    /// Flow gain k_flow from side B to side A.
    pub delivery: Delivery<T>,
}

impl<T: Real> Pump<T> {
    /// Flow \[m³/s\] drawn from side B, positive from B to A; Q_P = n K_VP (5), n in rev/s.
    #[inline(always)]
    pub fn flow(&self, speed: T) -> T {
        speed * self.displacement
    }

    /// Flow gain k_flow \[1\]: volume delivered to side A per volume drawn from side B, at the gauge pressures \[Pa\]
    /// of both sides.
    #[inline(always)]
    pub fn flow_gain(&self, oil: &Oil<T>, pressure_a: T, pressure_b: T) -> T {
        match self.delivery {
            Delivery::Published(k_flow) => k_flow,
            Delivery::Computed => (oil.compression(pressure_b) - oil.compression(pressure_a)).exp(),
        }
    }
}

impl<T> Pump<T> {
    /// Converts every parameter to another number type by `f`.
    pub fn map<U>(self, f: &mut impl FnMut(T) -> U) -> Pump<U> {
        Pump {
            displacement: f(self.displacement),
            delivery: match self.delivery {
                Delivery::Published(k_flow) => Delivery::Published(f(k_flow)),
                Delivery::Computed => Delivery::Computed,
            },
        }
    }
}
