//! Sequence lock: newest value of one writer for any number of readers, between threads or processes.

use std::sync::atomic::{AtomicU64, Ordering, fence};

/// Attempts of a reader before it gives up.
const TRIES: usize = 16;

/// Sequence lock of atomics: `N` words of 64 bits that are read together or not at all, so that any bytes in shared
/// memory are valid. The writer never waits; a reader makes a bounded number of attempts.
#[repr(C)]
#[derive(Debug)]
pub struct Slot<const N: usize> {
    /// Odd during a write.
    version: AtomicU64,
    words: [AtomicU64; N],
}

impl<const N: usize> Default for Slot<N> {
    fn default() -> Self {
        Self { version: AtomicU64::new(0), words: [const { AtomicU64::new(0) }; N] }
    }
}

impl<const N: usize> Slot<N> {
    /// Publishes `words` as the newest value. There must be one writer only.
    pub fn publish(&self, words: [u64; N]) {
        let version = self.version.load(Ordering::Relaxed) & !1;
        self.version.store(version | 1, Ordering::Relaxed);
        // the odd version becomes visible before any of the words
        fence(Ordering::Release);
        for (word, value) in self.words.iter().zip(words) {
            word.store(value, Ordering::Relaxed);
        }
        // another process may have left any number in the version: wrap instead of overflow
        self.version.store(version.wrapping_add(2), Ordering::Release);
    }

    /// Newest value and its version, which grows by two with each. None before the first value, and if a
    /// write is in progress in each of 16 attempts (or was interrupted for good).
    pub fn read(&self) -> Option<(u64, [u64; N])> {
        for _ in 0..TRIES {
            let version = self.version.load(Ordering::Acquire);
            if version == 0 {
                return None;
            }
            if version & 1 == 1 {
                std::hint::spin_loop();
                continue;
            }
            let words = std::array::from_fn(|i| self.words[i].load(Ordering::Relaxed));
            // the words are read before the version is read again
            fence(Ordering::Acquire);
            if self.version.load(Ordering::Relaxed) == version {
                return Some((version, words));
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    #[test]
    fn any_version_left_by_another_process_is_continued() {
        let slot = Slot::<1>::default();
        for left in [u64::MAX, u64::MAX - 1, 7] {
            slot.version.store(left, Ordering::Relaxed);
            slot.publish([1]);
            slot.publish([2]);
            assert_eq!(slot.read().map(|(_, words)| words), Some([2]));
        }
    }

    #[test]
    fn a_reader_never_sees_parts_of_two_values() {
        let slot = Arc::new(Slot::<8>::default());
        assert!(slot.read().is_none());
        let count = 200_000_u64;
        let writer = {
            let slot = Arc::clone(&slot);
            std::thread::spawn(move || (1..=count).for_each(|k| slot.publish([k; 8])))
        };
        let mut last = 0;
        while last < count {
            if let Some((version, words)) = slot.read() {
                assert!(words.iter().all(|w| *w == words[0]), "{words:?}");
                assert_eq!(version, 2 * words[0]);
                assert!(words[0] >= last, "an older value after a newer one");
                last = words[0];
            }
        }
        writer.join().unwrap();
    }
}
