"""Every public function and class says what it does, with an example that is run."""

from __future__ import annotations

import copy
import doctest
import importlib
import inspect
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import scrnn

MODULES = ["_data", "_results", "_estimators", "_following", "_studies", "_sweeps", "_progress", "_scrnn"]


def examples() -> list[Any]:
    finder = doctest.DocTestFinder()
    found = []
    for name in MODULES:
        found += [one for one in finder.find(importlib.import_module(f"scrnn.{name}")) if one.examples]
    return found


@pytest.mark.parametrize("example", examples(), ids=lambda one: one.name.replace("scrnn.", ""))
def test_the_example_holds(example: Any, trained: scrnn.SCTRNN, tmp_path: Path) -> None:
    # The waves of the examples are small: the network of the tests learned channels a and b.
    t = np.arange(40)
    wave = np.c_[0.6 * np.sin(t / 4), np.cos(t / 7)]
    new = [0.8 * wave, 0.7 * wave[::-1]]
    net = example_network(wave)
    example.globs.update(scrnn=scrnn, np=np, os=os, net=net, wave=wave, new=new, folder=tmp_path)
    if any("swept." in one.source and "swept =" not in one.source for one in example.examples):
        example.globs["swept"] = example_sweep(tmp_path)
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.IGNORE_EXCEPTION_DETAIL * 0)
    runner.run(example)
    assert runner.failures == 0


_NETWORK: list[scrnn.SCTRNN] = []


def example_network(wave: Any) -> scrnn.SCTRNN:
    """Trained once, copied for each example."""
    if not _NETWORK:
        other = np.c_[0.6 * np.sin(np.arange(40) / 2), np.cos(np.arange(40) / 3)]
        net = scrnn.SCTRNN(units=6, time_constant=3.0, epochs=400)
        _NETWORK.append(net.fit([wave, other], channels=["a", "b"], names=["slow", "fast"]))
    return copy.copy(_NETWORK[0])


def example_sweep(folder: Path) -> scrnn.Swept:
    """Two networks, trained for each example that asks for them."""
    network = '[[network.groups]]\nname = "context"\nunits = 3\ntime_constant = 2.0\n'
    training = '[training]\nepochs = 20\noptimiser = "adam"\n'
    (folder / "sine.toml").write_text('name = "sine"\n[data]\ntask = "sinusoid"\nsteps = 40\n' + network + training)
    (folder / "two.toml").write_text('name = "two"\nexperiment = "sine.toml"\nseeds = 2\n[then]\nreport = false\n')
    return scrnn.sweep(folder / "two.toml", out=folder / "two")


def public() -> list[Any]:
    """Everything in `scrnn.__all__`, with the public methods and properties of its classes."""
    found: list[Any] = []
    for name in scrnn.__all__:
        thing = getattr(scrnn, name)
        if name.startswith("__"):
            continue
        found.append(pytest.param(name, thing, id=name))
        if inspect.isclass(thing) and not issubclass(thing, (Exception, tuple)):
            for attribute, member in vars(thing).items():
                if not attribute.startswith("_") and (callable(member) or inspect.isdatadescriptor(member)):
                    found.append(pytest.param(f"{name}.{attribute}", member, id=f"{name}.{attribute}"))
    return found


#: Classes whose words are a sentence, and fields of a compiled class, which the class' example shows.
PLAIN = ("Error", "Step.")


@pytest.mark.parametrize("name, thing", public())
def test_it_says_what_it_does_with_an_example(name: str, thing: Any) -> None:
    text = inspect.getdoc(thing)
    assert text and len(text) > 15
    if not any(plain in name for plain in PLAIN):
        assert ">>>" in text, f"{name} has no example"


@pytest.mark.parametrize("name", ["fit", "generate", "forecast", "recognize", "follow", "score", "evaluate", "calibrate"])
def test_arguments_results_and_errors_are_told(name: str) -> None:
    method = getattr(scrnn.SCTRNN, name)
    text = inspect.getdoc(method) or ""
    assert "Args:" in text and "Raises:" in text
    missing = [one for one in inspect.signature(method).parameters if one != "self" and f"{one}:" not in text]
    assert not missing, f"{name} does not say what {missing} are"
