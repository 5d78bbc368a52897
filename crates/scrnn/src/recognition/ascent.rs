//! Adam on z of each column, u_0 = mean + s z, each of which keeps the best state that it has met.

use super::{Origin, Problem, Recognition, Trial};
use crate::objective::{Evaluation, Objective, Want};

/// Decay of the first moment.
const BETA_1: f64 = 0.9;
/// Added to the root of the second.
const EPSILON: f64 = 1e-8;

/// Moves the waiting columns uphill, and adds what they ended in to the results of their sequences.
pub(super) fn ascend(
    problem: &Problem<'_>,
    objective: &mut dyn Objective,
    waiting: &mut Vec<Origin>,
    results: &mut [Recognition],
) {
    if waiting.is_empty() {
        return;
    }
    let options = problem.options;
    let sequences: Vec<usize> = waiting.iter().map(|origin| origin.sequence).collect();
    let terms: Vec<f64> = sequences.iter().map(|&s| problem.terms(s)).collect();
    let mut states: Vec<f64> = waiting.iter().flat_map(|origin| &origin.state).copied().collect();
    let begin = |Origin { start, state, .. }| Trial {
        start,
        ln_prior: problem.ln_prior(&state),
        initial_state: state,
        ln_likelihood: f64::NEG_INFINITY,
        error: f64::INFINITY,
    };
    let mut best: Vec<Trial> = waiting.drain(..).map(begin).collect();
    let runs = problem.runs(sequences.iter().copied());
    let mut found = Evaluation::new(&problem.network.topology);
    let (mut first, mut second) = (vec![0.0; states.len()], vec![0.0; states.len()]);
    let (n_c, s) = (problem.mean.len(), problem.scale());
    for epoch in 0..=options.epochs {
        let want = if epoch < options.epochs { Want::InitialStates } else { Want::Score };
        objective.evaluate(&runs, &states, want, &mut found);
        let phase = std::f64::consts::PI * epoch as f64 / options.epochs.max(1) as f64;
        let rate = options.rate * 0.5 * (1.0 + phase.cos());
        let correct = |beta: f64| 1.0 / (1.0 - beta.powf(epoch as f64 + 1.0));
        let (correct_first, correct_second) = (correct(BETA_1), correct(options.beta2));
        for (index, best) in best.iter_mut().enumerate() {
            let own = index * n_c..(index + 1) * n_c;
            let ln_likelihood = found.ln_likelihood[index];
            let ln_prior = problem.ln_prior(&states[own.clone()]);
            let ln_joint = ln_likelihood + ln_prior;
            if !ln_joint.is_finite() {
                // Out of bounds: back to the best, at rest.
                states[own.clone()].copy_from_slice(&best.initial_state);
                first[own.clone()].fill(0.0);
                second[own].fill(0.0);
                continue;
            }
            if ln_joint > best.ln_joint() {
                (best.ln_likelihood, best.ln_prior) = (ln_likelihood, ln_prior);
                best.error = found.squared_error[index] / (2.0 * terms[index]);
                best.initial_state.copy_from_slice(&states[own.clone()]);
            }
            for at in own {
                let i = at % n_c;
                if !problem.learns[i] {
                    continue;
                }
                let g = problem.slope(i, found.initial[at], states[at]) / terms[index];
                first[at] = BETA_1 * first[at] + (1.0 - BETA_1) * g;
                second[at] = options.beta2 * second[at] + (1.0 - options.beta2) * g * g;
                let step = first[at] * correct_first / ((second[at] * correct_second).sqrt() + EPSILON);
                states[at] += s * rate * step;
            }
        }
    }
    for (s, trial) in sequences.into_iter().zip(best) {
        results[s].trials.push(trial);
    }
}
