"""Gaussian mixture regression (`gmr`): of position over time, and of the next step on position and velocity."""

import warnings

import numpy as np
from gmr import GMM

import measures
from method import Method
from simple import at_share


class Regression:
    """A mixture over (x, y), fitted by `gmr`, conditioned on x for many rows at once."""

    def __init__(self, x, y, components, seed, floor=1e-7):
        joint = np.concatenate([x, y], axis=1)
        self.offset, self.scale = joint.mean(axis=0), joint.std(axis=0) + 1e-12
        joint = (joint - self.offset) / self.scale
        gmm = GMM(n_components=components, random_state=seed)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            gmm.from_samples(joint, n_iter=60, init_params="kmeans++")
        self.n = x.shape[1]
        self.parts = []
        for prior, mean, covariance in zip(gmm.priors, gmm.means, gmm.covariances, strict=True):
            if not np.isfinite(covariance).all() or prior < 1e-6:
                continue
            covariance = covariance + floor * np.eye(len(covariance))
            xx, yx = covariance[: self.n, : self.n], covariance[self.n :, : self.n]
            gain = np.linalg.solve(xx, yx.T).T
            rest = covariance[self.n :, self.n :] - gain @ yx.T
            root = np.linalg.cholesky(rest + 1e-9 * np.eye(len(rest)))
            whitening = np.linalg.inv(np.linalg.cholesky(xx))
            level = np.log(prior) + np.log(np.diag(whitening)).sum()
            self.parts.append((level, mean[: self.n], mean[self.n :], gain, root, whitening))
        if not self.parts:
            raise FloatingPointError("no component is left")

    def responsibilities(self, x):
        z = (x - self.offset[: self.n]) / self.scale[: self.n]
        logs = np.stack([level - 0.5 * ((((z - mx) @ w.T) ** 2).sum(axis=1)) for level, mx, _, _, _, w in self.parts], axis=1)
        logs -= logs.max(axis=1, keepdims=True)
        shares = np.exp(logs)
        shares /= shares.sum(axis=1, keepdims=True)
        means = np.stack([my + (z - mx) @ gain.T for _, mx, my, gain, _, _ in self.parts], axis=1)
        return shares, means

    def moments(self, x):
        shares, means = self.responsibilities(x)
        mean = np.einsum("tk,tkc->tc", shares, means)
        own = np.stack([(root**2).sum(axis=1) for _, _, _, _, root, _ in self.parts])
        variance = shares @ own + np.einsum("tk,tkc->tc", shares, (means - mean[:, None]) ** 2)
        scale = self.scale[self.n :]
        return mean * scale + self.offset[self.n :], variance * scale**2

    def sample(self, x, rng):
        shares, means = self.responsibilities(x)
        chosen = (shares.cumsum(axis=1) > rng.random((len(x), 1))).argmax(axis=1)
        roots = np.stack([root for _, _, _, _, root, _ in self.parts])[chosen]
        y = means[np.arange(len(x)), chosen] + np.einsum("tab,tb->ta", roots, rng.standard_normal((len(x), roots.shape[1])))
        return y * self.scale[self.n :] + self.offset[self.n :]


def fitted(x, y, components, seed, floor=1e-7):
    """With fewer components where so many cannot be fitted."""
    while True:
        try:
            return Regression(x, y, components, seed, floor)
        except (np.linalg.LinAlgError, FloatingPointError, ValueError):
            if components == 1:
                raise
            components = max(1, components - 2)


def by_label(sequences, labels):
    return {label: [s for s, other in zip(sequences, labels, strict=True) if other == label] for label in sorted(set(labels))}


class TimeGMR(Method):
    """Position over the share of the time that has passed; the number of components by the validation part."""

    def fit(self, task, seed, quick):
        best = (np.inf, None)
        validation = by_label(*task.part(task.validation))
        for count in (3, 5, 8, 12, 18):
            models = self.models_of(by_label(*task.part(task.fitting())), count, seed)
            score = np.mean([measures.nll(s, *self.at(models[label], len(s))).mean() for label, own in validation.items() for s in own])
            best = min(best, (float(score), count))
        self.count = best[1]
        self.models = self.models_of(by_label(*task.part(task.learned)), self.count, seed)

    @staticmethod
    def models_of(groups, count, seed):
        models = {}
        for label, own in groups.items():
            time = np.concatenate([np.linspace(0, 1, len(s)) for s in own])[:, None]
            models[label] = fitted(time, np.concatenate(own), count, seed)
        return models

    @staticmethod
    def at(model, length):
        return model.moments(np.linspace(0, 1, length)[:, None])

    def one_step(self, sequences, labels):
        return [self.at(self.models[label], len(s)) for s, label in zip(sequences, labels, strict=True)]

    def ahead(self, sequences, labels, steps):
        return self.one_step(sequences, labels)

    def complete(self, observed, length, label, copies, rng):
        mean, variance = (x[len(observed) :] for x in self.at(self.models[label], length))
        return mean, variance, mean + np.sqrt(variance) * rng.standard_normal((copies, *mean.shape))

    def recognise(self, sequences):
        told = []
        for s in sequences:
            scores = {label: measures.nll(s, *self.at(model, len(s))).mean() for label, model in self.models.items()}
            told.append(min(scores, key=scores.get))
        return told

    def notes(self):
        return {"components": self.count}


class DynamicsGMR(Method):
    """The next displacement on position and the last displacement; components and a floor of their covariances by the validation part's nll."""

    def fit(self, task, seed, quick):
        self.models, self.counts = {}, {}
        for steps in (1, measures.AHEAD):
            if min(len(task.sequences[i]) for i in task.learned) <= steps + 3:
                continue
            best = (np.inf, None)
            validation = by_label(*task.part(task.validation))
            fitting = by_label(*task.part(task.fitting()))
            for count in (1, 2, 4, 8, 14) if task.sequences[0].shape[1] < 8 else (1, 2, 3):
                for floor in (1e-7, 1e-3, 1e-2, 0.1):
                    models = {label: fitted(*self.rows(own, steps), count, seed, floor) for label, own in fitting.items()}
                    scores = []
                    for label, own in validation.items():
                        x, y = self.rows(own, steps)
                        scores.append(measures.nll(y, *models[label].moments(x)).mean())
                    best = min(best, (float(np.mean(scores)), (count, floor)))
            self.counts[steps] = best[1]
            learned = by_label(*task.part(task.learned))
            self.models[steps] = {label: fitted(*self.rows(own, steps), best[1][0], seed, best[1][1]) for label, own in learned.items()}

    @staticmethod
    def rows(sequences, steps):
        x = np.concatenate([np.concatenate([s[1:-steps], np.diff(s, axis=0)[:-steps]], axis=1) for s in sequences])
        y = np.concatenate([s[1 + steps :] - s[1:-steps] for s in sequences])
        return x, y

    def one_step(self, sequences, labels):
        return self.ahead(sequences, labels, 1)

    def ahead(self, sequences, labels, steps):
        if steps not in self.models:
            return None
        out = []
        for s, label in zip(sequences, labels, strict=True):
            mean, variance = np.full_like(s, np.nan), np.full_like(s, np.nan)
            if len(s) > steps + 1:
                x, _ = self.rows([s], steps)
                step, spread = self.models[steps][label].moments(x)
                mean[1 + steps :], variance[1 + steps :] = s[1:-steps] + step, spread
            out.append((mean, variance))
        return out

    def roll(self, observed, steps, label, copies, rng):
        x, d = np.repeat(observed[-1:], copies, axis=0), np.repeat(observed[-1:] - observed[-2:-1], copies, axis=0)
        model, path = self.models[1][label], []
        for _ in range(steps):
            now = np.concatenate([x, d], axis=1)
            d = model.moments(now)[0] if rng is None else model.sample(now, rng)
            x = x + d
            path.append(x)
        return np.stack(path, axis=1)

    def complete(self, observed, length, label, copies, rng):
        samples = self.roll(observed, length - len(observed), label, copies, rng)
        return (*measures.moments(samples), samples)

    def beyond(self, observed, length, label, steps):
        return self.roll(observed, length - len(observed) + steps, label, 1, None)[0, length - len(observed) :]

    def recognise(self, sequences):
        told = []
        for s in sequences:
            x, y = self.rows([s], 1)
            scores = {label: measures.nll(y, *model.moments(x)).mean() for label, model in self.models[1].items()}
            told.append(min(scores, key=scores.get))
        return told

    def notes(self):
        return {"components_and_floor": {str(k): v for k, v in self.counts.items()}}
