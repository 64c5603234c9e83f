//! Stability limit of the step of the published scheme.

use crate::crane::{Crane, CraneState};
use crate::hydraulics::{Friction, FrictionLaw};
use core::fmt;
use hydroboom_math::Real;

/// Effect that limits the step of an explicit scheme.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StepBound {
    /// Fastest bending mode of the boom on the oil's spring.
    Bending,
    /// Steepest damping of the friction law, at rest.
    Friction,
    /// Settling of the LuGre bristles while the piston slides.
    Bristle,
    /// Pressure chatter across an open load-holding valve.
    Chatter,
}

impl fmt::Display for StepBound {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Bending => "of its fastest bending mode",
            Self::Friction => "of friction at rest",
            Self::Bristle => "of friction's bristles, 2 g/(sigma_0 |v|) less a reserve (friction.bristle_stiffness_n_per_mm)",
            Self::Chatter => "of pressure chatter across the load-holding valve",
        })
    }
}

/// Largest steps \[s\] at which the published scheme neither diverges nor chatters, by effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepLimit {
    /// From the fastest bending mode of angular frequency ω \[s\]: √2/ω, where the sequential update loses stability.
    pub bending: f64,
    /// From the steepest damping of the friction law, at rest \[s\].
    pub friction: f64,
    /// From the settling of the LuGre bristles at the piston's velocity \[s\]; infinite at rest, and for a law
    /// without memory.
    pub bristle: f64,
    /// From pressure chatter \[s\]: above this step the pressure across an open load-holding valve, with little flow,
    /// chatters by more than [`CHATTER`](StepLimit::CHATTER).
    pub chatter: f64,
}

impl StepLimit {
    /// Tolerated amplitude of pressure chatter \[Pa\]: 0.1 bar. Estimate.
    pub const CHATTER: f64 = 0.1e5;

    /// The largest step \[s\] of forward Euler on the bristles of friction that slide at a piston velocity \[m/s\].
    /// From `z' = v − σ_0 |v| z/g` follows `h < 2 g/(σ_0 |v|)`, of which 0.7 are taken. Infinite at rest, and for a
    /// law without memory.
    pub fn of_bristles(friction: &Friction<f64>, velocity: f64) -> f64 {
        1.4 / friction.bristle_rate(velocity)
    }

    /// Smallest of the four limits \[s\].
    pub fn smallest(&self) -> f64 {
        self.bending.min(self.friction).min(self.bristle).min(self.chatter)
    }

    /// Smallest limit \[s\] beyond which the scheme diverges, without chatter, and the effect that determines it.
    pub fn stable(&self) -> (f64, StepBound) {
        let all = [(self.friction, StepBound::Friction), (self.bristle, StepBound::Bristle)];
        let bending = (self.bending, StepBound::Bending);
        all.into_iter().fold(bending, |least, next| if next.0 < least.0 { next } else { least })
    }

    /// Effect with the smallest limit.
    pub fn bound(&self) -> StepBound {
        let (stable, bound) = self.stable();
        if self.chatter < stable { StepBound::Chatter } else { bound }
    }
}

impl<const N: usize> Crane<f64, N> {
    /// Step limit of the published scheme at a state.
    ///
    /// The fastest mode comes from a power iteration with the oil at its stiffest. The chatter is the limit cycle of
    /// forward Euler across a square root, of amplitude `(h c K/2)²` with `c = β (1/V_1 + 1/V_2)`.
    pub fn step_limit(&self, state: &CraneState<f64, N>) -> StepLimit {
        let boom = &self.boom;
        let (segments, n) = (boom.len(), boom.coordinates());
        let pose = boom.pose(&state.boom.angle);
        let cylinder = boom.cylinder_pose(&pose);
        let factors = boom.articulated(&pose, None);

        let beta = self.circuit.oil.bulk_modulus_max;
        let (volume_a, volume_b) =
            (self.cylinder.volume_a(cylinder.stroke), self.cylinder.volume_b(cylinder.stroke));
        let (contact_stiffness, contact_damping) = self.friction.steepest();
        let stiffness = beta
            * (self.cylinder.piston_area.square() / volume_a
                + self.cylinder.rod_side_area.square() / volume_b)
            + self.end_stops.stiffness
            + contact_stiffness;

        // the power iteration's start excites every mode
        let mut mode = [0.0; N];
        for (i, entry) in mode.iter_mut().enumerate().take(n) {
            *entry = if i % 2 == 0 { 1.0 } else { -0.7 };
        }
        let mut square = 0.0;
        for _ in 0..400 {
            let mut moments = [0.0; N];
            let push = stiffness * cylinder.velocity(boom, &mode);
            for i in 0..n {
                moments[i] += cylinder.arm[i] * push;
                if i + 1 < segments {
                    let torque = boom.joints()[i].stiffness * (mode[i + 1] - mode[i]);
                    moments[i] -= torque;
                    moments[i + 1] += torque;
                }
                if let Some(base) = boom.base().filter(|_| i == segments) {
                    moments[i] += base.stiffness * mode[i];
                }
            }
            mode = factors.solve(boom, &moments);
            square = mode[..n].iter().map(|x| x * x).sum();
            square = Real::sqrt(square);
            mode[..n].iter_mut().for_each(|x| *x /= square);
        }
        // the iteration approaches the largest eigenvalue from below
        let bending = 0.97 * Real::sqrt(2.0 / square);

        let compliance = cylinder.velocity(boom, &factors.solve(boom, &cylinder.arm));
        let friction = 1.4 / (compliance * contact_damping);

        let valve = self.circuit.holding_valve.check.flow_coefficient;
        let chatter = |pump_side: f64, chamber: f64| {
            2.0 * Real::sqrt(StepLimit::CHATTER)
                / (beta * (1.0 / pump_side + 1.0 / chamber) * valve)
        };
        let chatter = chatter(self.circuit.volume_pump_a, volume_a)
            .min(chatter(self.circuit.volume_pump_b, volume_b));
        let velocity = cylinder.velocity(boom, &state.boom.angular_velocity);
        StepLimit {
            bending,
            friction,
            bristle: StepLimit::of_bristles(&self.friction, velocity),
            chatter,
        }
    }

    /// The same at the piston velocity of a state; infinite for a law without memory.
    #[inline(always)]
    pub(crate) fn bristle_limit_at(&self, state: &CraneState<f64, N>) -> f64 {
        match self.friction {
            Friction::Stribeck(_) => f64::INFINITY,
            Friction::LuGre(_) => {
                let cylinder = self.boom.cylinder_pose(&self.boom.pose(&state.boom.angle));
                let velocity = cylinder.velocity(&self.boom, &state.boom.angular_velocity);
                StepLimit::of_bristles(&self.friction, velocity)
            }
        }
    }
}
