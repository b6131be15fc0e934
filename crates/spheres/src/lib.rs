//! spheres
