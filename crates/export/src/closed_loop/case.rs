//! What is tried with an exported controller.

use hydroboom_control::supervision::frame::FrameInput;
use hydroboom_description::Description;

/// How an input is wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bad {
    /// It is not a number.
    NotANumber,
    /// It is infinite.
    Infinite,
    /// It is a thousand times too large.
    Thousandfold,
    /// It stays as it was.
    Frozen,
}

impl Bad {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::NotANumber, Self::Infinite, Self::Thousandfold, Self::Frozen];

    /// Name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::NotANumber => "NaN",
            Self::Infinite => "infinite",
            Self::Thousandfold => "1000 times",
            Self::Frozen => "frozen",
        }
    }

    /// The value in the place of one, with the one as it was before all went wrong.
    pub(super) fn of(self, value: f64, before: f64) -> f64 {
        match self {
            Self::NotANumber => f64::NAN,
            Self::Infinite => f64::INFINITY,
            Self::Thousandfold => 1e3 * value,
            Self::Frozen => before,
        }
    }
}

/// When it is wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Moment {
    /// The released load rests.
    Rest,
    /// The piston moves at the fast speed.
    Motion,
}

/// An input that is wrong for a while.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Disturbed {
    /// Place of the input in [`FrameInput`].
    pub input: usize,
    /// How.
    pub bad: Bad,
    /// For how many periods.
    pub periods: u32,
    /// When.
    pub moment: Moment,
}

/// One trial: a machine, where it is engaged, how long it is held before, and what goes wrong.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// Payload of the machine \[kg\].
    pub payload: f64,
    /// Piston position at which it is engaged \[m\].
    pub stroke: f64,
    /// Time for which the load is held before the release \[s\].
    pub held: f64,
    /// Time for which the controller holds it then before the course \[s\].
    pub rest: f64,
    /// Whether a move at the fast speed follows.
    pub moves: bool,
    /// What goes wrong, if anything.
    pub disturbed: Option<Disturbed>,
    /// A factor on the proportional gain from a moment on, if it is changed while the controller runs.
    pub gain: Option<(f64, Moment)>,
}

impl Case {
    /// What is tried, in words.
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

/// Rest before the course \[s\].
const REST: f64 = 1.0;
/// Payloads that are engaged \[kg\].
const PAYLOADS: [f64; 4] = [0.0, 200.0, 318.0, 450.0];
/// Payloads that are moved \[kg\], and where from \[m\].
const MOVED: [f64; 5] = [0.0, 60.0, 200.0, 318.0, 450.0];
const FROM: [f64; 3] = [0.06, 0.2, 0.35];
/// Times for which a load is held \[s\].
const HELD: [f64; 3] = [1.0, 10.0, 60.0];
/// Factors on the proportional gain.
const GAINS: [f64; 3] = [0.5, 1.5, f64::NAN];
/// Periods for which an input is wrong.
const PERIODS: [u32; 3] = [1, 10, 1000];

/// All trials for a crane: engaged at both ends, 60, 200 and 350 mm with every payload, held for 1, 10 and
/// 60 s, gains changed, and every input wrong in every way at rest and in motion.
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

/// Moves at the fast speed with every payload from 60, 200 and 350 mm, undisturbed: what is compared between controllers.
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
