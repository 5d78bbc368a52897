#!/usr/bin/env python3
"""Times one epoch of scrnn, JAX and PyTorch on the same parameters and data, in turns, and prints one table.

    python3 benches/peers/compare.py [--rounds 5] [--without-torch]

12 sequences of 1000 steps on 2 channels, 60 context units, float64. For scrnn an epoch is likelihood, gradient and the
update by Adam; for the others likelihood and gradient. First all must agree on both to 1e-9; then every variant of a
peer is tried, and the fastest is kept; then all are measured in turns. Packages go into benches/peers/.venv.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import venv
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
VENV = HERE / ".venv"
WORK = HERE / ".work"
TOLERANCE = 1e-9

EXPERIMENT = """
name = "peers"
seed = 1

[data]
files = ["{data}"]
scaling = "none"

[network]
delay = 1
initial_state_variance = 100.0

[[network.groups]]
name = "context"
units = 60
time_constant = 2.0

[training]
epochs = {epochs}
optimiser = "momentum"

# Without momentum, the optimiser keeps the gradient of the last epoch.
[training.momentum]
rate = 0.05
momentum = 0.0
"""


def say(text):
    print(text, file=sys.stderr, flush=True)


def python():
    """The interpreter of the virtual environment, with all packages."""
    interpreter = VENV / "bin" / "python"
    wanted = (HERE / "requirements.txt").read_text()
    installed = VENV / "installed.txt"
    if not installed.exists() or installed.read_text() != wanted:
        say("installing the peers into .venv")
        if not interpreter.exists():
            venv.create(VENV, with_pip=True)
        pip = [interpreter, "-m", "pip", "install", "--quiet", "-r", HERE / "requirements.txt"]
        subprocess.run(pip, check=True, stdout=sys.stderr)
        installed.write_text(wanted)
    return interpreter


def built(*arguments):
    """Builds with cargo and gives the executable."""
    command = ["cargo", *arguments, "--message-format", "json-render-diagnostics"]
    out = subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout
    messages = [json.loads(line) for line in out.splitlines()]
    return [message["executable"] for message in messages if message.get("executable")][-1]


def prepare(scrnn):
    """Data, a network after some epochs, and the same one epoch later."""
    WORK.mkdir(exist_ok=True)
    data = WORK / "lissajous.npz"
    run = lambda *arguments: subprocess.run([scrnn, "--quiet", *arguments], check=True, stdout=subprocess.DEVNULL)  # noqa: E731
    run("data", "lissajous", "--steps", "1001", "--out", data)
    for name, epochs in [("before", 100), ("after", 101)]:
        experiment = WORK / f"{name}.toml"
        experiment.write_text(EXPERIMENT.format(data=data, epochs=epochs))
        run("train", experiment, "--out", WORK / name, "--overwrite")


class Peer:
    """A script that times its variants, on one thread or on all."""

    def __init__(self, name, script, threads):
        self.name, self.script, self.threads, self.variant = name, script, threads, None

    def run(self, *arguments):
        variant = ["--variant", self.variant] if self.variant else []
        command = [python(), HERE / self.script, WORK, "--threads", str(self.threads), *variant, *arguments]
        out = subprocess.run(command, stdout=subprocess.PIPE, text=True, timeout=1800)
        if out.returncode != 0:
            sys.exit(f"{self.name}: {self.script} failed")
        return json.loads(out.stdout.splitlines()[-1])

    def choose(self):
        """Checks all variants and keeps the fastest."""
        report = self.run("--seconds", "1")
        found, self.version = report["found"], report["version"]
        worst = max(variant["difference"] for variant in found.values())
        times = {name: variant["milliseconds"] for name, variant in found.items()}
        self.variant = min(times, key=times.get)
        listed = ", ".join(f"{name} {times[name]:.1f}" for name in sorted(times, key=times.get))
        say(f"{self.name} {self.version}, {label(self.threads)}, ms an epoch: {listed}")
        say(f"  likelihood and gradient differ from scrnn's by at most {worst:.1e}")
        if not worst <= TOLERANCE:
            sys.exit(f"{self.name} computes something else")

    def time(self):
        return self.run("--seconds", "2")["found"][self.variant]["milliseconds"]


def label(threads):
    return "1 thread" if threads == 1 else f"{len(os.sched_getaffinity(0))} threads"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--without-torch", action="store_true", help="compare with JAX only")
    given = parser.parse_args()

    scripts = [("JAX", "jax_epoch.py"), ("PyTorch", "torch_epoch.py")][: 1 if given.without_torch else 2]
    peers = [Peer(name, script, threads) for name, script in scripts for threads in (1, 0)]
    python()
    prepare(built("build", "--release", "-p", "scrnn-cli"))
    bench = built("bench", "-p", "scrnn-checks", "--bench", "share_of_peak", "--no-run")
    for peer in peers:
        peer.choose()

    ours, times = [], [[] for _ in peers]
    for index in range(given.rounds):
        say(f"round {index + 1} of {given.rounds}")
        command = [bench, "--bench", "--only", "lissajous", "--rounds", "5", "--json"]
        out = subprocess.run(command, check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True).stdout
        ours.append(json.loads(out)["epochs"][0])
        for peer, list_of_times in zip(peers, times):
            list_of_times.append(peer.time())

    best = [min(epoch["milliseconds"]) for epoch in ours]
    print("| | ms an epoch | epochs a second | times as long as scrnn, same threads | as scrnn's best |")
    print("|---|---|---|---|---|")
    for threads in (0, 1):
        share = statistics.median(epoch["share_of_peak"][threads] for epoch in ours)
        own = [epoch["milliseconds"][threads] for epoch in ours]
        row(f"scrnn, {threads + 1} thread{'s' * threads}, {100 * share:.0f} % of peak", own, own, best)
    for peer, own in zip(peers, times):
        same = [epoch["milliseconds"][0 if peer.threads == 1 else 1] for epoch in ours]
        row(f"{peer.name} {peer.version}, {label(peer.threads)}, {peer.variant}", own, same, best)


def row(name, own, same, best):
    median = statistics.median(own)
    ratio = lambda others: statistics.median(a / b for a, b in zip(own, others))  # noqa: E731
    print(f"| {name} | {median:.2f} | {1e3 / median:.1f} | {ratio(same):.2f} | {ratio(best):.2f} |")


main()
