//! Who asks: brings a machine up, starts it, stops it.

use crate::desk::Desk;
use hydroboom_control::{Decision, Request, State};

/// A reset waits so many periods for motor and valve to come to rest; not for what is broken to be mended.
const RESET_WAITS: u32 = 600;

/// An operator who wants courses run, one request after the other.
#[derive(Clone, Copy, Debug)]
pub struct Operator {
    state: State,
    has_moved: bool,
    start: bool,
    /// Whether all shall come to rest.
    pub stop: bool,
    /// Whether all shall stand still at once.
    pub emergency: bool,
    /// Periods for which a reset is still asked for.
    reset: u32,
}

impl Operator {
    /// An operator; with `start` the motion begins as soon as it can.
    pub fn new(start: bool) -> Self {
        let state = State::Idle;
        Self { state, has_moved: false, start, stop: false, emergency: false, reset: 0 }
    }

    /// Takes what was asked for at the desk.
    pub fn listen(&mut self, desk: &Desk) {
        if desk.take_start() {
            self.begin();
        }
        self.stop |= desk.take_stop() || desk.is_closing();
        self.emergency |= desk.take_emergency();
        self.reset = self.reset.saturating_sub(1);
        if desk.take_reset() && self.state == State::Fault {
            self.reset = RESET_WAITS;
        }
    }

    /// Wants a course run: the first, or another one after the last. During one, or in a fault, nothing
    /// comes of it.
    pub fn begin(&mut self) {
        if matches!(self.state, State::Idle | State::Ready | State::Holding) {
            (self.start, self.stop, self.has_moved) = (true, false, false);
        }
    }

    /// What is asked for in the coming period.
    pub fn request(&mut self) -> Request {
        match self.state {
            _ if self.emergency => {
                self.emergency = false;
                Request::EmergencyStop
            }
            State::Fault if self.reset > 0 => Request::Reset,
            // also while the pump takes the load over: it is not released then
            State::Moving | State::Holding if self.stop => Request::Stop,
            State::Idle => Request::Enable,
            State::Ready => Request::Hold,
            State::Holding if self.start => Request::Start,
            _ => Request::None,
        }
    }

    /// What came of it.
    pub fn see(&mut self, decision: &Decision) {
        self.state = decision.state;
        self.has_moved |= decision.state == State::Moving;
        // what was begun is not begun again by itself
        if matches!(decision.state, State::Moving | State::Stopping | State::Fault) {
            self.start = false;
        }
        // nor is a reset kept for a later fault
        if decision.state != State::Fault {
            self.reset = 0;
        }
    }

    /// Whether there is nothing more to do: the load has been moved, or shall not be, and is held.
    pub fn is_done(&self) -> bool {
        match self.state {
            State::Fault => true,
            State::Moving | State::Stopping => false,
            State::Idle | State::Ready | State::Holding => self.has_moved || self.stop,
        }
    }
}
