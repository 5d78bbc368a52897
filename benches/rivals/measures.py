"""What is measured. Every figure is in the data's own units; nll is in nats per step and channel.

A method gives means and variances as arrays of steps x channels, and samples as copies x steps x channels.
"""

import numpy as np

BURN_IN = 4  # one step ahead is scored from the fifth sample on, so that four lags are there for everybody
AHEAD = 10


def nll(sample, mean, variance):
    """Gaussian nll of each sample."""
    variance = np.maximum(variance, 1e-12)
    return 0.5 * (np.log(2 * np.pi * variance) + (sample - mean) ** 2 / variance)


def covered(sample, mean, variance, deviations):
    return np.abs(sample - mean) <= deviations * np.sqrt(np.maximum(variance, 1e-12))


def dtw(a, b):
    """Euclidean distance along the cheapest warping path (steps 1,0 / 0,1 / 1,1), over the number of steps of `a`."""
    distance = np.sqrt(np.maximum((a**2).sum(1)[:, None] + (b**2).sum(1)[None] - 2 * a @ b.T, 0.0))
    n, m = distance.shape
    # One antidiagonal at a time. Cell (i, d - i) of diagonal d stands at i + 1, so that index 0 lies outside.
    before, last = np.full(n + 1, np.inf), np.full(n + 1, np.inf)
    before[0] = 0.0
    for d in range(n + m - 1):
        rows = np.arange(max(0, d - m + 1), min(n - 1, d) + 1)
        cost = np.full(n + 1, np.inf)
        cost[rows + 1] = distance[rows, d - rows] + np.minimum(np.minimum(before[rows], last[rows]), last[rows + 1])
        before, last = last, cost
    return float(last[n] / n)


def jerk(path):
    """Root mean square of the third difference, of the last axis but one."""
    return float(np.sqrt(np.mean(np.diff(path, n=3, axis=-2) ** 2)))


def pooled(scores):
    """Means over sequences of figures that are means over a sequence's steps."""
    keys = scores[0].keys()
    return {key: float(np.mean([score[key] for score in scores if score[key] is not None])) for key in keys if scores[0][key] is not None}


def one_step(sequences, predictions, first=BURN_IN):
    """`predictions[s]` = mean, variance of every sample of sequence s given those before it; rows before `first` are not read."""
    scores = []
    for sequence, (mean, variance) in zip(sequences, predictions, strict=True):
        if len(sequence) <= first:
            continue
        sample, mean, variance = sequence[first:], mean[first:], variance[first:]
        scores.append({
            "nll": nll(sample, mean, variance).mean(),
            "cover1": covered(sample, mean, variance, 1).mean(),
            "cover2": covered(sample, mean, variance, 2).mean(),
            "rmse": np.sqrt(((sample - mean) ** 2).sum(axis=1).mean()),
        })
    return pooled(scores)


def completion(task, sequences, completions, beyonds):
    """`completions[s]` = mean, variance, samples of what follows the observed part; `beyonds[s]` = 1000 more steps, or None."""
    scores, worst = [], -np.inf
    for sequence, (mean, variance, samples), beyond in zip(sequences, completions, beyonds, strict=True):
        rest = sequence[task.seen(sequence):]
        error = rest - mean
        score = {
            "nll": nll(rest, mean, variance).mean(),
            "cover1": covered(rest, mean, variance, 1).mean(),
            "cover2": covered(rest, mean, variance, 2).mean(),
            "rmse": np.sqrt((error**2).sum(axis=1).mean()),
            "dtw": dtw(rest, mean),
            "end": np.linalg.norm(error[-1]),
            "jerk_of_samples": None if samples is None or len(rest) < 4 else jerk(samples) / jerk(rest),
            "leaves": None,
        }
        if task.ends and beyond is not None:
            # How far it ever is from where the demonstration came to rest, in the 1000 steps after.
            score["leaves"] = float(np.linalg.norm(beyond - sequence[-1], axis=1).max())
        scores.append(score)
        worst = max(worst, score["nll"])
    result = pooled(scores)
    result["worst_nll"] = float(worst)
    return result


def moments(samples, variances=None):
    """Mean and variance of a mixture of copies: what each predicted, or the spread of the samples alone."""
    mean = samples.mean(axis=0)
    variance = samples.var(axis=0, ddof=1)
    return mean, variance if variances is None else variance + variances.mean(axis=0)


def accuracy(labels, told):
    return float(np.mean([a == b for a, b in zip(labels, told, strict=True)]))
