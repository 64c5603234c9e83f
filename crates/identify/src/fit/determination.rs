//! Whether logs determine a key: by a stated rule.
//!
//! A key is determined where all of this holds, looked at in this order; the first that does not is the reason:
//!
//! 1. the search converged: where it ended by a limit of its rounds, nothing is said of the key;
//! 2. it is not biased: no lack of fit, or no structural limit that is known of the key;
//! 3. it is not at the end of what a crane file allows, and no channel's delay or offset is at the end of what is allowed of it: what the sum would gain beyond
//!    is in the other keys;
//! 4. the tuned model is right for position and pressures of every log, by the [limits](crate::LIMITS) of the verdict;
//! 5. the logs alone say more of it than was known: provenance, and range where there is one;
//! 6. its 95 % interval reaches no further than from 3/4 to 4/3 of its value.
//!
//! Frequency and damping do not count: they are of the boom's ringing, and the keys that move those have a structural limit each.

use super::nuisance::Nuisance;
use super::{Channel, Tuned};
use crate::differences::differences;
use crate::experiment::Experiment;
use crate::prediction::Prediction;
use crate::verdict::{Aspect, Judgement, verdict};

/// Whether logs determine a key, and why not.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Determination {
    /// They do.
    Determined,
    /// The search ended before its optimum.
    NotConverged,
    /// The logs show that the model is not the true one, and what it leaves out, which is said here, is found in the key.
    Biased(&'static str),
    /// It ended at a value that a crane file does not allow to pass.
    AtLimit,
    /// A channel's delay or offset ended where it may not pass.
    ChannelAtLimit(Nuisance),
    /// The tuned model is not right for a log.
    ModelNotRight(Aspect),
    /// The logs alone say no more of it than was known.
    NotMoreThanKnown,
    /// Its 95 % interval is wide beside its value.
    WideInterval,
}

impl Determination {
    /// Why the key is not determined, as the end of a sentence; none where it is.
    pub fn reason(self) -> Option<String> {
        Some(match self {
            Self::Determined => return None,
            Self::NotConverged => {
                "the search has not converged: tune again from the file that is written".into()
            }
            Self::Biased(reason) => reason.into(),
            Self::AtLimit => "it ends at a limit of what a crane file allows".into(),
            Self::ChannelAtLimit(nuisance) => {
                format!("{} ends at its limit", nuisance.path())
            }
            Self::ModelNotRight(aspect) => {
                format!("the tuned model is not right for {}", name(aspect))
            }
            Self::NotMoreThanKnown => "the logs say no more of it than was known".into(),
            Self::WideInterval => format!(
                "its 95 % interval reaches beyond {:.2} to {:.2} of its value",
                1.0 / WIDEST,
                WIDEST
            ),
        })
    }
}

/// Name of an aspect.
fn name(aspect: Aspect) -> &'static str {
    match aspect {
        Aspect::Position => "the position",
        Aspect::Pressures => "the pressures",
        Aspect::Frequency => "the frequency",
        Aspect::Damping => "the damping",
    }
}

/// An interval reaches no further than this ratio of its key's value either way. Ours: a load that is known to a third.
const WIDEST: f64 = 4.0 / 3.0;
/// A number is at its limit within this share of what it may be.
const AT_LIMIT: f64 = 1e-3;

/// Whether a value is at an end of a range, or beyond.
pub(super) fn is_at_limit(value: f64, [low, high]: [f64; 2]) -> bool {
    let near = AT_LIMIT * (high - low);
    value <= low + near || value >= high - near
}

/// What all keys of a search have in common.
pub(super) struct Common {
    /// Whether the search converged.
    has_converged: bool,
    /// An aspect in which the tuned model is not right.
    wrong: Option<Aspect>,
    /// A delay or offset at its limit.
    at_limit: Option<Nuisance>,
}

impl Common {
    /// Of what the tuned model shows, and the channels.
    pub(super) fn new(
        experiments: &[Experiment],
        after: &[Prediction],
        channels: &[Channel],
        has_converged: bool,
    ) -> Self {
        let judged = experiments.iter().zip(after).flat_map(|(e, p)| verdict(&differences(e, p)));
        let counts = |j: &Judgement| {
            matches!(j.aspect, Aspect::Position | Aspect::Pressures) && !j.is_right()
        };
        Self {
            has_converged,
            wrong: { judged }.find(counts).map(|j| j.aspect),
            at_limit: channels.iter().find(|c| c.is_at_limit()).map(|c| c.nuisance),
        }
    }

    /// Of one key, its structural limit being where lack of fit makes it count.
    pub(super) fn of(&self, t: &Tuned, biased: Option<&'static str>) -> Determination {
        let (low, high) = t.key.bounds();
        // bounds span decades: near is meant of the value
        let is_at_end = t.value.1 <= low * (1.0 + AT_LIMIT) || t.value.1 >= high * (1.0 - AT_LIMIT);
        let (from, to) = t.interval();
        if !self.has_converged {
            Determination::NotConverged
        } else if let Some(reason) = biased {
            Determination::Biased(reason)
        } else if is_at_end {
            Determination::AtLimit
        } else if let Some(nuisance) = self.at_limit {
            Determination::ChannelAtLimit(nuisance)
        } else if let Some(aspect) = self.wrong {
            Determination::ModelNotRight(aspect)
        } else if t.from_logs >= t.prior {
            Determination::NotMoreThanKnown
        } else if to / from > WIDEST * WIDEST {
            Determination::WideInterval
        } else {
            Determination::Determined
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::free::Free;
    use hydroboom_measurement::Signal;

    /// A payload of 300 kg that was known to a third, with a deviation of ln θ.
    fn payload(deviation: f64) -> Tuned {
        let key = Free { place: 0 };
        let place = hydroboom_description::schema::KEYS.iter();
        let place = place.enumerate().find(|(_, key)| key.path() == "payload.mass_kg");
        Tuned {
            key: place.map_or(key, |(place, _)| Free { place }),
            value: (300.0, 300.0),
            prior: 0.35,
            deviation,
            from_logs: deviation,
            others_exact: deviation,
            determination: Determination::Determined,
            partner: None,
        }
    }

    const NOTHING: Common = Common { has_converged: true, wrong: None, at_limit: None };

    #[test]
    fn a_key_is_determined_where_the_interval_is_narrow_and_the_model_right() {
        assert_eq!(NOTHING.of(&payload(0.05), None), Determination::Determined);
        // 182 to 497 kg: more than was known, and no finding
        let wide = payload((497.0_f64 / 182.0).ln() / 2.0 / 1.96);
        assert!(wide.from_logs < wide.prior);
        assert_eq!(NOTHING.of(&wide, None), Determination::WideInterval);
        assert_eq!(NOTHING.of(&payload(0.4), None), Determination::NotMoreThanKnown);
        let wrong = Common { wrong: Some(Aspect::Pressures), ..NOTHING };
        let found = wrong.of(&payload(0.05), None);
        assert_eq!(found, Determination::ModelNotRight(Aspect::Pressures));
        assert!(found.reason().unwrap().contains("pressures"));
        let biased = wrong.of(&payload(0.05), Some("play"));
        assert_eq!(biased, Determination::Biased("play"));
        // where the search ended early, nothing is said of the key
        let early = Common { has_converged: false, ..wrong };
        assert_eq!(early.of(&payload(0.05), Some("play")), Determination::NotConverged);
        assert_eq!(early.of(&payload(0.05), None), Determination::NotConverged);
        let mut at_end = payload(0.05);
        at_end.value.1 = at_end.key.bounds().1;
        assert_eq!(NOTHING.of(&at_end, None), Determination::AtLimit);
    }

    #[test]
    fn a_channel_at_its_limit_is_seen_and_no_key_is_determined_beside_it() {
        let nuisance = Nuisance::named("pressure_a.offset").unwrap()[0];
        let channel = |value: f64| Channel {
            log: "log".into(),
            nuisance,
            value,
            deviation: 0.1,
            partner: None,
        };
        assert_eq!(nuisance.signal, Signal::PressureA);
        assert!(channel(5.0).is_at_limit() && channel(-5.0).is_at_limit());
        assert!(!channel(4.5).is_at_limit() && !channel(0.0).is_at_limit());
        let found = Common::new(&[], &[], &[channel(0.3), channel(-5.0)], true);
        assert_eq!(found.of(&payload(0.05), None), Determination::ChannelAtLimit(nuisance));
    }
}
