"""The simple models: the mean of a label, linear prediction from four samples, the nearest learned sequence."""

import numpy as np

import measures
from method import Method


def at_share(sequence, length):
    """A sequence brought to `length` steps on straight lines."""
    if len(sequence) == length:
        return sequence
    places = np.linspace(0, len(sequence) - 1, length)
    return np.stack([np.interp(places, np.arange(len(sequence)), channel) for channel in sequence.T], axis=1)


class ClassMean(Method):
    """Mean and variance of a label's learned sequences at each share of their length."""

    seeds = (1,)

    def fit(self, task, seed, quick):
        sequences, labels = task.part(task.learned)
        self.length = int(np.median([len(s) for s in sequences]))
        floor = 1e-4 * np.concatenate(sequences).var(axis=0)
        self.models = {}
        for label in sorted(set(labels)):
            own = np.stack([at_share(s, self.length) for s, other in zip(sequences, labels, strict=True) if other == label])
            # (n + 1) / n: the mean itself was estimated.
            variance = own.var(axis=0, ddof=1) * (1 + 1 / len(own))
            self.models[label] = own.mean(axis=0), variance + floor

    def model(self, label, length):
        mean, variance = self.models[label]
        return at_share(mean, length), at_share(variance, length)

    def one_step(self, sequences, labels):
        return [self.model(label, len(s)) for s, label in zip(sequences, labels, strict=True)]

    def ahead(self, sequences, labels, steps):
        return self.one_step(sequences, labels)

    def complete(self, observed, length, label, copies, rng):
        mean, variance = (x[len(observed):] for x in self.model(label, length))
        return mean, variance, mean + np.sqrt(variance) * rng.standard_normal((copies, *mean.shape))

    def recognise(self, sequences):
        told = []
        for s in sequences:
            scores = {label: measures.nll(s, *self.model(label, len(s))).mean() for label in self.models}
            told.append(min(scores, key=scores.get))
        return told


def ridge(x, y, strength):
    """Least squares with a constant, x standardised; gives a function and the residuals' covariance."""
    mean, scale = x.mean(axis=0), x.std(axis=0) + 1e-12
    z = (x - mean) / scale
    offset = y.mean(axis=0)
    gram = z.T @ z + strength * len(z) * np.eye(z.shape[1])
    weights = np.linalg.solve(gram, z.T @ (y - offset))
    freedom = max(len(z) - z.shape[1] - 1, 1)
    residual = y - offset - z @ weights
    return (lambda new: (new - mean) / scale @ weights + offset), residual.T @ residual / freedom


class Linear(Method):
    """Vector autoregression on the last four samples, one for all labels; ten steps ahead has a regression of its own."""

    seeds = (1,)
    lags = 4

    def design(self, sequences, steps):
        x, y = [], []
        for s in sequences:
            for t in range(self.lags, len(s) - steps + 1):
                x.append(s[t - self.lags : t].ravel())
                y.append(s[t + steps - 1])
        return np.array(x), np.array(y)

    def trained(self, task, steps):
        fitting, validation = (task.part(p)[0] for p in (task.fitting(), task.validation))
        best = (np.inf, None)
        for strength in 10.0 ** np.arange(-12, 0):
            predict, covariance = ridge(*self.design(fitting, steps), strength)
            x, y = self.design(validation, steps)
            best = min(best, (measures.nll(y, predict(x), np.diag(covariance)).mean(), strength))
        return (*ridge(*self.design(task.part(task.learned)[0], steps), best[1]), best[1])

    def fit(self, task, seed, quick):
        self.next, self.covariance, self.strength = self.trained(task, 1)
        long = [s for s in task.part(task.learned)[0] if len(s) > self.lags + measures.AHEAD + 1]
        self.far = self.trained(task, measures.AHEAD) if len(long) == len(task.learned) else None

    def one_step(self, sequences, labels):
        out = []
        for s in sequences:
            mean = np.full_like(s, np.nan)
            mean[self.lags:] = self.next(np.array([s[t - self.lags : t].ravel() for t in range(self.lags, len(s))]))
            out.append((mean, np.broadcast_to(np.diag(self.covariance), s.shape)))
        return out

    def ahead(self, sequences, labels, steps):
        if self.far is None or steps != measures.AHEAD:
            return None
        out = []
        for s in sequences:
            mean = np.full_like(s, np.nan)
            first = self.lags + steps - 1
            mean[first:] = self.far[0](np.array([s[t - self.lags : t].ravel() for t in range(self.lags, len(s) - steps + 1)]))
            out.append((mean, np.broadcast_to(np.diag(self.far[1]), s.shape)))
        return out

    def roll(self, observed, steps, copies, rng):
        window = np.repeat(observed[None, -self.lags:], copies, axis=0)
        root = np.linalg.cholesky(self.covariance + 1e-12 * np.eye(len(self.covariance))) if rng is not None else None
        path = []
        for _ in range(steps):
            new = self.next(window.reshape(copies, -1))
            if rng is not None:
                new = new + rng.standard_normal(new.shape) @ root.T
            new = np.clip(new, -1e6, 1e6)
            path.append(new)
            window = np.concatenate([window[:, 1:], new[:, None]], axis=1)
        return np.stack(path, axis=1)

    def complete(self, observed, length, label, copies, rng):
        samples = self.roll(observed, length - len(observed), copies, rng)
        return (*measures.moments(samples), samples)

    def beyond(self, observed, length, label, steps):
        return self.roll(observed, length - len(observed) + steps, 1, None)[0, length - len(observed):]

    def notes(self):
        return {"ridge": self.strength}


class Nearest(Method):
    """1-NN: the learned sequence that is nearest by DTW; completion goes on as the one whose beginning is nearest."""

    seeds = (1,)

    def fit(self, task, seed, quick):
        self.sequences, self.labels = task.part(task.learned)
        self.scale = np.concatenate(self.sequences).std(axis=0) + 1e-12
        # Its variance: how far the rest of each learned sequence is from that of its nearest learned neighbour.
        errors = {}
        for i, (s, label) in enumerate(zip(self.sequences, self.labels, strict=True)):
            rest = self.rest(s[: task.seen(s)], len(s), label, without=i)
            errors.setdefault(label, []).append(at_share((s[task.seen(s):] - rest) ** 2, 50))
        self.spread = {label: np.mean(e, axis=0) for label, e in errors.items()}
        floor = 1e-4 * self.scale**2
        # Smoothed over a fifth of the rest: few sequences, and their errors vary slowly.
        kernel = np.ones(11) / 11
        for label, e in self.spread.items():
            padded = np.pad(e, ((5, 5), (0, 0)), mode="edge")
            self.spread[label] = np.stack([np.convolve(c, kernel, "valid") for c in padded.T], axis=1) + floor

    def rest(self, observed, length, label, without=None):
        best = (np.inf, None)
        for i, (s, other) in enumerate(zip(self.sequences, self.labels, strict=True)):
            if other != label or i == without:
                continue
            whole = at_share(s, length)
            distance = np.mean(((whole[: len(observed)] - observed) / self.scale) ** 2)
            best = min(best, (distance, i))
        return at_share(self.sequences[best[1]], length)[len(observed):]

    def complete(self, observed, length, label, copies, rng):
        mean = self.rest(observed, length, label)
        return mean, at_share(self.spread[label], len(mean)), None

    def recognise(self, sequences):
        scaled = [s / self.scale for s in self.sequences]
        every = 2 if min(len(s) for s in scaled) > 80 else 1
        told = []
        for s in sequences:
            distances = [measures.dtw(s[::every] / self.scale, other[::every]) for other in scaled]
            told.append(self.labels[int(np.argmin(distances))])
        return told
