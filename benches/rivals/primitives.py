"""Movement primitives: ProMP with everything chosen leave-one-out, and DMP. One model for each label, told label and length."""

import numpy as np

import measures
from method import Method
from simple import at_share


def basis(length, count):
    """Normalised Gaussian bumps over the phase, steps x count."""
    phase = np.linspace(0, 1, length)
    centres = np.linspace(0, 1, count)
    width = 1.0 / max(count - 1, 1)
    bumps = np.exp(-0.5 * ((phase[:, None] - centres) / width) ** 2)
    return bumps / bumps.sum(axis=1, keepdims=True)


class Prior:
    """Weights ~ N(mean, covariance), channel by channel in one vector; samples = basis weights + noise."""

    def __init__(self, weights, ridge, noise):
        self.count, self.channels = weights.shape[1], weights.shape[2]
        flat = weights.transpose(0, 2, 1).reshape(len(weights), -1)
        self.mean = flat.mean(axis=0)
        deviations = flat - self.mean
        covariance = deviations.T @ deviations / max(len(flat) - 1, 1)
        # A ridge in each channel's own scale.
        spread = np.repeat(np.diag(covariance).reshape(self.channels, -1).mean(axis=1), self.count)
        self.covariance = covariance * (1 + 1 / len(flat)) + ridge * np.diag(spread + 1e-9)
        self.noise = noise
        self.precision = np.linalg.inv(self.covariance)
        self.pull = self.precision @ self.mean

    def given(self, observed, bumps):
        """The posterior over weights given the first samples."""
        if len(observed) == 0:
            return self.mean, self.covariance
        gram = bumps.T @ bumps
        precision = self.precision + np.kron(np.diag(1 / self.noise), gram)
        covariance = np.linalg.inv(precision)
        seen = (bumps.T @ observed / self.noise).T.ravel()
        return covariance @ (self.pull + seen), covariance

    def predict(self, weights, bumps):
        """Mean and variance at rows of the basis, noise included."""
        mean, covariance = weights
        blocks = covariance.reshape(self.channels, self.count, self.channels, self.count)
        variance = np.stack([np.einsum("tb,bc,tc->t", bumps, blocks[c, :, c], bumps) for c in range(self.channels)], axis=1)
        return bumps @ mean.reshape(self.channels, -1).T, variance + self.noise


def weights_of(sequence, count):
    bumps = basis(len(sequence), count)
    return np.linalg.solve(bumps.T @ bumps + 1e-6 * np.eye(count), bumps.T @ sequence)


class ProMP(Method):
    """Number of bumps, ridge on the weights' covariance and noise are those with the best leave-one-out completion."""

    seeds = (1,)

    def fit(self, task, seed, quick):
        sequences, labels = task.part(task.learned)
        channel = np.concatenate(sequences).var(axis=0)
        shortest, channels = min(len(s) for s in sequences), sequences[0].shape[1]
        counts = [n for n in ((6, 10, 16, 24, 32) if channels < 4 else (4, 6, 10, 16) if channels < 8 else (3, 4, 6)) if n < shortest]
        best = (np.inf, None)
        for count in counts:
            weights = np.stack([weights_of(s, count) for s in sequences])
            for ridge in (1e-4, 1e-3, 1e-2, 0.03, 0.1, 0.3, 1.0):
                for noise in 10.0 ** np.arange(-6, 0.1, 0.5):
                    score = self.leave_one_out(task, sequences, labels, weights, ridge, noise * channel)
                    best = min(best, (score, (count, ridge, noise)))
        self.score, (self.count, self.ridge, share) = best
        self.share = share
        self.models = {}
        for label in sorted(set(labels)):
            own = np.stack([weights_of(s, self.count) for s, other in zip(sequences, labels, strict=True) if other == label])
            self.models[label] = Prior(own, self.ridge, share * channel)

    @staticmethod
    def leave_one_out(task, sequences, labels, weights, ridge, noise):
        scores = []
        for label in sorted(set(labels)):
            own = [i for i, other in enumerate(labels) if other == label]
            for i in own[:6]:
                prior = Prior(weights[[k for k in own if k != i]], ridge, noise)
                n, bumps = task.seen(sequences[i]), basis(len(sequences[i]), weights.shape[1])
                prediction = prior.predict(prior.given(sequences[i][:n], bumps[:n]), bumps[n:])
                scores.append(measures.nll(sequences[i][n:], *prediction).mean())
        return float(np.mean(scores))

    def step_by_step(self, model, s, steps):
        bumps = basis(len(s), self.count)
        mean, variance = np.full_like(s, np.nan), np.full_like(s, np.nan)
        for t in range(len(s) - steps + 1):
            rows = model.predict(model.given(s[:t], bumps[:t]), bumps[t + steps - 1 : t + steps])
            mean[t + steps - 1], variance[t + steps - 1] = rows[0][0], rows[1][0]
        return mean, variance

    def one_step(self, sequences, labels):
        return self.ahead(sequences, labels, 1)

    def ahead(self, sequences, labels, steps):
        return [self.step_by_step(self.models[label], s, steps) for s, label in zip(sequences, labels, strict=True)]

    def complete(self, observed, length, label, copies, rng):
        model, bumps, n = self.models[label], basis(length, self.count), len(observed)
        mean, covariance = model.given(observed, bumps[:n])
        drawn = rng.multivariate_normal(mean, covariance, copies, method="eigh").reshape(copies, model.channels, -1)
        samples = np.einsum("tb,kcb->ktc", bumps[n:], drawn)
        samples = samples + np.sqrt(model.noise) * rng.standard_normal(samples.shape)
        return (*model.predict((mean, covariance), bumps[n:]), samples)

    def recognise(self, sequences):
        told = []
        for s in sequences:
            scores = {label: measures.nll(s, *self.step_by_step(model, s, 1)).mean() for label, model in self.models.items()}
            told.append(min(scores, key=scores.get))
        return told

    def notes(self):
        return {"bumps": self.count, "ridge": self.ridge, "noise_share": float(self.share), "leave_one_out_nll": self.score}


class DMP(Method):
    """`movement_primitives`: imitates a label's mean movement, goes on from the last observed state to the label's mean end.

    It has no variance: the spread of its own leave-one-out completions stands for it.
    """

    seeds = (1,)

    def fit(self, task, seed, quick):
        sequences, labels = task.part(task.learned)
        best = (np.inf, None)
        for count in (10, 20, 40, 80):
            errors = self.leave_one_out(task, sequences, labels, count)
            best = min(best, (float(np.mean([np.sqrt((e**2).sum(axis=1).mean()) for own in errors.values() for e in own])), count))
        self.count = best[1]
        floor = 1e-4 * np.concatenate(sequences).var(axis=0)
        self.spread = {}
        for label, own in self.leave_one_out(task, sequences, labels, self.count).items():
            spread = np.mean([at_share(e**2, 50) for e in own], axis=0)
            padded = np.pad(spread, ((5, 5), (0, 0)), mode="edge")
            self.spread[label] = np.stack([np.convolve(c, np.ones(11) / 11, "valid") for c in padded.T], axis=1) + floor
        self.demos = {label: [s for s, other in zip(sequences, labels, strict=True) if other == label] for label in set(labels)}

    def leave_one_out(self, task, sequences, labels, count):
        errors = {}
        for label in sorted(set(labels)):
            own = [s for s, other in zip(sequences, labels, strict=True) if other == label]
            for i, s in enumerate(own[:6]):
                others = own[:i] + own[i + 1 :]
                path = self.path(others, s[: task.seen(s)], len(s), len(s) - task.seen(s), count)
                errors.setdefault(label, []).append(s[task.seen(s):] - path)
        return errors

    @staticmethod
    def path(demos, observed, length, steps, count):
        from movement_primitives.dmp import DMP as Primitive

        time = np.linspace(0, 1, length)
        dt = time[1]
        primitive = Primitive(observed.shape[1], execution_time=1.0, dt=dt, n_weights_per_dim=min(count, length - 2), int_dt=dt / 4)
        mean = np.mean([at_share(s, length) for s in demos], axis=0)
        primitive.imitate(time, mean, regularization_coefficient=1e-6)
        primitive.configure(start_y=observed[0], goal_y=mean[-1])
        y = observed[-1].copy()
        yd = (observed[-1] - observed[-3]) / (2 * dt)
        primitive.t, primitive.initialized = (len(observed) - 1) * dt, True
        primitive.current_y, primitive.current_yd = y.copy(), yd.copy()
        out = []
        for _ in range(steps):
            y, yd = primitive.step(y, yd)
            out.append(y)
        return np.array(out)

    def complete(self, observed, length, label, copies, rng):
        mean = self.path(self.demos[label], observed, length, length - len(observed), self.count)
        return mean, at_share(self.spread[label], len(mean)), None

    def beyond(self, observed, length, label, steps):
        rest = length - len(observed)
        return self.path(self.demos[label], observed, length, rest + steps, self.count)[rest:]

    def notes(self):
        return {"weights": self.count}
