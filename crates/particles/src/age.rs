//! How long ago each particle of a series first appeared.
//!
//! The age of a particle is the time of its frame less that of the first frame with its identifier; in frames
//! where the series tells no time. For frame n, the identifiers of all frames before are read, once.

use std::collections::HashMap;

use crate::read::{Wanted, names};
use crate::{Column, Particles, Result, Values};

/// When the particles of a series first appeared, as far as it was looked at.
#[derive(Debug, Default)]
pub(crate) struct Ages {
    first: HashMap<i64, Moment>,
    /// How many frames, from the first one on, were looked at.
    seen: usize,
}

#[derive(Clone, Copy, Debug)]
struct Moment {
    frame: usize,
    time: Option<f64>,
}

impl Ages {
    /// What must be read for ages to be among what is `wanted`.
    pub fn wanted(wanted: &Wanted) -> Wanted {
        match wanted {
            Wanted::Only(columns) if wanted.wants(names::AGE) => {
                let also = [names::PARTICLE_IDENTIFIER.to_owned()];
                Wanted::Only(columns.iter().cloned().chain(also).collect())
            }
            _ => wanted.clone(),
        }
    }

    /// Gives the particles of `frame` their ages, if they have identifiers and no ages of their own. `read` gives
    /// earlier frames.
    ///
    /// # Errors
    /// What `read` does.
    pub fn give(
        &mut self,
        frame: usize,
        particles: &mut Particles,
        mut read: impl FnMut(usize, &Wanted) -> Result<Particles>,
    ) -> Result<()> {
        let has = |name: &str| particles.columns.iter().any(|c| names::same(&c.name, name));
        if has(names::AGE) || particles.column(names::PARTICLE_IDENTIFIER).is_none() {
            return Ok(());
        }
        let identifiers = Wanted::Only(vec![names::PARTICLE_IDENTIFIER.to_owned()]);
        for earlier in self.seen..frame {
            self.look(earlier, &read(earlier, &identifiers)?);
        }
        if frame == self.seen {
            self.look(frame, particles);
        }
        let now = Moment { frame, time: particles.time };
        let age = |id: i64| match self.first.get(&id) {
            Some(first) => match (now.time, first.time) {
                (Some(now), Some(first)) => now - first,
                _ => (now.frame - first.frame.min(now.frame)) as f64,
            },
            None => 0.0,
        };
        let ages: Vec<f64> = identifiers_of(particles).map(age).collect();
        particles.columns.push(Column::new(names::AGE, 1, Values::F64(ages)));
        Ok(())
    }

    /// Notes who is new in `frame`, the one after those looked at.
    fn look(&mut self, frame: usize, particles: &Particles) {
        let now = Moment { frame, time: particles.time };
        identifiers_of(particles).for_each(|id| {
            self.first.entry(id).or_insert(now);
        });
        self.seen = frame + 1;
    }
}

fn identifiers_of(particles: &Particles) -> impl Iterator<Item = i64> {
    let column = particles.column(names::PARTICLE_IDENTIFIER);
    column.into_iter().flat_map(|ids| {
        (0..ids.rows()).map(|row| match &ids.values {
            Values::I64(values) => values[row * ids.components],
            _ => ids.number(row, 0) as i64,
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(ids: &[i64], time: Option<f64>) -> Particles {
        Particles {
            positions: vec![[0.0; 3]; ids.len()],
            columns: vec![Column::new(names::PARTICLE_IDENTIFIER, 1, Values::I64(ids.to_vec()))],
            time,
            ..Particles::default()
        }
    }

    fn ages_of(ages: &mut Ages, at: usize, frames: &[Particles]) -> (Vec<f64>, Vec<usize>) {
        let (mut given, mut read) = (frames[at].clone(), Vec::new());
        let earlier = |earlier: usize, wanted: &Wanted| {
            assert!(wanted.wants(names::PARTICLE_IDENTIFIER) && !wanted.wants(names::VELOCITY));
            read.push(earlier);
            Ok(frames[earlier].clone())
        };
        ages.give(at, &mut given, earlier).unwrap();
        let column = given.column(names::AGE).unwrap();
        ((0..column.rows()).map(|row| column.number(row, 0)).collect(), read)
    }

    #[test]
    fn a_particle_is_as_old_as_its_identifier() {
        // 7 leaves and comes back; 9 is born in frame 1, 3 in frame 2; the order changes.
        let frames =
            [frame(&[5, 7], Some(1.0)), frame(&[9, 5], Some(1.5)), frame(&[7, 3, 9, 5], Some(4.0))];
        let mut ages = Ages::default();
        assert_eq!(ages_of(&mut ages, 2, &frames), (vec![3.0, 0.0, 2.5, 3.0], vec![0, 1]));
        // Each frame is looked at once; going back makes nobody older or younger.
        assert_eq!(ages_of(&mut ages, 1, &frames), (vec![0.0, 0.5], vec![]));
        assert_eq!(ages_of(&mut ages, 2, &frames), (vec![3.0, 0.0, 2.5, 3.0], vec![]));
    }

    #[test]
    fn without_time_frames_count() {
        let frames = [frame(&[1], None), frame(&[1, 2], None), frame(&[2, 1, 3], None)];
        let mut ages = Ages::default();
        assert_eq!(ages_of(&mut ages, 2, &frames), (vec![1.0, 2.0, 0.0], vec![0, 1]));
    }

    #[test]
    fn who_has_an_age_keeps_it_and_who_has_no_name_gets_none() {
        let mut own = frame(&[1], None);
        own.columns.push(Column::new("age", 1, Values::F32(vec![42.0])));
        let mut nameless = Particles { positions: vec![[0.0; 3]], ..Particles::default() };
        for particles in [&mut own, &mut nameless] {
            let columns = particles.columns.len();
            Ages::default().give(5, particles, |_, _| panic!("nothing is to be read")).unwrap();
            assert_eq!(particles.columns.len(), columns);
        }
    }
}
