#![allow(missing_docs)]
pub struct Selection;
impl Selection {
    pub fn contains(&self, _: u32) -> bool {
        true
    }
}
pub fn select(_: &str, _: &crate::Particles) -> Result<Selection, String> {
    Err("x".into())
}
