//! Worst-case margins of the benchmark controller over payloads and piston positions.

use crate::design_report::benchmark_loop;
use crate::margins::minimum;
use crate::stability::POSITIONS;
use crate::{DesignError, LinearisedPlant, Loop, Margins, margins};
use hydroboom_description::Description;
use serde::Serialize;

/// Payloads at which gains are judged at each position to begin with; the ends of the range are among them.
const JUDGED_PAYLOADS: u32 = 13;
/// Positions at which gains are judged with the worst payload.
const JUDGED_POSITIONS: u32 = 10;
/// Where the sensitivity changes by more than this share between neighbours, one of which is as close to the largest,
/// gains are judged between them too. Local maxima as close are found by golden-section search. Both end at a distance
/// in payload or stroke that is this share of its range.
const CHANGE: f64 = 0.05;
const CLOSE: f64 = 0.9;
const LEAST_STEP: f64 = 1e-3;

/// Worst-case stability margins over payloads and piston positions.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct WorstMargins {
    /// Whether the loop is stable for all payloads and positions.
    pub stable: bool,
    /// Largest peak of the sensitivity function, M_s \[1\].
    pub sensitivity_peak: f64,
    /// Smallest phase margin \[deg\].
    pub phase_deg: f64,
    /// Smallest gain margin \[1\], a factor.
    pub gain: f64,
    /// Payload with the largest M_s \[kg\].
    pub payload_kg: f64,
    /// Piston position with the largest M_s \[mm\].
    pub stroke_mm: f64,
}

/// Worst-case margins of a description's own gains, over a range of payloads \[kg\] and the stroke.
///
/// # Errors
///
/// [`DesignError`] if the crane cannot be linearised with one of the payloads.
pub fn worst_margins(
    description: &Description,
    payload: [f64; 2],
) -> Result<WorstMargins, DesignError> {
    Ok(worst(description, payload)?.0)
}

/// The least margins over payloads between two \[kg\] and the stroke, and the frequency \[Hz\] at which the
/// sensitivity is largest.
///
/// At each position over payloads, halved where the sensitivity is large and changes; then at the worst payload over
/// positions, and there over payloads once more.
pub(super) fn worst(
    description: &Description,
    payload: [f64; 2],
) -> Result<(WorstMargins, f64), DesignError> {
    let mut search = MarginSearch {
        description,
        around: benchmark_loop(description),
        worst: WorstMargins {
            stable: true,
            sensitivity_peak: 0.0,
            phase_deg: f64::INFINITY,
            gain: f64::INFINITY,
            payload_kg: f64::NAN,
            stroke_mm: f64::NAN,
        },
        at_hz: f64::NAN,
    };
    let stroke = description.numbers.stroke;
    let [first, .., last] = POSITIONS.map(|share| share * stroke);
    for position in POSITIONS.map(|share| share * stroke) {
        search.along(payload, JUDGED_PAYLOADS, |payload| (payload, position))?;
    }
    let worst = search.worst.payload_kg;
    search.along([first, last], JUDGED_POSITIONS, |position| (worst, position))?;
    let position = search.worst.stroke_mm * 1e-3;
    search.along(payload, JUDGED_PAYLOADS, |payload| (payload, position))?;
    Ok((search.worst, search.at_hz))
}

/// Search for the worst margins, at one payload and position after the other.
struct MarginSearch<'a> {
    description: &'a Description,
    around: Loop,
    worst: WorstMargins,
    at_hz: f64,
}

impl MarginSearch<'_> {
    /// The largest sensitivity with a payload \[kg\] at a position \[m\]; infinite where the loop is unstable.
    fn at(&mut self, (payload, position): (f64, f64)) -> Result<f64, DesignError> {
        let mut loaded = self.description.clone();
        loaded.numbers.payload = payload;
        let of: Margins = margins(&LinearisedPlant::new(&loaded, position)?, &self.around)?;
        let peak = if of.is_stable() { 1.0 / of.modulus_margin } else { f64::INFINITY };
        let worst = &mut self.worst;
        worst.stable &= of.is_stable();
        worst.phase_deg = worst.phase_deg.min(of.phase_deg);
        worst.gain = worst.gain.min(of.gain);
        if peak > worst.sensitivity_peak {
            worst.sensitivity_peak = peak;
            (worst.payload_kg, worst.stroke_mm) = (payload, position * 1e3);
            self.at_hz = of.at_hz;
        }
        Ok(peak)
    }

    /// At places from the lowest to the highest, and between them where the sensitivity is large and changes.
    fn along(
        &mut self,
        [low, high]: [f64; 2],
        count: u32,
        place: impl Fn(f64) -> (f64, f64),
    ) -> Result<(), DesignError> {
        let mut points = vec![(low, self.at(place(low))?)];
        if high <= low {
            return Ok(());
        }
        let step = LEAST_STEP * (high - low);
        let all = (1..count).map(|k| low + (high - low) * f64::from(k) / f64::from(count - 1));
        for to in all {
            // what is to be reached, nearest last
            let mut ahead = vec![(to, self.at(place(to))?)];
            while let (Some(last), Some(next)) = (points.last().copied(), ahead.pop()) {
                let (least, most) = (last.1.min(next.1), last.1.max(next.1));
                let changes = most > (1.0 + CHANGE) * least;
                let is_close = most > CLOSE * self.worst.sensitivity_peak;
                if changes && is_close && next.0 - last.0 > step {
                    let middle = 0.5 * (last.0 + next.0);
                    ahead.push(next);
                    ahead.push((middle, self.at(place(middle))?));
                } else {
                    points.push(next);
                }
            }
        }
        for three in points.windows(3) {
            let [before, middle, after] = [0, 1, 2].map(|k| three[k]);
            let is_largest = middle.1 >= before.1.max(after.1);
            if is_largest && middle.1 > CLOSE * self.worst.sensitivity_peak {
                minimum(
                    |at| Ok::<_, DesignError>(-self.at(place(at))?),
                    [before.0, after.0],
                    step,
                )?;
            }
        }
        Ok(())
    }
}
