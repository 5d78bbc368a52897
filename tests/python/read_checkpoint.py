#!/usr/bin/env python3
"""Compares open-loop predictions of the program with the equations, computed here from the checkpoint alone.

The network of a checkpoint runs over every sequence of DATA.npz (members sequence_000, sequence_001, ...: samples x
channels, raw units) from that sequence's learned initial state. GENERATED.npz holds what the program predicted: members
mean_000, ... and, with variance units, variance_000, ..., also in raw units. A sequence of L samples gives T = L - xi
rows; row k predicts sample k + xi.

Exit code 0: everything agrees to 1e-12, relative to max(1, |value|). 1: it does not, or something is missing.
"""

import argparse
import json
import sys

import numpy as np
from safetensors import safe_open
from safetensors.numpy import load_file

TOLERANCE = 1e-12
FORMAT_VERSION = 1


def read(path):
    """The tensors by name, and what the metadata says."""
    with safe_open(path, framework="numpy") as file:
        record = json.loads(file.metadata()["scrnn"])
    if record["format_version"] != FORMAT_VERSION:
        sys.exit(f"{path}: format version {record['format_version']}; needed: {FORMAT_VERSION}")
    tensors = load_file(path)
    for name, tensor in tensors.items():
        if tensor.dtype != np.float64:
            sys.exit(f"{path}: tensor {name} is {tensor.dtype}; needed: float64")
    return tensors, record


def predict(tensors, topology, u, samples):
    """Means and variances (None without variance units) of an open-loop run from the internal state u, in raw units."""
    offset, scale, tau = tensors["scaling_offset"], tensors["scaling_scale"], tensors["time_constant"]
    inputs = ((samples - offset) * scale)[: len(samples) - topology["delay"]]
    has_variance = topology["prediction"] == "mean_and_variance"
    means, variances = np.empty_like(inputs), np.empty_like(inputs)
    c = np.tanh(u)
    for t, x in enumerate(inputs):
        drive = tensors["context_from_input"] @ x + tensors["context_from_context"] @ c + tensors["context_bias"]
        u = (1.0 - 1.0 / tau) * u + drive / tau  # (2.2), (2.27)
        c = np.tanh(u)  # (2.3)
        means[t] = np.tanh(tensors["mean_from_context"] @ c + tensors["mean_bias"])  # (2.4)
        if has_variance:
            internal = tensors["variance_from_context"] @ c + tensors["variance_bias"]
            variances[t] = np.exp(internal) + topology["variance_floor"]  # (2.5)
    return means / scale + offset, variances / scale**2 if has_variance else None


def compare(name, generated, ours):
    """The largest difference of one member, relative to max(1, |value|), and where it is."""
    if name not in generated:
        sys.exit(f"{name} is missing in what was generated")
    theirs = generated[name]
    if theirs.shape != ours.shape:
        sys.exit(f"{name} has shape {theirs.shape}; needed: {ours.shape}")
    difference = np.abs(theirs - ours) / np.maximum(1.0, np.abs(ours))
    row, channel = np.unravel_index(np.argmax(difference), difference.shape)  # argmax finds NaN first
    found, needed = float(theirs[row, channel]), float(ours[row, channel])
    return difference[row, channel], f"{name}, row {row}, channel {channel}: {found!r}, by the equations {needed!r}"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("checkpoint", metavar="CHECKPOINT")
    parser.add_argument("data", metavar="DATA.npz")
    parser.add_argument("generated", metavar="GENERATED.npz")
    arguments = parser.parse_args()

    tensors, record = read(arguments.checkpoint)
    data, generated = np.load(arguments.data), np.load(arguments.generated)
    sequences, delay, channels = tensors["first_inputs"].shape
    differences = []
    for s in range(sequences):
        name = f"sequence_{s:03}"
        if name not in data:
            sys.exit(f"{name} is missing in the data; the checkpoint knows {sequences} sequences")
        samples = data[name].astype(np.float64)
        if samples.ndim != 2 or samples.shape[1] != channels or len(samples) <= delay:
            sys.exit(f"{name} has shape {samples.shape}; needed: more than {delay} samples of {channels} channels")
        first = (samples[:delay] - tensors["scaling_offset"]) * tensors["scaling_scale"]
        differences.append(compare("first_inputs", {"first_inputs": tensors["first_inputs"][s]}, first))
        mean, variance = predict(tensors, record["topology"], tensors["initial_state"][s], samples)
        differences.append(compare(f"mean_{s:03}", generated, mean))
        if variance is not None:
            differences.append(compare(f"variance_{s:03}", generated, variance))
    if not differences:
        sys.exit("the checkpoint knows no sequence: nothing to compare")

    largest, place = max(differences, key=lambda found: (np.isnan(found[0]), found[0]))
    if not largest <= TOLERANCE:
        sys.exit(f"the largest difference is {largest:.3g}; allowed: {TOLERANCE:g}\n{place}")
    print(f"{sequences} sequences agree; the largest difference is {largest:.3g} ({place})")


if __name__ == "__main__":
    main()
