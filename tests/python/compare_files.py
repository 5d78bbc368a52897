#!/usr/bin/env python3
"""Reads files of the program with numpy and pandas, and compares them to the bit.

  compare_files.py same FOLDER         data.csv, .txt, .npy and .npz hold the same samples
  compare_files.py generated FOLDER    generated.csv, .txt and .npz hold the same mean, variance and sample
  compare_files.py observed FOLDER N   the first N samples of whole.csv and whole.npz are those of array.npy

Exit code 0: they are the same. 1: they are not, or something is missing.
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd


def table(path, start=""):
    """The columns of a CSV file whose names begin with start, one array for each sequence."""
    frame = pd.read_csv(path)
    columns = [name for name in frame.columns if name not in ("sequence", "step") and name.startswith(start)]
    return [part[columns].to_numpy() for _, part in frame.groupby("sequence", sort=False)]


def blocks(path):
    """The blocks of a text file between blank lines."""
    texts = path.read_text().split("\n\n")
    return [np.loadtxt(text.splitlines(), ndmin=2) for text in texts]


def members(path, stem):
    """The arrays stem_000, stem_001, ... of an archive."""
    with np.load(path) as archive:
        return [archive[name] for name in sorted(archive.files) if name.startswith(f"{stem}_")]


def check(what, found, expected):
    if len(found) != len(expected):
        sys.exit(f"{what}: {len(found)} sequences, expected {len(expected)}")
    for s, (one, other) in enumerate(zip(found, expected)):
        if one.dtype != np.float64 or one.shape != other.shape or one.tobytes() != other.tobytes():
            sys.exit(f"{what}, sequence {s + 1}:\n{one.dtype} {one.shape}\n{one}\nexpected:\n{other}")
    print(f"{what}: {len(found)} sequences, the same to the bit")


def same(folder):
    expected = members(folder / "data.npz", "sequence")
    check("data.csv", table(folder / "data.csv"), expected)
    check("data.txt", blocks(folder / "data.txt"), expected)
    check("data.npy", list(np.load(folder / "data.npy")), expected)


def generated(folder):
    rows = blocks(folder / "generated.txt")
    width = rows[0].shape[1] // 3
    for i, field in enumerate(["mean", "variance", "sample"]):
        expected = members(folder / "generated.npz", field)
        check(f"{field} in generated.csv", table(folder / "generated.csv", f"{field}_"), expected)
        check(f"{field} in generated.txt", [row[:, i * width : (i + 1) * width] for row in rows], expected)


def observed(folder, count):
    expected = [one[:count] for one in np.load(folder / "array.npy")]
    check("whole.npz", [one[:count] for one in members(folder / "whole.npz", "sequence")], expected)
    check("whole.csv", [one[:count] for one in table(folder / "whole.csv")], expected)


def main():
    command, folder = sys.argv[1], Path(sys.argv[2])
    if command == "observed":
        observed(folder, int(sys.argv[3]))
    else:
        {"same": same, "generated": generated}[command](folder)


if __name__ == "__main__":
    main()
