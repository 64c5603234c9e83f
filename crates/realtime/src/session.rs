//! Session at a machine: a sequence of courses, managed by an ordinary thread. Long computations are done
//! here and passed to the real-time tasks as an [`Order`].

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

/// Condition that ends a run; the load is held in any case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// A course is over or a fault occurred, and the load is held.
    OnceDone,
    /// The desk is closed and the load is held.
    OnceClosed,
}

impl Ending {
    pub(crate) fn has_come(self, operator: &Operator, desk: &Desk, decision: &Decision) -> bool {
        let is_over = operator.is_done() && (self == Self::OnceDone || desk.is_closing());
        is_over && decision.command.motor_speed == 0.0 && decision.command.holding_valve == 0.0
    }
}

/// Desk, attendant and end condition of a run.
pub struct Lookout<'a> {
    /// Operator desk, from which requests are read.
    pub desk: &'a Desk,
    /// Receiver of the records, and source of the orders.
    pub attendant: &'a mut dyn Attendant,
    /// Condition that ends the run.
    pub ending: Ending,
}

/// Order to the real-time tasks.
#[derive(Clone)]
pub enum Order {
    /// Course to run at the next start.
    Course(Course),
    /// State of rest to which the simulation is synchronised.
    Synchronise(Box<AtRest>),
    /// Fault or payload change to apply to the virtual machine.
    Tamper(Tampering),
}

/// Observer of a run in an ordinary thread: it receives the records and prepares orders for the real-time tasks.
pub trait Attendant {
    /// Receives every record in order.
    fn see(&mut self, record: &Record);
    /// Receives the true state of the machine in a period, before that period's record. Only in simulated
    /// time: a machine in another process reports no more than its sensors.
    fn see_truth(&mut self, _truth: &Truth) {}
    /// Returns the orders to pass on, in their order; called regularly, and often without any being due.
    fn orders(&mut self) -> Vec<Order>;
    /// Receives a failure of a real-time task. After a failure of the control task the session can only be
    /// ended.
    fn failed(&mut self, failure: &Failure) {
        eprintln!("{failure}");
    }
}

/// Payload change: time of the course \[s\], and payload attached from then on \[kg\].
pub type PayloadChange = (f64, f64);

/// Records of the last second before a fault, with its cause.
#[derive(Clone, Debug)]
pub struct FaultData {
    /// Cause of the fault.
    pub cause: Cause,
    /// Time of the fault since the start of the executive \[s\].
    pub time: f64,
    /// Records of the last second; the last one is that of the fault.
    pub records: Vec<Record>,
}

/// Largest number of synchronisations of the simulation in a course. After that its strategies stay
/// disabled, because the model itself is wrong.
const MOST_SYNCHRONISATIONS: u32 = 3;
/// Time for which piston and set point must have been at rest together before a synchronisation \[s\].
const RESTED: f64 = 0.3;
/// Largest distance between them for it \[m\].
const TOGETHER: f64 = 2e-3;
/// Time before a fault for which records are kept \[s\].
const KEPT: f64 = 1.0;

/// Session at a machine: a sequence of courses, with synchronisation of the simulation and load changes.
pub struct Session {
    model: Description,
    /// Trajectories passed to the tasks and possibly in use. A real-time task must not drop the last
    /// reference, because that frees memory.
    paths: Vec<Arc<dyn Trajectory>>,
    payload_changes: Vec<PayloadChange>,
    /// Number of payload changes already applied.
    applied_changes: usize,
    last: Option<Record>,
    recent: VecDeque<Record>,
    fault: Option<FaultData>,
    rested: f64,
    synchronised: u32,
    /// Synchronisations over all courses.
    synchronised_in_all: u32,
    /// Conditions at the last synchronisation of the simulation.
    conditions: Conditions,
}

impl Session {
    /// Description of the crane from which the controllers are designed.
    pub fn model(&self) -> &Description {
        &self.model
    }

    /// Session without a record, with a machine that `model` describes.
    pub fn new(model: &Description) -> Self {
        let records = (KEPT / model.numbers.control_period) as usize;
        Self {
            model: model.clone(),
            paths: Vec::new(),
            payload_changes: Vec::new(),
            applied_changes: 0,
            last: None,
            recent: VecDeque::with_capacity(records + 1),
            fault: None,
            rested: 0.0,
            synchronised: 0,
            synchronised_in_all: 0,
            conditions: Conditions::described(&model.numbers),
        }
    }

    /// Updates the session with the record of a control period. The records of the last second are kept for the case
    /// of a fault.
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

    /// Newest record; none before the first control period.
    pub fn last(&self) -> Option<&Record> {
        self.last.as_ref()
    }

    /// Data of the last fault; none without one.
    pub fn fault(&self) -> Option<&FaultData> {
        self.fault.as_ref()
    }

    /// Number of synchronisations of the simulation with the machine during all courses.
    pub fn synchronised_in_all(&self) -> u32 {
        self.synchronised_in_all
    }

    /// Whether a present operator can start a course now: the load is held and not being released.
    pub fn is_ready(&self) -> bool {
        self.last.is_some_and(|record| start_waits_for(&record.decision, true).is_none())
    }

    /// Orders that make the tasks ready for a trajectory: the course from the piston's position, and the simulation
    /// synchronised to that position. Before the first record the piston counts as at the start of the trajectory.
    ///
    /// `payload_changes` are those of the course: its time \[s\], and the payload from then on \[kg\], in order of
    /// time.
    ///
    /// # Errors
    ///
    /// [`PlantError`] if the model has no state of rest there.
    pub fn prepare(
        &mut self,
        path: Arc<dyn Trajectory>,
        payload_changes: Vec<PayloadChange>,
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
        (self.payload_changes, self.applied_changes, self.synchronised) = (payload_changes, 0, 0);
        Ok(vec![Order::Course(course), Order::Synchronise(Box::new(at))])
    }

    /// Orders that are due without a request of the operator: payload changes and synchronisations.
    ///
    /// The simulation is synchronised when the payload or oil that was estimated over a held load has changed. It is
    /// also synchronised at most three times a course after a fallback due to it, once piston and set point have
    /// rested within 2 mm for 0.3 s.
    pub fn orders(&mut self) -> Vec<Order> {
        let mut orders = Vec::new();
        if let Some(time) = self.last.and_then(|r| r.course_time) {
            while let Some((at, mass)) =
                self.payload_changes.get(self.applied_changes).filter(|(at, _)| *at <= time)
            {
                debug_assert!(at.is_finite());
                orders.push(Order::Tamper(Tampering::Payload(*mass)));
                self.applied_changes += 1;
            }
        }
        let is_held = self.last.is_some_and(|r| r.course_time.is_none());
        if is_held && self.conditions.differ(&self.estimated()) {
            // a payload estimated while the load is held: the simulation is set to rest with it
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

    /// Order that sets the simulation to rest at the piston's position; none if the model has no state of
    /// rest there.
    fn at_rest_again(&mut self) -> Option<Order> {
        let stroke = self.stroke(self.model.numbers.motion_start);
        self.at_rest(stroke).ok().map(|at| Order::Synchronise(Box::new(at)))
    }

    /// Position of the piston \[m\]; `otherwise` if there is no finite measurement.
    fn stroke(&self, otherwise: f64) -> f64 {
        let stroke = self.last.map(|r| r.signals().stroke).filter(|stroke| stroke.is_finite());
        Real::clamp(stroke.unwrap_or(otherwise), 0.0, self.model.numbers.stroke)
    }

    /// State of rest at a position \[m\] under the newest conditions.
    fn at_rest(&mut self, stroke: f64) -> Result<AtRest, PlantError> {
        self.conditions = self.estimated();
        AtRest::new(&self.model, &self.conditions, stroke)
    }

    /// Newest conditions; those of the crane file before the first record.
    fn estimated(&self) -> Conditions {
        let described = Conditions::described(&self.model.numbers);
        self.last.map_or(described, |record| record.conditions)
    }
}
