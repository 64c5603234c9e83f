//! Release of the load: proof of balance by motion, then the load-holding valve is energised.
//!
//! A shut load-holding valve lets oil pass from pump to cylinder. So the pump is run, with the valve
//! shut, until the piston moves against the load: then the pump side carries the load, whatever the
//! pressure transducers show. Only after that may the valve be energised.
//!
//! ```text
//! at rest:  mean x₀ and scatter σ of the position, drift |x̄₂ − x̄₁| of two half windows
//! filling:  V = ∫ n k D dt,  lift s (x̄ − x₀), x̄ the mean of the newest window
//! proof:    s (x̄ − x₀) ≥ max(x_p, 4 σ),  V ≥ V_PA (S(p_least) − S(p_PA)),  S(p) = ∫ dp/β
//! settling: the pump only makes good its leakage; one period of the load mode later x̄ is the same
//! ```
//!
//! Pressures are a cross-check of the motion: readings that disagree with it refuse the release. In two
//! cases nothing can move, and pressures are all there is: at the upper end stop, where the answer of the
//! cylinder's pressure to the delivered volume takes the place of the motion, and behind a valve without
//! check function, which is released on delivered volume and pressure from a drained pump side.
//!
//! One period is [`Release::advance`], over any scalar: its phases are numbers and its branches
//! `select`, so that exported blocks carry the same code.

mod proof;

use hydroboom_math::{Real, record};
use proof::{Lift, LoadJudgement, Period, Rest};

record! {
    /// Settings of a release, derived from a crane file's values and ranges.
    pub struct Release<T> {
        /// Control period
        #[unit = "s"]
        pub period: T,
        /// Direction that the load resists: +1 where the piston side carries it, −1 where the rod side does
        #[unit = "1"]
        pub direction: T,
        /// Duration of an averaging window of the position
        #[unit = "s"]
        pub window: T,
        /// Duration of observation at rest, and of the check that the piston has settled: a period of the load mode
        #[unit = "s"]
        pub observation: T,
        /// Largest change of the mean position at rest
        #[unit = "m"]
        pub rest_drift: T,
        /// Motion that proves the balance, x_p
        #[unit = "m"]
        pub proving_motion: T,
        /// Largest required motion where the position scatters
        #[unit = "m"]
        pub largest_motion: T,
        /// Length of the stroke
        #[unit = "m"]
        pub stroke: T,
        /// Distance from an end stop within which the piston may rest on it
        #[unit = "m"]
        pub end_zone: T,
        /// Delivered volume per revolution, k D
        #[unit = "m³/rev"]
        pub delivery: T,
        /// Motor speed while the pump side's pressure is below the load's by more than `approach`
        #[unit = "rev/s"]
        pub fast: T,
        /// Motor speed once the pump side is within `approach` of the load's pressure
        #[unit = "rev/s"]
        pub slow: T,
        /// Pressure difference to the load's pressure from which the pump fills slowly
        #[unit = "Pa"]
        pub approach: T,
        /// Largest acceleration of the motor
        #[unit = "rev/s²"]
        pub slew: T,
        /// Motor speed that compensates the pump's leakage at the nominal load pressure
        #[unit = "rev/s"]
        pub leakage: T,
        /// Gain from the pressure difference of load and pump side to motor speed, after the lift
        #[unit = "rev/(s·Pa)"]
        pub holding_gain: T,
        /// Nominal load pressure
        #[unit = "Pa"]
        pub nominal_pressure: T,
        /// Smallest possible pressure of the load, p_least
        #[unit = "Pa"]
        pub least_pressure: T,
        /// Largest possible pressure of the load, with no pressure on the other side
        #[unit = "Pa"]
        pub most_pressure: T,
        /// Largest disagreement of pump-side and cylinder pressure once the piston moves
        #[unit = "Pa"]
        pub pressure_tolerance: T,
        /// Rise of the cylinder's pressure that proves oil flow into it, at the upper end stop
        #[unit = "Pa"]
        pub pressure_response: T,
        /// Compression ∫ dp/β of the stiffest oil up to p_least
        #[unit = "1"]
        pub least_compression: T,
        /// Volume of the pump side
        #[unit = "m³"]
        pub pump_volume: T,
        /// Largest volume that can be needed until the piston moves
        #[unit = "m³"]
        pub largest_volume: T,
        /// Longest duration of a release
        #[unit = "s"]
        pub largest_duration: T,
        /// 1 where the shut valve lets oil pass from pump to cylinder, 0 where it does not
        #[unit = "1"]
        pub check_function: T,
        /// Largest compliance of the oil, 1/β_min
        #[unit = "1/Pa"]
        pub largest_compliance: T,
        /// Largest bulk modulus of the oil, β_max
        #[unit = "Pa"]
        pub bulk_modulus: T,
        /// Middle of the transition of the softest oil, p_c1
        #[unit = "Pa"]
        pub transition: T,
        /// Reciprocal of the transition's width, 1/p_c2
        #[unit = "1/Pa"]
        pub transition_slope: T,
        /// Area of the chamber that carries the load
        #[unit = "m²"]
        pub area: T,
        /// Area of the other chamber
        #[unit = "m²"]
        pub other_area: T,
        /// Smallest volume of the chamber that carries the load
        #[unit = "m³"]
        pub dead_volume: T,
        /// Largest movement of the load when pressure trapped on the unloaded side is released
        #[unit = "m"]
        pub largest_spring: T,
    }
}

record! {
    /// Inputs of a release in a control period.
    pub struct ReleaseInput<T> {
        /// Piston position
        #[unit = "m"]
        pub stroke: T,
        /// Measured motor speed
        #[unit = "rev/s"]
        pub motor_speed: T,
        /// Gauge pressure of the pump side that carries the load
        #[unit = "Pa"]
        pub pressure_pump: T,
        /// Gauge pressure of the cylinder chamber that carries the load
        #[unit = "Pa"]
        pub pressure_load: T,
        /// Gauge pressure of the other cylinder chamber
        #[unit = "Pa"]
        pub pressure_other: T,
        /// Gauge pressure of the other pump side
        #[unit = "Pa"]
        pub pressure_other_pump: T,
        /// 1 with a new measurement, 0 where the last one is repeated
        #[unit = "1"]
        pub is_new: T,
    }
}

record! {
    /// State of a release.
    pub struct ReleaseState<T> {
        /// Phase: 0 at rest, 1 filling, 2 settling, 3 proven, negative refused
        #[unit = "1"]
        pub phase: T,
        /// Time since the release began
        #[unit = "s"]
        pub time: T,
        /// Time in this phase
        #[unit = "s"]
        pub phase_time: T,
        /// Commanded motor speed
        #[unit = "rev/s"]
        pub motor_speed: T,
        /// First measured position, the origin of all sums of positions
        #[unit = "m"]
        pub origin: T,
        /// Sum of piston positions in the present averaging window
        #[unit = "m"]
        pub sum: T,
        /// Number of position measurements in this window
        #[unit = "1"]
        pub count: T,
        /// Time since the start of this window
        #[unit = "s"]
        pub window_time: T,
        /// Mean position of the newest window
        #[unit = "m"]
        pub mean: T,
        /// Sum of positions at rest
        #[unit = "m"]
        pub rest_sum: T,
        /// Sum of squared positions at rest
        #[unit = "m²"]
        pub rest_squares: T,
        /// Sum of positions in the first half at rest
        #[unit = "m"]
        pub half_sum: T,
        /// Number of position measurements at rest
        #[unit = "1"]
        pub rest_count: T,
        /// Number of position measurements in the first half at rest
        #[unit = "1"]
        pub half_count: T,
        /// Mean position at rest, x_0
        #[unit = "m"]
        pub rest_mean: T,
        /// Scatter of the position at rest, sigma
        #[unit = "m"]
        pub scatter: T,
        /// Mean cylinder pressure at rest
        #[unit = "Pa"]
        pub rest_pressure: T,
        /// Delivered volume since the pump began to turn, V
        #[unit = "m³"]
        pub volume: T,
        /// Delivered volume before which motion is not attributed to the pump
        #[unit = "m³"]
        pub least_volume: T,
        /// Duration of equal pressures of pump side and cylinder, for a valve without check function
        #[unit = "s"]
        pub balanced: T,
        /// Time since the reference for the settling check was taken
        #[unit = "s"]
        pub settling_time: T,
        /// Mean position at the start of the settling check
        #[unit = "m"]
        pub settled_mean: T,
    }
}

/// Reason for which a release was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// The position moved before the pump turned, before the delivered volume can have moved it, or after the pump
    /// had stopped.
    PositionNotSteady,
    /// The pump delivered the largest volume needed, and the piston did not move.
    NoLift,
    /// Pressure is trapped on the unloaded side: the released load would spring.
    TrappedPressure,
    /// The load needs a higher pressure than any load of the crane file.
    LoadTooHeavy,
    /// The piston moved, but the pressures disagree with it; or the load pressure is below the smallest possible one.
    PressureDisagrees,
}

impl Refusal {
    /// All reasons.
    pub const ALL: [Self; 5] = [
        Self::PositionNotSteady,
        Self::NoLift,
        Self::PressureDisagrees,
        Self::TrappedPressure,
        Self::LoadTooHeavy,
    ];

    /// Refusal with this phase number; `None` for a phase that is no refusal.
    pub fn from_phase(phase: f64) -> Option<Self> {
        Self::ALL.into_iter().find(|refusal| refusal.phase() == phase)
    }

    /// Phase number of the refusal, negative.
    pub fn phase(self) -> f64 {
        match self {
            Self::PositionNotSteady => -1.0,
            Self::NoLift => -2.0,
            Self::PressureDisagrees => -3.0,
            Self::TrappedPressure => -4.0,
            Self::LoadTooHeavy => -5.0,
        }
    }
}

/// Values of the phase of a release.
pub mod phase {
    /// Observation of the position at rest; the pump does not turn.
    pub const AT_REST: f64 = 0.0;
    /// The pump fills its side until the piston moves.
    pub const FILLING: f64 = 1.0;
    /// The pump compensates its leakage; the piston must stay.
    pub const SETTLING: f64 = 2.0;
    /// Proof complete: the pump side carries the load.
    pub const PROVEN: f64 = 3.0;
}

impl<T: Real> Release<T> {
    /// Initial state of a release, with the motor at rest.
    pub fn begin(&self) -> ReleaseState<T> {
        ReleaseState::from_array([T::zero(); ReleaseState::NAMES.len()])
    }

    /// One control period; `elapsed` \[s\] is its length by the machine's clock, positive.
    #[inline(always)]
    pub fn advance(
        &self,
        before: &ReleaseState<T>,
        now: &ReleaseInput<T>,
        elapsed: T,
    ) -> ReleaseState<T> {
        let zero = T::zero();
        let is = |phase: f64| {
            let lower = T::lit(phase - 0.5).lt(before.phase);
            lower & before.phase.lt(T::lit(phase + 0.5))
        };
        let (at_rest, filling, settling) =
            (is(phase::AT_REST), is(phase::FILLING), is(phase::SETTLING));
        let is_new = T::lit(0.5).lt(now.is_new);

        let mut s = *before;
        s.time = before.time + elapsed;
        s.phase_time = before.phase_time + elapsed;
        let begins = before.time.lt(T::lit(1e-12));
        s.origin = T::select(begins, now.stroke, before.origin);
        let position = now.stroke - s.origin;
        let period = Period { before, now, elapsed, at_rest, filling, settling, is_new, position };

        let closes = self.average(&period, &mut s);
        let has_check = T::lit(0.5).lt(self.check_function);
        let rest = self.observe_rest(&period, closes, &mut s);
        let load = self.judge_load(&period, rest.observed, has_check, &mut s);
        let lift = self.lift(&period, rest.needed, &mut s);
        let (by_pressure, spent) = self.balance(&period, has_check, lift.apart, &mut s);
        let (settled, still_moves) = self.settle(&period, &mut s);
        let transitions =
            Transitions { rest, load, lift, by_pressure, spent, settled, still_moves };
        let next = transitions.next_phase(before.phase);
        let changes = (next - before.phase).abs();
        s.phase_time = T::select(T::lit(0.5).lt(changes), zero, s.phase_time);
        s.phase = next;
        let wanted = self.pump_speed(now, has_check, next);
        let reach = self.slew * self.period;
        s.motor_speed = wanted.clamp(before.motor_speed - reach, before.motor_speed + reach);
        s
    }

    /// Motor speed \[rev/s\] in the phase `next`: fast, slow, then what leaks.
    #[inline(always)]
    fn pump_speed(&self, now: &ReleaseInput<T>, has_check: T::Mask, next: T) -> T {
        let zero = T::zero();
        // readings only choose how fast the pump fills: if they are wrong, the lift is less gentle
        let is_far = now.pressure_pump.lt(now.pressure_load - self.approach);
        let filling_speed = T::select(is_far, self.fast, self.slow);
        let share = (now.pressure_pump.max(zero) / self.nominal_pressure).min(T::lit(4.0)).sqrt();
        // level with the load nothing passes the check valve, and nothing is lost when it opens
        let lost = now.pressure_load - now.pressure_pump;
        let holding_speed =
            (self.leakage * share + self.holding_gain * lost).max(zero).min(self.slow);
        // nothing passes a valve without check function: the pump side is brought level with the load
        let levels =
            !has_check & !(now.pressure_pump.lt(now.pressure_load - self.pressure_tolerance));
        let filling_speed = T::select(levels, holding_speed, filling_speed);
        let is_filling =
            T::lit(phase::FILLING - 0.5).lt(next) & next.lt(T::lit(phase::FILLING + 0.5));
        let is_held = T::lit(phase::FILLING + 0.5).lt(next);
        self.direction
            * T::select(is_filling, filling_speed, T::select(is_held, holding_speed, zero))
    }
}

/// Conditions of the transitions from one phase to the next.
struct Transitions<T: Real> {
    rest: Rest<T>,
    load: LoadJudgement<T>,
    lift: Lift<T>,
    /// Balance proven by volume and pressure.
    by_pressure: T::Mask,
    /// All volume delivered, or all time passed, that can be needed.
    spent: T::Mask,
    settled: T::Mask,
    still_moves: T::Mask,
}

impl<T: Real> Transitions<T> {
    /// The next phase; a refusal counts more than progress.
    #[inline(always)]
    fn next_phase(&self, phase: T) -> T {
        let Self { rest, load, lift, by_pressure, spent, settled, still_moves } = self;
        let Rest { observed, drifts, too_noisy, .. } = *rest;
        let LoadJudgement { too_light, too_heavy, undrained, springs } = *load;
        let Lift { moved, too_soon, sank, apart } = *lift;
        let (by_pressure, spent) = (*by_pressure, *spent);
        let (settled, still_moves) = (*settled, *still_moves);
        let number = |value: f64| T::lit(value);
        let mut next = phase;
        next = T::select(observed, number(phase::FILLING), next);
        next = T::select(moved | by_pressure, number(phase::SETTLING), next);
        next = T::select(settled, number(phase::PROVEN), next);
        let not_steady = (observed & (drifts | too_noisy)) | too_soon | sank | still_moves;
        let disagrees = undrained | (observed & too_light) | (moved & apart) | (settled & apart);
        next = T::select(spent & !(moved | by_pressure), number(Refusal::NoLift.phase()), next);
        next = T::select(disagrees, number(Refusal::PressureDisagrees.phase()), next);
        next = T::select(observed & too_heavy, number(Refusal::LoadTooHeavy.phase()), next);
        next = T::select(springs, number(Refusal::TrappedPressure.phase()), next);
        T::select(not_steady, number(Refusal::PositionNotSteady.phase()), next)
    }
}
