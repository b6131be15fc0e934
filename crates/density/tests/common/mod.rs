//! Particles for tests, the same each time.

/// Numbers from 0 to 1.
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> f32 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1 << 24) as f32
    }
}

/// Particles of different radii, dense in the middle.
#[allow(dead_code)]
pub fn cloud(count: usize, seed: u64) -> (Vec<[f32; 3]>, Vec<f32>) {
    let mut random = Random(seed);
    let positions = (0..count).map(|_| {
        let mut along = || 2.0 * (random.next() + random.next() + random.next()) / 3.0;
        [along(), along(), along() - 5.0]
    });
    let positions = positions.collect();
    let radii = (0..count).map(|_| 0.03 + 0.05 * random.next()).collect();
    (positions, radii)
}

/// A block of liquid, `side` particles along its edge, a wave on it, and drops above; of this radius.
#[allow(dead_code)]
pub fn dam(side: usize) -> (Vec<[f32; 3]>, f32) {
    let mut random = Random(1);
    let spacing = 1.0 / side as f32;
    let mut positions = Vec::new();
    for i in 0..side * side * side {
        let cell = [i % side, i / side % side, i / (side * side)];
        let mut p = cell.map(|c| (c as f32 + 0.5 + 0.3 * (random.next() - 0.5)) * spacing);
        p[2] *= 0.8 + 0.2 * (6.0 * p[0]).sin() * (4.0 * p[1]).cos();
        positions.push(p);
    }
    for _ in 0..side {
        positions.push([random.next(), random.next(), 1.1 + 0.5 * random.next()]);
    }
    (positions, 0.5 * spacing)
}
