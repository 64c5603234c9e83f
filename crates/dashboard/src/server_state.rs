//! State shared by all connections, and the execution of a viewer's message.

use crate::choice::Offered;
use crate::command::{self, Demand, Message};
use crate::feed::Feed;
use crate::limits::Limits;
use crate::operator_role::OperatorRole;
use crate::scene::Scene;
use crate::token::Token;
use crate::viewers::{Place, Viewers};
use hydroboom_realtime::desk::{Desk, Generation};
use serde_json::{Value, json};
use std::net::SocketAddr;
use std::sync::mpsc::Sender;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

/// State shared by all connections.
pub(crate) struct ServerState {
    pub(crate) feed: Mutex<Feed>,
    pub(crate) scene: Scene,
    pub(crate) offered: Offered,
    pub(crate) role: OperatorRole,
    pub(crate) desk: Arc<Desk>,
    pub(crate) token: Token,
    pub(crate) demands: Sender<Demand>,
    pub(crate) bound: SocketAddr,
    pub(crate) viewers: Arc<Viewers>,
    pub(crate) limits: Limits,
}

impl ServerState {
    /// Locks the data for the viewers.
    pub(crate) fn feed(&self) -> MutexGuard<'_, Feed> {
        // only lists are extended: the data stay valid after a panic of another thread
        self.feed.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Data that a new viewer receives first.
    pub(crate) fn setup(&self, place: &Place) -> Value {
        let mut setup = self.scene.setup().clone();
        setup["viewer"] = json!(place.number);
        setup["has_token"] = json!(place.has_token);
        setup["chosen"] = self.feed().chosen.json();
        setup
    }

    /// Executes a message whose token has been checked.
    ///
    /// # Errors
    ///
    /// The reason for the refusal, to be shown to the viewer.
    pub(crate) fn carry_out(&self, viewer: u64, message: Message) -> Result<(), String> {
        let ended = |_| "the session has ended".to_string();
        match message {
            Message::Alive => self.role.sign_of_life(viewer),
            Message::TakeRole { .. } if !self.role.take(viewer) => {
                return Err("somebody else operates".into());
            }
            Message::TakeRole { .. } => {}
            Message::LeaveRole { .. } => self.role.leave(viewer),
            Message::EmergencyStop { .. } => self.desk.emergency_stop(),
            Message::Start { speed_mm_s, scenario, strategy, .. } => {
                let generation = self.operates(viewer)?;
                let strategy = command::strategy(&strategy)?;
                let course = self.offered.course(speed_mm_s, scenario)?;
                let mut feed = self.feed();
                feed.chosen.strategy = strategy;
                feed.chosen.course = course.unwrap_or_else(|| feed.chosen.course.clone());
                let choice = feed.chosen.clone();
                drop(feed);
                let start = Demand::Start { choice, generation, asked: Instant::now() };
                self.demands.send(start).map_err(ended)?;
            }
            Message::Course { speed_mm_s, scenario, .. } => {
                self.operates(viewer)?;
                let course = self.offered.course(speed_mm_s, scenario)?;
                let course = course.ok_or("a course is a speed or a scenario")?;
                self.feed().chosen.course = course;
            }
            Message::Strategy { strategy, .. } => {
                self.operates(viewer)?;
                let strategy = command::strategy(&strategy)?;
                self.feed().chosen.strategy = strategy;
                self.desk.choose(strategy);
            }
            Message::Stop { .. } => {
                self.operates(viewer)?;
                self.desk.stop();
            }
            Message::Reset { .. } => {
                let generation = self.operates(viewer)?;
                if !self.desk.reset_in(generation) {
                    return Err("no reset: an emergency stop came in between".into());
                }
            }
            Message::Fault { fault, .. } => {
                self.operates(viewer)?;
                self.demands.send(Demand::Fault(command::fault(&fault)?)).map_err(ended)?;
            }
            Message::Mend { .. } => {
                self.operates(viewer)?;
                self.demands.send(Demand::Mend).map_err(ended)?;
            }
        }
        Ok(())
    }

    /// The generation in which a viewer holds the operator's role, or the reason why it may not command.
    fn operates(&self, viewer: u64) -> Result<Generation, String> {
        let generation = self.role.generation(viewer);
        generation.ok_or_else(|| "only the operator may: take the role first".into())
    }
}
