//! Operator: turns the requests at the desk into requests to the supervisor, and tracks their validity.
//!
//! A start needs a request of a present operator in [`State::Holding`]. A start that the supervisor has not
//! accepted is dropped in five cases. They are: the operator changes or leaves; a stop, an emergency stop
//! or a fault occurs; the state is another one; or one second has passed. An accepted start is valid for
//! the duration of the release.

use crate::desk::{Desk, Generation};
use hydroboom_control::supervision::supervisor::{Decision, Request, State};

/// Validity of a reset request \[s\]. It covers the time in which motor, valve and load come to rest, not
/// the repair of a defect.
const RESET_WITHIN: f64 = 5.0;

/// State of the operator's requests: start, stop, emergency stop and reset. One course is requested at a time.
#[derive(Clone, Copy, Debug)]
pub struct Operator {
    /// Control period \[s\].
    period: f64,
    state: State,
    /// Generation at the desk in the last period.
    generation: Option<Generation>,
    start: Start,
    /// Whether a stop is requested.
    pub stop: bool,
    /// Whether an emergency stop is requested; kept until the supervisor is in the fault state.
    pub emergency: bool,
    reset: Option<Pending>,
    has_moved: bool,
    has_stopped: bool,
    /// Whether nothing is ever asked of the machine.
    listens: bool,
}

/// Request that the supervisor has not accepted yet.
#[derive(Clone, Copy, Debug)]
struct Pending {
    generation: Generation,
    /// Remaining validity \[s\].
    left: f64,
}

/// State of a start request.
#[derive(Clone, Copy, Debug)]
enum Start {
    /// No request.
    Nothing,
    /// Requested as soon as the load is held.
    Planned,
    /// Requested.
    Requested(Pending),
    /// Accepted: the supervisor releases the load, or has released it.
    TakenUp,
}

impl Operator {
    /// Operator who acts at a desk; `period` is the control period \[s\].
    pub fn new(period: f64) -> Self {
        Self {
            period,
            state: State::Idle,
            generation: None,
            start: Start::Nothing,
            stop: false,
            emergency: false,
            reset: None,
            has_moved: false,
            has_stopped: false,
            listens: false,
        }
    }

    /// Operator without a desk, who starts one course as soon as the load is held; `period` is the control
    /// period \[s\].
    pub fn automatic(period: f64) -> Self {
        Self { start: Start::Planned, ..Self::new(period) }
    }

    /// Reads the requests at the desk. It must be called once per control period.
    pub fn listen(&mut self, desk: &Desk) {
        self.listens = desk.listens();
        let (start, reset) = (desk.take_start(), desk.take_reset());
        self.emergency |= desk.take_emergency();
        self.stop |= desk.take_stop() || desk.is_closing();
        let generation = desk.generation();
        let is_attended = desk.is_attended();
        if self.generation.replace(generation).is_some_and(|before| before != generation) {
            // the operator of this motion has left, even if another one took the role within the period
            self.stop |= self.state == State::Moving || matches!(self.start, Start::TakenUp);
        }
        let holds = |asked: Generation| asked == generation && is_attended;
        self.renew_start(start, holds);
        self.renew_reset(reset, holds);
    }

    fn renew_start(
        &mut self,
        asked: Option<(Generation, f64)>,
        holds: impl Fn(Generation) -> bool,
    ) {
        let (asked, before) = match self.start {
            Start::Nothing => (asked, None),
            Start::Requested(pending) => (asked, pending.after(self.period)),
            // a new start is ignored until the last one has ended
            Start::Planned | Start::TakenUp => return,
        };
        let asked = asked.map(|(generation, within)| Pending {
            generation,
            left: within.min(Desk::START_WITHIN),
        });
        let is_wanted = !self.stop && !self.emergency && self.state == State::Holding;
        self.start = match asked.or(before).filter(|p| is_wanted && holds(p.generation)) {
            Some(pending) => Start::Requested(pending),
            None => Start::Nothing,
        };
        if asked.is_some() && matches!(self.start, Start::Requested(_)) {
            (self.has_moved, self.has_stopped) = (false, false);
        }
    }

    fn renew_reset(&mut self, asked: Option<Generation>, holds: impl Fn(Generation) -> bool) {
        let asked = asked.map(|generation| Pending { generation, left: RESET_WITHIN });
        let before = self.reset.and_then(|pending| pending.after(self.period));
        let is_wanted = !self.emergency && self.state == State::Fault;
        self.reset = asked.or(before).filter(|p| is_wanted && holds(p.generation));
    }

    /// Request to the supervisor in the coming period. An emergency stop comes before all others, and is the only
    /// request of a desk that listens only.
    pub fn request(&self) -> Request {
        match self.state {
            _ if self.emergency => Request::EmergencyStop,
            _ if self.listens => Request::None,
            State::Idle => Request::Enable,
            State::Fault if self.reset.is_some() => Request::Reset,
            // a stop also applies while the pump pre-loads: the load is then not released
            State::Moving | State::Holding if self.stop => Request::Stop,
            State::Ready => Request::Hold,
            State::Holding if matches!(self.start, Start::Planned | Start::Requested(_)) => {
                Request::Start
            }
            _ => Request::None,
        }
    }

    /// Updates the requests from the decision of the supervisor.
    pub fn see(&mut self, decision: &Decision) {
        self.state = decision.state;
        self.has_moved |= decision.state == State::Moving;
        self.has_stopped |= self.stop;
        let is_at_rest =
            decision.command.motor_speed == 0.0 && decision.command.holding_valve == 0.0;
        self.start = match (decision.state, self.start) {
            (_, Start::Planned | Start::Requested(_)) if self.stop => Start::Nothing,
            _ if is_taken_up(decision) && !self.stop => Start::TakenUp,
            (State::Idle | State::Ready, Start::Planned) => Start::Planned,
            (State::Holding, start @ (Start::Planned | Start::Requested(_))) => start,
            (State::Holding, Start::TakenUp) if decision.releasing => Start::TakenUp,
            // a finished or refused start is not repeated
            _ => Start::Nothing,
        };
        // a request does not survive a change of state
        if decision.state == State::Fault {
            (self.stop, self.emergency) = (false, false);
        } else {
            self.reset = None;
        }
        if is_at_rest && decision.state != State::Stopping {
            self.stop = false;
        }
    }

    /// Whether the operator requests nothing more: the supervisor is in the fault state, or the load is held after its
    /// motion or after a stop.
    pub fn is_done(&self) -> bool {
        match self.state {
            State::Fault => true,
            State::Moving | State::Stopping => false,
            State::Idle | State::Ready | State::Holding => self.has_moved || self.has_stopped,
        }
    }
}

impl Pending {
    /// The request after `time` \[s\]; none if it has expired.
    fn after(self, time: f64) -> Option<Self> {
        let left = self.left - time;
        (left > 0.0).then_some(Self { left, ..self })
    }
}

/// Whether the supervisor has accepted a start: it releases the load, or has released it.
fn is_taken_up(decision: &Decision) -> bool {
    match decision.state {
        State::Holding => decision.releasing,
        state => state == State::Moving,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hydroboom_control::command::AxisCommand;
    use hydroboom_control::strategy::Strategy;

    const PERIOD: f64 = 1e-3;

    fn decision(state: State, motor_speed: f64) -> Decision {
        let command = AxisCommand { motor_speed, holding_valve: 0.0 };
        let releasing = state == State::Holding && motor_speed != 0.0;
        Decision { command, state, releasing, ..Decision::IDLE }
    }

    /// Operator at a desk, in front of a simulated supervisor that accepts nothing by itself.
    struct Bench {
        desk: Desk,
        operator: Operator,
    }

    impl Bench {
        /// Someone has the role for an hour, and the supervisor is in the given state.
        fn new(state: State) -> Self {
            let desk = Desk::new(Strategy::BenchmarkClosedLoop);
            desk.take_role(3600.0);
            let mut bench = Self { desk, operator: Operator::new(PERIOD) };
            bench.period(state);
            bench
        }

        /// One control period with the machine at rest, and the supervisor in the given state. Returns the
        /// request.
        fn period(&mut self, state: State) -> Request {
            self.period_with(state, 0.0)
        }

        fn period_with(&mut self, state: State, motor_speed: f64) -> Request {
            self.operator.listen(&self.desk);
            let request = self.operator.request();
            self.operator.see(&decision(state, motor_speed));
            request
        }

        /// Whether a start is requested in any of the next 2000 periods with the load held.
        fn starts_later(&mut self) -> bool {
            (0..2000).any(|_| self.period(State::Holding) == Request::Start)
        }
    }

    #[test]
    fn a_start_is_requested_until_it_is_taken_and_not_again() {
        let mut bench = Bench::new(State::Holding);
        bench.desk.start();
        assert_eq!(bench.period(State::Holding), Request::Start);
        assert_eq!(bench.period_with(State::Holding, 1.0), Request::Start);
        // longer than the validity of a request
        for _ in 0..3000 {
            assert_eq!(bench.period_with(State::Holding, 1.0), Request::None);
        }
        bench.period_with(State::Moving, 1.0);
        bench.period_with(State::Stopping, 1.0);
        assert!(!bench.operator.is_done());
        bench.period(State::Holding);
        assert!(bench.operator.is_done() && !bench.starts_later());
    }

    #[test]
    fn a_start_expires_a_second_after_its_request() {
        for (within, periods) in [(Desk::START_WITHIN, 1000), (0.25, 250), (3600.0, 1000)] {
            let mut bench = Bench::new(State::Holding);
            bench.desk.start_in(bench.desk.generation(), within);
            let asked = (0..2000).filter(|_| bench.period(State::Holding) == Request::Start);
            let asked = asked.count();
            assert!(asked.abs_diff(periods) <= 1, "{asked} periods of {periods}");
        }
    }

    #[test]
    fn a_start_is_cleared_in_every_state_but_holding() {
        for state in State::ALL.into_iter().filter(|state| *state != State::Holding) {
            // requested in that state
            let mut bench = Bench::new(state);
            bench.desk.start();
            assert!(bench.period(state) != Request::Start && !bench.starts_later(), "{state:?}");
            // requested before the state is entered
            let mut bench = Bench::new(State::Holding);
            bench.desk.start();
            bench.period(state);
            assert!(!bench.starts_later(), "{state:?}");
        }
    }

    #[test]
    fn a_start_is_cleared_when_its_operator_leaves() {
        type Change = fn(&Desk);
        let given_back: Change = |desk| desk.leave_role();
        let lost: Change = |desk| desk.attend(0.0);
        let taken: Change = |desk| {
            desk.take_role(3600.0);
        };
        let given_back_and_taken: Change = |desk| {
            desk.leave_role();
            desk.take_role(3600.0);
        };
        for change in [given_back, lost, taken, given_back_and_taken] {
            // before the desk is read
            let mut bench = Bench::new(State::Holding);
            bench.desk.start();
            change(&bench.desk);
            assert!(!bench.starts_later());
            // after the desk is read
            let mut bench = Bench::new(State::Holding);
            bench.desk.start();
            assert_eq!(bench.period(State::Holding), Request::Start);
            change(&bench.desk);
            assert!(!bench.starts_later());
            // a later operator has not requested it
            bench.desk.take_role(3600.0);
            assert!(!bench.starts_later());
        }
        // no operator is present
        let mut bench = Bench::new(State::Holding);
        bench.desk.leave_role();
        bench.desk.start();
        assert!(!bench.starts_later());
    }

    #[test]
    fn stops_and_emergency_stops_clear_pending_requests() {
        let mut bench = Bench::new(State::Holding);
        let generation = bench.desk.generation();
        bench.desk.start();
        bench.desk.stop();
        assert!(bench.period(State::Holding) != Request::Start && !bench.starts_later());
        bench.desk.start();
        bench.desk.emergency_stop();
        // a request still in transit through another thread has an earlier generation
        assert!(!bench.desk.start_in(generation, 1.0));
        assert_eq!(bench.period(State::Fault), Request::EmergencyStop);
        assert!(!bench.starts_later());
        // likewise for a reset
        let mut bench = Bench::new(State::Fault);
        bench.desk.reset();
        assert_eq!(bench.period(State::Fault), Request::Reset);
        bench.desk.emergency_stop();
        assert_eq!(bench.period(State::Fault), Request::EmergencyStop);
        assert_eq!(bench.period(State::Fault), Request::None);
        // it is requested until the supervisor reports the fault, also from Idle
        let mut bench = Bench::new(State::Idle);
        bench.desk.emergency_stop();
        for _ in 0..5000 {
            assert_eq!(bench.period(State::Idle), Request::EmergencyStop);
        }
        assert_eq!(bench.period(State::Fault), Request::EmergencyStop);
        assert_eq!(bench.period(State::Fault), Request::None);
        // no operator needs to be present
        let mut bench = Bench::new(State::Holding);
        bench.desk.leave_role();
        bench.desk.emergency_stop();
        assert_eq!(bench.period(State::Fault), Request::EmergencyStop);
    }

    #[test]
    fn a_reset_needs_a_present_operator_and_a_fault() {
        let resets = |bench: &mut Bench| {
            (0..6000).filter(|_| bench.period(State::Fault) == Request::Reset).count()
        };
        let mut bench = Bench::new(State::Fault);
        bench.desk.reset();
        assert!(resets(&mut bench).abs_diff((RESET_WITHIN / PERIOD) as usize) <= 1);
        assert_eq!(resets(&mut bench), 0, "asked for once");
        let taken: fn(&Desk) = |desk| {
            desk.take_role(3600.0);
        };
        for change in [Desk::leave_role, taken] {
            let mut bench = Bench::new(State::Fault);
            bench.desk.reset();
            assert_eq!(bench.period(State::Fault), Request::Reset);
            change(&bench.desk);
            assert_eq!(resets(&mut bench), 0);
        }
        let mut bench = Bench::new(State::Holding);
        bench.desk.reset();
        bench.period(State::Holding);
        assert_eq!(resets(&mut bench), 0, "a reset was kept for a later fault");
    }

    #[test]
    fn a_stop_is_not_kept_for_a_later_course() {
        let mut bench = Bench::new(State::Ready);
        bench.desk.stop();
        bench.period(State::Ready);
        bench.period(State::Holding);
        bench.desk.start();
        assert_eq!(bench.period_with(State::Holding, 1.0), Request::Start);
        assert_eq!(bench.period_with(State::Moving, 1.0), Request::None);
        // during a motion the stop is kept until the load is held
        bench.desk.stop();
        assert_eq!(bench.period_with(State::Moving, 1.0), Request::Stop);
        assert_eq!(bench.period_with(State::Stopping, 1.0), Request::Stop);
        bench.period(State::Holding);
        assert_eq!(bench.period(State::Holding), Request::None);
    }

    #[test]
    fn a_motion_stops_on_any_change_of_operator() {
        for (state, motor_speed) in [(State::Holding, 1.0), (State::Moving, 5.0)] {
            let mut bench = Bench::new(State::Holding);
            bench.desk.start();
            bench.period_with(state, motor_speed);
            bench.desk.leave_role();
            bench.desk.take_role(3600.0);
            assert_eq!(bench.period_with(state, motor_speed), Request::Stop, "{state:?}");
        }
    }

    #[test]
    fn a_desk_that_only_listens_makes_no_request() {
        let mut bench = Bench::new(State::Idle);
        bench.desk.listen_only();
        bench.desk.start();
        assert!((0..3000).all(|_| bench.period(State::Idle) == Request::None));
        bench.desk.close();
        bench.period(State::Idle);
        assert!(bench.operator.is_done());
    }

    #[test]
    fn a_closed_desk_starts_nothing_and_ends_the_session() {
        let mut bench = Bench::new(State::Holding);
        bench.desk.close();
        bench.desk.start();
        assert!(!bench.starts_later() && bench.operator.is_done());
    }
}
