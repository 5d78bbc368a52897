"""The task that all peers share: a network out of a checkpoint of scrnn, and the sequences it learns.

Also what the scripts have in common: their arguments, a process kept to one core, and the check of likelihood and
gradient against those of scrnn on the same parameters.
"""

import argparse
import csv
import json
import os
import time
from pathlib import Path

import numpy as np
from safetensors.numpy import load_file

# The blocks of the shared parameters in the order of scrnn's flat list.
BLOCKS = [
    "context_from_input",
    "context_from_context",
    "context_bias",
    "mean_from_context",
    "mean_bias",
    "variance_from_context",
    "variance_bias",
]


def arguments(description):
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("folder", type=Path, help="where compare.py put data and checkpoints")
    parser.add_argument("--threads", type=int, default=0, help="1 keeps the process to one core; 0 takes all")
    parser.add_argument("--seconds", type=float, default=2.0, help="how long to measure each variant")
    parser.add_argument("--variant", help="measure this variant only, instead of all")
    given = parser.parse_args()
    if given.threads == 1:
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    return given


def learned(folder):
    """The sequences of the archive, in their order; it holds their names, too."""
    with np.load(folder / "lissajous.npz") as archive:
        return [archive[name] for name in sorted(archive.files) if name.startswith("sequence_")]


def load(folder):
    """Parameters with the initial states, samples [T + 1, S, I], and time constants."""
    tensors = load_file(folder / "before" / "checkpoint.safetensors")
    parameters = {name: tensors[name] for name in [*BLOCKS, "initial_state"]}
    return parameters, np.stack(learned(folder), axis=1), tensors["time_constant"]


def difference(folder, ln_likelihood, gradients):
    """How far ln L and the blocks of the gradient are from scrnn's: the largest, relative to the block's largest value."""
    tensors = load_file(folder / "after" / "checkpoint.safetensors")
    before = load_file(folder / "before" / "checkpoint.safetensors")
    flat, at = tensors["optimiser.velocity.shared"], 0
    ours = {"initial_state": tensors["optimiser.velocity.initial_state"]}
    for name in BLOCKS:
        ours[name] = flat[at : at + before[name].size].reshape(before[name].shape)
        at += before[name].size
    with open(folder / "before" / "history.csv", newline="") as file:
        nll = float(list(csv.DictReader(file))[-1]["nll"])
    terms = sum(sequence[1:].size for sequence in learned(folder))
    worst = abs(-float(ln_likelihood) / terms / nll - 1.0)
    for name, value in ours.items():
        worst = max(worst, float(np.abs(np.asarray(gradients[name]) - value).max() / np.abs(value).max()))
    return worst


def milliseconds(epoch, seconds):
    """The median time of an epoch; `epoch` must have run before."""
    times = []
    end = time.perf_counter() + seconds
    while time.perf_counter() < end or len(times) < 3:
        start = time.perf_counter()
        epoch()
        times.append(time.perf_counter() - start)
    return 1e3 * float(np.median(times))


def run(given, variants, version, evaluate):
    """Checks and times variants, and prints what was found. `evaluate` takes a variant and gives a function of nothing
    that gives ln L and the gradient, the latter as arrays by the names of the blocks."""
    found = {}
    for variant in [given.variant] if given.variant else variants:
        epoch = evaluate(variant)
        worst = difference(given.folder, *epoch())
        found[variant] = {"milliseconds": milliseconds(epoch, given.seconds), "difference": worst}
    print(json.dumps({"version": version, "found": found}))
