//! Differential cylinder and its end stops.

use hydroboom_math::{Real, record};

record! {
    /// Differential cylinder: chamber A on the piston side, chamber B on the rod side.
    pub struct Cylinder<T> {
        /// Piston area, A_p
        #[unit = "m²"]
        pub piston_area: T,
        /// Annulus area on the rod side, A_r
        #[unit = "m²"]
        pub rod_side_area: T,
        /// Distance between the end stops
        #[unit = "m"]
        pub stroke_length: T,
        /// Volume of chamber A and its line with the piston at its lower stop, V_0A
        #[unit = "m³"]
        pub dead_volume_a: T,
        /// Volume of chamber B and its line with the piston at its upper stop, V_0B
        #[unit = "m³"]
        pub dead_volume_b: T,
    }
}

impl<T: Real> Cylinder<T> {
    /// Cylinder from the diameters of piston D and rod d \[m\], stroke \[m\] and dead volumes \[m³\]: A_p = π D²/4,
    /// A_r = π (D² − d²)/4. The rod must be thinner than the piston; this is not checked.
    pub fn from_diameters(
        piston: T,
        rod: T,
        stroke_length: T,
        dead_volume_a: T,
        dead_volume_b: T,
    ) -> Self {
        let quarter_pi = T::lit(core::f64::consts::FRAC_PI_4);
        Self {
            piston_area: quarter_pi * piston.square(),
            rod_side_area: quarter_pi * (piston.square() - rod.square()),
            stroke_length,
            dead_volume_a,
            dead_volume_b,
        }
    }

    /// Oil volume \[m³\] in chamber A with the piston at x = `stroke` \[m\] from the lower stop, V_A0 + A_p x.
    #[inline(always)]
    pub fn volume_a(&self, stroke: T) -> T {
        self.dead_volume_a + self.piston_area * stroke
    }

    /// Oil volume \[m³\] in chamber B with the piston at x = `stroke` \[m\] from the lower stop, V_B0 + A_r (L − x).
    #[inline(always)]
    pub fn volume_b(&self, stroke: T) -> T {
        self.dead_volume_b + self.rod_side_area * (self.stroke_length - stroke)
    }

    /// Force A_p p_A − A_r p_B \[N\] of both gauge pressures \[Pa\] on the piston, positive outwards (9).
    #[inline(always)]
    pub fn force(&self, pressure_a: T, pressure_b: T) -> T {
        self.piston_area * pressure_a - self.rod_side_area * pressure_b
    }

    /// Rod-side area over piston area, A_r/A_p \[1\].
    #[inline(always)]
    pub fn area_ratio(&self) -> T {
        self.rod_side_area / self.piston_area
    }

    /// Load pressure p_L = p_A − (A_r/A_p) p_B \[Pa\] from both gauge pressures \[Pa\].
    #[inline(always)]
    pub fn load_pressure(&self, pressure_a: T, pressure_b: T) -> T {
        pressure_a - self.area_ratio() * pressure_b
    }
}

record! {
    /// Mechanical stops at both ends of the stroke: springs that push and never pull, damped in
    /// proportion to their compression (ours).
    ///
    /// ```text
    /// F = k s max(0, 1 + d ṡ),   s: depth into the stop
    /// ```
    ///
    /// The force is continuous at contact; `k s²/2` is its stored energy, the rest is lost.
    pub struct EndStops<T> {
        /// Stiffness of an end stop, k
        #[unit = "N/m"]
        pub stiffness: T,
        /// Damping of an end stop relative to its spring force, d
        #[unit = "s/m"]
        pub damping: T,
    }
}

impl<T: Real> EndStops<T> {
    /// Depths \[m\] into the lower and the upper stop, zero away from them.
    #[inline(always)]
    fn depths(&self, stroke: T, stroke_length: T) -> (T, T) {
        ((-stroke).max(T::zero()), (stroke - stroke_length).max(T::zero()))
    }

    /// Force \[N\] of the stops on the piston, positive outwards, at its position \[m\] and velocity \[m/s\]. The
    /// upper stop is at `stroke_length` \[m\]; between the stops the force is zero.
    #[inline(always)]
    pub fn force(&self, stroke: T, velocity: T, stroke_length: T) -> T {
        let (lower, upper) = self.depths(stroke, stroke_length);
        let push = |depth: T, approach: T| {
            self.stiffness * depth * (T::one() + self.damping * approach).max(T::zero())
        };
        push(lower, -velocity) - push(upper, velocity)
    }

    /// Elastic energy k s²/2 \[J\] of the stops at a piston position \[m\], the upper one at `stroke_length` \[m\].
    pub fn energy(&self, stroke: T, stroke_length: T) -> T {
        let (lower, upper) = self.depths(stroke, stroke_length);
        T::lit(0.5) * self.stiffness * (lower.square() + upper.square())
    }

    /// Elastic force \[N\] of the stops at a piston position \[m\], positive outwards, without damping; the upper stop
    /// is at `stroke_length` \[m\].
    pub fn spring_force(&self, stroke: T, stroke_length: T) -> T {
        let (lower, upper) = self.depths(stroke, stroke_length);
        self.stiffness * (lower - upper)
    }
}
