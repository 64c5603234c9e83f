//! Who operates: one viewer at a time, and only as long as it shows that it is there.

use hydroboom_realtime::desk::Desk;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// The operator's page says that it is there several times a second; after so long without, nobody
/// attends.
const PATIENCE: Duration = Duration::from_millis(1500);

/// The operator's role.
pub(crate) struct OperatorRole {
    desk: Arc<Desk>,
    holder: Mutex<Option<(u64, Instant)>>,
}

impl OperatorRole {
    /// Nobody operates yet.
    pub(crate) fn new(desk: Arc<Desk>) -> Self {
        desk.attend(0.0);
        Self { desk, holder: Mutex::new(None) }
    }

    fn holder(&self) -> std::sync::MutexGuard<'_, Option<(u64, Instant)>> {
        // a holder is whole whatever happened to the thread that wrote it
        self.holder.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The viewer that operates, if any.
    pub(crate) fn viewer(&self) -> Option<u64> {
        self.holder().filter(|(_, heard)| heard.elapsed() < PATIENCE).map(|(viewer, _)| viewer)
    }

    /// A viewer wants to operate; whether it may. It may not while another one does.
    pub(crate) fn take(&self, viewer: u64) -> bool {
        let mut holder = self.holder();
        let is_free =
            holder.is_none_or(|(now, heard)| now == viewer || heard.elapsed() >= PATIENCE);
        if is_free {
            *holder = Some((viewer, Instant::now()));
            self.desk.attend(PATIENCE.as_secs_f64());
        }
        is_free
    }

    /// A viewer says that it is there.
    pub(crate) fn hear(&self, viewer: u64) {
        let mut holder = self.holder();
        if let Some((now, heard)) = holder.as_mut()
            && *now == viewer
            && heard.elapsed() < PATIENCE
        {
            *heard = Instant::now();
            self.desk.attend(PATIENCE.as_secs_f64());
        }
    }

    /// A viewer gives the role back, or is gone.
    pub(crate) fn leave(&self, viewer: u64) {
        let mut holder = self.holder();
        if holder.is_some_and(|(now, _)| now == viewer) {
            *holder = None;
            self.desk.attend(0.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hydroboom_control::Strategy;

    #[test]
    fn one_viewer_operates_at_a_time_and_its_absence_is_noticed() {
        let desk = Arc::new(Desk::new(Strategy::BenchmarkClosedLoop));
        let role = OperatorRole::new(Arc::clone(&desk));
        assert!(!desk.is_attended());
        assert!(role.take(1) && desk.is_attended());
        assert!(!role.take(2), "two operators");
        role.leave(2);
        assert_eq!(role.viewer(), Some(1), "somebody else gave the role back");
        role.leave(1);
        assert!(!desk.is_attended());
        assert!(role.take(2));
        std::thread::sleep(PATIENCE + Duration::from_millis(50));
        assert!(!desk.is_attended() && role.viewer().is_none());
        // who was silent for too long has to ask again
        role.hear(2);
        assert!(!desk.is_attended());
        assert!(role.take(3));
    }
}
