//! Results that are kept for the next picture.

use std::sync::{Arc, Mutex, PoisonError};

/// The last results, each with what it was made of; as many as may be asked for in turn.
pub(crate) struct Memo<K, T> {
    kept: Mutex<Vec<(K, Arc<T>)>>,
    most: usize,
}

impl<K: PartialEq, T> Memo<K, T> {
    /// One that keeps so many results.
    pub fn new(most: usize) -> Self {
        Self { kept: Mutex::default(), most }
    }

    /// What is made of `key`, made now if it is not there. What was asked for longest ago is given up before.
    ///
    /// # Errors
    /// As `make`.
    pub fn get<E>(&self, key: K, make: impl FnOnce() -> Result<T, E>) -> Result<Arc<T>, E> {
        // A list is whole after each step.
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(at) = kept.iter().position(|(had, _)| *had == key) {
            let found = kept.remove(at);
            let value = found.1.clone();
            kept.push(found);
            return Ok(value);
        }
        while kept.len() >= self.most.max(1) {
            kept.remove(0);
        }
        let value = Arc::new(make()?);
        kept.push((key, value.clone()));
        Ok(value)
    }
}

/// The very same thing, not one like it.
pub(crate) struct Same<T: ?Sized>(pub Arc<T>);

impl<T: ?Sized> PartialEq for Same<T> {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

#[cfg(test)]
mod tests {
    use std::convert::Infallible;

    use super::*;

    #[test]
    fn a_result_is_made_once_and_the_oldest_goes() {
        let memo = Memo::new(2);
        let mut made = Vec::new();
        for key in [1, 1, 2, 1, 3, 1, 2] {
            let value = memo.get(key, || {
                made.push(key);
                Ok::<_, Infallible>(10 * key)
            });
            assert_eq!(*value.unwrap(), 10 * key);
        }
        assert_eq!(made, [1, 2, 3, 2]);
        assert_eq!(memo.get(9, || Err("no")), Err("no"));
    }

    #[test]
    fn like_is_not_the_same() {
        let one = Arc::new(1);
        assert!(Same(one.clone()) == Same(one.clone()) && Same(one) != Same(Arc::new(1)));
    }
}
