//! Controller's endpoint of the local interface: accepts one machine and its datagrams, answers them, and
//! measures the delays. It has no socket, and no clock but the times passed to it.
//! `docs/reference/machine-interface.md` is the normative text.

use crate::machine::{Delay, Link, Outgoing};
use hydroboom_control::measurement::AXES;
use hydroboom_machine_interface::datagram::{
    Body, Command, CommandedAxis, Dropped, Header, Hello, LONGEST, MOST_AXES, Measurement, Peer,
    VERSION, decode, encode,
};
use hydroboom_machine_interface::session::{Counters, Session, WATCHDOG};
use hydroboom_machine_interface::signal::MEASURED;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use thiserror::Error;

/// Number of commands whose measurement's sampling time is kept until the machine acknowledges them.
const REMEMBERED: usize = 64;
/// Number of measurements over which delays are averaged.
const AVERAGED: f64 = 256.0;

/// Reason why a machine cannot be controlled: its interface version, control period or number of axes differs.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum Difference {
    /// Another version of the interface.
    #[error(
        "the machine has version {0} of the interface, and the controller {VERSION}: use a machine of version {VERSION}"
    )]
    Version(u16),
    /// Another control period \[ns\].
    #[error(
        "the machine's control period is {machine} ns, and the controller's {controller} ns: set controller.control_period_ms of the crane file, or the \
         machine's period, so that they are equal"
    )]
    Period {
        /// Control period of the machine.
        machine: u32,
        /// Control period of the controller.
        controller: u32,
    },
    /// Another number of axes.
    #[error(
        "the machine has {machine} axes, and the controller {AXES}: the machine must send {AXES}"
    )]
    Axes {
        /// Number of axes of the machine.
        machine: usize,
    },
}

/// Kind of a received datagram, after its checks.
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "no allocation in the control period")]
pub enum Received {
    /// No accepted datagram.
    Nothing,
    /// Session request of a machine; the reply has this many bytes.
    Hello(usize),
    /// Measurement with its sequence number; its axes are those of this program.
    Measurement(u64, Measurement),
}

/// A command's sequence number with the measurement that it answers.
#[derive(Clone, Copy, Debug, Default)]
struct Answer {
    sequence: u64,
    /// Sampling time of the measurement \[ns\].
    sampled: u64,
}

/// Endpoint of the controller in a session with one machine.
#[derive(Clone, Copy, Debug)]
pub struct Endpoint {
    /// Control period \[ns\].
    period: u32,
    session: Session,
    machine: Option<(SocketAddr, Peer)>,
    /// Number of the machine's firmware, as it states it; 0 where it does not.
    firmware: u64,
    /// Whether a measurement of this session has been accepted.
    has_begun: bool,
    /// Number of datagrams from another address or port than the machine's.
    refused: u64,
    difference: Option<Difference>,
    sent: u64,
    answers: [Answer; REMEMBERED],
    /// Sequence number of the last command that the machine acknowledged.
    named: u64,
    delay: Option<Delay>,
    commands_lost: bool,
}

impl Endpoint {
    /// Endpoint without a machine. `session` is an unpredictable session number, `period` the control
    /// period \[ns\]; a 0 in either counts as 1.
    pub fn new(session: u64, period: u32) -> Self {
        Self {
            // zero marks the session request: a session's own number is at least 1
            session: Session::new(session.max(1)),
            period: period.max(1),
            machine: None,
            firmware: 0,
            has_begun: false,
            refused: 0,
            difference: None,
            sent: 0,
            answers: [Answer::default(); REMEMBERED],
            named: 0,
            delay: None,
            commands_lost: false,
        }
    }

    /// Address of the machine, and whether it declares itself simulated; none before a machine has requested a
    /// session.
    pub fn machine(&self) -> Option<(SocketAddr, Peer)> {
        self.machine
    }

    /// Number of the machine's firmware, as it states it; 0 where it does not.
    pub fn firmware(&self) -> u64 {
        self.firmware
    }

    /// Whether a measurement of this session has been accepted.
    pub fn has_begun(&self) -> bool {
        self.has_begun
    }

    /// Mismatch of the machine that last requested a session; none if it fits.
    pub fn difference(&self) -> Option<Difference> {
        self.difference
    }

    /// Counts of datagrams of the session, and the number of datagrams from another address or port.
    pub fn counters(&self) -> (Counters, u64) {
        (self.session.counters, self.refused)
    }

    /// State of the connection: losses and delays.
    pub fn link(&self) -> Link {
        Link {
            lost: self.session.counters.lost,
            dropped: self.session.counters.dropped() + self.refused,
            delay: self.delay,
            commands_lost: self.commands_lost,
        }
    }

    /// Processes a datagram that was received from an address at the monotonic time `clock` \[ns\]. The bytes to send
    /// back, if any, are in `reply`.
    pub fn receive(
        &mut self,
        bytes: &[u8],
        from: SocketAddr,
        clock: u64,
        reply: &mut [u8; LONGEST],
    ) -> Received {
        let is_other = self.machine.is_some_and(|(machine, _)| machine != from);
        if is_other || from.ip() != IpAddr::V4(Ipv4Addr::LOCALHOST) {
            self.refused += 1;
            return Received::Nothing;
        }
        match decode(bytes) {
            Ok((header, Body::Hello(hello))) if !self.has_begun && header.session == 0 => {
                return self.greet(&hello, from, clock, reply);
            }
            Err(Dropped::Version(version)) if self.machine.is_none() => {
                self.difference = Some(Difference::Version(version));
            }
            // a command, which only a controller may send, or another number of axes
            Ok((_, Body::Command(_))) => {
                self.session.counters.malformed += 1;
                return Received::Nothing;
            }
            Ok((_, Body::Measurement(measurement))) if measurement.count != AXES => {
                self.session.counters.malformed += 1;
                return Received::Nothing;
            }
            _ => {}
        }
        match self.session.accept(bytes) {
            // a sender that has not requested the session does not know its number legitimately
            Some((header, Body::Measurement(measurement))) if self.machine.is_some() => {
                self.has_begun = true;
                self.look_at_answer(&header, &measurement);
                Received::Measurement(header.sequence, measurement)
            }
            _ => Received::Nothing,
        }
    }

    /// Starts a session at a machine's request. The reply is repeated if the request is, because it may
    /// have been lost.
    fn greet(
        &mut self,
        hello: &Hello,
        from: SocketAddr,
        clock: u64,
        reply: &mut [u8; LONGEST],
    ) -> Received {
        self.difference = if hello.newest_version < VERSION {
            Some(Difference::Version(hello.newest_version))
        } else if hello.period != self.period {
            Some(Difference::Period { machine: hello.period, controller: self.period })
        } else if hello.axes != AXES {
            Some(Difference::Axes { machine: hello.axes })
        } else {
            None
        };
        if self.difference.is_some() || hello.peer == Peer::Controller {
            return Received::Nothing;
        }
        self.machine = Some((from, hello.peer));
        self.firmware = hello.firmware;
        let header = Header { session: self.session.number(), clock, ..Header::default() };
        let own = Hello {
            peer: Peer::Controller,
            period: self.period,
            newest_version: VERSION,
            axes: AXES,
            firmware: 0,
            ranges: [[[f64::NAN; 2]; MEASURED.len()]; MOST_AXES],
        };
        Received::Hello(encode(&header, &Body::Hello(own), reply))
    }

    /// Updates the delays from a measurement and the last command that it acknowledges.
    fn look_at_answer(&mut self, header: &Header, measurement: &Measurement) {
        let period = f64::from(self.period);
        // an acknowledgement cannot exceed the number of commands sent
        let received = header.received.min(self.sent);
        let waiting = (self.sent - received) as f64 * period;
        self.commands_lost = waiting > WATCHDOG.as_nanos() as f64;
        if received <= self.named {
            return;
        }
        self.named = received;
        let answer = self.answers[(received % REMEMBERED as u64) as usize];
        if answer.sequence != received {
            return;
        }
        let cycles = |from: u64, to: u64| to.wrapping_sub(from) as i64 as f64 / period;
        let now = Delay {
            measurement: cycles(measurement.sampled, header.clock),
            total: cycles(answer.sampled, header.clock) - 1.0,
        };
        self.delay = Some(self.delay.map_or(now, |mean| Delay {
            measurement: mean.measurement + (now.measurement - mean.measurement) / AVERAGED,
            total: mean.total + (now.total - mean.total) / AVERAGED,
        }));
    }

    /// Writes a command to the given bytes. `answers` is the sampling time \[ns\] of the measurement that
    /// it answers, by the machine's clock; `None` for a command that answers none, as the safe command. `clock` is the
    /// monotonic time \[ns\]. Returns its length \[byte\] and destination; none before the first accepted measurement.
    pub fn command(
        &mut self,
        outgoing: &Outgoing,
        answers: Option<u64>,
        clock: u64,
        into: &mut [u8; LONGEST],
    ) -> Option<(usize, SocketAddr)> {
        let (machine, _) = self.machine.filter(|_| self.has_begun)?;
        let header = self.session.next_header(clock);
        self.sent = header.sequence;
        if let Some(sampled) = answers {
            let answer = Answer { sequence: header.sequence, sampled };
            self.answers[(header.sequence % REMEMBERED as u64) as usize] = answer;
        }
        let mut command =
            Command { is_enabled: outgoing.is_enabled, count: AXES, ..Command::default() };
        for (to, from) in command.axes.iter_mut().zip(&outgoing.command.axes) {
            *to =
                CommandedAxis { motor_speed: from.motor_speed, holding_valve: from.holding_valve };
        }
        Some((encode(&header, &Body::Command(command), into), machine))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hydroboom_machine_interface::datagram::MeasuredAxis;

    const PERIOD: u32 = 1_000_000;
    const SESSION: u64 = 0x5EED;

    fn port(port: u16) -> SocketAddr {
        SocketAddr::from((Ipv4Addr::LOCALHOST, port))
    }

    fn hello(change: impl FnOnce(&mut Hello)) -> Vec<u8> {
        let mut hello = Hello {
            peer: Peer::SimulatedMachine,
            period: PERIOD,
            newest_version: VERSION,
            axes: 1,
            firmware: 0,
            ranges: [[[f64::NAN; 2]; MEASURED.len()]; MOST_AXES],
        };
        change(&mut hello);
        let mut bytes = [0; LONGEST];
        let length = encode(&Header::default(), &Body::Hello(hello), &mut bytes);
        bytes[..length].to_vec()
    }

    fn measurement(header: Header, sampled: u64) -> Vec<u8> {
        let mut body = Measurement { sampled, count: 1, ..Measurement::default() };
        body.axes[0] = MeasuredAxis::default();
        let mut bytes = [0; LONGEST];
        let length = encode(&header, &Body::Measurement(body), &mut bytes);
        bytes[..length].to_vec()
    }

    fn take(endpoint: &mut Endpoint, bytes: &[u8], from: SocketAddr) -> Received {
        endpoint.receive(bytes, from, 0, &mut [0; LONGEST])
    }

    fn greeted() -> Endpoint {
        let mut endpoint = Endpoint::new(SESSION, PERIOD);
        let answer = take(&mut endpoint, &hello(|_| ()), port(4000));
        assert!(matches!(answer, Received::Hello(_)), "{answer:?}");
        endpoint
    }

    #[test]
    fn a_second_machine_and_other_addresses_are_refused_and_counted() {
        let mut endpoint = Endpoint::new(SESSION, PERIOD);
        let elsewhere = SocketAddr::from(([192, 0, 2, 1], 4000));
        assert_eq!(take(&mut endpoint, &hello(|_| ()), elsewhere), Received::Nothing);
        assert_eq!(endpoint.machine(), None);
        let mut endpoint = greeted();
        let header = Header { session: SESSION, sequence: 1, ..Header::default() };
        assert_eq!(take(&mut endpoint, &hello(|_| ()), port(4001)), Received::Nothing);
        assert_eq!(take(&mut endpoint, &measurement(header, 0), port(4001)), Received::Nothing);
        assert_eq!(endpoint.counters().1, 2);
        // a lost reply is repeated until the session runs
        assert!(matches!(take(&mut endpoint, &hello(|_| ()), port(4000)), Received::Hello(_)));
        let taken = take(&mut endpoint, &measurement(header, 0), port(4000));
        assert!(matches!(taken, Received::Measurement(1, _)));
        assert_eq!(take(&mut endpoint, &hello(|_| ()), port(4000)), Received::Nothing);
        assert_eq!(endpoint.counters().0.session, 1);
    }

    #[test]
    fn a_mismatch_is_reported_to_the_machine() {
        let mut endpoint = Endpoint::new(SESSION, PERIOD);
        let cases: [(Vec<u8>, &str); 3] = [
            (hello(|hello| hello.period = 2_000_000), "2000000 ns"),
            (hello(|hello| hello.axes = 2), "2 axes"),
            (hello(|hello| hello.newest_version = 0), "version 0"),
        ];
        for (bytes, named) in cases {
            assert_eq!(take(&mut endpoint, &bytes, port(4000)), Received::Nothing);
            let message = endpoint.difference().unwrap().to_string();
            assert!(message.contains(named), "{message}");
            assert_eq!(endpoint.machine(), None);
        }
        let mut newer = hello(|_| ());
        newer[4] = 2;
        assert_eq!(take(&mut endpoint, &newer, port(4000)), Received::Nothing);
        assert_eq!(endpoint.difference(), Some(Difference::Version(2)));
    }

    /// Delay measured for a machine that sends measurements `sensors` cycles after sampling and accepts
    /// commands `late` cycles after sending.
    fn delay_of(sensors: u64, late: u64) -> Delay {
        let mut endpoint = greeted();
        let period = u64::from(PERIOD);
        for k in 1..=3000_u64 {
            let clock = (k + sensors) * period;
            let received = (k - 1).saturating_sub(late);
            let header = Header { session: SESSION, sequence: k, received, clock };
            take(&mut endpoint, &measurement(header, k * period), port(4000));
            let mut into = [0; LONGEST];
            endpoint.command(&Outgoing::SAFE, Some(k * period), 0, &mut into).unwrap();
        }
        endpoint.link().delay.unwrap()
    }

    #[test]
    fn delays_follow_from_sampling_times_and_accepted_commands() {
        for (sensors, late) in [(0, 0), (1, 0), (0, 1), (2, 3)] {
            let delay = delay_of(sensors, late);
            assert_eq!(delay.cycles(), [sensors as usize, late as usize], "{delay:?}");
        }
    }

    #[test]
    fn unaccepted_commands_are_detected_within_the_watchdog_time() {
        let mut endpoint = greeted();
        for k in 1..=60_u64 {
            // the machine receives the first thirty commands
            let received = (k - 1).min(30);
            let header = Header { session: SESSION, sequence: k, received, clock: 0 };
            take(&mut endpoint, &measurement(header, 0), port(4000));
            assert_eq!(endpoint.link().commands_lost, k > 51, "{k}");
            endpoint.command(&Outgoing::SAFE, None, 0, &mut [0; LONGEST]).unwrap();
        }
    }
}
