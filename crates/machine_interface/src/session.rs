//! Session with a peer: acceptance of its datagrams by session, sequence number and check sum.

use crate::datagram::{Body, Dropped, Header, decode};
use std::time::Duration;

/// Watchdog time of a machine, 20 ms: without an accepted command for longer it stops its motor and shuts its
/// load-holding valve. Normative: `docs/reference/machine-interface.md`.
pub const WATCHDOG: Duration = Duration::from_millis(20);

/// Number of received datagrams, by whether and why they were dropped.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Accepted datagrams.
    pub accepted: u64,
    /// Datagrams with a wrong magic, version or length, or with undefined numbers.
    pub malformed: u64,
    /// Datagrams with a wrong check sum.
    pub check_sum: u64,
    /// Datagrams of another session.
    pub session: u64,
    /// Datagrams with an old or repeated sequence number.
    pub sequence: u64,
    /// Datagrams with a number that is not finite.
    pub not_finite: u64,
    /// Lost datagrams: sequence numbers skipped before an accepted one. One that arrives later counts as lost and as
    /// old.
    pub lost: u64,
}

impl Counters {
    /// Sum of all dropped datagrams; lost ones, which never arrived, are not among them.
    pub fn dropped(&self) -> u64 {
        self.malformed + self.check_sum + self.session + self.sequence + self.not_finite
    }
}

/// Session with a peer: accepts its datagrams in order, and numbers the own ones.
#[derive(Clone, Copy, Debug)]
pub struct Session {
    number: u64,
    sent: u64,
    received: u64,
    /// Counts of received datagrams.
    pub counters: Counters,
}

impl Session {
    /// Session with this number, before the first datagram.
    pub fn new(number: u64) -> Self {
        Self { number, sent: 0, received: 0, counters: Counters::default() }
    }

    /// Number of the session.
    pub fn number(&self) -> u64 {
        self.number
    }

    /// Header of the next datagram to be sent, at a time of the sender's clock \[ns\].
    pub fn next_header(&mut self, clock: u64) -> Header {
        self.sent += 1;
        Header { session: self.number, sequence: self.sent, received: self.received, clock }
    }

    /// Decodes and checks a received datagram; `None` if it is dropped, which is counted. A dropped one must not feed
    /// a watchdog.
    ///
    /// Accepted is a valid datagram of this session whose sequence number is above the last accepted one. A hello of
    /// the session is accepted with any number.
    pub fn accept(&mut self, bytes: &[u8]) -> Option<(Header, Body)> {
        let counters = &mut self.counters;
        let (header, body) = match decode(bytes) {
            Ok(read) => read,
            Err(reason) => {
                match reason {
                    Dropped::CheckSum => counters.check_sum += 1,
                    Dropped::NotFinite => counters.not_finite += 1,
                    _ => counters.malformed += 1,
                }
                return None;
            }
        };
        if header.session != self.number {
            counters.session += 1;
            return None;
        }
        // a hello is no part of the sequence: it begins it
        if !matches!(body, Body::Hello(_)) {
            if header.sequence <= self.received {
                counters.sequence += 1;
                return None;
            }
            counters.lost += header.sequence - self.received - 1;
            self.received = header.sequence;
        }
        counters.accepted += 1;
        Some((header, body))
    }
}
