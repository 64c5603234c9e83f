//! Detector of sustained oscillation of the control error while the reference rests.
//!
//! While the reference rests the detector finds the turning points of the error (with hysteresis, as
//! rainflow counting does) and compares the range R of each half-cycle with those before.
//!
//! ```text
//! R ≥ R_min  and  R ≥ q max(R₁ s^t₁, R₂ s^t₂, …),  t_i the time since half-cycle i of this run
//! sustained: m such half-cycles one after the other that take T at least
//! amplitude = R/2,  frequency = (half-cycles − 1)/(2 · time between the first turning point and the last)
//! ```
//!
//! A load that creeps back to its reference has no turning points, one that dies out falls below the
//! decaying range. A reference that moves begins the detection anew.

use hydroboom_math::{Real, record};

record! {
    /// Settings of the detector of sustained oscillation.
    pub struct OscillationDetector<T> {
        /// Smallest range of a half-cycle, R_min
        #[unit = "m"]
        pub range: T,
        /// Share of a half-cycle's range that remains after a second at the limit of sustained oscillation, s
        #[unit = "1"]
        pub sustained: T,
        /// Smallest ratio of a half-cycle's range to the decayed range of those before, q
        #[unit = "1"]
        pub scatter: T,
        /// Number of consecutive half-cycles, m
        #[unit = "1"]
        pub half_cycles: T,
        /// Smallest duration of these half-cycles, T
        #[unit = "s"]
        pub time: T,
        /// Longest duration of a half-cycle
        #[unit = "s"]
        pub slowest: T,
    }
}

record! {
    /// State of the detector of sustained oscillation.
    pub struct OscillationState<T> {
        /// 1 while the error rises, −1 while it falls, 0 before the first error
        #[unit = "1"]
        pub direction: T,
        /// Extreme of the control error since the last turning point
        #[unit = "m"]
        pub extreme: T,
        /// Control error at the last turning point
        #[unit = "m"]
        pub turned_at: T,
        /// Time since the last turning point
        #[unit = "s"]
        pub since: T,
        /// Number of consecutive sustained half-cycles
        #[unit = "1"]
        pub half_cycles: T,
        /// Time between the first and the last of their turning points
        #[unit = "s"]
        pub time: T,
        /// Largest range of these half-cycles, each decayed since
        #[unit = "m"]
        pub reference: T,
        /// Range of the last half-cycle
        #[unit = "m"]
        pub range: T,
    }
}

impl OscillationDetector<f64> {
    /// Settings for piston positioning: four half-cycles of 2 mm, in 1.5 s at least, that do not fall to 80 % within
    /// a second. Load modes and their limit cycles are at 0.3 to 5 Hz. Estimate.
    pub const POSITIONING: Self = Self {
        range: 2e-3,
        sustained: 0.8,
        scatter: 0.9,
        half_cycles: 4.0,
        time: 1.5,
        slowest: 2.0,
    };

    /// Time at rest \[s\] within which an oscillation of a frequency f \[Hz\] is detected:
    /// `(max(m, 2 f T + 2) + 2)/(2 f)`.
    ///
    /// It applies to a range of R_min at least, and to half-cycles shorter than [`slowest`](Self::slowest): above
    /// 0.25 Hz with [`POSITIONING`](Self::POSITIONING). A slower oscillation is not detected.
    pub fn time_to_find(&self, frequency: f64) -> f64 {
        let half = 0.5 / frequency;
        // what is seen first is part of a half-cycle, and a turning point is known by its hysteresis
        (self.half_cycles.max(self.time / half + 2.0) + 2.0) * half
    }
}

/// Hysteresis of a turning point, of the smallest range.
const HYSTERESIS: f64 = 0.25;

impl<T: Real> OscillationDetector<T> {
    /// Adds the control error \[m\] of a period of `elapsed` \[s\]. Returns whether it is in sustained oscillation.
    ///
    /// Where `rests` is false the reference moves, and the detector is reset.
    #[inline(always)]
    pub fn update(
        &self,
        state: &mut OscillationState<T>,
        error: T,
        rests: T::Mask,
        elapsed: T,
    ) -> T::Mask {
        let (zero, one) = (T::zero(), T::one());
        let was = *state;
        let half = T::lit(0.5);
        let (rises, falls) = (half.lt(was.direction), was.direction.lt(-half));
        let is_fresh = !rises & !falls;

        // a turning point, once the error has come back from its extreme
        let extreme = T::select(rises, was.extreme.max(error), was.extreme.min(error));
        let extreme = T::select(is_fresh, error, extreme);
        let back = T::lit(HYSTERESIS) * self.range;
        let turns = (rises & error.lt(extreme - back)) | (falls & (extreme + back).lt(error));
        let since = was.since + elapsed;
        let range = (extreme - was.turned_at).abs();

        // a half-cycle that is as large as those before, as far as they would be left
        let left = was.reference * (self.sustained.ln() * since).exp();
        let counts = !range.lt(self.range) & since.lt(self.slowest);
        let sustains = counts & !range.lt(self.scatter * left);
        let goes_on = sustains & half.lt(was.half_cycles);
        let turned = OscillationState {
            direction: -was.direction,
            extreme: error,
            turned_at: extreme,
            since: zero,
            half_cycles: T::select(goes_on, was.half_cycles + one, T::select(counts, one, zero)),
            time: T::select(goes_on, was.time + since, zero),
            reference: T::select(goes_on, left.max(range), T::select(counts, range, zero)),
            range,
        };
        // where nothing turns for long, nothing oscillates
        let is_over = self.slowest.lt(since);
        let still = OscillationState {
            direction: T::select(is_fresh, one, was.direction),
            extreme,
            turned_at: T::select(is_fresh, error, was.turned_at),
            since,
            half_cycles: T::select(is_over, zero, was.half_cycles),
            time: T::select(is_over, zero, was.time),
            ..was
        };
        let mut next = still.to_array();
        for (place, turned) in next.iter_mut().zip(turned.to_array()) {
            *place = T::select(rests, T::select(turns, turned, *place), zero);
        }
        *state = OscillationState::from_array(next);
        self.found(state)
    }

    /// Whether the last half-cycles are a sustained oscillation: m of them at least, that take T at least.
    #[inline(always)]
    pub fn found(&self, state: &OscillationState<T>) -> T::Mask {
        (self.half_cycles - T::lit(0.5)).lt(state.half_cycles) & !state.time.lt(self.time)
    }

    /// Amplitude \[m\] and frequency \[Hz\] of the last sustained half-cycles; zero for fewer than two.
    ///
    /// The amplitude is half the range of the last one. The frequency is `(h − 1)/(2 t)` for h half-cycles, of which
    /// all but the first took the time t \[s\].
    #[inline(always)]
    pub fn amplitude_and_frequency(&self, state: &OscillationState<T>) -> [T; 2] {
        let is = T::lit(1.5).lt(state.half_cycles) & T::zero().lt(state.time);
        let time = T::select(is, T::lit(2.0) * state.time, T::one());
        let values = [T::lit(0.5) * state.range, (state.half_cycles - T::one()) / time];
        values.map(|value| T::select(is, value, T::zero()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::TAU;

    const DETECTOR: OscillationDetector<f64> = OscillationDetector::POSITIONING;

    /// Time at which an error over time is found to be in sustained oscillation, with amplitude and frequency.
    fn found(error: impl Fn(f64) -> f64, rests: impl Fn(f64) -> bool) -> Option<(f64, [f64; 2])> {
        let mut state = OscillationState::default();
        (0..20_000).map(|k| f64::from(k) * 1e-3).find_map(|t| {
            DETECTOR
                .update(&mut state, error(t), rests(t), 1e-3)
                .then(|| (t, DETECTOR.amplitude_and_frequency(&state)))
        })
    }

    #[test]
    fn a_sustained_oscillation_is_found_in_time_with_its_amplitude_and_frequency() {
        for frequency in [0.3, 0.7, 1.3, 3.0, 5.0] {
            for bias in [0.0, 20e-3] {
                let swing = |t: f64| bias + 4e-3 * (TAU * frequency * t).sin();
                let (time, [amplitude, hz]) = found(swing, |_| true).unwrap();
                assert!(time < DETECTOR.time_to_find(frequency), "{frequency} Hz: {time} s");
                assert!((amplitude / 4e-3 - 1.0).abs() < 0.01, "{frequency} Hz: {amplitude}");
                assert!((hz / frequency - 1.0).abs() < 0.02, "{frequency} Hz: {hz}");
            }
        }
        // between two stops, with a scatter of a twentieth, and hardly dying out
        assert!(found(|t| 4e-3 * (TAU * t).sin().signum(), |_| true).is_some());
        let scatters = |t: f64| 4e-3 * (1.0 + 0.025 * (37.0 * t).sin()) * (TAU * 2.0 * t).sin();
        assert!(found(scatters, |_| true).is_some());
        let hardly = |t: f64| 8e-3 * (-0.1 * t).exp() * (TAU * 2.0 * t).sin();
        assert!(found(hardly, |_| true).is_some());
    }

    #[test]
    fn an_oscillation_that_doubles_each_period_is_detected_early() {
        let growing = |t: f64| 0.5e-3 * (t * core::f64::consts::LN_2).exp() * (TAU * t).sin();
        let (_, [amplitude, _]) = found(growing, |_| true).unwrap();
        assert!(amplitude < 5.0 * DETECTOR.range, "{amplitude}");
    }

    #[test]
    fn decaying_creeping_and_small_errors_are_no_oscillation() {
        let swing = |t: f64, hz: f64| 8e-3 * (TAU * hz * t).sin();
        for hz in [0.5, 1.0, 2.0, 4.0] {
            assert_eq!(found(|t| swing(t, hz) * (-0.5 * t).exp(), |_| true), None, "{hz} Hz");
        }
        assert_eq!(found(|t| -9e-3 + 2e-3 * t.min(4.5), |_| true), None);
        assert_eq!(found(|t| 0.1 * swing(t, 2.0), |_| true), None);
        // stick-slip
        assert_eq!(found(|t| if t % 5.0 < 2.5 { 5e-3 } else { -1e-3 }, |_| true), None);
    }

    #[test]
    fn a_moving_reference_restarts_the_detection() {
        let swing = |t: f64| 8e-3 * (TAU * 2.0 * t).sin();
        assert_eq!(found(swing, |t| t % 2.0 > 0.5), None);
        assert!(found(swing, |t| t > 7.0).unwrap().0 > 7.0 + DETECTOR.time);
    }
}
