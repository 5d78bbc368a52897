"""LSTM and GRU with Gaussian outputs in PyTorch: what behaviour cloning with a recurrent network does, at its honest best.

Inputs are standardised samples and displacements. The mean is a base plus the network's output in units of the base's residual;
which base (nothing, the last sample, or the line through the last two) and how many epochs is chosen on the validation part.
"""

import time

import numpy as np
import torch

import measures
from method import Method

torch.set_num_threads(1)


class Net(torch.nn.Module):
    def __init__(self, kind, channels, hidden):
        super().__init__()
        self.cell = getattr(torch.nn, kind)(2 * channels, hidden, batch_first=True)
        self.out = torch.nn.Linear(hidden, 2 * channels)
        torch.nn.init.zeros_(self.out.weight)
        torch.nn.init.zeros_(self.out.bias)


BASES = ("mean", "last", "line")


class Scaled:
    """Brings samples and displacements to the network's units."""

    def __init__(self, sequences, base):
        every, steps = np.concatenate(sequences), np.concatenate([np.diff(s, axis=0) for s in sequences])
        turns = np.concatenate([np.diff(s, n=2, axis=0) for s in sequences])
        tensor = lambda a: torch.tensor(a, dtype=torch.float32)  # noqa: E731
        self.offset, self.scale = tensor(every.mean(axis=0)), tensor(every.std(axis=0) + 1e-9)
        self.pace = tensor(steps.std(axis=0) + 1e-9)
        self.base = base
        self.residual = {"mean": self.scale, "last": self.pace, "line": tensor(turns.std(axis=0) + 1e-9)}[base]

    def inputs(self, x, d):
        return torch.cat([(x - self.offset) / self.scale, d / self.pace], dim=-1)

    def outputs(self, raw, x, d):
        rho, log_variance = raw.chunk(2, dim=-1)
        start = {"mean": self.offset, "last": x, "line": x + d}[self.base]
        return start + self.residual * rho, self.residual**2 * torch.exp(log_variance.clamp(-14, 14))


def padded(sequences):
    """Sequences x steps x channels, displacements, and which steps there are."""
    longest = max(len(s) for s in sequences)
    x = np.zeros((len(sequences), longest, sequences[0].shape[1]))
    there = np.zeros((len(sequences), longest))
    for i, s in enumerate(sequences):
        x[i, : len(s)], x[i, len(s) :] = s, s[-1]
        there[i, : len(s)] = 1
    x = torch.tensor(x, dtype=torch.float32)
    d = torch.cat([torch.zeros_like(x[:, :1]), x[:, 1:] - x[:, :-1]], dim=1)
    return x, d, torch.tensor(there, dtype=torch.float32)


class Recurrent(Method):
    kind, hidden, rate, decay = "LSTM", 64, 3e-3, 1e-3
    patience, most = 60, 600

    def loss(self, net, scaled, x, d, there):
        raw = net.out(net.cell(scaled.inputs(x, d)[:, :-1])[0])
        mean, variance = scaled.outputs(raw, x[:, :-1], d[:, :-1])
        terms = 0.5 * (torch.log(2 * torch.pi * variance) + (x[:, 1:] - mean) ** 2 / variance)
        mask = there[:, 1:, None]
        return (terms * mask).sum() / (mask.sum() * x.shape[2])

    def train(self, sequences, base, epochs, seed, validation=None):
        torch.manual_seed(seed)
        rng = np.random.default_rng(seed)
        scaled, net = Scaled(sequences, base), Net(self.kind, sequences[0].shape[1], self.hidden)
        optimiser = torch.optim.AdamW(net.parameters(), lr=self.rate, weight_decay=self.decay)
        schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, self.most)
        x, d, there = padded(sequences)
        batch = max(4, min(32, len(sequences) // 2))
        held = padded(validation) if validation else None
        best, curve, begun = (np.inf, 0), [], time.process_time()
        for epoch in range(1, epochs + 1):
            order = torch.tensor(rng.permutation(len(sequences)))
            for some in order.split(batch):
                optimiser.zero_grad()
                self.loss(net, scaled, x[some], d[some], there[some]).backward()
                torch.nn.utils.clip_grad_norm_(net.parameters(), 1.0)
                optimiser.step()
            schedule.step()
            if held and epoch % 5 == 0:
                with torch.no_grad():
                    score = float(self.loss(net, scaled, *held))
                curve.append((time.process_time() - begun, score))
                best = min(best, (score, epoch))
                if epoch - best[1] > self.patience:
                    break
        return scaled, net, best, curve

    def fit(self, task, seed, quick):
        fitting, validation = task.part(task.fitting())[0], task.part(task.validation)[0]
        most = 60 if quick else self.most
        tried = {base: self.train(fitting, base, most, seed, validation)[2:] for base in BASES}
        self.base = min(BASES, key=lambda base: tried[base][0][0])
        (self.score, self.epochs), self.curve = tried[self.base]
        begun = time.process_time()
        self.scaled, self.net, _, _ = self.train(task.part(task.learned)[0], self.base, self.epochs, seed)
        self.seconds_once = time.process_time() - begun
        self.task, self.seed = task, seed

    @torch.no_grad()
    def one_step(self, sequences, labels):
        x, d, _ = padded(sequences)
        mean, variance = self.scaled.outputs(self.net.out(self.net.cell(self.scaled.inputs(x, d))[0]), x, d)
        out = []
        for i, s in enumerate(sequences):
            rows = np.full_like(s, np.nan), np.full_like(s, np.nan)
            rows[0][1:], rows[1][1:] = mean[i, : len(s) - 1].numpy(), variance[i, : len(s) - 1].numpy()
            out.append(rows)
        return out

    def run(self, state, x, d, steps, generator, noise=True):
        """Own predictions fed back; `x` and `d` are the last sample and displacement, copies x 1 x channels."""
        means, variances, samples = [], [], []
        for _ in range(steps):
            out, state = self.net.cell(self.scaled.inputs(x, d), state)
            mean, variance = self.scaled.outputs(self.net.out(out), x, d)
            new = mean + variance.sqrt() * torch.randn(mean.shape, generator=generator) if noise else mean
            new = new.clamp(-1e6, 1e6)
            x, d = new, new - x
            means.append(mean), variances.append(variance), samples.append(new)
        return [torch.cat(part, dim=1).double().numpy() for part in (means, variances, samples)]

    def listened(self, observed, copies):
        """State before the last observed sample is fed, and that sample."""
        x, d, _ = padded([observed])
        _, state = self.net.cell(self.scaled.inputs(x, d)[:, :-1])
        spread = lambda part: part.repeat(1, copies, 1)  # noqa: E731
        state = tuple(spread(part) for part in state) if isinstance(state, tuple) else spread(state)
        return state, x[:, -1:].repeat(copies, 1, 1), d[:, -1:].repeat(copies, 1, 1)

    @torch.no_grad()
    def ahead(self, sequences, labels, steps):
        generator, out = torch.Generator().manual_seed(self.seed), []
        for s in sequences:
            mean, variance = np.full_like(s, np.nan), np.full_like(s, np.nan)
            # Every fifth sample: the rows between stay NaN and are not scored.
            for t in range(measures.BURN_IN, len(s) - steps + 1, 5):
                m, v, _ = self.run(*self.listened(s[:t], 30), steps, generator)
                mean[t + steps - 1], variance[t + steps - 1] = measures.moments(m[:, -1], v[:, -1])
            out.append((mean, variance))
        return out

    @torch.no_grad()
    def complete(self, observed, length, label, copies, rng):
        generator = torch.Generator().manual_seed(int(rng.integers(2**31)))
        means, variances, samples = self.run(*self.listened(observed, copies), length - len(observed), generator)
        return (*measures.moments(means, variances), samples)

    @torch.no_grad()
    def beyond(self, observed, length, label, steps):
        rest = length - len(observed)
        return self.run(*self.listened(observed, 1), rest + steps, None, noise=False)[0][0, rest:]

    def recognise(self, sequences):
        """A classifier of the same kind and size, trained for it; epochs by the validation part."""
        task = self.task
        names = sorted(set(task.labels))

        def train(indices, epochs, validation):
            torch.manual_seed(self.seed)
            net, readout = Net(self.kind, len(task.channels), self.hidden), torch.nn.Linear(self.hidden, len(names))
            weights = [*net.cell.parameters(), *readout.parameters()]
            optimiser = torch.optim.AdamW(weights, lr=self.rate, weight_decay=1e-2)
            x, d, there = padded([task.sequences[i] for i in indices])
            target = torch.tensor([names.index(task.labels[i]) for i in indices])
            held = [task.sequences[i] for i in validation]
            wanted = [task.labels[i] for i in validation]
            best = (np.inf, 1)

            def scores(x, d, there):
                hidden = net.cell(self.scaled.inputs(x, d))[0]
                return readout((hidden * there[..., None]).sum(dim=1) / there.sum(dim=1, keepdim=True))

            for epoch in range(1, epochs + 1):
                for some in torch.randperm(len(indices)).split(max(4, min(32, len(indices) // 2))):
                    optimiser.zero_grad()
                    torch.nn.functional.cross_entropy(scores(x[some], d[some], there[some]), target[some]).backward()
                    torch.nn.utils.clip_grad_norm_(weights, 1.0)
                    optimiser.step()
                if validation and epoch % 5 == 0:
                    with torch.no_grad():
                        loss = torch.nn.functional.cross_entropy(scores(*padded(held)), torch.tensor([names.index(w) for w in wanted]))
                    best = min(best, (float(loss), epoch))
                    if epoch - best[1] > 40:
                        break
            return scores, best[1]

        _, epochs = train(task.fitting(), 150, task.validation)
        scores, _ = train(task.learned, epochs, [])
        with torch.no_grad():
            return [names[int(k)] for k in scores(*padded(sequences)).argmax(dim=1)]

    def notes(self):
        return {"base": self.base, "epochs": self.epochs, "validation_nll": self.score, "seconds_of_final_training": self.seconds_once, "curve": self.curve[:: max(1, len(self.curve) // 40)]}


class GRU(Recurrent):
    kind = "GRU"


class LSTM(Recurrent):
    kind = "LSTM"
