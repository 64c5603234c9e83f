//! What a controller of piston and load pressure sees of a crane: a mass on an oil spring; and gains that place its poles.

use hydroboom_math::{Real, record};

record! {
    /// The crane at a piston position as a mass on an oil spring, in small changes of piston position x, velocity v, load
    /// pressure p and motor speed n: `v' = a_x x + a_v v + a_p p`, `p' = c_x x + c_v v + c_p p + b n`.
    pub struct OilSpring<T> {
        /// a_x
        #[unit = "1/s²"]
        pub acceleration_by_stroke: T,
        /// a_v
        #[unit = "1/s"]
        pub acceleration_by_velocity: T,
        /// a_p
        #[unit = "m/(s² Pa)"]
        pub acceleration_by_pressure: T,
        /// c_x
        #[unit = "Pa/(s m)"]
        pub pressure_by_stroke: T,
        /// c_v
        #[unit = "Pa/m"]
        pub pressure_by_velocity: T,
        /// c_p
        #[unit = "1/s"]
        pub pressure_by_pressure: T,
        /// b
        #[unit = "Pa/rev"]
        pub pressure_by_speed: T,
    }
}

record! {
    /// What a lag of each is worth in motor speed.
    pub struct Gains<T> {
        /// Of position
        #[unit = "rev/(s m)"]
        pub position: T,
        /// Of velocity
        #[unit = "rev/m"]
        pub velocity: T,
        /// Of load pressure
        #[unit = "rev/(s Pa)"]
        pub pressure: T,
        /// Of position, summed up over time
        #[unit = "rev/(s² m)"]
        pub integral: T,
    }
}

impl<T: Real> OilSpring<T> {
    /// Natural frequency of the mass on the oil \[rad/s\].
    #[inline(always)]
    pub fn ring(&self) -> T {
        (-self.acceleration_by_pressure * self.pressure_by_velocity).sqrt()
    }

    /// Gains that place the poles of position, velocity, pressure and integral: a pair of natural frequency `ring` \[rad/s\] and
    /// damping ratio `damping`, and two at −`bandwidth` \[rad/s\]. By comparing coefficients of
    /// `s (s − c_p + b k_p)(s² − a_v s − a_x) − a_p s (c_x + c_v s) + a_p b (k_i + k_x s + k_v s²)`.
    pub fn gains(&self, ring: T, damping: T, bandwidth: T) -> Gains<T> {
        let [a_x, a_v, a_p, c_x, c_v, c_p, b] = self.to_array();
        let two = T::lit(2.0);
        // (s² + 2 ζ ω s + ω²)(s + ω_b)²
        let (q1, q0) = (two * damping * ring, ring.square());
        let (r1, r0) = (two * bandwidth, bandwidth.square());
        let d3 = q1 + r1;
        let d2 = q0 + q1 * r1 + r0;
        let d1 = q0 * r1 + q1 * r0;
        let d0 = q0 * r0;
        // what the pressure's own pole becomes
        let kept = d3 + a_v;
        Gains {
            pressure: (kept + c_p) / b,
            velocity: (d2 + a_x + a_v * kept + a_p * c_v) / (a_p * b),
            position: (d1 + a_x * kept + a_p * c_x) / (a_p * b),
            integral: d0 / (a_p * b),
        }
    }

    /// Gains without an integral, of a spring that nothing holds at a position: they place a pair of natural frequency `ring` \[rad/s\] and
    /// damping ratio `damping`, and one pole at −`bandwidth` \[rad/s\]. By comparing coefficients of
    /// `(s + b k_p)(s² − a_v s) − a_p c_v s + a_p b (k_x + k_v s)`.
    #[inline(always)]
    pub fn proportional_gains(&self, ring: T, damping: T, bandwidth: T) -> Gains<T> {
        let [_, a_v, a_p, _, c_v, _, b] = self.to_array();
        let pair = T::lit(2.0) * damping * ring;
        let kept = pair + bandwidth + a_v;
        Gains {
            pressure: kept / b,
            velocity: (ring.square() + pair * bandwidth + a_v * kept + a_p * c_v) / (a_p * b),
            position: ring.square() * bandwidth / (a_p * b),
            integral: T::zero(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poles_are_where_they_were_wished() {
        let spring = OilSpring::from_array([-0.3, -0.2, 2e-7, 1e7, -1.1e9, -0.03, 3.2e6]);
        let (ring, damping, bandwidth) = (15.0, 0.7, 9.0);
        let g: Gains<f64> = spring.gains(ring, damping, bandwidth);
        let [a_x, a_v, a_p, c_x, c_v, c_p, b] = spring.to_array();
        // s (s − c_p + b k_p)(s² − a_v s − a_x) − a_p s (c_x + c_v s) + a_p b (k_i + k_x s + k_v s²) at its wished zeros, which
        // come in powers of a complex s = r + i m
        let at = |r: f64, m: f64| {
            let mul = |(p, q): (f64, f64), (x, y): (f64, f64)| (p * x - q * y, p * y + q * x);
            let s = (r, m);
            let s2 = mul(s, s);
            let pressure = (r - c_p + b * g.pressure, m);
            let mass = (s2.0 - a_v * r - a_x, s2.1 - a_v * m);
            let first = mul(s, mul(pressure, mass));
            let flow = mul(s, (c_x + c_v * r, c_v * m));
            let back = (
                g.integral + g.position * r + g.velocity * s2.0,
                g.position * m + g.velocity * s2.1,
            );
            let re = first.0 - a_p * flow.0 + a_p * b * back.0;
            let im = first.1 - a_p * flow.1 + a_p * b * back.1;
            (re.abs() + im.abs()) / (ring * ring * bandwidth * bandwidth)
        };
        let turned = ring * Real::sqrt(1.0 - damping * damping);
        assert!(at(-ring * damping, turned) < 1e-9);
        assert!(at(-bandwidth, 0.0) < 1e-9);
    }

    /// Vieta: the coefficients of the loop's cubic are those of the poles that were wished.
    #[test]
    fn proportional_gains_place_three_poles() {
        let spring = OilSpring::from_array([0.0, -0.2, 2e-7, 0.0, -1.1e9, 0.0, 3.2e6]);
        let (ring, damping, bandwidth) = (12.0, 0.5, 8.0);
        let g: Gains<f64> = spring.proportional_gains(ring, damping, bandwidth);
        let [_, a_v, a_p, _, c_v, _, b] = spring.to_array();
        // [x, v, p]' = A [x, v, p] of the closed loop: trace, sum of principal minors, determinant
        let a = [
            [0.0, 1.0, 0.0],
            [0.0, a_v, a_p],
            [-b * g.position, c_v - b * g.velocity, -b * g.pressure],
        ];
        let minor = |i: usize, j: usize| a[i][i] * a[j][j] - a[i][j] * a[j][i];
        let determinant = a[0][1] * a[1][2] * a[2][0];
        let wished = [
            2.0 * damping * ring + bandwidth,
            ring * ring + 2.0 * damping * ring * bandwidth,
            ring * ring * bandwidth,
        ];
        let found = [-(a[1][1] + a[2][2]), minor(0, 1) + minor(0, 2) + minor(1, 2), -determinant];
        for (found, wished) in found.into_iter().zip(wished) {
            assert!(f64::abs(found / wished - 1.0) < 1e-9, "{found} for {wished}");
        }
        assert_eq!(g.integral, 0.0);
    }
}
