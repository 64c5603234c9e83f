//! A session at a machine: course after course, seen from an ordinary thread. What takes long is
//! prepared here and handed to the real-time tasks as an [`Order`].

use crate::conditions::Conditions;
use crate::control_task::{Fallback, Record};
use crate::course::Course;
use crate::desk::Desk;
use crate::failure::Failure;
use crate::operator::Operator;
use crate::readiness::start_waits_for;
use crate::simulation_task::AtRest;
use crate::trouble::Tampering;
use hydroboom_control::reference::trajectory::Trajectory;
use hydroboom_control::supervision::fault::Cause;
use hydroboom_control::supervision::supervisor::Decision;
use hydroboom_description::Description;
use hydroboom_math::Real;
use hydroboom_plant::PlantError;
use hydroboom_virtual_crane::Truth;
use std::collections::VecDeque;
use std::sync::Arc;

/// When a run ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// Once a course is over, or a fault is there, and the load is held.
    OnceDone,
    /// Once the desk is closed and the load is held.
    OnceClosed,
}

impl Ending {
    pub(crate) fn has_come(self, operator: &Operator, desk: &Desk, decision: &Decision) -> bool {
        let is_over = operator.is_done() && (self == Self::OnceDone || desk.is_closing());
        is_over && decision.command.motor_speed == 0.0 && decision.command.holding_valve == 0.0
    }
}

/// Who looks after a run, from where, and until when.
pub struct Lookout<'a> {
    /// Where people ask.
    pub desk: &'a Desk,
    /// Who looks on.
    pub attendant: &'a mut dyn Attendant,
    /// When it ends.
    pub ending: Ending,
}

/// What the tasks are handed.
#[derive(Clone)]
pub enum Order {
    /// The course to be run when the operator wants it.
    Course(Course),
    /// The simulation goes on from here.
    Synchronise(Box<AtRest>),
    /// Something is done to the virtual machine.
    Tamper(Tampering),
}

/// Who looks on from an ordinary thread, and prepares what the tasks are to do.
pub trait Attendant {
    /// Shown every record, in order.
    fn see(&mut self, record: &Record);
    /// Shown, before the record of a period, what is true of the machine in it. Only in simulated time: a machine in another process tells no more than its
    /// sensors.
    fn see_truth(&mut self, _truth: &Truth) {}
    /// Asked now and then: what is to be handed over.
    fn orders(&mut self) -> Vec<Order>;
    /// Told of a real-time task that failed. After the control task has, the session can only be ended.
    fn failed(&mut self, failure: &Failure) {
        eprintln!("{failure}");
    }
}

/// A payload \[kg\] that is hung on at a time of the course \[s\].
pub type Hung = (f64, f64);

/// What was recorded before and at a fault.
#[derive(Clone, Debug)]
pub struct FaultData {
    /// Why.
    pub cause: Cause,
    /// When \[s since the executive began\].
    pub time: f64,
    /// The last second, the fault's own record last.
    pub records: Vec<Record>,
}

/// In a course the simulation is set to the machine's state so often at most; after that it is not
/// followed any more, because then it is the model that is wrong.
const MOST_SYNCHRONISATIONS: u32 = 3;
/// Piston and reference must have rested together for so long before \[s\].
const RESTED: f64 = 0.3;
/// And so near to each other \[m\].
const TOGETHER: f64 = 2e-3;
/// What is kept of the time before a fault \[s\].
const KEPT: f64 = 1.0;

/// What is known of the machine and asked of it.
pub struct Session {
    model: Description,
    /// Every path handed over that may still be in use: the real-time tasks must not be the last to
    /// let one go, which would free memory.
    paths: Vec<Arc<dyn Trajectory>>,
    hung: Vec<Hung>,
    /// How many of them hang.
    hanging: usize,
    last: Option<Record>,
    recent: VecDeque<Record>,
    fault: Option<FaultData>,
    rested: f64,
    synchronised: u32,
    /// How often over all courses.
    synchronised_in_all: u32,
    /// Under what the simulation was set to a state last.
    conditions: Conditions,
}

impl Session {
    /// The model that it is of.
    pub fn model(&self) -> &Description {
        &self.model
    }

    /// A session with a machine that the model stands for.
    pub fn new(model: &Description) -> Self {
        let records = (KEPT / model.numbers.control_period) as usize;
        Self {
            model: model.clone(),
            paths: Vec::new(),
            hung: Vec::new(),
            hanging: 0,
            last: None,
            recent: VecDeque::with_capacity(records + 1),
            fault: None,
            rested: 0.0,
            synchronised: 0,
            synchronised_in_all: 0,
            conditions: Conditions::described(&model.numbers),
        }
    }

    /// Takes a record into account.
    pub fn see(&mut self, record: &Record) {
        let period = self.model.numbers.control_period;
        self.recent.push_back(*record);
        if self.recent.len() as f64 > KEPT / period {
            self.recent.pop_front();
        }
        let before = self.last.replace(*record);
        if let Some(cause) = record.decision.cause
            && before.is_none_or(|b| b.decision.cause.is_none())
        {
            let records = self.recent.iter().copied().collect();
            self.fault = Some(FaultData { cause, time: record.time, records });
        }
        let apart = (record.signals().stroke - record.reference.position).abs();
        let rests = record.fallback == Some(Fallback::Simulation)
            && record.reference.velocity == 0.0
            && apart < TOGETHER;
        self.rested = if rests { self.rested + period } else { 0.0 };
    }

    /// The newest record.
    pub fn last(&self) -> Option<&Record> {
        self.last.as_ref()
    }

    /// The last fault, if there was any.
    pub fn fault(&self) -> Option<&FaultData> {
        self.fault.as_ref()
    }

    /// How often the simulation was set to the machine's state in the midst of a course.
    pub fn synchronised_in_all(&self) -> u32 {
        self.synchronised_in_all
    }

    /// Whether an operator who is present can begin a course now: the load is held, and not being released.
    pub fn is_ready(&self) -> bool {
        self.last.is_some_and(|record| start_waits_for(&record.decision, true).is_none())
    }

    /// What makes the machine ready for a path: the course there from where the piston is, and the
    /// simulation set to where the piston is.
    ///
    /// # Errors
    ///
    /// [`PlantError`] when the model has no state of rest there.
    pub fn prepare(
        &mut self,
        path: Arc<dyn Trajectory>,
        hung: Vec<Hung>,
    ) -> Result<Vec<Order>, PlantError> {
        let begin = path.reference(0.0).position;
        let course = match self.last {
            Some(record) => Course::from_stroke(Arc::clone(&path), record.signals().stroke),
            None => Course::new(Arc::clone(&path)),
        };
        let stroke = if course.approach() > 0.0 { self.stroke(begin) } else { begin };
        let at = self.at_rest(stroke)?;
        self.paths.retain(|path| Arc::strong_count(path) > 1);
        self.paths.push(path);
        (self.hung, self.hanging, self.synchronised) = (hung, 0, 0);
        Ok(vec![Order::Course(course), Order::Synchronise(Box::new(at))])
    }

    /// What is due by itself.
    pub fn orders(&mut self) -> Vec<Order> {
        let mut orders = Vec::new();
        if let Some(time) = self.last.and_then(|r| r.course_time) {
            while let Some((at, mass)) = self.hung.get(self.hanging).filter(|(at, _)| *at <= time) {
                debug_assert!(at.is_finite());
                orders.push(Order::Tamper(Tampering::Payload(*mass)));
                self.hanging += 1;
            }
        }
        let is_held = self.last.is_some_and(|r| r.course_time.is_none());
        if is_held && self.conditions.differ(&self.estimated()) {
            // weighed while it is held: the simulation rests with what hangs there
            orders.extend(self.at_rest_again());
        }
        if self.rested >= RESTED && self.synchronised < MOST_SYNCHRONISATIONS {
            self.rested = 0.0;
            self.synchronised += 1;
            let order = self.at_rest_again();
            self.synchronised_in_all += u32::from(order.is_some());
            orders.extend(order);
        }
        orders
    }

    /// The simulation set to rest where the piston is; none where the model cannot be there, and the simulation not follow.
    fn at_rest_again(&mut self) -> Option<Order> {
        let stroke = self.stroke(self.model.numbers.motion_start);
        self.at_rest(stroke).ok().map(|at| Order::Synchronise(Box::new(at)))
    }

    /// Where the piston is \[m\].
    fn stroke(&self, otherwise: f64) -> f64 {
        let stroke = self.last.map(|r| r.signals().stroke).filter(|stroke| stroke.is_finite());
        Real::clamp(stroke.unwrap_or(otherwise), 0.0, self.model.numbers.stroke)
    }

    /// Rest at a position \[m\], under the newest conditions.
    fn at_rest(&mut self, stroke: f64) -> Result<AtRest, PlantError> {
        self.conditions = self.estimated();
        AtRest::new(&self.model, &self.conditions, stroke)
    }

    /// The newest conditions, as described before the first record.
    fn estimated(&self) -> Conditions {
        let described = Conditions::described(&self.model.numbers);
        self.last.map_or(described, |record| record.conditions)
    }
}
