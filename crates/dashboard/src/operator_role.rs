//! The operator's role: held by at most one viewer, and lost when its signs of life stop.

use hydroboom_realtime::desk::{Desk, Generation};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Time without a sign of life after which the operator counts as absent. The page sends several a second.
const ABSENT_AFTER: Duration = Duration::from_millis(1500);

/// The operator's role.
pub(crate) struct OperatorRole {
    desk: Arc<Desk>,
    holder: Mutex<Option<Holder>>,
}

#[derive(Clone, Copy)]
struct Holder {
    viewer: u64,
    last_sign: Instant,
}

impl OperatorRole {
    /// The role without a holder.
    pub(crate) fn new(desk: Arc<Desk>) -> Self {
        desk.leave_role();
        Self { desk, holder: Mutex::new(None) }
    }

    /// Locks the holder, after removing one whose signs of life have stopped.
    fn holder(&self) -> MutexGuard<'_, Option<Holder>> {
        // the holder is written in one assignment: it stays valid after a panic of another thread
        let mut holder = self.holder.lock().unwrap_or_else(PoisonError::into_inner);
        if holder.is_some_and(|holder| holder.last_sign.elapsed() >= ABSENT_AFTER) {
            *holder = None;
            self.desk.leave_role();
        }
        holder
    }

    /// The viewer that holds the role, if any.
    pub(crate) fn viewer(&self) -> Option<u64> {
        self.holder().map(|holder| holder.viewer)
    }

    /// The generation in which a viewer's requests are valid; `None` unless it holds the role. An emergency stop
    /// by any viewer starts a new generation.
    pub(crate) fn generation(&self, viewer: u64) -> Option<Generation> {
        let holder = self.holder();
        holder.filter(|holder| holder.viewer == viewer).map(|_| self.desk.generation())
    }

    /// Gives the role to a viewer if it is free; returns whether the viewer holds it then.
    pub(crate) fn take(&self, viewer: u64) -> bool {
        let mut holder = self.holder();
        match holder.as_ref() {
            Some(holder) => holder.viewer == viewer,
            None => {
                *holder = Some(Holder { viewer, last_sign: Instant::now() });
                self.desk.take_role(ABSENT_AFTER.as_secs_f64());
                true
            }
        }
    }

    /// Records a sign of life from a viewer.
    pub(crate) fn sign_of_life(&self, viewer: u64) {
        if let Some(holder) = self.holder().as_mut().filter(|holder| holder.viewer == viewer) {
            holder.last_sign = Instant::now();
            self.desk.attend(ABSENT_AFTER.as_secs_f64());
        }
    }

    /// Frees the role if this viewer holds it.
    pub(crate) fn leave(&self, viewer: u64) {
        let mut holder = self.holder();
        if holder.is_some_and(|holder| holder.viewer == viewer) {
            *holder = None;
            self.desk.leave_role();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hydroboom_control::strategy::Strategy;

    #[test]
    fn only_one_viewer_has_the_role_and_its_loss_is_detected() {
        let desk = Arc::new(Desk::new(Strategy::BenchmarkClosedLoop));
        let role = OperatorRole::new(Arc::clone(&desk));
        assert!(!desk.is_attended());
        assert!(role.take(1) && desk.is_attended());
        assert!(!role.take(2), "two operators");
        role.leave(2);
        assert_eq!(role.viewer(), Some(1), "somebody else gave the role back");
        let first = role.generation(1).unwrap();
        assert!(role.generation(2).is_none());
        // taking the role again and signs of life keep the generation
        assert!(role.take(1));
        role.sign_of_life(1);
        assert_eq!(role.generation(1), Some(first));
        role.leave(1);
        assert!(!desk.is_attended() && role.generation(1).is_none());
        assert!(desk.generation() != first);
        assert!(role.take(2));
        std::thread::sleep(ABSENT_AFTER + Duration::from_millis(50));
        assert!(!desk.is_attended() && role.viewer().is_none());
        // after a time-out a sign of life does not bring the role back
        role.sign_of_life(2);
        assert!(!desk.is_attended());
        let lost = desk.generation();
        assert!(role.take(3));
        assert!(role.generation(3).is_some_and(|now| now != lost && now != first));
    }
}
