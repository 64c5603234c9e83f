//! One-step policy improvement (rollout): while feedback saturates, the law itself and four alternatives are predicted
//! on the reduced model, and the one of least cost is applied.
//!
//! An alternative holds the motor's limit, either way, for a short or a long time, then the law goes on. Stage costs
//! are the regulator's, the end cost its cost to go. The cause of the deviation is a force or a payload: each
//! alternative is predicted under both hypotheses. A decision takes eleven periods: in the first the reference ahead
//! is sampled, in each of the others one prediction is made, from the state of the first on.
//!
//! Source: D. Bertsekas, *Reinforcement Learning and Optimal Control*, 2019, section 2.4.

mod prediction;

use super::riccati::{Matrix, ORDER, quadratic};
use super::saturation::NestedSaturation;
use crate::estimation::drive_identification::DriveLag;
use crate::estimation::reduced_model::{MachineState, ReducedModel};
use crate::estimation::state_estimator::PredictedState;
use crate::memory::Memory;
use crate::reference::governor::ReferenceGovernor;
use hydroboom_math::{Real, record};
use prediction::Prediction;

/// Alternatives: the law; then each limit for a short and a long time.
const ALTERNATIVES: usize = 5;
/// Hypotheses of the change.
const HYPOTHESES: usize = 2;
/// Periods of a decision.
const PERIODS: usize = 1 + ALTERNATIVES * HYPOTHESES;
/// Samples of the reference over the horizon, and steps of the prediction between two.
const SAMPLES: usize = 26;
const STEPS_BETWEEN: usize = 5;

record! {
    /// Settings of the one-step policy improvement.
    pub struct Rollout<T> {
        /// Prediction horizon
        #[unit = "s"]
        pub horizon: T,
        /// Short time for which the motor's limit is held in an alternative
        #[unit = "s"]
        pub short: T,
        /// Long time for which the motor's limit is held in an alternative
        #[unit = "s"]
        pub long: T,
        /// Share of the law's cost by which an alternative must be cheaper
        #[unit = "1"]
        pub improvement: T,
        /// Offset of the governed reference above which alternatives are predicted
        #[unit = "m"]
        pub offset: T,
        /// Probability that a deviation is caused by a change of payload, not by a force
        #[unit = "1"]
        pub payload_probability: T,
    }
}

/// The reference ahead as the law follows it.
#[derive(Clone, Copy, Debug, PartialEq)]
struct ReferenceSample<T> {
    reference_state: [T; ORDER],
    feedforward: T,
    position: T,
}

/// Numbers of a sample.
const SAMPLED: usize = ORDER + 2;

impl<T: Copy> ReferenceSample<T> {
    #[inline(always)]
    fn to_array(self) -> [T; SAMPLED] {
        let [y, w, p, n] = self.reference_state;
        [y, w, p, n, self.feedforward, self.position]
    }

    #[inline(always)]
    fn from_array([y, w, p, n, feedforward, position]: [T; SAMPLED]) -> Self {
        Self { reference_state: [y, w, p, n], feedforward, position }
    }
}

/// Plant, control law and reference governor for the prediction of the closed loop.
#[derive(Clone, Copy, Debug)]
pub struct Policy<T> {
    /// Reduced model of the plant.
    pub model: ReducedModel<T>,
    /// Estimated states, with parameters and disturbances.
    pub estimate: MachineState<T>,
    /// Part of the piston-side pressure that balances the rod side, (A_r/A_p) p_B \[Pa\].
    pub rod_side_term: T,
    /// Identified lag of the drive.
    pub drive: DriveLag<T>,
    /// Control period \[s\].
    pub period: T,
    /// Largest motor speed \[rev/s\].
    pub limit: T,
    /// Largest change of motor speed in a control period \[rev/s\].
    pub slew: T,
    /// Gain K of the regulator, for load position \[m\], load velocity \[m/s\], load pressure \[Pa\] and motor speed
    /// \[rev/s\].
    pub gain: [T; ORDER],
    /// Cost-to-go matrix P of the regulator, the terminal cost of a prediction.
    pub cost_to_go: Matrix<T>,
    /// The regulator's weights of position error \[1/m²\], velocity error \[s²/m²\] and motor speed \[s²/rev²\].
    pub weights: [T; 3],
    /// Saturation limits of the feedback.
    pub saturation: NestedSaturation<T>,
    /// Reference governor.
    pub governor: ReferenceGovernor<T>,
    /// Decay rate of the governor's offset \[1/s\].
    pub decay: T,
}

/// State of the one-step policy improvement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RolloutState<T> {
    /// Period of the decision under way, from 0.
    phase: T,
    /// Whether a decision is under way \[1\].
    is_evaluating: T,
    /// Where it began: state, and offset of the reference \[m\].
    begin: PredictedState<T>,
    offset: T,
    ahead: [ReferenceSample<T>; SAMPLES],
    /// Costs so far, over the hypotheses weighted.
    costs: [T; ALTERNATIVES],
    /// Speed that is applied \[rev/s\], and whether one is \[1\].
    speed: T,
    is_applied: T,
}

impl<T: Copy> Memory<T> for RolloutState<T> {
    fn visited(self, visit: &mut impl FnMut(&'static str, T) -> T) -> Self {
        Self {
            phase: visit("rollout_phase", self.phase),
            is_evaluating: visit("rollout_is_evaluating", self.is_evaluating),
            begin: self.begin.map(|v| visit("rollout_begin", v)),
            offset: visit("rollout_offset", self.offset),
            ahead: self.ahead.map(|sample| {
                ReferenceSample::from_array(
                    sample.to_array().map(|v| visit("rollout_reference", v)),
                )
            }),
            costs: self.costs.map(|v| visit("rollout_costs", v)),
            speed: visit("rollout_speed", self.speed),
            is_applied: visit("rollout_is_applied", self.is_applied),
        }
    }
}

impl<T: Real> RolloutState<T> {
    /// Discards the decision under way and the applied speed where `mask` holds.
    #[must_use]
    pub fn restarted_where(self, mask: T::Mask) -> Self {
        let none = |value: T| T::select(mask, T::zero(), value);
        let (phase, is_evaluating) = (none(self.phase), none(self.is_evaluating));
        Self { phase, is_evaluating, is_applied: none(self.is_applied), ..self }
    }

    /// Initial state: no decision under way.
    pub fn start() -> Self {
        let zero = T::zero();
        let nowhere =
            ReferenceSample { reference_state: [zero; ORDER], feedforward: zero, position: zero };
        Self {
            phase: zero,
            is_evaluating: zero,
            begin: PredictedState {
                position: zero,
                velocity: zero,
                load_pressure: zero,
                motor_speed: zero,
            },
            offset: zero,
            ahead: [nowhere; SAMPLES],
            costs: [zero; ALTERNATIVES],
            speed: zero,
            is_applied: zero,
        }
    }

    /// Applied motor speed \[rev/s\]: that of the chosen alternative, or else that of the law, `law` \[rev/s\].
    #[inline(always)]
    pub fn command(&self, law: T) -> T {
        T::select(T::lit(0.5).lt(self.is_applied), self.speed, law)
    }
}

impl<T: Real> Rollout<T> {
    /// One control period: samples the reference, predicts one alternative, or decides, in turn.
    ///
    /// `now` is the machine's state when the command arrives. `offset` is that of the governed reference \[m\].
    /// `needed` holds where feedback saturates or the reference has been offset. `ahead` gives state, motor speed
    /// \[rev/s\] and piston position \[m\] of the reference at a time \[s\] after the command's arrival.
    pub fn update(
        &self,
        state: &mut RolloutState<T>,
        policy: &Policy<T>,
        now: &PredictedState<T>,
        offset: T,
        needed: T::Mask,
        ahead: impl Fn(T) -> (PredictedState<T>, T, T),
    ) {
        let (zero, one, half) = (T::zero(), T::one(), T::lit(0.5));
        let begins = state.phase.lt(half);
        let truth = |mask| T::select(mask, one, zero);
        state.is_evaluating = T::select(begins, truth(needed), state.is_evaluating);
        let is_evaluating = half.lt(state.is_evaluating);
        state.is_applied = T::select(is_evaluating, state.is_applied, zero);
        let samples = begins & is_evaluating;
        let pick = |new: T, old: T| T::select(samples, new, old);
        let spacing = self.horizon / T::lit((SAMPLES - 1) as f64);
        let (_, sampled) = T::repeat_where(samples, &[[]; SAMPLES], [], |k, [], []| {
            let (reference_state, feedforward, position) = ahead(spacing * k);
            let new = ReferenceSample {
                reference_state: reference_state.to_array(),
                feedforward,
                position,
            };
            ([], new.to_array())
        });
        if T::any(samples) {
            for (kept, new) in state.ahead.iter_mut().zip(sampled) {
                let old = kept.to_array();
                let row = core::array::from_fn(|i| pick(new[i], old[i]));
                *kept = ReferenceSample::from_array(row);
            }
            let (new, old) = (now.to_array(), state.begin.to_array());
            state.begin =
                PredictedState::from_array(core::array::from_fn(|i| pick(new[i], old[i])));
            state.offset = pick(offset, state.offset);
            state.costs = state.costs.map(|cost| pick(zero, cost));
        }
        let predicts = !begins & is_evaluating;
        if T::any(predicts) {
            self.predict(state, policy, predicts);
        }
        let last = T::lit(PERIODS as f64 - 1.5).lt(state.phase);
        if T::any(last & is_evaluating) {
            self.decide(state, policy.limit, last & is_evaluating);
        }
        state.phase = T::select(last, zero, state.phase + one);
    }

    /// One prediction: of the alternative and the hypothesis that are due.
    fn predict(&self, state: &mut RolloutState<T>, policy: &Policy<T>, is_due: T::Mask) {
        let (zero, one, half) = (T::zero(), T::one(), T::lit(0.5));
        // phases 1, 2: the law under both hypotheses; 3, 4: the first alternative …
        let limit = policy.limit;
        let held_speeds = [zero, -limit, limit, -limit, limit];
        let holds = [zero, self.short, self.short, self.long, self.long];
        let (mut held_speed, mut hold, mut is_payload) = (zero, zero, zero);
        for k in 0..ALTERNATIVES {
            for hypothesis in 0..HYPOTHESES {
                let number = T::lit((1 + HYPOTHESES * k + hypothesis) as f64);
                let is_it = (state.phase - number).abs().lt(half);
                held_speed = T::select(is_it, held_speeds[k], held_speed);
                hold = T::select(is_it, holds[k], hold);
                is_payload = T::select(is_it, T::lit(hypothesis as f64), is_payload);
            }
        }
        let is_payload = half.lt(is_payload);
        let cost = self.cost(state, policy, held_speed, hold, is_payload, is_due);
        let probability =
            T::select(is_payload, self.payload_probability, one - self.payload_probability);
        for k in 0..ALTERNATIVES {
            let middle = T::lit((1 + HYPOTHESES * k) as f64 + 0.5);
            let is_it = (state.phase - middle).abs().lt(one) & is_due;
            let more = probability.mul_add(cost, state.costs[k]);
            state.costs[k] = T::select(is_it, more, state.costs[k]);
        }
    }

    /// Takes the best alternative, if it is better than the law.
    fn decide(&self, state: &mut RolloutState<T>, limit: T, is_due: T::Mask) {
        let (zero, one) = (T::zero(), T::one());
        let [law, costs @ ..] = state.costs;
        let mut best = law * (one - self.improvement);
        let (mut speed, mut is_applied) = (zero, zero);
        for (cost, held_speed) in costs.into_iter().zip([-limit, limit, -limit, limit]) {
            let is_better = cost.lt(best);
            best = T::select(is_better, cost, best);
            speed = T::select(is_better, held_speed, speed);
            is_applied = T::select(is_better, one, is_applied);
        }
        state.speed = T::select(is_due, speed, state.speed);
        state.is_applied = T::select(is_due, is_applied, state.is_applied);
    }

    /// Cost over the horizon and beyond it: the present command until the decision, then an extreme speed
    /// \[rev/s\] for a time \[s\]. Without meaning where no decision is due.
    fn cost(
        &self,
        state: &RolloutState<T>,
        policy: &Policy<T>,
        held_speed: T,
        hold: T,
        is_payload: T::Mask,
        is_due: T::Mask,
    ) -> T {
        let h = self.horizon / T::lit(((SAMPLES - 1) * STEPS_BETWEEN) as f64);
        let prediction = Prediction::new(policy, &state.begin, is_payload, h);
        let until_decision = policy.period * T::lit(PERIODS as f64 - 1.0);
        let until_hold_ends = until_decision + hold;
        let spans: [[T; 2 * SAMPLED]; SAMPLES - 1] = core::array::from_fn(|k| {
            let [from, to] = [k, k + 1].map(|k| state.ahead[k].to_array());
            core::array::from_fn(|i| if i < SAMPLED { from[i] } else { to[i - SAMPLED] })
        });
        let places: [[T; 1]; STEPS_BETWEEN] =
            core::array::from_fn(|part| [T::lit(part as f64 / STEPS_BETWEEN as f64)]);
        let [y, w, p, n] = state.begin.to_array();
        let begun = [y, w, p, n, state.offset, T::zero()];
        let step = |time: T,
                    place: T,
                    from: &ReferenceSample<T>,
                    to: &ReferenceSample<T>,
                    [y, w, p, n, offset, sum]: [T; 6]| {
            let now = [y, w, p, n];
            let reference = prediction.reference(place, from, to);
            let x = prediction.machine.at.compliance.mul_add(p, y);
            let (law, offset) = prediction.law(&reference, &now, x, offset);
            let held = T::select(time.lt(until_hold_ends), held_speed, law);
            let u = T::select(time.lt(until_decision), state.command(law), held);
            let u = u.clamp(-policy.limit, policy.limit);
            let sum = sum + prediction.stage_cost(&reference, x, w, u);
            let [y, w, p, n] = prediction.next_state(&now, x, u);
            [y, w, p, n, offset, sum]
        };
        let ([y, w, p, n, _, sum], _) = T::repeat_where(is_due, &spans, begun, |k, span, now| {
            let half = |begin: usize| {
                ReferenceSample::from_array(core::array::from_fn(|i| span[begin + i]))
            };
            let (from, to) = (half(0), half(SAMPLED));
            let (now, _) = T::repeat(&places, now, |part, [place], now| {
                let time = h * (k * T::lit(STEPS_BETWEEN as f64) + part);
                (step(time, *place, &from, &to, now), [])
            });
            (now, [])
        });
        let end = prediction.with_added_payload(state.ahead[SAMPLES - 1].reference_state);
        let error = [end[0] - y, end[1] - w, end[2] - p, end[3] - n];
        sum * prediction.periods + quadratic(&policy.cost_to_go, &error)
    }
}
