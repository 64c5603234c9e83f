//! Bus task: owns the UDP socket of the local interface and passes measurements and commands between the
//! machine and the [control task's side](LocalMachine).
//!
//! It sends each new command once. If none arrives for [`SILENT`] periods, the control task counts as lost.
//! The bus task then holds the load as `docs/explanation/hazards.md` prescribes: motor speed zero, valve
//! shut. From then on it forwards no command that moves the load until the control task has itself
//! commanded the load to be held. A new release therefore starts with the proof of pressure and motion
//! again.

use crate::endpoint::{Endpoint, Received};
use crate::failure::{guarded, hand_panics_on};
use crate::local_machine::{Exchange, LocalMachine};
use crate::machine::{Link, Outgoing};
use crate::posix::{now, wait_for_input};
use crate::real_time_thread::prepare;
use hydroboom_machine_interface::datagram::LONGEST;
use hydroboom_machine_interface::session::Counters;
use std::io::{self, ErrorKind};
use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use thiserror::Error;

/// Number of control periods without a new command after which the control task counts as lost.
pub const SILENT: u64 = 2;
/// Polls for a new command per period: a command waits at most a tenth of a period.
const LOOKS: u64 = 10;
/// Largest number of datagrams taken in one call, so that a flood cannot delay the commands.
const AT_ONCE: usize = 64;
/// SCHED_FIFO priority: between the simulation and the control task, whose core the bus task shares.
const PRIORITY: i32 = 75;

/// Reason why the local interface cannot be opened.
#[derive(Debug, Error)]
pub enum BusError {
    /// The UDP port cannot be bound.
    #[error("UDP port {port} of 127.0.0.1 cannot be opened ({error}): {}", advice(error))]
    Port {
        /// The port.
        port: u16,
        /// Error of the operating system.
        error: io::Error,
    },
    /// The operating system supplies no random number for the session.
    #[error("no random number for the session: {0}")]
    Random(getrandom::Error),
}

/// Advice for a port that cannot be opened.
fn advice(error: &io::Error) -> &'static str {
    match error.kind() {
        ErrorKind::AddrInUse => {
            "another program uses it, perhaps another `hydroboom run`; end that program, or use another port"
        }
        ErrorKind::PermissionDenied => {
            "ports below 1024 require administrator rights; use one from 1024 on"
        }
        _ => "name another port",
    }
}

/// Bus task of the local interface: it owns the UDP socket and exchanges datagrams with the machine.
#[derive(Debug)]
pub struct BusTask {
    socket: UdpSocket,
    /// Endpoint of the controller, which processes the datagrams.
    pub endpoint: Endpoint,
    exchange: Arc<Exchange>,
    /// Control period \[ns\].
    period: u64,
    /// Sequence number of the newest command.
    taken: u64,
    last: Outgoing,
    /// Times of the newest command, of the newest datagram sent and of the newest poll for commands \[ns\].
    taken_at: u64,
    sent_at: u64,
    looked_at: u64,
    /// Whether the bus task holds the load because commands are missing.
    holds: bool,
}

impl BusTask {
    /// Opens a UDP port of the loopback address; port 0 is any free one. `period` is the control period \[s\], up to
    /// one second. Returns the bus task and the control task's side.
    ///
    /// # Errors
    ///
    /// [`BusError::Port`] if the port cannot be bound, [`BusError::Random`] if the operating system supplies no random
    /// number for the session.
    pub fn open(port: u16, period: f64) -> Result<(Self, LocalMachine), BusError> {
        let opened = UdpSocket::bind((Ipv4Addr::LOCALHOST, port))
            .and_then(|socket| socket.set_nonblocking(true).map(|()| socket));
        let socket = opened.map_err(|error| BusError::Port { port, error })?;
        let mut session = [0; 8];
        getrandom::fill(&mut session).map_err(BusError::Random)?;
        let exchange = Arc::new(Exchange::default());
        let period = (period * 1e9).round() as u64;
        let task = Self {
            socket,
            // the control period is at most one second
            endpoint: Endpoint::new(u64::from_ne_bytes(session), period as u32),
            exchange: Arc::clone(&exchange),
            period,
            taken: 0,
            last: Outgoing::SAFE,
            taken_at: 0,
            sent_at: 0,
            looked_at: 0,
            holds: false,
        };
        Ok((task, LocalMachine::new(exchange)))
    }

    /// Number of the UDP port that is bound; 0 if the operating system does not report it.
    pub fn port(&self) -> u16 {
        self.socket.local_addr().map_or(0, |address| address.port())
    }

    /// Sleeps until a datagram arrives, at most for a time \[ns\].
    pub fn wait(&self, nanoseconds: u64) {
        wait_for_input(&self.socket, nanoseconds);
    }

    /// Receives the waiting datagrams, at most 64 in a call; `clock` is the present monotonic time \[ns\]. Returns the
    /// number of accepted measurements.
    pub fn receive(&mut self, clock: u64) -> usize {
        // one byte more than the longest datagram, so that a longer one is recognised and not cut to a
        // valid length
        let mut bytes = [0; LONGEST + 1];
        let mut reply = [0; LONGEST];
        let mut accepted = 0;
        for _ in 0..AT_ONCE {
            let Ok((length, from)) = self.socket.recv_from(&mut bytes) else { break };
            match self.endpoint.receive(&bytes[..length], from, clock, &mut reply) {
                Received::Nothing => {}
                Received::Hello(length) => self.send(&reply[..length], from),
                Received::Measurement(number, measurement) => {
                    self.exchange.publish(number, &measurement, &self.endpoint.link());
                    accepted += 1;
                }
            }
        }
        accepted
    }

    /// Sends datagrams that are due at the monotonic time `clock` \[ns\]: a new command once, or the safe command once
    /// a period while the control task is lost.
    pub fn answer(&mut self, clock: u64) {
        // after a delay of the bus task itself the control task gets one more poll before it counts as lost
        let is_punctual = clock.saturating_sub(self.looked_at) <= self.period;
        self.looked_at = clock;
        if self.exchange.is_withheld.load(Ordering::Acquire) {
            // the machine's watchdog is being tried: the control task is not lost
            self.taken_at = clock;
            return;
        }
        let newest = self.exchange.command().filter(|written| written.sequence != self.taken);
        if let Some(written) = newest {
            (self.taken, self.taken_at, self.last) = (written.sequence, clock, written.outgoing);
            if self.holds && written.outgoing.is_safe() {
                self.hold(false);
            }
            let outgoing = if self.holds { self.safe() } else { written.outgoing };
            self.command(&outgoing, written.answers, clock);
            return;
        }
        let since = |time: u64| clock.saturating_sub(time);
        let is_silent = since(self.taken_at) > SILENT * self.period;
        if is_silent && is_punctual && since(self.sent_at) >= self.period {
            if !self.last.is_safe() {
                self.hold(true);
            }
            self.command(&self.safe(), None, clock);
        }
    }

    fn hold(&mut self, holds: bool) {
        self.holds = holds;
        self.exchange.holds.store(holds, Ordering::Release);
    }

    /// Safe command: immediate stop. A drive that was enabled stays enabled, because it needs torque to
    /// brake.
    fn safe(&self) -> Outgoing {
        Outgoing { is_enabled: self.last.is_enabled, ..Outgoing::SAFE }
    }

    fn command(&mut self, outgoing: &Outgoing, answers: Option<u64>, clock: u64) {
        let mut bytes = [0; LONGEST];
        if let Some((length, to)) = self.endpoint.command(outgoing, answers, clock, &mut bytes) {
            self.sent_at = clock;
            self.send(&bytes[..length], to);
        }
    }

    fn send(&self, bytes: &[u8], to: SocketAddr) {
        // the receiver detects a lost datagram by its sequence number
        let _ = self.socket.send_to(bytes, to);
    }

    /// Runs the bus task in a thread on the given core until [`BusThread::end`].
    pub fn spawn(self, core: usize) -> BusThread {
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = Arc::clone(&stop);
        hand_panics_on();
        BusThread { stop, thread: thread::spawn(move || self.run(core, &stopped)) }
    }

    fn run(mut self, core: usize, stop: &AtomicBool) -> BusReport {
        let mut remarks = prepare("the bus task", core, PRIORITY);
        let cycle = guarded(|| {
            while !stop.load(Ordering::Acquire) {
                self.wait(self.period / LOOKS);
                let clock = now();
                self.receive(clock);
                self.answer(clock);
            }
            self.command(&Outgoing::SAFE, None, now());
        });
        if let Err(why) = cycle {
            remarks.push(format!("the bus task failed, and the machine's watchdog acted: {why}"));
        }
        BusReport::of(&self.endpoint, remarks)
    }
}

/// Statistics of a session on the local interface, made when the bus task ends.
#[derive(Clone, Debug)]
pub struct BusReport {
    /// Numbers of accepted, lost and dropped datagrams.
    pub counters: Counters,
    /// Number of datagrams from another address or port than the machine's.
    pub refused: u64,
    /// State of the connection at the end.
    pub link: Link,
    /// Real-time privileges that the system refused, and failures, a sentence each.
    pub remarks: Vec<String>,
}

impl BusReport {
    /// Statistics of a session from the controller's endpoint, with remarks on the thread.
    pub fn of(endpoint: &Endpoint, remarks: Vec<String>) -> Self {
        let (counters, refused) = endpoint.counters();
        Self { counters, refused, link: endpoint.link(), remarks }
    }
}

/// Handle of the thread in which a bus task runs.
#[derive(Debug)]
pub struct BusThread {
    stop: Arc<AtomicBool>,
    thread: JoinHandle<BusReport>,
}

impl BusThread {
    /// Ends the bus task with a safe command, and returns its statistics. None if the thread panicked outside its
    /// guarded task.
    pub fn end(self) -> Option<BusReport> {
        self.stop.store(true, Ordering::Release);
        self.thread.join().ok()
    }
}
