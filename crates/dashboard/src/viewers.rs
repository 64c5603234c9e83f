//! Places of viewers. One is reserved before a connection becomes a viewer's, and given back when it ends.
//!
//! Viewers without the token leave some places free. Who presents the token always gets one: where all are taken,
//! the viewer makes room that has been there longest and does not operate, one without the token before one with it.

use crate::limits::Limits;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tokio::sync::Notify;

/// All places.
pub(crate) struct Viewers {
    places: usize,
    /// Places that are left free by viewers without the token.
    with_token: usize,
    taken: Mutex<Taken>,
}

#[derive(Default)]
struct Taken {
    /// Number of the newest viewer.
    last: u64,
    /// By number, and so in the order in which they came.
    viewers: BTreeMap<u64, Viewer>,
}

struct Viewer {
    has_token: bool,
    displaced: Arc<Notify>,
}

/// A viewer's place; given back when dropped.
pub(crate) struct Place {
    /// Number of the viewer.
    pub(crate) number: u64,
    /// Whether it came with the token.
    pub(crate) has_token: bool,
    displaced: Arc<Notify>,
    all: Arc<Viewers>,
}

impl Viewers {
    /// As many places as the limits say, all of them free.
    pub(crate) fn new(limits: &Limits) -> Arc<Self> {
        let (places, with_token) = (limits.viewers, limits.with_token);
        Arc::new(Self { places, with_token, taken: Mutex::default() })
    }

    fn taken(&self) -> MutexGuard<'_, Taken> {
        // a list is whole whatever happened to the thread that had it
        self.taken.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// How many there are.
    pub(crate) fn count(&self) -> usize {
        self.taken().viewers.len()
    }

    /// A place for a viewer who came with the token or without, while somebody operates or nobody does; none where
    /// there is none.
    pub(crate) fn reserve(
        self: &Arc<Self>,
        has_token: bool,
        operator: Option<u64>,
    ) -> Option<Place> {
        let mut taken = self.taken();
        if has_token && taken.viewers.len() >= self.places {
            let others = taken.viewers.iter().filter(|(number, _)| Some(**number) != operator);
            let (number, _) = others.min_by_key(|(number, v)| (v.has_token, **number))?;
            let number = *number;
            taken.viewers.remove(&number)?.displaced.notify_one();
        }
        let without = taken.viewers.values().filter(|viewer| !viewer.has_token).count();
        let is_free = taken.viewers.len() < self.places
            && (has_token || without + self.with_token < self.places);
        if !is_free {
            return None;
        }
        taken.last += 1;
        let (number, displaced) = (taken.last, Arc::new(Notify::new()));
        taken.viewers.insert(number, Viewer { has_token, displaced: Arc::clone(&displaced) });
        Some(Place { number, has_token, displaced, all: Arc::clone(self) })
    }
}

impl Place {
    /// The viewer has sent the token with a message.
    pub(crate) fn present_token(&self) {
        if let Some(viewer) = self.all.taken().viewers.get_mut(&self.number) {
            viewer.has_token = true;
        }
    }

    /// Waits until another viewer has the place.
    pub(crate) async fn displaced(&self) {
        self.displaced.notified().await;
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.all.taken().viewers.remove(&self.number);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn viewers(places: usize, with_token: usize) -> Arc<Viewers> {
        Viewers::new(&Limits { viewers: places, with_token, ..Limits::default() })
    }

    fn is_displaced(place: &Place) -> bool {
        let displaced = !place.all.taken().viewers.contains_key(&place.number);
        let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build().unwrap();
        let told = runtime.block_on(async {
            tokio::time::timeout(std::time::Duration::ZERO, place.displaced()).await.is_ok()
        });
        assert_eq!(displaced, told);
        told
    }

    #[test]
    fn viewers_without_the_token_leave_places_free_and_a_place_is_given_back() {
        let all = viewers(4, 1);
        let mut some: Vec<_> = (0..10).map(|_| all.reserve(false, None)).collect();
        assert_eq!(some.iter().flatten().count(), 3);
        let with = all.reserve(true, None).unwrap();
        assert_eq!(all.count(), 4);
        drop(with);
        some.clear();
        assert_eq!(all.count(), 0);
        let number = all.reserve(false, None).unwrap().number;
        assert!(number > 4, "numbers are not used again");
    }

    #[test]
    fn who_presents_the_token_gets_the_place_of_who_has_been_there_longest_without_the_role() {
        let all = viewers(4, 2);
        let operator = all.reserve(true, None).unwrap();
        let first = all.reserve(false, None).unwrap();
        let second = all.reserve(false, None).unwrap();
        let third = all.reserve(true, None).unwrap();
        // by a message, which counts as much
        first.present_token();
        let mut late = Vec::new();
        for gone in [&second, &first, &third] {
            assert!(!is_displaced(gone));
            late.push(all.reserve(true, Some(operator.number)).unwrap());
            assert!(is_displaced(gone), "{}", gone.number);
            assert_eq!(all.count(), 4);
        }
        assert!(!is_displaced(&operator));
        // who was displaced takes nobody else's place away when it has gone
        drop((first, second, third));
        assert_eq!(all.count(), 4);
        assert!(all.reserve(false, Some(operator.number)).is_none());
    }
}
