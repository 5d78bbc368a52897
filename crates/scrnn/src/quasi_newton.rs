//! What L-BFGS is made of (Nocedal and Wright 2006, algorithms 7.4 and 3.5): the pairs that it remembers, and the search for a step.
//!
//! ```text
//! theta <- theta + t H g,   H from the last pairs s = theta' - theta, d = g - g'
//! enough:  f(theta + t p) - f(theta) >= 1e-4 t p^T g        the step gains a share of what its slope promises
//! level:   p^T g(theta + t p) <= 0.9 p^T g                  and the slope along it is nearly gone
//! ```
//!
//! Both conditions together (the weak Wolfe conditions) make the curvature s^T d of a pair positive. The step is doubled until it
//! no longer gains enough, and bisected from then on. f is climbed, not descended. Learning climbs in all parameters, recognition in
//! the initial state of each start.

/// A step must gain this share of what its slope promises (Armijo).
const GAIN: f64 = 1e-4;
/// A step must leave at most this share of the slope (curvature).
const SLOPE: f64 = 0.9;
/// Tries for a step.
const TRIES: usize = 25;
/// Length of the first try where there is no pair yet from which the scale is known.
const FIRST: f64 = 1e-3;

/// The last moves, and how the gradient changed along them.
#[derive(Debug, Clone)]
pub(crate) struct Pairs {
    /// Coordinates of theta.
    len: usize,
    /// The most pairs that are held.
    memory: usize,
    /// s and d, `[held, len]`, in a ring: row `next` is the oldest once all rows are there.
    moves: Vec<f64>,
    changes: Vec<f64>,
    held: usize,
    next: usize,
    along: Vec<f64>,
}

impl Pairs {
    /// Room for `memory` pairs of `len` values; no pair yet.
    pub fn new(len: usize, memory: usize) -> Self {
        let room = || Vec::with_capacity(memory * len);
        Self { len, memory, moves: room(), changes: room(), held: 0, next: 0, along: vec![0.0; memory] }
    }

    /// The number of pairs.
    pub fn held(&self) -> usize {
        self.held
    }

    /// Starts anew.
    pub fn forget(&mut self) {
        self.moves.clear();
        self.changes.clear();
        (self.held, self.next) = (0, 0);
    }

    /// Row of the pair that is `age` pairs older than the newest.
    fn row(&self, age: usize) -> std::ops::Range<usize> {
        let place = (self.next + self.memory - 1 - age) % self.memory;
        place * self.len..(place + 1) * self.len
    }

    /// H g (algorithm 7.4).
    pub fn direction(&mut self, gradient: &[f64], direction: &mut [f64]) {
        direction.copy_from_slice(gradient);
        for age in 0..self.held() {
            let (s, d) = (&self.moves[self.row(age)], &self.changes[self.row(age)]);
            let along = dot(s, direction) / dot(s, d);
            direction.iter_mut().zip(d).for_each(|(q, d)| *q -= along * d);
            self.along[age] = along;
        }
        if self.held() > 0 {
            let (s, d) = (&self.moves[self.row(0)], &self.changes[self.row(0)]);
            let scale = dot(s, d) / dot(d, d);
            direction.iter_mut().for_each(|q| *q *= scale);
        }
        for age in (0..self.held()).rev() {
            let (s, d) = (&self.moves[self.row(age)], &self.changes[self.row(age)]);
            let back = self.along[age] - dot(d, direction) / dot(s, d);
            direction.iter_mut().zip(s).for_each(|(q, s)| *q += back * s);
        }
    }

    /// Takes a pair up, in place of the oldest where all rows are there, unless it has no positive curvature.
    pub fn remember(&mut self, s: &[f64], d: &[f64]) {
        if dot(s, d) > f64::EPSILON * (dot(s, s) * dot(d, d)).sqrt() {
            for (rows, new) in [(&mut self.moves, s), (&mut self.changes, d)] {
                match rows.get_mut(self.next * self.len..(self.next + 1) * self.len) {
                    Some(oldest) => oldest.copy_from_slice(new),
                    None => rows.extend_from_slice(new),
                }
            }
            self.held = (self.held + 1).min(self.memory);
            self.next = (self.next + 1) % self.memory;
        }
    }

    /// s and d, `[held, len]`, and the row of the next pair.
    pub fn rows(&self) -> (&[f64], &[f64], usize) {
        (&self.moves, &self.changes, self.next)
    }

    /// Takes over the pairs of [`Self::rows`], of which the first `held` rows count.
    pub fn restore(&mut self, moves: &[f64], changes: &[f64], held: usize, next: usize) {
        self.forget();
        self.moves.extend_from_slice(&moves[..held * self.len]);
        self.changes.extend_from_slice(&changes[..held * self.len]);
        (self.held, self.next) = (held, next);
    }

    /// The first step to try in `direction`.
    pub fn first_step(&self, direction: &[f64]) -> f64 {
        if self.held() > 0 { 1.0 } else { FIRST / dot(direction, direction).sqrt() }
    }
}

/// The search for a step t along one direction.
#[derive(Debug, Clone)]
pub(crate) struct Search {
    /// Slope at t = 0.
    slope: f64,
    /// The step to try, and once the search has ended, to take.
    pub step: f64,
    /// Bounds on t.
    low: f64,
    high: f64,
    tries: usize,
    /// Gain and length of the best step that gained enough.
    best: Option<(f64, f64)>,
}

/// What comes after a try.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Next {
    /// Another try, with the new step.
    Try,
    /// The step just tried is the one to take.
    Take,
    /// No further try; an earlier step gained enough, and is the new step to take.
    GoBack,
    /// No further try; no step gained enough.
    Nothing,
}

impl Search {
    /// A search that begins with `step`; none where nothing can be gained along a direction of this slope.
    pub fn new(slope: f64, step: f64) -> Option<Self> {
        let possible = slope > 0.0 && step.is_finite();
        possible.then_some(Self { slope, step, low: 0.0, high: f64::INFINITY, tries: 0, best: None })
    }

    /// Judges the step that was tried by what it gained, which is not finite where a value or the gradient is not; the slope there is
    /// asked for only where it gained enough.
    pub fn judge(&mut self, gain: f64, slope_there: impl FnOnce() -> f64) -> Next {
        let tried = self.step;
        let enough = gain.is_finite() && gain >= GAIN * tried * self.slope;
        if enough {
            if self.best.is_none_or(|(best, _)| gain > best) {
                self.best = Some((gain, tried));
            }
            if slope_there() <= SLOPE * self.slope {
                return Next::Take;
            }
            self.low = tried;
        } else {
            self.high = tried;
        }
        self.tries += 1;
        let next = if self.high.is_finite() { 0.5 * (self.low + self.high) } else { 2.0 * tried };
        if self.tries < TRIES && next.is_finite() {
            self.step = next;
            return Next::Try;
        }
        match self.best {
            _ if enough => Next::Take,
            Some((_, step)) => {
                self.step = step;
                Next::GoBack
            }
            None => Next::Nothing,
        }
    }
}

/// Eight sums side by side, as wide as vectors get: the same bits on all of them.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (eights, rest) = a.as_chunks::<8>();
    let (others, other_rest) = b.as_chunks::<8>();
    let mut sums = [0.0; 8];
    for (a, b) in eights.iter().zip(others) {
        sums.iter_mut().zip(a.iter().zip(b)).for_each(|(sum, (a, b))| *sum += a * b);
    }
    sums.iter().sum::<f64>() + rest.iter().zip(other_rest).map(|(a, b)| a * b).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_direction_is_that_of_the_whole_matrix() {
        let len = 43;
        let number = |k: usize| (1.7 * k as f64 + 0.3).sin();
        // Five pairs for a memory of four: d = A s with a diagonal A has positive curvature.
        let mut own = Pairs::new(len, 4);
        let mut pairs = Vec::new();
        for k in 0..5 {
            let s: Vec<f64> = (0..len).map(|i| number(31 * k + i)).collect();
            let d: Vec<f64> = s.iter().enumerate().map(|(i, s)| (0.5 + (i % 7) as f64) * s).collect();
            own.remember(&s, &d);
            pairs.push((s, d));
        }
        assert_eq!((own.held(), own.next), (4, 1));
        let gradient: Vec<f64> = (0..len).map(|i| number(1000 + i)).collect();
        let mut direction = vec![0.0; len];
        own.direction(&gradient, &mut direction);

        // BFGS with the matrix written out: H <- (1 - r s d^T) H (1 - r d s^T) + r s s^T, r = 1 / s^T d.
        let (s, d) = &pairs[4];
        let mut matrix = nalgebra::DMatrix::<f64>::identity(len, len) * (dot(s, d) / dot(d, d));
        for (s, d) in &pairs[1..] {
            let (s, d) = (nalgebra::DVector::from_column_slice(s), nalgebra::DVector::from_column_slice(d));
            let r = 1.0 / s.dot(&d);
            let left = nalgebra::DMatrix::identity(len, len) - &s * d.transpose() * r;
            matrix = &left * matrix * left.transpose() + &s * s.transpose() * r;
        }
        let expected = matrix * nalgebra::DVector::from_column_slice(&gradient);
        for (found, expected) in direction.iter().zip(&expected) {
            assert!((found - expected).abs() < 1e-10 * expected.abs().max(1.0), "{found} and {expected}");
        }
    }

    #[test]
    fn a_pair_without_curvature_leaves_the_others_as_they_are() {
        let mut pairs = Pairs::new(3, 2);
        pairs.remember(&[1.0, 0.0, 0.0], &[2.0, 0.0, 0.0]);
        pairs.remember(&[0.0, 1.0, 0.0], &[0.0, 4.0, 0.0]);
        let mut before = [0.0; 3];
        pairs.direction(&[1.0, 1.0, 1.0], &mut before);
        for d in [[0.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 0.0, f64::NAN]] {
            pairs.remember(&[0.0, 0.0, 1.0], &d);
            let mut after = [0.0; 3];
            pairs.direction(&[1.0, 1.0, 1.0], &mut after);
            assert_eq!((after, pairs.held()), (before, 2));
        }
    }

    /// Searches along f, which is 0 at t = 0, with its slope; the steps tried, and how it ended.
    fn search(first: f64, f: impl Fn(f64) -> (f64, f64)) -> (Vec<f64>, Next, f64) {
        let mut search = Search::new(f(0.0).1, first).unwrap();
        let mut tried = Vec::new();
        loop {
            tried.push(search.step);
            let (gain, slope) = f(search.step);
            let next = search.judge(gain, || slope);
            if next != Next::Try {
                return (tried, next, search.step);
            }
        }
    }

    #[test]
    fn a_step_grows_and_shrinks_until_it_gains_enough_and_is_level() {
        // f = t - t^2 / 2, at its top at t = 1.
        let hill = |t: f64| (t - 0.5 * t * t, 1.0 - t);
        assert_eq!(search(0.5, hill), (vec![0.5], Next::Take, 0.5));
        assert_eq!(search(0.01, hill), (vec![0.01, 0.02, 0.04, 0.08, 0.16], Next::Take, 0.16));
        assert_eq!(search(4.0, hill), (vec![4.0, 2.0, 1.0], Next::Take, 1.0));
        assert!(Search::new(0.0, 1.0).is_none() && Search::new(f64::NAN, 1.0).is_none());
        assert!(Search::new(1.0, f64::INFINITY).is_none());
    }

    #[test]
    fn where_no_step_is_level_the_best_that_gained_enough_is_taken() {
        // A slope that never falls, up to an edge behind which there are no numbers.
        let mut gone_back = 0;
        for edge in [1.1, 1.3, 1.7, 5.0, 9.3] {
            let (tried, next, step) = search(1.0, |t| if t < edge { (t, 1.0) } else { (f64::NAN, f64::NAN) });
            assert_eq!(tried.len(), TRIES);
            let best = tried.iter().copied().filter(|t| *t < edge).fold(0.0, f64::max);
            assert_eq!(step, best, "{edge}");
            assert_eq!(next, if tried[TRIES - 1] < edge { Next::Take } else { Next::GoBack });
            gone_back += usize::from(next == Next::GoBack);
        }
        assert!(gone_back > 0, "the edges end all searches on their near side");
        // Nothing gained at all.
        assert_eq!(search(1.0, |t| (-t, 1.0)).1, Next::Nothing);
    }
}
