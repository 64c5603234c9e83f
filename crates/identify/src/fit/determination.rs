//! Practical identifiability: rule for whether logs determine a key.
//!
//! A key is determined if all of these conditions hold. The first one that fails is the reason why it is not:
//!
//! 1. The iteration has converged.
//! 2. The key is not biased: there is no lack of fit, or no structural limit of the key is known.
//! 3. Neither the key nor the delay or offset of any channel is at a bound. Otherwise its excess biases the
//!    other keys.
//! 4. The fitted model is within the [limits](crate::LIMITS) of the verdict for position and pressures of
//!    every log.
//! 5. The standard deviation from the logs alone is below the prior one of provenance and range.
//! 6. The 95 % interval is within 3/4 to 4/3 of the value.
//!
//! Frequency and damping of the boom's oscillation do not count, because the keys that change them all have a
//! structural limit.

use super::nuisance::Nuisance;
use super::{Channel, Tuned};
use crate::differences::differences;
use crate::experiment::Experiment;
use crate::prediction::Prediction;
use crate::verdict::{Aspect, Judgement, verdict};

/// Result of the test whether the logs determine a key: passed, or the condition that failed first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Determination {
    /// All conditions hold.
    Determined,
    /// The iteration ended before the minimum.
    NotConverged,
    /// The logs show a lack of fit, and the given omitted effect biases the key.
    Biased(&'static str),
    /// The estimate is at a bound of the crane file.
    AtLimit,
    /// The delay or offset of a channel is at a bound of its range.
    ChannelAtLimit(Nuisance),
    /// The fitted model exceeds the limit of an aspect of a log.
    ModelNotRight(Aspect),
    /// The standard deviation from the logs alone is not below the prior one.
    NotMoreThanKnown,
    /// The 95 % interval is too wide relative to the value.
    WideInterval,
}

impl Determination {
    /// Reason why the key is not determined, as the end of a sentence; none if it is.
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
            Self::NotMoreThanKnown => "the logs add nothing to its prior".into(),
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

/// Largest ratio of an end of the 95 % interval to the value, or of the value to that end \[-\]. Ours: a
/// payload known to a third.
const WIDEST: f64 = 4.0 / 3.0;
/// Distance from a bound at which a value counts as being at it, as a share of its range \[-\].
const AT_LIMIT: f64 = 1e-3;

/// Whether a value is at a bound of its range, or beyond.
pub(super) fn is_at_limit(value: f64, [low, high]: [f64; 2]) -> bool {
    let near = AT_LIMIT * (high - low);
    value <= low + near || value >= high - near
}

/// Conditions that apply to all keys of a fit.
pub(super) struct FitConditions {
    /// Whether the iteration has converged.
    has_converged: bool,
    /// Aspect in which the fitted model exceeds its limit.
    exceeded: Option<Aspect>,
    /// Delay or offset at a bound.
    at_limit: Option<Nuisance>,
}

impl FitConditions {
    /// Conditions from the prediction of the fitted model and the estimates of the channels.
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
            exceeded: { judged }.find(counts).map(|j| j.aspect),
            at_limit: channels.iter().find(|c| c.is_at_limit()).map(|c| c.nuisance),
        }
    }

    /// Determination of one key; `biased` is its structural limit if there is a lack of fit.
    pub(super) fn of(&self, t: &Tuned, biased: Option<&'static str>) -> Determination {
        let (low, high) = t.key.bounds();
        // bounds span decades: the distance is relative to the value
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
        } else if let Some(aspect) = self.exceeded {
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

    /// Payload of 300 kg with a prior standard deviation of a third, and a posterior one of ln θ.
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

    const NOTHING: FitConditions =
        FitConditions { has_converged: true, exceeded: None, at_limit: None };

    #[test]
    fn a_key_is_determined_where_the_interval_is_narrow_and_the_model_right() {
        assert_eq!(NOTHING.of(&payload(0.05), None), Determination::Determined);
        // 182 to 497 kg: better than the prior, and still not determined
        let wide = payload((497.0_f64 / 182.0).ln() / 2.0 / 1.96);
        assert!(wide.from_logs < wide.prior);
        assert_eq!(NOTHING.of(&wide, None), Determination::WideInterval);
        assert_eq!(NOTHING.of(&payload(0.4), None), Determination::NotMoreThanKnown);
        let exceeded = FitConditions { exceeded: Some(Aspect::Pressures), ..NOTHING };
        let found = exceeded.of(&payload(0.05), None);
        assert_eq!(found, Determination::ModelNotRight(Aspect::Pressures));
        assert!(found.reason().unwrap().contains("pressures"));
        let biased = exceeded.of(&payload(0.05), Some("play"));
        assert_eq!(biased, Determination::Biased("play"));
        // without convergence no other reason is given
        let early = FitConditions { has_converged: false, ..exceeded };
        assert_eq!(early.of(&payload(0.05), Some("play")), Determination::NotConverged);
        assert_eq!(early.of(&payload(0.05), None), Determination::NotConverged);
        let mut at_end = payload(0.05);
        at_end.value.1 = at_end.key.bounds().1;
        assert_eq!(NOTHING.of(&at_end, None), Determination::AtLimit);
    }

    #[test]
    fn with_a_channel_at_its_bound_no_key_is_determined() {
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
        let found = FitConditions::new(&[], &[], &[channel(0.3), channel(-5.0)], true);
        assert_eq!(found.of(&payload(0.05), None), Determination::ChannelAtLimit(nuisance));
    }
}
