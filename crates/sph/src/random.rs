//! Random numbers by hash, for tests: the same everywhere.

/// Uniform in 0..1, of `seed` and `n` (SplitMix64).
pub(crate) fn uniform(seed: u64, n: u64) -> f32 {
    let mut z = seed.wrapping_add(n.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 40) as f32 / (1u64 << 24) as f32
}

/// Points in the box from 0 to `size`, coordinate by coordinate, with room for whole vectors behind.
pub(crate) fn points(count: usize, size: [f32; 3]) -> [Vec<f32>; 3] {
    std::array::from_fn(|a| {
        let mut row: Vec<f32> = (0..count).map(|i| uniform(a as u64, i as u64) * size[a]).collect();
        row.resize(crate::pairs::padded(count), 0.0);
        row
    })
}
