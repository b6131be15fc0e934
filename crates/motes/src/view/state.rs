//! What one client wants to see: its scene, how it came to be, and whether it is moving.

use motes_scene::Scene;

use super::play::Running;
use crate::session::same_sources;
use crate::{Error, Result};

/// Changes that can be undone.
const MOST: usize = 200;

/// What one client wants to see.
#[derive(Debug)]
pub(super) struct State {
    scene: Scene,
    /// Scenes before, the latest last; and those that were undone.
    past: Vec<Scene>,
    future: Vec<Scene>,
    /// The scene before a gesture that has not ended.
    gesture: Option<Scene>,
    /// The size of what is drawn, pixels.
    pub size: (u32, u32),
    /// Number of the last change of any kind.
    pub number: u32,
    /// What runs, if frame follows frame.
    pub running: Option<Running>,
}

impl State {
    pub fn new(scene: Scene) -> Self {
        let size = (scene.image.width, scene.image.height);
        let (past, future) = (Vec::new(), Vec::new());
        Self { scene, past, future, gesture: None, size, number: 1, running: None }
    }

    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The scene at the size of what is drawn.
    pub fn seen(&self) -> Scene {
        let mut scene = self.scene.clone();
        (scene.image.width, scene.image.height) = self.size;
        scene
    }

    /// Whether a gesture goes on.
    pub fn moving(&self) -> bool {
        self.gesture.is_some()
    }

    /// How many changes can be undone, and redone.
    pub fn steps(&self) -> (usize, usize) {
        (self.past.len() + usize::from(self.gesture.is_some()), self.future.len())
    }

    /// Changes the scene as a whole; `ends` if the gesture that this belongs to ends with it.
    ///
    /// # Errors
    /// The scene makes no sense, or has other sources; nothing is changed then.
    pub fn change(&mut self, scene: Scene, ends: bool) -> Result<()> {
        scene.check()?;
        if !same_sources(&scene, &self.scene) {
            let message = "the sources of a view cannot change; begin another one for these";
            return Err(Error::Usage(message.into()));
        }
        let before = std::mem::replace(&mut self.scene, scene);
        let before = self.gesture.take().unwrap_or(before);
        if ends {
            self.remember(before);
        } else {
            self.gesture = Some(before);
        }
        self.changed();
        Ok(())
    }

    fn remember(&mut self, before: Scene) {
        if before == self.scene {
            return;
        }
        if self.past.len() == MOST {
            self.past.remove(0);
        }
        self.past.push(before);
        self.future.clear();
    }

    /// Takes the last change back.
    ///
    /// # Errors
    /// There is none.
    pub fn undo(&mut self) -> Result<()> {
        let before = match self.gesture.take() {
            Some(before) => before,
            None => self.past.pop().ok_or_else(|| Error::Usage("nothing to undo".into()))?,
        };
        self.future.push(std::mem::replace(&mut self.scene, before));
        self.changed();
        Ok(())
    }

    /// Makes the change again that was taken back last.
    ///
    /// # Errors
    /// There is none.
    pub fn redo(&mut self) -> Result<()> {
        let after = self.future.pop().ok_or_else(|| Error::Usage("nothing to redo".into()))?;
        if let Some(before) = self.gesture.take() {
            self.past.push(before);
        }
        self.past.push(std::mem::replace(&mut self.scene, after));
        self.changed();
        Ok(())
    }

    /// Goes to a frame, which is no change of the scene that could be undone.
    pub fn go_to(&mut self, frame: u32) {
        self.scene.image.frame = frame;
        self.changed();
    }

    /// Makes the camera stand where it does, which looks the same and cannot be undone.
    pub fn settle(&mut self, stand: impl FnOnce(&mut motes_scene::Camera)) {
        stand(&mut self.scene.camera);
    }

    /// Gives the systems of all scenes, before and after too, other sources.
    pub fn rename(&mut self, rename: &dyn Fn(&str) -> String) {
        let all = self.past.iter_mut().chain(&mut self.future).chain(&mut self.gesture);
        for system in all.chain([&mut self.scene]).flat_map(|scene| &mut scene.system) {
            system.source = rename(&system.source);
        }
        self.changed();
    }

    /// Something is to be drawn anew.
    pub fn changed(&mut self) {
        self.number = self.number.wrapping_add(1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with(fov: f64) -> Scene {
        let mut scene = Scene::default();
        scene.camera.fov = fov;
        scene
    }

    #[test]
    fn a_gesture_is_one_step() {
        let mut state = State::new(with(10.0));
        for fov in [11.0, 12.0, 13.0] {
            state.change(with(fov), false).unwrap();
            assert!(state.moving() && state.steps() == (1, 0));
        }
        state.change(with(14.0), true).unwrap();
        assert!(!state.moving() && state.steps() == (1, 0));
        state.change(with(20.0), true).unwrap();
        assert_eq!(state.steps(), (2, 0));
        state.undo().unwrap();
        assert_eq!((state.scene().camera.fov, state.steps()), (14.0, (1, 1)));
        state.undo().unwrap();
        assert_eq!((state.scene().camera.fov, state.steps()), (10.0, (0, 2)));
        assert!(state.undo().is_err());
        state.redo().unwrap();
        state.redo().unwrap();
        assert!(state.redo().is_err());
        assert_eq!((state.scene().camera.fov, state.steps()), (20.0, (2, 0)));
    }

    #[test]
    fn a_change_ends_what_was_undone_and_none_is_no_step() {
        let mut state = State::new(with(10.0));
        state.change(with(10.0), true).unwrap();
        assert_eq!(state.steps(), (0, 0));
        state.change(with(11.0), true).unwrap();
        state.undo().unwrap();
        state.change(with(12.0), false).unwrap();
        assert_eq!(state.steps(), (1, 1));
        state.undo().unwrap();
        assert_eq!(state.scene().camera.fov, 10.0);
        state.change(with(13.0), true).unwrap();
        assert_eq!(state.steps(), (1, 0));
    }

    #[test]
    fn nonsense_and_other_sources_change_nothing() {
        let mut state = State::new(with(10.0));
        let number = state.number;
        assert!(state.change(with(-1.0), true).is_err());
        let mut other = with(11.0);
        other.set_sources(&["elsewhere".into()]);
        assert!(state.change(other, true).is_err());
        assert_eq!((state.number, state.scene()), (number, &with(10.0)));
    }

    #[test]
    fn the_past_is_bounded() {
        let mut state = State::new(with(10.0));
        for i in 0..2 * MOST {
            state.change(with(11.0 + i as f64 / 10.0), true).unwrap();
        }
        assert_eq!(state.steps(), (MOST, 0));
    }
}
