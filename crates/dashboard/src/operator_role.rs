//! Who operates: one viewer at a time, and only as long as it shows that it is there.

use hydroboom_realtime::desk::{Desk, Generation};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// The operator's page says that it is there several times a second; after so long without, nobody
/// attends.
const PATIENCE: Duration = Duration::from_millis(1500);

/// The operator's role.
pub(crate) struct OperatorRole {
    desk: Arc<Desk>,
    holder: Mutex<Option<Holder>>,
}

#[derive(Clone, Copy)]
struct Holder {
    viewer: u64,
    heard: Instant,
}

impl OperatorRole {
    /// Nobody operates yet.
    pub(crate) fn new(desk: Arc<Desk>) -> Self {
        desk.leave_role();
        Self { desk, holder: Mutex::new(None) }
    }

    /// Who holds the role; nobody any more who was silent for too long.
    fn holder(&self) -> MutexGuard<'_, Option<Holder>> {
        // a holder is whole whatever happened to the thread that wrote it
        let mut holder = self.holder.lock().unwrap_or_else(PoisonError::into_inner);
        if holder.is_some_and(|holder| holder.heard.elapsed() >= PATIENCE) {
            *holder = None;
            self.desk.leave_role();
        }
        holder
    }

    /// The viewer that operates, if any.
    pub(crate) fn viewer(&self) -> Option<u64> {
        self.holder().map(|holder| holder.viewer)
    }

    /// The generation in which a viewer makes its requests; none unless it operates. An emergency stop by somebody
    /// else changes it.
    pub(crate) fn generation(&self, viewer: u64) -> Option<Generation> {
        let holder = self.holder();
        holder.filter(|holder| holder.viewer == viewer).map(|_| self.desk.generation())
    }

    /// A viewer wants to operate; whether it may. It may not while another one does.
    pub(crate) fn take(&self, viewer: u64) -> bool {
        let mut holder = self.holder();
        match holder.as_ref() {
            Some(holder) => holder.viewer == viewer,
            None => {
                *holder = Some(Holder { viewer, heard: Instant::now() });
                self.desk.take_role(PATIENCE.as_secs_f64());
                true
            }
        }
    }

    /// A viewer says that it is there.
    pub(crate) fn hear(&self, viewer: u64) {
        if let Some(holder) = self.holder().as_mut().filter(|holder| holder.viewer == viewer) {
            holder.heard = Instant::now();
            self.desk.attend(PATIENCE.as_secs_f64());
        }
    }

    /// A viewer gives the role back, or is gone.
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
    fn one_viewer_operates_at_a_time_and_its_absence_is_noticed() {
        let desk = Arc::new(Desk::new(Strategy::BenchmarkClosedLoop));
        let role = OperatorRole::new(Arc::clone(&desk));
        assert!(!desk.is_attended());
        assert!(role.take(1) && desk.is_attended());
        assert!(!role.take(2), "two operators");
        role.leave(2);
        assert_eq!(role.viewer(), Some(1), "somebody else gave the role back");
        let first = role.generation(1).unwrap();
        assert!(role.generation(2).is_none());
        // asked for again, and heard, it is the same operator's
        assert!(role.take(1));
        role.hear(1);
        assert_eq!(role.generation(1), Some(first));
        role.leave(1);
        assert!(!desk.is_attended() && role.generation(1).is_none());
        assert!(desk.generation() != first);
        assert!(role.take(2));
        std::thread::sleep(PATIENCE + Duration::from_millis(50));
        assert!(!desk.is_attended() && role.viewer().is_none());
        // who was silent for too long has to ask again
        role.hear(2);
        assert!(!desk.is_attended());
        let lost = desk.generation();
        assert!(role.take(3));
        assert!(role.generation(3).is_some_and(|now| now != lost && now != first));
    }
}
