//! Arrays of plain numbers on large pages.
//!
//! Writing to memory for the first time costs more than sorting it does: the system hands it out page
//! by page. Large arrays therefore ask for large pages, which also keeps addresses cheap to translate
//! while particles are scattered over hundreds of places.

use std::ops::{Deref, DerefMut};

use bytemuck::Pod;
use memmap2::MmapMut;

/// Arrays below this many bytes are ordinary ones.
const LEAST_MAPPED: usize = 1 << 22;

/// An array that derefs to a slice. A new one holds zeros.
#[derive(Debug)]
pub struct Pages<T> {
    store: Store<T>,
    len: usize,
}

#[derive(Debug)]
enum Store<T> {
    Heap(Vec<T>),
    Mapped(MmapMut),
}

impl<T: Pod> Pages<T> {
    /// An array without elements.
    pub const fn new() -> Self {
        Self { store: Store::Heap(Vec::new()), len: 0 }
    }

    /// An array of `len` zeros.
    pub fn zeroed(len: usize) -> Self {
        let bytes = len.saturating_mul(size_of::<T>());
        if bytes >= LEAST_MAPPED
            && align_of::<T>() <= 4096
            && let Ok(map) = MmapMut::map_anon(bytes)
        {
            // Where the system has no large pages, others do.
            #[cfg(target_os = "linux")]
            let _ = map.advise(memmap2::Advice::HugePage);
            return Self { store: Store::Mapped(map), len };
        }
        Self::zeroed_by_and_by(len)
    }

    /// An array of `len` zeros on ordinary pages: memory is taken no sooner than it is written to.
    pub fn zeroed_by_and_by(len: usize) -> Self {
        Self { store: Store::Heap(bytemuck::zeroed_vec(len)), len }
    }

    /// An array of `len` elements of any value, in the memory of this one where that suffices.
    pub fn reused(mut self, len: usize) -> Self {
        let capacity = self.capacity();
        // Much too large a memory is given back.
        if len > capacity || len < capacity / 4 {
            return Self::zeroed(len);
        }
        self.len = len;
        self
    }

    /// Makes it `len` long; what comes in addition has any value.
    pub fn grow(&mut self, len: usize) {
        if len > self.capacity() {
            let mut larger = Self::zeroed(len + len / 4);
            larger[..self.len].copy_from_slice(self);
            *self = larger;
        }
        self.len = self.len.max(len);
    }

    fn capacity(&self) -> usize {
        match &self.store {
            Store::Heap(elements) => elements.len(),
            Store::Mapped(map) => map.len() / size_of::<T>().max(1),
        }
    }

    /// Leaves out all but the first `len` elements.
    pub fn truncate(&mut self, len: usize) {
        self.len = self.len.min(len);
    }
}

impl<T: Pod> Deref for Pages<T> {
    type Target = [T];

    #[inline]
    fn deref(&self) -> &[T] {
        match &self.store {
            Store::Heap(elements) => &elements[..self.len],
            Store::Mapped(map) => bytemuck::cast_slice(&map[..self.len * size_of::<T>()]),
        }
    }
}

impl<T: Pod> DerefMut for Pages<T> {
    #[inline]
    fn deref_mut(&mut self) -> &mut [T] {
        match &mut self.store {
            Store::Heap(elements) => &mut elements[..self.len],
            Store::Mapped(map) => bytemuck::cast_slice_mut(&mut map[..self.len * size_of::<T>()]),
        }
    }
}

impl<T: Pod> Default for Pages<T> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Pod> Clone for Pages<T> {
    fn clone(&self) -> Self {
        let mut copy = Self::zeroed(self.len);
        copy.copy_from_slice(self);
        copy
    }
}

impl<T: Pod + PartialEq> PartialEq for Pages<T> {
    fn eq(&self, other: &Self) -> bool {
        self[..] == other[..]
    }
}

impl<'a, T: Pod> IntoIterator for &'a Pages<T> {
    type Item = &'a T;
    type IntoIter = std::slice::Iter<'a, T>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_and_large_arrays_are_the_same_to_their_users() {
        for len in [0, 1, 1000, LEAST_MAPPED / 4 + 5] {
            let mut array = Pages::<u32>::zeroed(len);
            assert_eq!(array.len(), len);
            assert!(array.iter().all(|v| *v == 0));
            array.iter_mut().enumerate().for_each(|(i, v)| *v = i as u32);
            assert!(array == array.clone());
            array.truncate(len / 2);
            assert!(array.iter().enumerate().all(|(i, v)| i == *v as usize));
            assert_eq!(array.reused(len).len(), len);
        }
    }
}
