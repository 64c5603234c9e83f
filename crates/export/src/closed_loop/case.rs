//! Test cases for exported controllers in closed loop.

use hydroboom_control::supervision::frame::FrameInput;
use hydroboom_description::Description;

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
/// Payloads of the engagement cases \[kg\].
const PAYLOADS: [f64; 4] = [0.0, 200.0, 318.0, 450.0];
/// Payloads of the motion cases \[kg\], combined with several initial positions.
const MOVED: [f64; 5] = [0.0, 60.0, 200.0, 318.0, 450.0];
const FROM: [f64; 3] = [0.06, 0.2, 0.35];
/// Hold times before the release \[s\].
const HELD: [f64; 3] = [1.0, 10.0, 60.0];
/// Factors on the proportional gain.
const GAINS: [f64; 3] = [0.5, 1.5, f64::NAN];
/// Durations of input errors \[control periods\].
const PERIODS: [u32; 3] = [1, 10, 1000];

/// All test cases for a crane: engagement at both ends of the stroke and at 60, 200 and 350 mm with payloads of 0 to
/// 450 kg; holds of 1, 10 and 60 s; changed gains; every kind of error in every input, at standstill and in motion.
pub fn cases(model: &Description) -> Vec<Case> {
    let n = &model.numbers;
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
    for stroke in [0.0, 0.06, 0.2, 0.35, n.stroke] {
        cases.extend(PAYLOADS.map(|payload| case(payload, stroke, HELD[0])));
    }
    cases.extend(HELD[1..].iter().map(|held| case(n.payload, 0.2, *held)));
    let undisturbed = Case { moves: true, ..case(n.payload, 0.2, HELD[0]) };
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

/// Undisturbed motions at the fast speed with payloads of 0 to 450 kg, from 60, 200 and 350 mm, for comparing
/// controllers.
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
    let all = FROM.iter().filter(|from| **from < model.numbers.stroke);
    all.flat_map(|stroke| MOVED.map(|payload| moved(payload, *stroke))).collect()
}
