//! The polish of each sequence's best start: L-BFGS ([`quasi_newton`](crate::quasi_newton)) on z, u_0 = mean + s z, until nothing is
//! left to gain.
//!
//! Adam's rate ends on a cosine, wherever the state is by then. In a dozen or some dozens of dimensions L-BFGS finds the top of the
//! hill that it stands on in some tens of updates. The columns of all sequences are evaluated side by side, each at the step that its
//! own search asks for.

use super::{Problem, Recognition};
use crate::objective::{Evaluation, Objective, Want};
use crate::quasi_newton::{Next, Pairs, Search, dot};

/// Updates that are remembered.
pub(super) const MEMORY: usize = 20;
/// Updates whose gain says whether anything is left: a single one may be short by chance.
const WINDOW: usize = 10;

/// How the polish of a start ended.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Polish {
    /// Updates of L-BFGS.
    pub updates: u64,
    /// What they gained, in nats per step and channel.
    pub gain: f64,
    /// Whether it converged: the last ten updates together gained at most the tolerance, or no step gained anything any more.
    /// If not, it ran out of updates, or the start never had a likelihood.
    pub converged: bool,
}

/// Polishes the first trial of each result.
pub(super) fn polish(problem: &Problem<'_>, objective: &mut dyn Objective, results: &mut [Recognition]) {
    if problem.options.polish == 0 {
        return;
    }
    let able = |(_, result): &(usize, &mut Recognition)| result.trials[0].ln_joint().is_finite();
    let mut results: Vec<(usize, &mut Recognition)> = results.iter_mut().enumerate().filter(able).collect();
    for some in results.chunks_mut(problem.columns_at_a_time()) {
        let mut columns: Vec<Column> =
            some.iter().map(|(s, result)| Column::new(problem, *s, &result.trials[0].initial_state)).collect();
        climb(problem, objective, &mut columns);
        for ((_, result), column) in some.iter_mut().zip(columns) {
            let best = &mut result.trials[0];
            best.initial_state = column.best.state;
            (best.ln_likelihood, best.ln_prior) = (column.best.ln_likelihood, column.best.ln_prior);
            best.error = column.best.squared_error / (2.0 * column.terms);
            result.polish = column.polish;
        }
    }
}

/// Evaluates the columns until all have come to an end.
fn climb(problem: &Problem<'_>, objective: &mut dyn Objective, columns: &mut [Column]) {
    let mut found = Evaluation::new(&problem.network.topology);
    let mut running: Vec<&mut Column> = columns.iter_mut().collect();
    while !running.is_empty() {
        let runs = problem.runs(running.iter().map(|column| column.sequence));
        let mut states = Vec::new();
        // Those that have ended are left out once they are half of what is computed.
        let count = running.len();
        while 2 * running.iter().filter(|column| !column.ended).count() > count {
            states.clear();
            states.extend(running.iter().flat_map(|column| &column.tried.state));
            objective.evaluate(&runs, &states, Want::InitialStates, &mut found);
            for (index, column) in running.iter_mut().enumerate().filter(|(_, column)| !column.ended) {
                column.take(problem, &found, index);
            }
        }
        running.retain(|column| !column.ended);
    }
}

/// A place and what it is worth.
#[derive(Debug, Clone)]
struct Place {
    /// u_0.
    state: Vec<f64>,
    ln_likelihood: f64,
    ln_prior: f64,
    squared_error: f64,
    /// ln L_all per step and channel.
    value: f64,
    /// Its slopes in z, of the units that are looked for.
    gradient: Vec<f64>,
}

/// One start on its way.
struct Column {
    sequence: usize,
    /// Steps times channels.
    terms: f64,
    best: Place,
    tried: Place,
    direction: Vec<f64>,
    pairs: Pairs,
    search: Option<Search>,
    /// Whether the search has ended with a step that is to be evaluated once more.
    goes_back: bool,
    /// Values before the last updates, in a ring.
    before: [f64; WINDOW],
    polish: Polish,
    ended: bool,
}

impl Column {
    fn new(problem: &Problem<'_>, sequence: usize, state: &[f64]) -> Self {
        let len = problem.units().count();
        let place = Place {
            state: state.to_vec(),
            ln_likelihood: f64::NEG_INFINITY,
            ln_prior: f64::NEG_INFINITY,
            squared_error: f64::INFINITY,
            value: f64::NEG_INFINITY,
            gradient: vec![0.0; len],
        };
        Self {
            sequence,
            terms: problem.terms(sequence),
            best: place.clone(),
            tried: place,
            direction: vec![0.0; len],
            pairs: Pairs::new(len, MEMORY),
            search: None,
            goes_back: false,
            before: [f64::NEG_INFINITY; WINDOW],
            polish: Polish::default(),
            ended: false,
        }
    }

    /// Takes in what was found at `tried`, and says where to try next.
    fn take(&mut self, problem: &Problem<'_>, found: &Evaluation, index: usize) {
        let tried = &mut self.tried;
        tried.ln_likelihood = found.ln_likelihood[index];
        tried.ln_prior = problem.ln_prior(&tried.state);
        tried.squared_error = found.squared_error[index];
        tried.value = (tried.ln_likelihood + tried.ln_prior) / self.terms;
        let n_c = problem.mean.len();
        let initial = &found.initial[index * n_c..(index + 1) * n_c];
        for (g, i) in tried.gradient.iter_mut().zip(problem.units()) {
            *g = problem.slope(i, initial[i], tried.state[i]) / self.terms;
        }
        let sound = tried.gradient.iter().all(|g| g.is_finite());
        let Some(search) = &mut self.search else {
            // Where it begins.
            self.best = self.tried.clone();
            self.ended = !sound;
            return self.turn(problem);
        };
        let next = match self.goes_back {
            true => Next::Take,
            false => {
                let gain = if sound { self.tried.value - self.best.value } else { f64::NAN };
                search.judge(gain, || dot(&self.tried.gradient, &self.direction))
            }
        };
        self.goes_back = next == Next::GoBack;
        match next {
            Next::Try | Next::GoBack => self.attempt(problem),
            Next::Take => {
                let step = search.step;
                self.move_there(step);
                self.turn(problem);
            }
            Next::Nothing if self.pairs.held() > 0 => {
                self.pairs.forget();
                self.turn(problem);
            }
            Next::Nothing => (self.ended, self.polish.converged) = (true, true),
        }
    }

    /// Makes an update of the step that was tried.
    fn move_there(&mut self, step: f64) {
        let s: Vec<f64> = self.direction.iter().map(|p| step * p).collect();
        let d: Vec<f64> =
            self.best.gradient.iter().zip(&self.tried.gradient).map(|(here, there)| here - there).collect();
        self.pairs.remember(&s, &d);
        self.before[self.polish.updates as usize % WINDOW] = self.best.value;
        self.polish.gain += self.tried.value - self.best.value;
        self.polish.updates += 1;
        self.best.clone_from(&self.tried);
    }

    /// Chooses a direction and the first step along it, or ends.
    fn turn(&mut self, problem: &Problem<'_>) {
        if self.ended {
            return;
        }
        self.pairs.direction(&self.best.gradient, &mut self.direction);
        let slope = dot(&self.best.gradient, &self.direction);
        self.search = Search::new(slope, self.pairs.first_step(&self.direction));
        // The oldest value of the ring is the one that the next update replaces.
        let gained = self.best.value - self.before[self.polish.updates as usize % WINDOW];
        if gained <= problem.options.tolerance || self.search.is_none() && self.pairs.held() == 0 {
            (self.ended, self.polish.converged) = (true, true);
        } else if self.polish.updates >= problem.options.polish {
            self.ended = true;
        } else if self.search.is_none() {
            // Pairs that lead astray: once more without them.
            self.pairs.forget();
            self.turn(problem);
        } else {
            self.attempt(problem);
        }
    }

    /// Goes to the step that the search asks for.
    fn attempt(&mut self, problem: &Problem<'_>) {
        let Some(search) = &self.search else { return };
        let scale = problem.scale() * search.step;
        for (p, i) in self.direction.iter().zip(problem.units()) {
            self.tried.state[i] = self.best.state[i] + scale * p;
        }
    }
}
