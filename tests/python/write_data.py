#!/usr/bin/env python3
"""Writes the same two sequences in all the ways in which numpy and pandas users keep them.

All files but ragged.npz hold the same numbers, two sequences of 40 samples on the channels left and right. The numbers
are random, use every bit of a float32, and are exact in a float64. ragged.npz holds the members sequence_000 of 40 and
sequence_001 of 23 samples.
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd

CHANNELS = ["left", "right"]


def main():
    folder = Path(sys.argv[1])
    random = np.random.default_rng(7)
    single = random.normal([1200.0, 0.003], [100.0, 0.001], size=(2, 40, 2)).astype(np.float32)
    data = single.astype(np.float64)

    np.savez(folder / "plain.npz", *data)
    np.savez(folder / "named.npz", b=data[0], a=data[1])
    np.savez(folder / "one.npz", data)
    np.savez_compressed(folder / "compressed.npz", *data)
    np.savez(folder / "float32.npz", *single)
    np.save(folder / "array.npy", data)
    np.save(folder / "float32.npy", single)
    np.save(folder / "fortran.npy", np.asfortranarray(data))
    np.save(folder / "big_endian.npy", data.astype(">f8"))
    np.savez(folder / "ragged.npz", sequence_000=data[0], sequence_001=data[1, :23])
    np.savetxt(folder / "lines.txt", data[0])
    with open(folder / "lines.txt", "a") as file:
        file.write("\n")
        np.savetxt(file, data[1])

    frame = pd.concat([pd.DataFrame(one, columns=CHANNELS).assign(sequence=s) for s, one in enumerate(data)])
    frame.to_csv(folder / "index.csv")
    frame.to_csv(folder / "no_index.csv", index=False)
    frame.to_csv(folder / "tabs.tsv", index=False, sep="\t")
    frame.to_csv(folder / "semicolons.csv", index=False, sep=";")
    frame[["sequence", *CHANNELS]].reset_index(names="time").to_csv(folder / "time.csv", index=False)


if __name__ == "__main__":
    main()
