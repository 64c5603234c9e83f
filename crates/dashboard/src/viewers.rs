//! Places of viewers. A place is reserved before a connection is upgraded, and released when it ends.
//!
//! Some places are reserved for viewers with the token. Such a viewer always gets one. Where all are taken, it
//! replaces the oldest viewer without the token, else the oldest with it, but never the operator.

use crate::limits::Limits;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tokio::sync::Notify;

/// All places.
pub(crate) struct Viewers {
    places: usize,
    /// Places reserved for viewers with the token.
    with_token: usize,
    taken: Mutex<Taken>,
}

#[derive(Default)]
struct Taken {
    /// Number of the newest viewer.
    last: u64,
    /// Viewers by number, and so by time of arrival.
    viewers: BTreeMap<u64, Viewer>,
}

struct Viewer {
    has_token: bool,
    displaced: Arc<Notify>,
}

/// A viewer's place, released on drop.
pub(crate) struct Place {
    /// Number of the viewer.
    pub(crate) number: u64,
    /// Whether the viewer sent the token with its request.
    pub(crate) has_token: bool,
    displaced: Arc<Notify>,
    all: Arc<Viewers>,
}

impl Viewers {
    /// Places according to the limits, all free.
    pub(crate) fn new(limits: &Limits) -> Arc<Self> {
        let (places, with_token) = (limits.viewers, limits.with_token);
        Arc::new(Self { places, with_token, taken: Mutex::default() })
    }

    fn taken(&self) -> MutexGuard<'_, Taken> {
        // the map stays valid after a panic of another thread: it is only inserted into and removed from
        self.taken.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Number of viewers.
    pub(crate) fn count(&self) -> usize {
        self.taken().viewers.len()
    }

    /// Reserves a place for a viewer with or without the token; `operator` is never displaced. `None` if no place
    /// can be freed.
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
    /// Records that the viewer has sent the token with a message.
    pub(crate) fn present_token(&self) {
        if let Some(viewer) = self.all.taken().viewers.get_mut(&self.number) {
            viewer.has_token = true;
        }
    }

    /// Waits until another viewer takes over the place.
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
    fn places_are_reserved_for_the_token_and_freed_on_leaving() {
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
    fn a_viewer_with_the_token_replaces_the_oldest_without_the_role() {
        let all = viewers(4, 2);
        let operator = all.reserve(true, None).unwrap();
        let first = all.reserve(false, None).unwrap();
        let second = all.reserve(false, None).unwrap();
        let third = all.reserve(true, None).unwrap();
        // a token in a message counts like one in the request
        first.present_token();
        let mut late = Vec::new();
        for gone in [&second, &first, &third] {
            assert!(!is_displaced(gone));
            late.push(all.reserve(true, Some(operator.number)).unwrap());
            assert!(is_displaced(gone), "{}", gone.number);
            assert_eq!(all.count(), 4);
        }
        assert!(!is_displaced(&operator));
        // releasing a displaced viewer's place leaves the new holder's
        drop((first, second, third));
        assert_eq!(all.count(), 4);
        assert!(all.reserve(false, Some(operator.number)).is_none());
    }
}
