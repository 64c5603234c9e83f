//! Proof of balance: what position, pressures and delivered volume show in a control period of a release.

use super::{Release, ReleaseInput, ReleaseState};
use hydroboom_math::Real;
use hydroboom_model::hydraulics::Oil;

/// Standard deviations of the scatter at rest that a motion must exceed.
const SIGNIFICANT: f64 = 4.0;
/// Time for which pressures must agree where there is no check function \[s\].
const BALANCED: f64 = 0.1;
/// Periods of the load mode in which a lifted load has to come to rest.
const SETTLING_PERIODS: f64 = 6.0;

impl<T: Real> Release<T> {
    /// Movement \[m\] that the load springs by when the valve opens, with the piston so far \[m\] from the
    /// end that the load pushes it to: the loaded side expands by what the other side no longer holds back.
    ///
    /// `(V_A + V_PA) (S(p_A) − S(p_A − (p_B − p_PB) A_B/A_A))/A_A`, with the softest oil.
    #[inline(always)]
    fn spring(&self, now: &ReleaseInput<T>, height: T) -> T {
        let oil = Oil {
            bulk_modulus_max: self.bulk_modulus,
            bulk_modulus_min: T::one() / self.largest_compliance,
            transition_pressure: self.transition,
            transition_slope: self.transition_slope,
            vapour_pressure: T::zero(),
        };
        let trapped = (now.pressure_other - now.pressure_other_pump).max(T::zero());
        let held_back = trapped * self.other_area / self.area;
        // the loaded side carries what is shut in and the smallest load at least, whatever it shows
        let before = now.pressure_load.max(self.least_pressure + held_back);
        let after = (before - held_back).max(T::zero());
        let volume = self.dead_volume + self.area * height + self.pump_volume;
        volume * (oil.compression(before) - oil.compression(after)) / self.area
    }

    /// Mean position of the newest window; whether the window closes.
    #[inline(always)]
    pub(super) fn average(&self, period: &Period<'_, T>, s: &mut ReleaseState<T>) -> T::Mask {
        let Period { before, is_new, position, elapsed, .. } = *period;
        let (zero, one) = (T::zero(), T::one());
        s.sum = before.sum + T::select(is_new, position, zero);
        s.count = before.count + T::select(is_new, one, zero);
        s.window_time = before.window_time + elapsed;
        let closes = self.window.lt(s.window_time + T::lit(0.5) * self.period) & zero.lt(s.count);
        s.mean = T::select(closes, s.sum / s.count.max(one), before.mean);
        s.sum = T::select(closes, zero, s.sum);
        s.count = T::select(closes, zero, s.count);
        s.window_time = T::select(closes, zero, s.window_time);
        closes
    }

    /// Mean, scatter and drift of the position at rest, and the mean pressure. `closes` holds where the averaging
    /// window closes.
    #[inline(always)]
    pub(super) fn observe_rest(
        &self,
        period: &Period<'_, T>,
        closes: T::Mask,
        s: &mut ReleaseState<T>,
    ) -> Rest<T> {
        let Period { before, now, at_rest, filling, is_new, position, .. } = *period;
        let (zero, one) = (T::zero(), T::one());
        let counted = T::select(at_rest & is_new, one, zero);
        let in_first_half = s.phase_time.lt(T::lit(0.5) * self.observation);
        let half = T::select(in_first_half, counted, zero);
        s.rest_sum = before.rest_sum + counted * position;
        s.rest_squares = before.rest_squares + counted * position.square();
        s.rest_count = before.rest_count + counted;
        s.half_sum = before.half_sum + half * position;
        s.half_count = before.half_count + half;
        let rest_pressure = before.rest_pressure
            + (now.pressure_load - before.rest_pressure) / s.rest_count.max(one);
        s.rest_pressure = T::select(at_rest & is_new, rest_pressure, before.rest_pressure);
        let observed = at_rest & self.observation.lt(s.phase_time);
        let mean = s.rest_sum / s.rest_count.max(one);
        let first = s.half_sum / s.half_count.max(one);
        let second = (s.rest_sum - s.half_sum) / (s.rest_count - s.half_count).max(one);
        let variance = (s.rest_squares / s.rest_count.max(one) - mean.square()).max(zero);
        // while the pump fills, the mean at rest follows slowly: a position that drifts is no lift
        let follows =
            before.rest_mean + (s.mean - before.rest_mean) * self.window / self.observation;
        let rest_mean = T::select(filling & closes, follows, before.rest_mean);
        s.rest_mean = T::select(observed, mean, rest_mean);
        s.scatter = T::select(observed, variance.sqrt(), before.scatter);
        let drifts = self.rest_drift.lt((second - first).abs());
        let needed = (T::lit(SIGNIFICANT) * s.scatter).max(self.proving_motion);
        let too_noisy = self.largest_motion.lt(needed);
        Rest { observed, drifts, needed, too_noisy }
    }

    /// Distance of the piston \[m\] from the end stop that the load pushes it to.
    #[inline(always)]
    fn height(&self, stroke: T) -> T {
        T::select(T::zero().lt(self.direction), stroke, self.stroke - stroke)
    }

    /// The pressures at rest against those that a load of the crane file can have.
    #[inline(always)]
    pub(super) fn judge_load(
        &self,
        period: &Period<'_, T>,
        observed: T::Mask,
        has_check: T::Mask,
        s: &mut ReleaseState<T>,
    ) -> LoadJudgement<T> {
        let Period { before, now, .. } = *period;
        let zero = T::zero();
        // on the lower stop the stop carries the load; elsewhere some pressure must
        let height = self.height(now.stroke);
        let hangs = self.end_zone.lt(height);
        let low = s.rest_pressure.lt(self.least_pressure - self.pressure_tolerance);
        // what is shut in on the other side is carried besides the load
        let held_back = now.pressure_other.max(zero) * self.other_area / self.area;
        let most = self.most_pressure + held_back + self.pressure_tolerance;
        let too_heavy = most.lt(s.rest_pressure);
        let too_light = hangs & low;
        let compressed = now.pressure_pump.max(zero) * self.largest_compliance;
        let least_volume = self.pump_volume * (self.least_compression - compressed).max(zero);
        s.least_volume = T::select(observed, least_volume, before.least_volume);

        // without check function an empty pump side is to be filled: one that shows the load's pressure
        // before the pump turned has not drained, or its transducer shows another pressure
        let is_drained = now
            .pressure_pump
            .lt(now.pressure_load - self.pressure_tolerance - self.pressure_tolerance);
        let undrained = observed & !has_check & !is_drained;
        let springs = observed & self.largest_spring.lt(self.spring(now, height));
        LoadJudgement { too_light, too_heavy, undrained, springs }
    }

    /// Delivered volume, and motion against the load; `needed` \[m\] is the motion that proves the balance.
    #[inline(always)]
    pub(super) fn lift(
        &self,
        period: &Period<'_, T>,
        needed: T,
        s: &mut ReleaseState<T>,
    ) -> Lift<T> {
        let Period { before, now, elapsed, filling, settling, .. } = *period;
        let delivered = self.direction * now.motor_speed * self.delivery * elapsed;
        s.volume = before.volume + T::select(filling | settling, delivered, T::zero());
        let lift = self.direction * (s.mean - s.rest_mean);
        let moved = filling & needed.lt(lift);
        let too_soon = moved & s.volume.lt(s.least_volume);
        // moved away from the load: a position that drifts the other way
        let sank = filling & lift.lt(-needed);
        let difference = now.pressure_pump - now.pressure_load;
        let apart = self.pressure_tolerance.lt(difference.abs());
        Lift { moved, too_soon, sank, apart }
    }

    /// Balance by delivered volume and pressure where nothing can move; and whether the pump has delivered, or the
    /// release lasted, as much as can be needed. `apart` holds where the pressures of pump side and cylinder differ.
    #[inline(always)]
    pub(super) fn balance(
        &self,
        period: &Period<'_, T>,
        has_check: T::Mask,
        apart: T::Mask,
        s: &mut ReleaseState<T>,
    ) -> (T::Mask, T::Mask) {
        let Period { before, now, elapsed, filling, .. } = *period;
        // at the upper end stop the piston cannot move: the cylinder's pressure answers instead
        let at_upper_end = (self.stroke - self.end_zone).lt(self.height(now.stroke));
        let rise = now.pressure_load - s.rest_pressure;
        let enough = s.least_volume.lt(s.volume);
        let answered = self.pressure_response.lt(rise) & enough & !apart;
        // without check function nothing passes: delivered volume and pressure
        let agrees = filling & !apart & enough;
        s.balanced = T::select(agrees, before.balanced + elapsed, T::zero());
        let balanced = T::lit(BALANCED).lt(s.balanced);
        let by_pressure =
            filling & ((!has_check & balanced) | (has_check & at_upper_end & answered));
        let spent = filling & (self.largest_volume.lt(s.volume) | self.largest_duration.lt(s.time));
        (by_pressure, spent)
    }

    /// Over a period of the load mode the piston stays where it is. A swinging one gets a few periods, a position
    /// that drifts does not become steady. Returns whether it has settled, and whether it moves still.
    #[inline(always)]
    pub(super) fn settle(
        &self,
        period: &Period<'_, T>,
        s: &mut ReleaseState<T>,
    ) -> (T::Mask, T::Mask) {
        let Period { before, elapsed, settling, .. } = *period;
        let over = settling & self.observation.lt(s.settling_time);
        let stays = (s.mean - before.settled_mean).abs().lt(self.proving_motion);
        let settled = over & stays;
        s.settling_time = T::select(settling & !over, before.settling_time + elapsed, T::zero());
        let restarts = !(before.settling_time.lt(T::lit(1e-12)));
        s.settled_mean = T::select(restarts & !over, before.settled_mean, s.mean);
        let patience = T::lit(SETTLING_PERIODS) * self.observation;
        let still_moves = settling & !settled & patience.lt(s.phase_time);
        (settled, still_moves)
    }
}

/// A control period of a release: state before it, inputs, and phase.
pub(super) struct Period<'a, T: Real> {
    pub(super) before: &'a ReleaseState<T>,
    pub(super) now: &'a ReleaseInput<T>,
    /// Its length \[s\].
    pub(super) elapsed: T,
    pub(super) at_rest: T::Mask,
    pub(super) filling: T::Mask,
    pub(super) settling: T::Mask,
    /// Whether the position is a new measurement.
    pub(super) is_new: T::Mask,
    /// Piston position from the first measured one \[m\].
    pub(super) position: T,
}

/// The position at rest.
pub(super) struct Rest<T: Real> {
    /// Observed for long enough, in this control period.
    pub(super) observed: T::Mask,
    pub(super) drifts: T::Mask,
    /// Motion \[m\] that proves the balance.
    pub(super) needed: T,
    pub(super) too_noisy: T::Mask,
}

/// The pressures at rest.
pub(super) struct LoadJudgement<T: Real> {
    /// Below the smallest possible pressure of the load, off the lower stop.
    pub(super) too_light: T::Mask,
    /// Above the largest possible pressure of the load.
    pub(super) too_heavy: T::Mask,
    /// The pump side of a valve without check function is not empty.
    pub(super) undrained: T::Mask,
    /// The released load would spring too far.
    pub(super) springs: T::Mask,
}

/// Motion while the pump fills its side.
pub(super) struct Lift<T: Real> {
    /// Against the load, by the needed motion.
    pub(super) moved: T::Mask,
    /// That, before the delivered volume can have moved it.
    pub(super) too_soon: T::Mask,
    /// With the load.
    pub(super) sank: T::Mask,
    /// Pump-side and cylinder pressure disagree.
    pub(super) apart: T::Mask,
}
