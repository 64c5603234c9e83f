//! Messages that viewers may send.

use crate::choice::{Choice, shortened};
use hydroboom_control::strategy::Strategy;
use hydroboom_realtime::desk::Generation;
use hydroboom_realtime::fault::Fault;
use serde::Deserialize;
use std::time::Instant;

/// Request of a viewer to the session. Requests to the control task (stop, reset, strategy) go to the `Desk` instead.
#[derive(Clone, Debug, PartialEq)]
pub enum Demand {
    /// Run a course.
    Start {
        /// Strategy and course.
        choice: Choice,
        /// Generation of the operator's role in which the request was made; an older one is refused.
        generation: Generation,
        /// Time of the request.
        asked: Instant,
    },
    /// Inject this fault into the virtual crane.
    Fault(Fault),
    /// Remove all injected faults.
    Mend,
}

/// A message from a viewer, as JSON with the tag `command`.
#[derive(Debug, Deserialize)]
#[serde(tag = "command", rename_all = "kebab-case", deny_unknown_fields)]
pub(crate) enum Message {
    /// Sign of life of the operator's page.
    Alive,
    /// Take the operator's role.
    TakeRole { token: String },
    /// Give the operator's role back.
    LeaveRole { token: String },
    /// Start a course; without speed and scenario, the course selected last.
    Start {
        token: String,
        #[serde(default)]
        speed_mm_s: Option<f64>,
        #[serde(default)]
        scenario: Option<String>,
        strategy: String,
    },
    /// Select the course that the next start runs.
    Course {
        token: String,
        #[serde(default)]
        speed_mm_s: Option<f64>,
        #[serde(default)]
        scenario: Option<String>,
    },
    /// Select the strategy; allowed during motion.
    Strategy { token: String, strategy: String },
    /// Decelerate to standstill.
    Stop { token: String },
    /// Stop at once. Allowed for every viewer that sends the token, operator or not.
    EmergencyStop { token: String },
    /// Reset a fault, so that a course can be started again.
    Reset { token: String },
    /// Inject a fault, by its name.
    Fault { token: String, fault: String },
    /// Remove all injected faults.
    Mend { token: String },
}

/// Longest accepted message \[bytes\].
pub(crate) const LONGEST: usize = 2048;

impl Message {
    /// Parses a message.
    pub(crate) fn parse(text: &str) -> Result<Self, String> {
        serde_json::from_str(text).map_err(|error| format!("not understood: {error}"))
    }

    /// The token sent with the message; `None` for messages that need none.
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
    fn only_known_messages_are_parsed() {
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
