"""Error regression, sample by sample."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pytest

import scrnn
from conftest import movement


def test_a_step_has_what_it_says(trained: scrnn.SCTRNN) -> None:
    live = trained.follow(window=8, iterations=3, ahead=4, contexts=True)
    for k, x in enumerate(movement(4.0)):
        step = live.observe(x)
        assert step.sample == k + 1 == live.taken
        assert step.mean.shape == step.variance.shape == (2,) and step.forecast.shape == (4, 2)
        assert step.smoothed.shape == (min(k, 8), 2) and step.contexts.shape == (min(k, 8), 6)
    assert step.iterations == 3 and step.milliseconds > 0 and step.missing == []
    assert step.forecast_variance.shape == (4, 2) and (step.forecast_variance > 0).all()
    before, after = step.log_likelihood
    assert after >= before and step.locked in (True, False)
    assert live.latency.longest >= live.latency.median > 0 and live.latency.missed is None
    assert trained.follow().observe([0.0, 20.0]).contexts is None
    assert "Step 40" in repr(step) and "40 samples" in repr(live)


def test_what_is_smoothed_stays_what_it_was_at_its_step(trained: scrnn.SCTRNN) -> None:
    live, other = trained.follow(window=6, iterations=5), trained.follow(window=6, iterations=5)
    steps = [live.observe(x) for x in movement(4.0)[:12]]
    asked_at_once = [other.observe(x).smoothed for x in movement(4.0)[:12]]
    for step, smoothed in zip(steps, asked_at_once):
        assert (step.smoothed == smoothed).all() and step.smoothed is step.smoothed


def test_it_finds_what_it_follows(trained: scrnn.SCTRNN) -> None:
    live = trained.follow(window=20, iterations=20)
    errors = []
    for x in movement(4.0):
        if live.taken > 20:
            errors.append(abs(step.mean - x) / [0.6, 5])
        step = live.observe(x)
    assert step.locked and np.mean(errors) < 0.4


@pytest.mark.parametrize(
    "form",
    [list, tuple, np.float32, lambda x: x.astype(object), lambda x: x[::-1][::-1], lambda x: x.reshape(1, -1),
     lambda x: {"b": x[1], "a": x[0]}],
    ids=["list", "tuple", "float32", "objects", "strided", "row", "mapping"],
)  # fmt: skip
def test_samples_come_in_any_form(trained: scrnn.SCTRNN, form: Any) -> None:
    wave = np.float32(movement(4.0)).astype(np.float64)
    one, other = trained.follow(window=5), trained.follow(window=5)
    for x in wave[:12]:
        assert (one.observe(x).mean == other.observe(form(x)).mean).all()


def test_missing_values_are_stood_in_for(trained: scrnn.SCTRNN) -> None:
    live = trained.follow(window=5)
    for x in movement(4.0)[:10]:
        live.observe(x)
    for value in [np.nan, np.inf, -np.inf, 1e300]:
        step = live.observe([value, 20.0])
        assert step.missing == ["a"] and np.isfinite(step.mean).all()
    assert live.observe({"b": 20.0}).missing == ["a"]


@pytest.mark.parametrize("sample", [[], [1.0], [1.0, 2.0, 3.0], np.zeros((2, 2)), ["x", "y"], None, {"c": 1.0}, 3.0])
def test_what_is_no_sample_is_refused_and_not_taken_in(trained: scrnn.SCTRNN, sample: Any) -> None:
    live = trained.follow(window=5)
    with pytest.raises(scrnn.Error):
        live.observe(sample)
    assert live.taken == 0


@pytest.mark.parametrize(
    "options, words",
    [
        ({"window": 0}, "window is 0"),
        ({"window": 2.5}, "window is 2.5"),
        ({"iterations": -1}, "iterations is -1"),
        ({"ahead": -1}, "ahead is -1"),
        ({"window": 1_000_000, "ahead": 100_001}, "ahead is"),
        ({"optimiser": "sgd"}, "no optimiser"),
        ({"optimiser": "adam", "momentum": 0.9}, "does not go with"),
        ({"optimiser": "lbfgs", "rate": 0.1}, "does not go with"),
        ({"optimiser": "lbfgs", "max_norm": 1.0}, "does not go with"),
        ({"optimiser": "lbfgs", "momentum": 0.9}, "does not go with"),
        ({"tolerance": -1.0}, "tolerance is -1"),
        ({"momentum": 1.5}, "momentum"),
        ({"rate": 0.0}, "positive"),
        ({"max_norm": -1.0}, "positive"),
        ({"deadline": 0.0}, "more than 0"),
        ({"deadline": float("nan")}, "more than 0"),
        ({"closed_channels": ["c"]}, "channels are a, b"),
        ({"masked_channels": "c"}, "channels are a, b"),
        ({"sequence": "nobody"}, "slow, fast"),
        ({"begin": "sometime"}, "no way to begin"),
    ],
    ids=lambda one: str(one)[:30],
)
def test_options_out_of_range_are_refused_in_words(trained: scrnn.SCTRNN, options: Any, words: str) -> None:
    with pytest.raises(scrnn.Error, match=words):
        trained.follow(**options)


@pytest.mark.parametrize(
    "options",
    [
        {"optimiser": "momentum"},
        {"optimiser": "adam", "rate": 0.01},
        {"optimiser": "adam", "keep_best": True, "guard": True},
        {"optimiser": "lbfgs", "guard": False, "tolerance": 1e-3},
        {"rate": 0.01},
        {"momentum": 0.5},
        {"max_norm": 1.0},
        {"max_norm": 0},
        {"deadline": 1000.0},
        {"closed_channels": ["a"]},
        {"masked_channels": ["b"]},
        {"begin": "mean"},
        {"sequence": "fast"},
        {"sequence": 2},
        {"iterations": 0},
        {"ahead": 0},
        {"window": 1},
    ],
    ids=lambda one: ",".join(one),
)
def test_every_option_follows(trained: scrnn.SCTRNN, options: Any) -> None:
    live = trained.follow(**{"window": 6, "iterations": 2, **options})
    for x in movement(4.0)[:15]:
        step = live.observe(x)
    assert np.isfinite(step.mean).all()


def test_a_deadline_is_kept(trained: scrnn.SCTRNN) -> None:
    live = trained.follow(window=40, iterations=1_000_000, deadline=20.0)
    begun = time.monotonic()
    for x in movement(4.0)[:10]:
        step = live.observe(x)
    assert time.monotonic() - begun < 5 and step.iterations < 1_000_000 and live.latency.missed is not None


def test_before_the_delay_is_over_nothing_is_predicted() -> None:
    net = scrnn.SCTRNN(units=4, delay=3, epochs=3).fit([movement(4.0)])
    live = net.follow(window=5, begin="mean")
    assert live.observe([0.0, 20.0]).mean is None and live.observe([0.0, 20.0]).forecast.shape == (0, 2)
    assert live.observe([0.0, 20.0]).mean.shape == (2,)


def test_two_followers_do_not_know_of_each_other(trained: scrnn.SCTRNN) -> None:
    one, other = trained.follow(window=5), trained.follow(window=5)
    alone = trained.follow(window=5)
    for x in movement(4.0)[:10]:
        mean = one.observe(x).mean
        other.observe(x + 0.1)
        assert (mean == alone.observe(x).mean).all()
