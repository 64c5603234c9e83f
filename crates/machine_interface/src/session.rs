//! A session: which datagrams of the peer are accepted, and why others are dropped.

use crate::datagram::{Body, Dropped, Header, decode};
use std::time::Duration;

/// Time without an accepted command after which a machine stops its motor and shuts its load-holding valve by itself.
pub const WATCHDOG: Duration = Duration::from_millis(20);

/// Counts of datagrams by their fate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Accepted.
    pub accepted: u64,
    /// Of another interface or version, of a wrong length, or with undefined numbers.
    pub malformed: u64,
    /// With a wrong check sum.
    pub check_sum: u64,
    /// Of another session.
    pub session: u64,
    /// Old or repeated.
    pub sequence: u64,
    /// With a number that is not finite.
    pub not_finite: u64,
    /// Sequence numbers that never arrived: lost datagrams.
    pub lost: u64,
}

impl Counters {
    /// All that were dropped.
    pub fn dropped(&self) -> u64 {
        self.malformed + self.check_sum + self.session + self.sequence + self.not_finite
    }
}

/// Acceptance of datagrams within a session.
#[derive(Clone, Copy, Debug)]
pub struct Session {
    number: u64,
    sent: u64,
    received: u64,
    /// Counts of datagrams so far.
    pub counters: Counters,
}

impl Session {
    /// A session with a number, before its first datagram.
    pub fn new(number: u64) -> Self {
        Self { number, sent: 0, received: 0, counters: Counters::default() }
    }

    /// Its number.
    pub fn number(&self) -> u64 {
        self.number
    }

    /// Header of the next datagram, by the sender's clock \[ns\].
    pub fn next_header(&mut self, clock: u64) -> Header {
        self.sent += 1;
        Header { session: self.number, sequence: self.sent, received: self.received, clock }
    }

    /// Takes a datagram; none where it is dropped, which is counted. A dropped datagram must not feed a
    /// watchdog.
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
