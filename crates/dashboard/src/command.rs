//! What viewers may send.

use crate::choice::{Choice, shortened};
use hydroboom_control::strategy::Strategy;
use hydroboom_realtime::desk::Generation;
use hydroboom_realtime::fault::Fault;
use serde::Deserialize;
use std::time::Instant;

/// What is asked of the session, not of the desk.
#[derive(Clone, Debug, PartialEq)]
pub enum Demand {
    /// Run a course.
    Start {
        /// Which, and how.
        choice: Choice,
        /// The generation of the operator who asked.
        generation: Generation,
        /// When it was asked for.
        asked: Instant,
    },
    /// Let this go wrong.
    Fault(Fault),
    /// Mend what is broken.
    Mend,
}

/// A viewer's message.
#[derive(Debug, Deserialize)]
#[serde(tag = "command", rename_all = "kebab-case", deny_unknown_fields)]
pub(crate) enum Message {
    /// The operator's page is there.
    Alive,
    /// To operate.
    TakeRole { token: String },
    /// To operate no more.
    LeaveRole { token: String },
    /// To move: along the course chosen last where none is named.
    Start {
        token: String,
        #[serde(default)]
        speed_mm_s: Option<f64>,
        #[serde(default)]
        scenario: Option<String>,
        strategy: String,
    },
    /// To choose the course that a start shall run.
    Course {
        token: String,
        #[serde(default)]
        speed_mm_s: Option<f64>,
        #[serde(default)]
        scenario: Option<String>,
    },
    /// To change the strategy, also on the way.
    Strategy { token: String, strategy: String },
    /// To come to rest.
    Stop { token: String },
    /// To stand still at once: everybody who has the token may.
    EmergencyStop { token: String },
    /// To go on after a fault.
    Reset { token: String },
    /// To let something go wrong.
    Fault { token: String, fault: String },
    /// To mend it.
    Mend { token: String },
}

/// Longest message that is read \[bytes\].
pub(crate) const LONGEST: usize = 2048;

impl Message {
    /// A message from its text.
    pub(crate) fn parse(text: &str) -> Result<Self, String> {
        serde_json::from_str(text).map_err(|error| format!("not understood: {error}"))
    }

    /// The token that came with it; none for what needs none.
    pub(crate) fn token(&self) -> Option<&str> {
        match self {
            Self::Alive => None,
            Self::TakeRole { token }
            | Self::LeaveRole { token }
            | Self::Start { token, .. }
            | Self::Course { token, .. }
            | Self::Strategy { token, .. }
            | Self::Stop { token }
            | Self::EmergencyStop { token }
            | Self::Reset { token }
            | Self::Fault { token, .. }
            | Self::Mend { token } => Some(token),
        }
    }
}

/// A strategy by its name.
pub(crate) fn strategy(name: &str) -> Result<Strategy, String> {
    name.parse::<Strategy>().map_err(|why| format!("\"{}\": {why}", shortened(name)))
}

/// A fault of the machine by its name.
pub(crate) fn fault(name: &str) -> Result<Fault, String> {
    let mut all = Fault::of_machine().into_iter();
    all.find(|f| f.name() == name).ok_or_else(|| format!("no fault \"{}\"", shortened(name)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_is_known_is_understood() {
        let start =
            r#"{"command":"start","token":"t","speed_mm_s":25,"strategy":"benchmark-closed-loop"}"#;
        assert!(matches!(Message::parse(start), Ok(Message::Start { speed_mm_s: Some(_), .. })));
        for text in [
            "",
            "null",
            "[]",
            "{}",
            r#"{"command":"fire"}"#,
            r#"{"command":"stop"}"#,
            r#"{"command":"stop","token":"t","also":1}"#,
            r#"{"command":"start","token":"t","speed_mm_s":"fast","strategy":"x"}"#,
        ] {
            assert!(Message::parse(text).is_err(), "{text}");
        }
        assert!(strategy("drop tables").is_err() && fault("nothing").is_err());
        assert!(fault("drive dead").is_ok());
    }
}
