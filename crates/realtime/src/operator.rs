//! Who asks: brings a machine up, starts it, stops it.
//!
//! A start is a request of an operator who is present, in [`State::Holding`], and nothing else. Until the
//! supervisor takes it up it is dropped when the operator changes or is lost, when a stop, an emergency stop or a fault
//! comes, when the state is another one, and a second after it was asked for. Once taken up it lives as long as
//! the release takes.

use crate::desk::{Desk, Generation};
use hydroboom_control::supervision::supervisor::{Decision, Request, State};

/// A reset waits so long for motor, valve and load to come to rest \[s\]; not for what is broken to be mended.
const RESET_WITHIN: f64 = 5.0;

/// An operator who wants courses run, one request after the other.
#[derive(Clone, Copy, Debug)]
pub struct Operator {
    /// Control period \[s\].
    period: f64,
    state: State,
    /// The generation at the desk when it was listened to last.
    generation: Option<Generation>,
    start: Start,
    /// Whether all shall come to rest.
    pub stop: bool,
    /// Whether all shall stand still at once; kept until the machine does.
    pub emergency: bool,
    reset: Option<Pending>,
    has_moved: bool,
    has_stopped: bool,
}

/// A request that has not been taken up.
#[derive(Clone, Copy, Debug)]
struct Pending {
    generation: Generation,
    /// For how long it still holds \[s\].
    left: f64,
}

/// What has become of a start.
#[derive(Clone, Copy, Debug)]
enum Start {
    /// None is asked for.
    Nothing,
    /// It is asked for as soon as the load is held.
    Planned,
    /// It is asked for.
    Requested(Pending),
    /// The supervisor releases the load, or has released it.
    TakenUp,
}

impl Operator {
    /// An operator at a desk, with a control period \[s\].
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
        }
    }

    /// An operator without a desk, with a control period \[s\], who starts one course as soon as the load is held.
    pub fn automatic(period: f64) -> Self {
        Self { start: Start::Planned, ..Self::new(period) }
    }

    /// Takes what was asked for at the desk; called once a control period.
    pub fn listen(&mut self, desk: &Desk) {
        let (start, reset) = (desk.take_start(), desk.take_reset());
        self.emergency |= desk.take_emergency();
        self.stop |= desk.take_stop() || desk.is_closing();
        let generation = desk.generation();
        let is_attended = desk.is_attended();
        if self.generation.replace(generation).is_some_and(|before| before != generation) {
            // whose motion it was is not there any more, even if another one came within the period
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
            // nothing is asked for before the last start has come to its end
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

    /// What is asked for in the coming period.
    pub fn request(&self) -> Request {
        match self.state {
            _ if self.emergency => Request::EmergencyStop,
            State::Idle => Request::Enable,
            State::Fault if self.reset.is_some() => Request::Reset,
            // also while the pump takes the load over: it is not released then
            State::Moving | State::Holding if self.stop => Request::Stop,
            State::Ready => Request::Hold,
            State::Holding if matches!(self.start, Start::Planned | Start::Requested(_)) => {
                Request::Start
            }
            _ => Request::None,
        }
    }

    /// What came of it.
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
            // what was begun is not begun again by itself
            _ => Start::Nothing,
        };
        // what was asked for in one state is not kept for a later one
        if decision.state == State::Fault {
            (self.stop, self.emergency) = (false, false);
        } else {
            self.reset = None;
        }
        if is_at_rest && decision.state != State::Stopping {
            self.stop = false;
        }
    }

    /// Whether there is nothing more to do: the load has been moved, or shall not be, and is held.
    pub fn is_done(&self) -> bool {
        match self.state {
            State::Fault => true,
            State::Moving | State::Stopping => false,
            State::Idle | State::Ready | State::Holding => self.has_moved || self.has_stopped,
        }
    }
}

impl Pending {
    /// The request a time later \[s\], if it still holds.
    fn after(self, time: f64) -> Option<Self> {
        let left = self.left - time;
        (left > 0.0).then_some(Self { left, ..self })
    }
}

/// Whether the supervisor releases the load, or has released it.
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

    /// An operator at a desk, before a machine that does not take requests up by itself.
    struct Bench {
        desk: Desk,
        operator: Operator,
    }

    impl Bench {
        /// Somebody has the role for an hour, and the machine is in a state.
        fn new(state: State) -> Self {
            let desk = Desk::new(Strategy::BenchmarkClosedLoop);
            desk.take_role(3600.0);
            let mut bench = Self { desk, operator: Operator::new(PERIOD) };
            bench.period(state);
            bench
        }

        /// One control period, after which the machine is at rest in a state; what was asked for in it.
        fn period(&mut self, state: State) -> Request {
            self.period_with(state, 0.0)
        }

        fn period_with(&mut self, state: State, motor_speed: f64) -> Request {
            self.operator.listen(&self.desk);
            let request = self.operator.request();
            self.operator.see(&decision(state, motor_speed));
            request
        }

        /// Whether a start is asked for in any of the next two seconds' periods, the load held meanwhile.
        fn starts_later(&mut self) -> bool {
            (0..2000).any(|_| self.period(State::Holding) == Request::Start)
        }
    }

    #[test]
    fn a_start_is_asked_for_until_it_is_taken_up_and_not_again() {
        let mut bench = Bench::new(State::Holding);
        bench.desk.start();
        assert_eq!(bench.period(State::Holding), Request::Start);
        assert_eq!(bench.period_with(State::Holding, 1.0), Request::Start);
        // longer than a request lives
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
    fn a_start_dies_a_second_after_it_was_asked_for() {
        for (within, periods) in [(Desk::START_WITHIN, 1000), (0.25, 250), (3600.0, 1000)] {
            let mut bench = Bench::new(State::Holding);
            bench.desk.start_in(bench.desk.generation(), within);
            let asked = (0..2000).filter(|_| bench.period(State::Holding) == Request::Start);
            let asked = asked.count();
            assert!(asked.abs_diff(periods) <= 1, "{asked} periods of {periods}");
        }
    }

    #[test]
    fn a_start_dies_in_every_state_but_holding() {
        for state in State::ALL.into_iter().filter(|state| *state != State::Holding) {
            // asked for in that state
            let mut bench = Bench::new(state);
            bench.desk.start();
            assert!(bench.period(state) != Request::Start && !bench.starts_later(), "{state:?}");
            // and while the state comes
            let mut bench = Bench::new(State::Holding);
            bench.desk.start();
            bench.period(state);
            assert!(!bench.starts_later(), "{state:?}");
        }
    }

    #[test]
    fn a_start_dies_with_its_operator() {
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
            // before the desk is looked at
            let mut bench = Bench::new(State::Holding);
            bench.desk.start();
            change(&bench.desk);
            assert!(!bench.starts_later());
            // and after
            let mut bench = Bench::new(State::Holding);
            bench.desk.start();
            assert_eq!(bench.period(State::Holding), Request::Start);
            change(&bench.desk);
            assert!(!bench.starts_later());
            // somebody who takes the role then has not asked for it either
            bench.desk.take_role(3600.0);
            assert!(!bench.starts_later());
        }
        // nobody is there
        let mut bench = Bench::new(State::Holding);
        bench.desk.leave_role();
        bench.desk.start();
        assert!(!bench.starts_later());
    }

    #[test]
    fn a_stop_and_an_emergency_stop_clear_what_is_pending_and_are_not_lost() {
        let mut bench = Bench::new(State::Holding);
        let generation = bench.desk.generation();
        bench.desk.start();
        bench.desk.stop();
        assert!(bench.period(State::Holding) != Request::Start && !bench.starts_later());
        bench.desk.start();
        bench.desk.emergency_stop();
        // what was on its way through another thread comes too late
        assert!(!bench.desk.start_in(generation, 1.0));
        assert_eq!(bench.period(State::Fault), Request::EmergencyStop);
        assert!(!bench.starts_later());
        // a reset neither
        let mut bench = Bench::new(State::Fault);
        bench.desk.reset();
        assert_eq!(bench.period(State::Fault), Request::Reset);
        bench.desk.emergency_stop();
        assert_eq!(bench.period(State::Fault), Request::EmergencyStop);
        assert_eq!(bench.period(State::Fault), Request::None);
        // it is asked for until the machine is in its fault, also from Idle
        let mut bench = Bench::new(State::Idle);
        bench.desk.emergency_stop();
        for _ in 0..5000 {
            assert_eq!(bench.period(State::Idle), Request::EmergencyStop);
        }
        assert_eq!(bench.period(State::Fault), Request::EmergencyStop);
        assert_eq!(bench.period(State::Fault), Request::None);
        // nobody has to attend
        let mut bench = Bench::new(State::Holding);
        bench.desk.leave_role();
        bench.desk.emergency_stop();
        assert_eq!(bench.period(State::Fault), Request::EmergencyStop);
    }

    #[test]
    fn a_reset_is_one_of_a_present_operator_in_a_fault() {
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
        // in a motion it holds until the load is held
        bench.desk.stop();
        assert_eq!(bench.period_with(State::Moving, 1.0), Request::Stop);
        assert_eq!(bench.period_with(State::Stopping, 1.0), Request::Stop);
        bench.period(State::Holding);
        assert_eq!(bench.period(State::Holding), Request::None);
    }

    #[test]
    fn a_motion_stops_when_another_operator_comes_however_quickly() {
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
    fn a_desk_that_closes_stops_and_starts_nothing() {
        let mut bench = Bench::new(State::Holding);
        bench.desk.close();
        bench.desk.start();
        assert!(!bench.starts_later() && bench.operator.is_done());
    }
}
