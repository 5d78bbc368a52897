//! Files that are damaged at random, for all readers' tests.

/// Bytes that a reader may hold beyond its budget: a window of zstd, and a vector that grows.
const BESIDE: u64 = 24 << 20;

/// A linear congruential generator (Knuth's constants): the same numbers everywhere.
pub struct Random(pub u64);

impl Random {
    /// A number below `bound`.
    pub fn below(&mut self, bound: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 33) as usize) % bound
    }
}

/// Runs `read` on the bytes with one to four of them changed, `runs` times (`SCRNN_FLIPS` says another number), and on
/// their beginnings. It must not panic, and must not hold more than `budget` bytes and a little more.
pub fn damage(bytes: &[u8], runs: usize, budget: u64, read: impl Fn(&[u8])) {
    let runs = std::env::var("SCRNN_FLIPS").ok().and_then(|runs| runs.parse().ok()).unwrap_or(runs);
    let bounded = |bytes: &[u8]| {
        let held = allocation_counter::measure(|| read(bytes)).bytes_max;
        assert!(held <= 2 * budget + BESIDE, "{held} bytes held");
    };
    let mut random = Random(7);
    for _ in 0..runs {
        let mut damaged = bytes.to_vec();
        for _ in 0..=random.below(4) {
            let place = random.below(damaged.len());
            damaged[place] = random.below(256) as u8;
        }
        bounded(&damaged);
    }
    for part in 0..100 {
        bounded(&bytes[..bytes.len() * part / 100]);
    }
}
