"""Plots on matplotlib's axes, handed in or made."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from scrnn import _scrnn
from scrnn._data import Floats, column_of
from scrnn._results import Evaluation, Generated, History

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def axes(ax: Axes | None) -> Axes:
    """The axes that were handed in, or new ones."""
    if ax is not None:
        return ax
    import matplotlib.pyplot as plt

    return plt.subplots()[1]


def history(found: History, ax: Axes | None) -> Axes:
    """The learning curve, and that of what is held out."""
    ax = axes(ax)
    if found.rows == 0:
        raise _scrnn.Error("there is no history\nload the run folder, not the checkpoint file alone")
    kind = "nll" if np.isfinite(found["nll"]).any() else "mse"
    ax.plot(found["epoch"], found[kind], label="learned")
    held_out = found.get(f"held_out_{kind}")
    if held_out is not None:
        there = np.isfinite(held_out)
        ax.plot(found["epoch"][there], held_out[there], label="held out")
        ax.legend()
    ax.set_xlabel("epoch")
    ax.set_ylabel("nll (nats per step and channel)" if kind == "nll" else "mean squared error")
    if kind == "mse":
        ax.set_yscale("log")
    return ax


def generated(found: Generated, channel: str | int, ax: Axes | None) -> Axes:
    """Mean, two standard deviations and samples of one channel of the first sequence."""
    ax = axes(ax)
    place = column_of(found.channels, channel) if isinstance(channel, str) else int(channel)
    if not 0 <= place < len(found.channels):
        raise _scrnn.Error(f"there is no channel {place}\nthere are {len(found.channels)}, counted from 0")
    first = {field: getattr(found, field) for field in ("mean", "variance", "sample")}
    first = {field: value[0] if isinstance(value, list) else value for field, value in first.items() if value is not None}
    mean, samples = first["mean"], first["sample"]
    loops = samples if samples.ndim == 3 else samples[None]
    steps = np.arange(1, loops.shape[1] + 1)
    for loop in loops[:20]:
        ax.plot(steps, loop[:, place], color="0.7", linewidth=0.8)
    if mean.ndim == 3:
        mean = mean[0]
        first = {field: value[0] for field, value in first.items()}
    (line,) = ax.plot(steps, mean[:, place], label="mean")
    if "variance" in first:
        deviation = 2 * np.sqrt(first["variance"][:, place])
        low, high = mean[:, place] - deviation, mean[:, place] + deviation
        ax.fill_between(steps, low, high, color=line.get_color(), alpha=0.2, label="two standard deviations")
    ax.set_xlabel("step")
    ax.set_ylabel(found.channels[place])
    ax.legend()
    return ax


def calibration(found: Evaluation, ax: Axes | None) -> Axes:
    """The errors' standard deviations in bins of predicted ones."""
    ax = axes(ax)
    if not found.calibration:
        raise _scrnn.Error("there is no calibration to draw: the network predicts no variance, or too little was given")
    bins = found.calibration["bins"]
    predicted = np.array([one["predicted"] for one in bins])
    observed = np.array([one["observed"] for one in bins])
    ax.plot(predicted, observed, "o-")
    low, high = min(predicted.min(), observed.min()), max(predicted.max(), observed.max())
    ax.plot([low, high], [low, high], color="0.6", linestyle="--", linewidth=1)
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.set_xlabel("predicted standard deviation (scaled)")
    ax.set_ylabel("of the errors")
    return ax


def initial_states(states: Floats, names: Sequence[str], ax: Axes | None) -> Axes:
    """The initial states of the sequences of these names, on their first two principal components."""
    ax = axes(ax)
    states = states - states.mean(axis=0)
    _, _, components = np.linalg.svd(states, full_matrices=False)
    places = np.zeros((len(states), 2))
    count = min(2, len(components))
    places[:, :count] = states @ components[:count].T
    ax.scatter(places[:, 0], places[:, 1])
    if len(states) <= 40:
        for name, (x, y) in zip(names, places):
            ax.annotate(name, (x, y), textcoords="offset points", xytext=(4, 4), fontsize=8)
    ax.set_xlabel("first principal component")
    ax.set_ylabel("second")
    return ax
