//! Test cases for exported controllers in closed loop.

use hydroboom_control::supervision::frame::FrameInput;
use hydroboom_description::Description;
use hydroboom_design::benchmark_design::payload_range;

/// Kind of error of an input signal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bad {
    /// NaN.
    NotANumber,
    /// Infinity.
    Infinite,
    /// The true value times 1000.
    Thousandfold,
    /// Constant at the value before the error.
    Frozen,
}

impl Bad {
    /// All kinds of input error.
    pub const ALL: [Self; 4] = [Self::NotANumber, Self::Infinite, Self::Thousandfold, Self::Frozen];

    /// Name in tables, as `NaN` or `frozen`.
    pub fn name(self) -> &'static str {
        match self {
            Self::NotANumber => "NaN",
            Self::Infinite => "infinite",
            Self::Thousandfold => "1000 times",
            Self::Frozen => "frozen",
        }
    }

    /// The erroneous value in place of `value`, where `before` is the value before the error began.
    pub(super) fn of(self, value: f64, before: f64) -> f64 {
        match self {
            Self::NotANumber => f64::NAN,
            Self::Infinite => f64::INFINITY,
            Self::Thousandfold => 1e3 * value,
            Self::Frozen => before,
        }
    }
}

/// Phase of a trial in which a disturbance begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Moment {
    /// At standstill after the release.
    Rest,
    /// During motion at the fast speed.
    Motion,
}

/// Temporary error of one input signal of the controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Disturbed {
    /// Index of the disturbed input among the [`FrameInput`].
    pub input: usize,
    /// Kind of input error.
    pub bad: Bad,
    /// Duration of the error \[control periods\].
    pub periods: u32,
    /// Phase of the trial in which the error begins.
    pub moment: Moment,
}

/// Test case of a trial: payload, initial position, hold time, motion and disturbance.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// Payload of the machine \[kg\].
    pub payload: f64,
    /// Initial piston position \[m\].
    pub stroke: f64,
    /// Time for which the load is held before the release \[s\].
    pub held: f64,
    /// Time at standstill between release and course \[s\].
    pub rest: f64,
    /// Whether an out-and-back motion at the fast speed follows the release.
    pub moves: bool,
    /// Input error; none for an undisturbed trial.
    pub disturbed: Option<Disturbed>,
    /// Factor on the proportional gain \[-\] and the phase in which it takes effect; none for a constant gain.
    pub gain: Option<(f64, Moment)>,
}

impl Case {
    /// Description of the case as text, as `318 kg at 200 mm, held for 10 s`.
    pub fn name(&self) -> String {
        let Self { payload, stroke, held, .. } = self;
        let moment = |moment: Moment| match moment {
            Moment::Rest => "at rest",
            Moment::Motion => "in motion",
        };
        match (self.disturbed, self.gain) {
            (Some(d), _) => {
                let name = FrameInput::NAMES[d.input.min(FrameInput::NAMES.len() - 1)];
                format!("{name} {} for {} periods {}", d.bad.name(), d.periods, moment(d.moment))
            }
            (None, Some((factor, when))) => format!("K_p times {factor} {}", moment(when)),
            (None, None) if self.moves => {
                format!("{payload:.0} kg moved from {:.0} mm at the fast speed", stroke * 1e3)
            }
            (None, None) => {
                format!("{payload:.0} kg at {:.0} mm, held for {held:.0} s", stroke * 1e3)
            }
        }
    }
}

/// Time at standstill before the course \[s\].
const REST: f64 = 1.0;
/// Payloads of the engagement cases \[kg\] for the payload range of the paper's crane: from the empty hook to an
/// overload.
const PAYLOADS: [f64; 4] = [0.0, 200.0, 318.0, 450.0];
/// Payloads of the motion cases \[kg\] for that range, combined with several initial positions.
const MOVED: [f64; 5] = [0.0, 60.0, 200.0, 318.0, 450.0];
/// Payloads of another crane beside its nominal one, as shares of its payload range \[-\]: of the engagement cases and
/// of the motion cases.
const PAYLOAD_SHARES: [f64; 3] = [0.0, 0.5, 1.0];
const MOVED_SHARES: [f64; 4] = [0.0, 0.15, 0.5, 1.0];
/// Initial piston positions as shares of the stroke \[-\]: 60, 200 and 350 mm of the paper's crane.
const FROM: [f64; 3] = [0.12, 0.4, 0.7];
/// Travel of the course as a share of the stroke \[-\], which leads no position above beyond an end: 150 mm of the
/// paper's crane.
pub(super) const TRAVEL: f64 = 0.3;
/// Hold times before the release \[s\].
const HELD: [f64; 3] = [1.0, 10.0, 60.0];
/// Factors on the proportional gain.
const GAINS: [f64; 3] = [0.5, 1.5, f64::NAN];
/// Durations of input errors \[control periods\].
const PERIODS: [u32; 3] = [1, 10, 1000];

/// Payloads of test cases \[kg\], lightest first: those of the paper's crane for its payload range, else the nominal
/// one and shares of the crane file's range.
fn payloads(model: &Description, of_paper: &[f64], shares: &[f64]) -> Vec<f64> {
    let [low, high] = payload_range(model);
    let is_papers = |paper: &Description| payload_range(paper) == [low, high];
    if Description::uia_single_boom().is_ok_and(|paper| is_papers(&paper)) {
        return of_paper.to_vec();
    }
    let of_range = shares.iter().map(|share| low + share * (high - low));
    let mut all: Vec<f64> = of_range.chain([model.numbers.payload]).collect();
    all.sort_by(f64::total_cmp);
    all.dedup();
    all
}

/// All test cases for a crane: engagement at both ends of the stroke and at three positions between, with payloads from
/// the least to the largest; holds of 1, 10 and 60 s; changed gains; every kind of error in every input, at standstill
/// and in motion.
pub fn cases(model: &Description) -> Vec<Case> {
    let n = &model.numbers;
    let [_, middle, _] = FROM.map(|share| share * n.stroke);
    let mut cases = Vec::new();
    let case = |payload, stroke, held| Case {
        payload,
        stroke,
        held,
        rest: REST,
        moves: false,
        disturbed: None,
        gain: None,
    };
    let payloads = payloads(model, &PAYLOADS, &PAYLOAD_SHARES);
    for share in [0.0].into_iter().chain(FROM).chain([1.0]) {
        let stroke = share * n.stroke;
        cases.extend(payloads.iter().map(|payload| case(*payload, stroke, HELD[0])));
    }
    cases.extend(HELD[1..].iter().map(|held| case(n.payload, middle, *held)));
    let undisturbed = Case { moves: true, ..case(n.payload, middle, HELD[0]) };
    cases.push(undisturbed.clone());
    for factor in GAINS {
        for moment in [Moment::Rest, Moment::Motion] {
            cases.push(Case { gain: Some((factor, moment)), ..undisturbed.clone() });
        }
    }
    for input in 0..FrameInput::NAMES.len() {
        for bad in Bad::ALL {
            for periods in PERIODS {
                for moment in [Moment::Rest, Moment::Motion] {
                    let disturbed = Some(Disturbed { input, bad, periods, moment });
                    cases.push(Case { disturbed, ..undisturbed.clone() });
                }
            }
        }
    }
    cases
}

/// Undisturbed motions at the fast speed with payloads from the least to the largest, from three positions, for
/// comparing controllers.
pub fn moves(model: &Description) -> Vec<Case> {
    let moved = |payload: f64, stroke: f64| Case {
        payload,
        stroke,
        held: HELD[0],
        rest: REST,
        moves: true,
        disturbed: None,
        gain: None,
    };
    let payloads = payloads(model, &MOVED, &MOVED_SHARES);
    let from = FROM.map(|share| share * model.numbers.stroke);
    let along = |stroke: f64| payloads.iter().map(move |payload| moved(*payload, stroke));
    from.into_iter().flat_map(along).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use hydroboom_description::UIA_SINGLE_BOOM;

    /// Payloads \[kg\] and initial positions \[mm\] of the motions, in their order.
    fn moved(model: &Description) -> Vec<(f64, f64)> {
        moves(model).iter().map(|case| (case.payload, (case.stroke * 1e6).round() * 1e-3)).collect()
    }

    #[test]
    fn cases_of_the_papers_crane_are_those_of_its_tests() {
        let paper = Description::uia_single_boom().unwrap();
        let each = |from: f64| [0.0, 60.0, 200.0, 318.0, 450.0].map(|payload| (payload, from));
        assert_eq!(moved(&paper), [60.0, 200.0, 350.0].map(each).concat());
        let engaged = cases(&paper);
        let name = |at: usize| engaged[at].name();
        assert_eq!(name(0), "0 kg at 0 mm, held for 1 s");
        assert_eq!(name(6), "318 kg at 60 mm, held for 1 s");
        assert_eq!(name(19), "450 kg at 500 mm, held for 1 s");
        assert_eq!(name(20), "307 kg at 200 mm, held for 10 s");
        assert_eq!(name(22), "307 kg moved from 200 mm at the fast speed");
        // positions by their shares are those in millimetres to the last digit
        assert!(engaged.iter().all(|case| [0.0, 0.06, 0.2, 0.35, 0.5].contains(&case.stroke)));
    }

    #[test]
    fn cases_of_another_crane_are_of_its_payload_range_and_stroke() {
        let text = UIA_SINGLE_BOOM.replacen("range = [0.0, 370.0]", "range = [50.0, 450.0]", 1);
        let mut crane = Description::parse("crane.toml", &text).unwrap();
        crane.set("cylinder.stroke_mm=600").unwrap();
        let each = |from: f64| [50.0, 110.0, 250.0, 307.0, 450.0].map(|payload| (payload, from));
        assert_eq!(moved(&crane), [72.0, 240.0, 420.0].map(each).concat());
        assert_eq!(cases(&crane)[0].name(), "50 kg at 0 mm, held for 1 s");
        // a nominal payload at an end of the range is no case of its own
        crane.set("payload.mass_kg=50").unwrap();
        assert_eq!(moved(&crane).len(), 3 * MOVED_SHARES.len());
    }
}
