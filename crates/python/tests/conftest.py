"""What the tests share: movements, trained networks, the program."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pytest

matplotlib.use("Agg")

import scrnn  # noqa: E402

STEPS = np.arange(40)


def movement(period: float, steps: int = 40, noise: float = 0.0) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Two channels that swing."""
    t = np.arange(steps)
    made = np.c_[0.6 * np.sin(t / period), 20 + 5 * np.cos(t / (1.7 * period))]
    return made + noise * np.random.default_rng(0).normal(size=made.shape)


@pytest.fixture
def slow() -> Any:
    return movement(4.0)


@pytest.fixture
def fast() -> Any:
    return movement(2.0, 30)


@pytest.fixture(scope="session")
def trained() -> scrnn.SCTRNN:
    """A network that learned a slow and a fast movement. Not to be changed."""
    net = scrnn.SCTRNN(units=6, time_constant=3.0, epochs=400)
    return net.fit([movement(4.0), movement(2.0, 30)], channels=["a", "b"], names=["slow", "fast"])


@pytest.fixture
def net(trained: scrnn.SCTRNN) -> scrnn.SCTRNN:
    """The same, to be changed."""
    import copy

    return copy.copy(trained)


@pytest.fixture(scope="session")
def program() -> str:
    """The program: the installed one, or the one that SCRNN_PROGRAM names."""
    found = os.environ.get("SCRNN_PROGRAM")
    if found is None:
        from scrnn.__main__ import program as installed

        found = installed() or shutil.which("scrnn")
    if found is None:
        if os.environ.get("CI"):
            pytest.fail("there is no program scrnn: SCRNN_PROGRAM names one")
        pytest.skip("there is no program scrnn: SCRNN_PROGRAM names one")
    return found


@pytest.fixture(autouse=True)
def in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Runs each test in a folder of its own: nothing is left in the tree."""
    monkeypatch.chdir(tmp_path)
    yield
