//! How many may come, and how long they may take.

use std::time::Duration;

/// Bounds on connections and viewers. File descriptors are bounded by `connections` + `viewers`, far below the
/// 1024 that a process has by default.
#[derive(Clone, Debug)]
pub(crate) struct Limits {
    /// Connections that are open at once and are no viewers' yet; the oldest makes room for a new one.
    pub(crate) connections: usize,
    /// A request's header is there within this time of connecting.
    pub(crate) header: Duration,
    /// And its answer has been taken within this one.
    pub(crate) exchange: Duration,
    /// Longest header \[bytes\].
    pub(crate) header_bytes: usize,
    /// Viewers at once.
    pub(crate) viewers: usize,
    /// Of these so many at least have presented the token.
    pub(crate) with_token: usize,
    /// Time from ping to ping.
    pub(crate) ping: Duration,
    /// A viewer of which nothing is heard for so long, not even the answer to a ping, is gone.
    pub(crate) silence: Duration,
    /// A viewer that takes longer for one message is gone.
    pub(crate) sending: Duration,
    /// Messages of one viewer in a second.
    pub(crate) messages: u32,
    /// Answers that wait for one viewer to take them.
    pub(crate) answers: usize,
    /// Wrong tokens of one viewer.
    pub(crate) wrong_tokens: u32,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            connections: 128,
            header: Duration::from_secs(5),
            // a long report over a slow network
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
