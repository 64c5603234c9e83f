//! Drop test: the boom is lifted with the oil in its cylinder locked in, and drops onto it.

use crate::crane::{Crane, CraneState};
use hydroboom_math::Real;

/// Parts that the way is divided into, so that the oil's stiffness follows its pressure.
const PARTS: u32 = 1000;

impl<T: Real, const N: usize> Crane<T, N> {
    /// State with the whole boom turned by `angle` \[rad\], counter-clockwise, with the oil in both cylinder chambers
    /// locked in.
    ///
    /// Chamber pressures follow from dp = −β dV/V. Released, the boom drops onto the cylinder.
    pub fn lifted(&self, state: &CraneState<T, N>, angle: T) -> CraneState<T, N> {
        let stroke = |state: &CraneState<T, N>| {
            let pose = self.boom.pose(&state.boom.angle);
            self.boom.cylinder_pose(&pose).stroke
        };
        let mut lifted = *state;
        for i in 0..self.boom.len() {
            lifted.boom.angle[i] = lifted.boom.angle[i] + angle;
        }
        // dp = -beta dV/V
        let before = stroke(state);
        let dx = (stroke(&lifted) - before) / T::lit(f64::from(PARTS));
        let (mut a, mut b) = (state.circuit.nodes.a, state.circuit.nodes.b);
        let (cylinder, oil) = (&self.cylinder, self.circuit.oils());
        let (growth_a, growth_b) = (cylinder.piston_area * dx, -cylinder.rod_side_area * dx);
        let (zero, one) = (T::zero(), T::one());
        for i in 0..PARTS {
            let x = before + T::lit(f64::from(i) + 0.5) * dx;
            let (per_a, per_b) = (one / cylinder.volume_a(x), one / cylinder.volume_b(x));
            a = a + oil.a.growing_pressure_rate(a, per_a, zero, growth_a);
            b = b + oil.b.growing_pressure_rate(b, per_b, zero, growth_b);
        }
        (lifted.circuit.nodes.a, lifted.circuit.nodes.b) = (a, b);
        lifted
    }
}
