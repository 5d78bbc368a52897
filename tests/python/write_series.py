#!/usr/bin/env python3
"""Writes the labelled series in crates/data/tests/fixtures/series with sktime's own writers.

    write_series.py FOLDER

Run by hand (pip install sktime==1.2.0) when that changes: sktime is too heavy for every run of the checks. In series e, step
t, dimension c the value is 16 e + t / 4 + c / 32; in array.ts one is missing.
"""

import sys

import numpy as np
import sktime
from sktime.datasets import write_ndarray_to_tsfile, write_panel_to_tsfile

folder = sys.argv[1]
e, c, t = np.arange(3)[:, None, None], np.arange(2)[None, :, None], np.arange(6)[None, None, :]
values = 16.0 * e + t / 4 + c / 32
labels = np.array(["wave", "rest", "wave"])
origin = f"Written by sktime {sktime.__version__}"
write_panel_to_tsfile(values, folder, target=labels, problem_name="panel", header=f"{origin}: 16 e + t / 4 + c / 32")
values[1, 0, 2] = np.nan
write_ndarray_to_tsfile(
    values,
    folder,
    problem_name="array",
    class_label=["wave", "rest"],
    class_value_list=labels,
    equal_length=True,
    series_length=6,
    missing_values="?",
    comment=origin,
)
