//! Prediction of the closed loop on the reduced model, under the hypothesis of a force or of a payload.

use super::{Policy, ReferenceSample};
use crate::estimation::reduced_model::OperatingPoint;
use crate::estimation::state_estimator::PredictedState;
use crate::feedback::riccati::ORDER;
use hydroboom_math::Real;

/// The closed loop in steps of several control periods, under a hypothesis.
pub(super) struct Prediction<'a, T> {
    policy: &'a Policy<T>,
    pub(super) machine: Hypothesis<T>,
    /// Piston position where the prediction begins \[m\].
    first: T,
    /// Duration of a step \[s\], and control periods in it.
    h: T,
    pub(super) periods: T,
    /// Share of the way to the commanded motor speed in a step: 1 − (1 − g) to the power of periods in it.
    share: T,
    /// Largest change of motor speed in a step \[rev/s\].
    slew: T,
    /// Factor of the velocity for viscous friction over a step, implicit.
    per_damping: T,
    /// Revolutions of the motor per length of the piston's way \[rev/m\].
    revolutions: T,
}

impl<'a, T: Real> Prediction<'a, T> {
    /// Prediction from a state on, in steps of `h` \[s\].
    #[inline(always)]
    pub(super) fn new(
        policy: &'a Policy<T>,
        begin: &PredictedState<T>,
        is_payload: T::Mask,
        h: T,
    ) -> Self {
        let one = T::one();
        let model = &policy.model;
        let [y, w, p, _] = begin.to_array();
        let at_begin = model.at(y, policy.estimate.payload);
        let machine = hypothesis(policy, &at_begin, y, w, p, is_payload);
        let first = y + machine.at.compliance * p;
        let periods = h / policy.period;
        let share = one - (one - policy.drive.coefficient).powf(periods);
        let slew = policy.slew * periods;
        let damping = machine.at.acceleration * model.viscous;
        let per_damping = one / h.mul_add(damping, one);
        let revolutions = model.revolutions_per_metre();
        Self { policy, machine, first, h, periods, share, slew, per_damping, revolutions }
    }

    /// States of the reference, with the load pressure, and so the compression, that an added payload needs.
    #[inline(always)]
    pub(super) fn with_added_payload(&self, mut reference_state: [T; ORDER]) -> [T; ORDER] {
        let Hypothesis { at, added_payload, .. } = &self.machine;
        reference_state[0] = reference_state[0] - at.compliance * *added_payload;
        reference_state[2] = reference_state[2] + *added_payload;
        reference_state
    }

    /// Reference at a place between two samples, as a share of their distance.
    #[inline(always)]
    pub(super) fn reference(
        &self,
        place: T,
        from: &ReferenceSample<T>,
        to: &ReferenceSample<T>,
    ) -> ReferenceSample<T> {
        let between = |a: T, b: T| place.mul_add(b - a, a);
        let reference_state =
            core::array::from_fn(|i| between(from.reference_state[i], to.reference_state[i]));
        let reference_state = self.with_added_payload(reference_state);
        let feedforward = between(from.feedforward, to.feedforward);
        let position = between(from.position, to.position);
        ReferenceSample { reference_state, feedforward, position }
    }

    /// Motor speed by the control law \[rev/s\], and the governor's next offset \[m\], with the piston at `x` \[m\].
    #[inline(always)]
    pub(super) fn law(
        &self,
        reference: &ReferenceSample<T>,
        &[y, w, p, n]: &[T; ORDER],
        x: T,
        offset: T,
    ) -> (T, T) {
        let Policy { governor, saturation, gain, decay, .. } = self.policy;
        let offset = governor.update(offset, x - reference.position, *decay, self.h);
        let drift = governor.drift(offset, *decay);
        let reference_state = reference.reference_state;
        let error = [
            reference_state[0] - y,
            reference_state[1] - w,
            reference_state[2] - p,
            reference_state[3] - n,
        ];
        let turning = self.revolutions * drift;
        let governed_error = [error[0] + offset, error[1] + drift, error[2], error[3] + turning];
        let (feedback, _) = saturation.feedback(gain, &governed_error);
        (reference.feedforward + turning + feedback, offset)
    }

    /// The regulator's stage cost. The piston is at `x` \[m\], the load's velocity is `w` \[m/s\], and the commanded
    /// motor speed `u` \[rev/s\].
    #[inline(always)]
    pub(super) fn stage_cost(&self, reference: &ReferenceSample<T>, x: T, w: T, u: T) -> T {
        let [by_position, by_velocity, by_speed] = self.policy.weights;
        let e = x - reference.position;
        let effort = u - reference.feedforward;
        by_position * e.square()
            + by_velocity * (reference.reference_state[1] - w).square()
            + by_speed * effort.square()
    }

    /// State of the machine a step later, with the piston at `x` \[m\] and the commanded motor speed `u` \[rev/s\].
    #[inline(always)]
    pub(super) fn next_state(&self, &[y, w, p, n]: &[T; ORDER], x: T, u: T) -> [T; ORDER] {
        let Self { policy, h, .. } = *self;
        let Hypothesis { at, holding, .. } = &self.machine;
        let Policy { model, estimate, .. } = policy;
        let one = T::one();
        let next = n + (self.share * (u - n)).clamp(-self.slew, self.slew);
        let turned = T::lit(0.5) * (n + next);
        let n = next.clamp(-policy.limit, policy.limit);
        let friction = model.coulomb * (w / model.sliding_velocity).clamp(-one, one);
        let force = p - *holding - at.holding_slope * (x - self.first) - friction;
        let w = (h * at.acceleration).mul_add(force, w) * self.per_damping;
        let bulk = model.bulk_modulus(p, estimate.transition_pressure, policy.rod_side_term);
        let turning = turned - model.leakage(p) + estimate.unknown_flow;
        let inflow = model.displacement * turning - model.piston_area * w;
        let y = h.mul_add(w, y);
        let p = (h * model.stiffness(at, bulk)).mul_add(inflow, p);
        [y, w, p, n]
    }
}

/// The machine under a hypothesis.
pub(super) struct Hypothesis<T> {
    pub(super) at: OperatingPoint<T>,
    /// Pressure \[Pa\] that holds the load, and how much more that is than thought.
    holding: T,
    added_payload: T,
}

/// What accelerates the load is a force, as estimated; or it is a payload: `a_p(m) (p − p_0(m) − p_C s − p_v w) = w'`,
/// which is linear in m.
fn hypothesis<T: Real>(
    policy: &Policy<T>,
    at: &OperatingPoint<T>,
    y: T,
    w: T,
    p: T,
    is_payload: T::Mask,
) -> Hypothesis<T> {
    let (zero, one) = (T::zero(), T::one());
    let (model, estimate) = (&policy.model, &policy.estimate);
    let holding = at.holding_pressure + at.holding_slope * at.compliance * p - estimate.disturbance;
    let friction =
        model.viscous.mul_add(w, model.coulomb * (w / model.sliding_velocity).clamp(-one, one));
    let acceleration = at.acceleration * (p - holding - friction);
    let (empty, full) = (model.at(y, zero), model.at(y, model.maximum_payload));
    let mass = |a: &OperatingPoint<T>| one / a.acceleration;
    let pressure_per_kg = (full.holding_pressure - empty.holding_pressure) / model.maximum_payload;
    let mass_per_kg = (mass(&full) - mass(&empty)) / model.maximum_payload;
    let left = p
        - friction
        - empty.holding_pressure
        - empty.holding_slope * at.compliance * p
        - acceleration * mass(&empty);
    let payload =
        (left / (pressure_per_kg + acceleration * mass_per_kg)).clamp(zero, model.maximum_payload);
    let payload = T::select(is_payload, payload, estimate.payload);
    let changed = model.at(y, payload);
    let other = changed.holding_pressure + changed.holding_slope * at.compliance * p;
    let other = T::select(is_payload, other, holding);
    Hypothesis {
        at: OperatingPoint { compliance: at.compliance, ..changed },
        holding: other,
        added_payload: other - holding,
    }
}
