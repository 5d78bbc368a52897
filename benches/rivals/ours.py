"""scrnn through its command line. Nothing is chosen for it: it trains on the data alone, as for anybody.

The program is `scrnn` in the folder target/release, or what the environment variable SCRNN names.
"""

import functools
import json
import os
import pathlib
import resource
import shutil
import subprocess
import tempfile

import numpy as np

import measures
from method import Method

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent

# Nothing is chosen here: `scrnn train FILE` writes the experiment that it takes, as it would for anybody. One thread, for the time.

# An array is steps x channels. The program asks where that is not plain, as of a beginning of 6 steps on 12 channels.
AXES = ("--axes", "tc")
RUNS = pathlib.Path(__file__).resolve().parent / "results" / "runs"


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


def trained(task, seed, quick, members=1):
    """The run of a task and a seed, and its processor time."""
    mixed = f".{members}-mixed" if members > 1 else ""
    at = RUNS / ("quick" if quick else "full") / f"{task.name}.{seed}{mixed}"
    kept = at / "seconds.json"
    if not kept.exists():
        shutil.rmtree(at, ignore_errors=True)
        at.mkdir(parents=True)
        write(at / "learned.npz", task.part(task.learned)[0])
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        told = [("training.epochs", 100)] * quick + [("training.members", members)] * (members > 1)
        settings = [part for key, value in told for part in ("--set", f"{key}={value}")]
        scrnn("train", at / "learned.npz", *AXES, "--out", at / "run", "--seed", seed, *settings)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        kept.write_text(json.dumps(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime))
    return at / "run", json.loads(kept.read_text())


class Scrnn(Method):
    """One network for all labels, told neither label nor length. Runs are kept beside the results, and not trained again."""

    copies_ahead = 10
    members = 1

    def fit(self, task, seed, quick):
        self.task, self.seed = task, seed
        self.folder = tempfile.TemporaryDirectory(prefix="rivals-")
        self.at = pathlib.Path(self.folder.name)
        self.run, self.seconds = trained(task, seed, quick, self.members)

    def generate(self, name, sequences, *arguments):
        """Means, variances and samples; the network hears the sequences, then itself."""
        write(self.at / f"{name}.npz", sequences)
        out = self.at / f"{name}-generated.npz"
        told = (*AXES, "--mode", "open", "--mean", "--seed", self.seed, *arguments)
        scrnn("generate", self.run, "--data", self.at / f"{name}.npz", "--out", out, *told)
        return functools.partial(read, out)

    def one_step(self, sequences, labels):
        got = self.generate("open", sequences)
        out = []
        for s, m, v in zip(sequences, got("mean"), got("variance"), strict=True):
            rows = np.full_like(s, np.nan), np.full_like(s, np.nan)
            rows[0][1:], rows[1][1:] = m[: len(s) - 1], v[: len(s) - 1]
            out.append(rows)
        return out

    def ahead(self, sequences, labels, steps):
        out = []
        for s in sequences:
            mean, variance = np.full_like(s, np.nan), np.full_like(s, np.nan)
            times = list(range(measures.BURN_IN, len(s) - steps + 1, 5))
            longest = times[-1] - 1 + steps
            got = self.generate("ahead", [s[:t] for t in times], "--steps", longest, "--samples", self.copies_ahead)
            m, v = (np.array(got(field)).reshape(len(times), self.copies_ahead, longest, -1) for field in ("mean", "variance"))
            for k, t in enumerate(times):
                # Row 0 predicts the second sample.
                row = t + steps - 2
                mean[t + steps - 1], variance[t + steps - 1] = measures.moments(m[k, :, row], v[k, :, row])
            out.append((mean, variance))
        return out

    def rolled(self, observed, steps, copies):
        """Copies of what follows `observed`: means, variances and samples."""
        heard = len(observed) - 1
        got = self.generate("rolled", [observed], "--steps", heard + steps, "--samples", copies)
        return tuple(np.array(got(field))[:, heard:] for field in ("mean", "variance", "sample"))

    def complete(self, observed, length, label, copies, rng):
        means, variances, samples = self.rolled(observed, length - len(observed), copies)
        return (*measures.moments(means, variances), samples)

    def beyond(self, observed, length, label, steps):
        rest = length - len(observed)
        # The mean of closed loops with noise, as a person would run it.
        return self.rolled(observed, rest + steps, 10)[0].mean(axis=0)[rest:]

    def recognise(self, sequences):
        write(self.at / "recognise.npz", sequences)
        found = json.loads(scrnn("recognize", self.run, self.at / "recognise.npz", *AXES, "--json"))
        labels = self.task.part(self.task.learned)[1]
        found = found if isinstance(found, list) else found["sequences"]
        return [labels[one["learned"][0]["number"] - 1] for one in found]

    def notes(self):
        return {"seconds_of_training": self.seconds}


class ScrnnMembers(Scrnn):
    """A mixture of four networks, as `--set training.members=4` makes it: of this seed and the three after it."""

    seeds = (1, 5, 9)
    members = 4
