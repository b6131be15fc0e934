//! All visits, by their keys.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use serde_json::{Map, Value};

use crate::Exhibit;
use crate::guard;
use crate::visit::Visit;

/// Views at once.
const MOST: usize = 32;
/// How long a view without a client keeps what can be made again.
const AWAKE: Duration = Duration::from_secs(60);
/// How long a view lives without a client.
const KEPT: Duration = Duration::from_secs(600);

/// All visits of an exhibit.
pub(crate) struct Hall {
    exhibit: Arc<dyn Exhibit>,
    visits: Mutex<HashMap<String, Arc<Visit>>>,
}

impl Hall {
    pub fn new(exhibit: Arc<dyn Exhibit>) -> Self {
        Self { exhibit, visits: Mutex::default() }
    }

    /// The visit called `key`, or a new one where there is none. May take a while.
    ///
    /// # Errors
    /// What is told to the client.
    pub fn enter(&self, key: Option<&str>) -> Result<Arc<Visit>, String> {
        self.tidy();
        if let Some(visit) = key.and_then(|key| self.find(key)) {
            return Ok(visit);
        }
        self.make_room()?;
        let view = self.exhibit.open()?;
        let key = guard::token().map_err(|e| e.to_string())?;
        let visit = Visit::begin(key.clone(), view).map_err(|e| e.to_string())?;
        self.visits().insert(key, visit.clone());
        Ok(visit)
    }

    /// The visit called `key`.
    pub fn find(&self, key: &str) -> Option<Arc<Visit>> {
        self.visits().get(key).cloned()
    }

    /// Ends visits whose client has been away for long.
    pub fn tidy(&self) {
        let mut over = Vec::new();
        self.visits().retain(|_, visit| {
            let stays = visit.empty_for().is_none_or(|time| time < KEPT);
            if !stays {
                over.push(visit.clone());
            }
            stays
        });
        over.iter().for_each(|visit| visit.close(None));
        let all: Vec<_> = self.visits().values().cloned().collect();
        all.iter().for_each(|visit| visit.rest(AWAKE));
    }

    /// Ends all visits, with a last message.
    pub fn close(&self, last: &Map<String, Value>) {
        let visits = std::mem::take(&mut *self.visits());
        visits.values().for_each(|visit| visit.close(Some(last.clone())));
    }

    /// Where all places are taken, the one left first is free.
    fn make_room(&self) -> Result<(), String> {
        let mut visits = self.visits();
        if visits.len() < MOST {
            return Ok(());
        }
        let left = visits.iter().filter_map(|(key, v)| Some((v.empty_for()?, key.clone())));
        let Some((_, key)) = left.max() else {
            return Err(format!("there are {MOST} views already"));
        };
        let gone = visits.remove(&key);
        drop(visits);
        gone.iter().for_each(|visit| visit.close(None));
        Ok(())
    }

    fn visits(&self) -> MutexGuard<'_, HashMap<String, Arc<Visit>>> {
        self.visits.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
