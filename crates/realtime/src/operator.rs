//! Who asks: brings a machine up, starts it, stops it.

use hydroboom_control::{Decision, Request, State};

/// An operator who wants one course run, one request after the other.
#[derive(Clone, Copy, Debug)]
pub struct Operator {
    state: State,
    has_moved: bool,
    /// Whether the motion may begin.
    pub start: bool,
    /// Whether all shall come to rest.
    pub stop: bool,
    /// Whether all shall stand still at once.
    pub emergency: bool,
}

impl Operator {
    /// An operator; with `start` the motion begins as soon as it can.
    pub fn new(start: bool) -> Self {
        Self { state: State::Idle, has_moved: false, start, stop: false, emergency: false }
    }

    /// What is asked for in the coming period.
    pub fn request(&mut self) -> Request {
        match self.state {
            _ if self.emergency => {
                self.emergency = false;
                Request::EmergencyStop
            }
            // also while the pump takes the load over: it is not released then
            State::Moving | State::Holding if self.stop => Request::Stop,
            _ if self.stop || self.has_moved => Request::None,
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
