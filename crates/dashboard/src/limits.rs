//! Bounds on the number of connections and viewers, and on their times.

use std::time::Duration;

/// Bounds on connections and viewers. `connections` + `viewers` bounds the file descriptors, far below the
/// usual limit of 1024 for a process.
#[derive(Clone, Debug)]
pub(crate) struct Limits {
    /// Largest number of open connections that are not yet viewers; a new one replaces the oldest.
    pub(crate) connections: usize,
    /// Time limit from connecting to the end of the request's header.
    pub(crate) header: Duration,
    /// Time limit from there to the end of the answer.
    pub(crate) exchange: Duration,
    /// Longest header \[bytes\].
    pub(crate) header_bytes: usize,
    /// Largest number of viewers.
    pub(crate) viewers: usize,
    /// Places among these that are reserved for viewers that have sent the token.
    pub(crate) with_token: usize,
    /// Interval between pings.
    pub(crate) ping: Duration,
    /// Longest silence of a viewer, including answers to pings, before its connection is closed.
    pub(crate) silence: Duration,
    /// Time limit for sending one message to a viewer.
    pub(crate) sending: Duration,
    /// Messages accepted from one viewer in a second.
    pub(crate) messages: u32,
    /// Answers queued for one viewer.
    pub(crate) answers: usize,
    /// Wrong tokens after which a viewer's connection is closed.
    pub(crate) wrong_tokens: u32,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            connections: 128,
            header: Duration::from_secs(5),
            // enough for a long report over a slow network
            exchange: Duration::from_secs(60),
            header_bytes: 16 * 1024,
            viewers: 32,
            with_token: 8,
            ping: Duration::from_secs(2),
            silence: Duration::from_secs(10),
            sending: Duration::from_secs(5),
            messages: 100,
            answers: 16,
            wrong_tokens: 5,
        }
    }
}
