//! A frame that is read, or simulated, while another is drawn.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use motes_particles::Particles;

/// The particles of each system; none of hidden ones.
pub(crate) type All = Vec<Option<Arc<Particles>>>;

/// The next frame: one is read at a time. `K` says which it is.
pub(crate) struct Ahead<K>(Arc<Mutex<Slot<K>>>);

struct Slot<K> {
    reading: bool,
    /// The last one that was read; without particles where that failed: whoever asks for it is told why.
    ready: Option<(K, Option<All>)>,
}

impl<K> Default for Ahead<K> {
    fn default() -> Self {
        Self(Arc::new(Mutex::new(Slot { reading: false, ready: None })))
    }
}

impl<K: Clone + PartialEq + Send + 'static> Ahead<K> {
    fn slot(&self) -> MutexGuard<'_, Slot<K>> {
        // A slot is whole after each step.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Begins to read a frame on a thread of its own, unless it is there or another is being read.
    pub fn begin(&self, key: K, read: impl FnOnce() -> Option<All> + Send + 'static) {
        let mut slot = self.slot();
        if slot.reading || slot.ready.as_ref().is_some_and(|(ready, _)| *ready == key) {
            return;
        }
        let (own, its) = (Self(self.0.clone()), key.clone());
        let thread = std::thread::Builder::new().name("next frame".into());
        let begun = thread.spawn(move || {
            let all = read();
            let mut slot = own.slot();
            (slot.reading, slot.ready) = (false, Some((its, all)));
        });
        match begun {
            Ok(_) => slot.reading = true,
            // It is read when it is drawn, then.
            Err(_) => slot.ready = Some((key, None)),
        }
    }

    /// Which frame is there.
    pub fn ready(&self) -> Option<K> {
        self.slot().ready.as_ref().map(|(key, _)| key.clone())
    }

    /// Takes a frame, if it is there.
    pub fn take(&self, key: &K) -> Option<All> {
        let taken = self.slot().ready.take_if(|(ready, _)| ready == key);
        taken.and_then(|(_, all)| all)
    }
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, Instant};

    use super::*;

    fn wait(ahead: &Ahead<usize>) -> Option<usize> {
        let until = Instant::now() + Duration::from_secs(10);
        while ahead.ready().is_none() && Instant::now() < until {
            std::thread::sleep(Duration::from_millis(1));
        }
        ahead.ready()
    }

    #[test]
    fn a_frame_is_read_once_and_taken_once() {
        let ahead = Ahead::default();
        let count = Arc::new(Mutex::new(0));
        for _ in 0..3 {
            let count = count.clone();
            ahead.begin(4, move || {
                *count.lock().unwrap() += 1;
                Some(vec![None])
            });
            assert_eq!(wait(&ahead), Some(4));
        }
        assert_eq!(*count.lock().unwrap(), 1);
        assert!(ahead.take(&5).is_none() && ahead.take(&4).is_some() && ahead.take(&4).is_none());
        ahead.begin(6, || None);
        assert_eq!(wait(&ahead), Some(6));
        assert!(ahead.take(&6).is_none() && ahead.ready().is_none());
    }
}
