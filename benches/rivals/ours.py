"""scrnn through its command line. The one file to change when the program learns more: see "The seam" below.

The program is `scrnn` in the folder target/release, or what the environment variable SCRNN names.
"""

import functools
import json
import os
import pathlib
import resource
import subprocess
import tempfile

import numpy as np

import measures
from method import Method

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent

# The seam.
#
# 1. RECIPE is what stands in the experiment file besides its data. Once there is `[training] recipe = "auto"` it is that one line;
#    until then it is README's first example of own data.
# 2. Once there is `scrnn evaluate RUN DATA --json`, `one_step`, `ahead`, `complete` and `recognise` become readings of its object.
#    Until then they are made of `generate` and `recognize`: the network listens in the open loop, its state is taken from
#    `--contexts` (u = artanh c), and closed loops start there.
# 3. Once there is `training.members`, ScrnnMembers is a line of the experiment; until then it trains four and mixes them here.

RECIPE = """
[[network.groups]]
name = "context"
units = 20
time_constant = 3.0

[training]
epochs = {epochs}
optimiser = "adam"
"""
EPOCHS = 5000


def program():
    named = os.environ.get("SCRNN")
    path = pathlib.Path(named) if named else ROOT / "target" / "release" / "scrnn"
    if not path.exists():
        raise FileNotFoundError(f"{path} is not there: `cargo build --release -p scrnn-cli`, or set SCRNN")
    return path


def scrnn(*arguments):
    command = [program(), *map(str, arguments), "--quiet", "--threads", "1"]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{' '.join(map(str, command))}\n{done.stderr}")
    return done.stdout


def write(path, sequences):
    """Members are read in the order of their names."""
    np.savez(path, **{f"sequence_{i:05}": s for i, s in enumerate(sequences)})


def read(path, field):
    held = np.load(path)
    names = [name for name in held.files if name.startswith(f"{field}_")]
    return [held[name] for name in sorted(names, key=lambda name: int(name.rsplit("_", 1)[1]))]


class Scrnn(Method):
    """One network for all labels, told neither label nor length."""

    copies_ahead = 30

    def fit(self, task, seed, quick):
        self.task, self.seed = task, seed
        self.folder = tempfile.TemporaryDirectory(prefix="rivals-")
        self.at = pathlib.Path(self.folder.name)
        write(self.at / "learned.npz", task.part(task.learned)[0])
        head = f'name = "rivals"\nseed = {seed}\n\n[data]\nfiles = ["learned.npz"]\n'
        (self.at / "experiment.toml").write_text(head + RECIPE.format(epochs=EPOCHS // 25 if quick else EPOCHS))
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        self.result = json.loads(scrnn("train", self.at / "experiment.toml", "--out", self.at / "run", "--json"))
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        self.seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime

    def generate(self, name, sequences, *arguments):
        write(self.at / f"{name}.npz", sequences)
        out = self.at / f"{name}-generated.npz"
        scrnn("generate", self.at / "run", "--data", self.at / f"{name}.npz", "--out", out, *arguments)
        return functools.partial(read, out)

    def listened(self, sequences):
        """Mean, variance and internal state after each sample, from the mean initial state."""
        got = self.generate("open", sequences, "--mode", "open", "--mean", "--contexts")
        states = [np.arctanh(np.clip(c, -1 + 1e-15, 1 - 1e-15)) for c in got("context")]
        return got("mean"), got("variance"), states

    def closed(self, starts, states, steps, copies):
        """Closed loops that have heard `states` and now hear the one sample of `starts`: starts x copies x steps x channels."""
        np.savez(self.at / "states.npz", states=np.array(states))
        padded = [np.repeat(x[None], 3, axis=0) for x in starts]
        got = self.generate(
            "closed", padded, "--mode", "closed", "--initial-state", self.at / "states.npz",
            "--steps", steps, "--samples", copies, "--seed", self.seed,
        )
        shape = lambda parts: np.array(parts).reshape(len(starts), copies, steps, -1)  # noqa: E731
        return shape(got("mean")), shape(got("variance")), shape(got("sample"))

    def one_step(self, sequences, labels):
        means, variances, _ = self.listened(sequences)
        out = []
        for s, m, v in zip(sequences, means, variances, strict=True):
            rows = np.full_like(s, np.nan), np.full_like(s, np.nan)
            rows[0][1:], rows[1][1:] = m[: len(s) - 1], v[: len(s) - 1]
            out.append(rows)
        return out

    def ahead(self, sequences, labels, steps):
        _, _, states = self.listened(sequences)
        out = []
        for s, u in zip(sequences, states, strict=True):
            mean, variance = np.full_like(s, np.nan), np.full_like(s, np.nan)
            times = list(range(measures.BURN_IN, len(s) - steps + 1, 5))
            m, v, _ = self.closed([s[t - 1] for t in times], [u[t - 2] for t in times], steps, self.copies_ahead)
            for k, t in enumerate(times):
                mean[t + steps - 1], variance[t + steps - 1] = measures.moments(m[k, :, -1], v[k, :, -1])
            out.append((mean, variance))
        return out

    def rolled(self, observed, steps, copies):
        _, _, states = self.listened([observed])
        m, v, samples = self.closed([observed[-1]], [states[0][len(observed) - 2]], steps, copies)
        return m[0], v[0], samples[0]

    def complete(self, observed, length, label, copies, rng):
        means, variances, samples = self.rolled(observed, length - len(observed), copies)
        return (*measures.moments(means, variances), samples)

    def beyond(self, observed, length, label, steps):
        rest = length - len(observed)
        # The mean of closed loops with noise, as a person would run it.
        return self.rolled(observed, rest + steps, 10)[0].mean(axis=0)[rest:]

    def recognise(self, sequences):
        write(self.at / "recognise.npz", sequences)
        found = json.loads(scrnn("recognize", self.at / "run", self.at / "recognise.npz", "--json"))
        labels = self.task.part(self.task.learned)[1]
        return [labels[one["learned"][0]["number"] - 1] for one in (found if isinstance(found, list) else found["sequences"])]

    def notes(self):
        return {"seconds_of_training": self.seconds, "train": self.result}


class ScrnnMembers(Method):
    """Four networks of different seeds, mixed with equal weights."""

    members = 4

    def fit(self, task, seed, quick):
        self.networks = [Scrnn() for _ in range(self.members)]
        for k, network in enumerate(self.networks):
            network.fit(task, 100 * seed + k, quick)

    def mixed(self, parts):
        return [measures.moments(np.stack([m for m, _ in of]), np.stack([v for _, v in of])) for of in zip(*parts, strict=True)]

    def one_step(self, sequences, labels):
        return self.mixed([network.one_step(sequences, labels) for network in self.networks])

    def ahead(self, sequences, labels, steps):
        return self.mixed([network.ahead(sequences, labels, steps) for network in self.networks])

    def complete(self, observed, length, label, copies, rng):
        share = max(2, copies // self.members)
        parts = [network.rolled(observed, length - len(observed), share) for network in self.networks]
        means, variances, samples = (np.concatenate(part) for part in zip(*parts, strict=True))
        return (*measures.moments(means, variances), samples)

    def beyond(self, observed, length, label, steps):
        return np.mean([network.beyond(observed, length, label, steps) for network in self.networks], axis=0)

    def notes(self):
        return {"members": [network.notes() for network in self.networks]}
