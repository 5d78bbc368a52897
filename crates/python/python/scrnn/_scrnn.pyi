"""Stubs of the compiled module. What a person uses lies in the package `scrnn`, in Python."""

from collections.abc import Callable, Sequence
from typing import Any, final

import numpy as np
import numpy.typing as npt

_Floats = npt.NDArray[np.float64]
#: Names of channels, names of sequences, arrays (steps, channels).
_Given = tuple[list[str], list[str], list[_Floats]]
_Show = Callable[[str, int, int, float | None, float, float | None], bool]
_Say = Callable[[str], None]

__all__ = [
    "__version__",
    "Error",
    "FileError",
    "RefusedError",
    "DivergedError",
    "InternalError",
    "break_down",
    "Model",
    "Follower",
    "Step",
    "fit",
    "train_paths",
    "generate",
    "go_on",
    "recognize",
    "score",
    "evaluate",
    "calibrate",
    "read",
    "write",
    "task",
    "sweep_plan",
    "sweep_run",
    "sweep_status",
    "compare",
    "studies",
    "reproduce",
    "simulate_reach",
    "simulate_interact",
]

__version__: str

class Error(ValueError): ...
class FileError(Error): ...
class RefusedError(Error): ...
class DivergedError(Error): ...
class InternalError(Error): ...

def break_down(attended: bool) -> None: ...

@final
class Model:
    @staticmethod
    def open(path: str, best: bool) -> Model: ...
    @staticmethod
    def restore(
        all: list[tuple[str, bytes]],
        best: list[tuple[str, bytes]],
        histories: list[str],
        experiment: str,
        data: _Given | None,
    ) -> Model: ...
    def __copy__(self) -> Model: ...
    def __deepcopy__(self, _memo: Any) -> Model: ...
    def save(self, folder: str, overwrite: bool) -> None: ...
    def spill(self, folder: str) -> None: ...
    def best(self) -> Model: ...
    def checkpoint(self) -> bytes: ...
    def histories(self) -> list[dict[str, _Floats]]: ...
    def parameters(self) -> dict[str, _Floats]: ...
    def initial_states(self) -> tuple[_Floats, _Floats]: ...
    def learned_data(self) -> tuple[_Given, _Given | None]: ...
    def read_like(self, paths: Sequence[str]) -> _Given: ...
    @property
    def members(self) -> int: ...
    @property
    def path(self) -> str: ...
    @property
    def experiment(self) -> str: ...
    @property
    def settings(self) -> str: ...
    @property
    def channels(self) -> list[str]: ...
    @property
    def sequences(self) -> list[str]: ...
    @property
    def epoch(self) -> int: ...
    @property
    def delay(self) -> int: ...
    @property
    def has_variance(self) -> bool: ...
    @property
    def groups(self) -> list[tuple[str, int, float]]: ...
    @property
    def units(self) -> list[str]: ...
    @property
    def scores(self) -> str: ...
    @property
    def remark(self) -> str | None: ...
    @property
    def variance_factors(self) -> list[float] | None: ...
    @property
    def ranges(self) -> list[tuple[float, float]]: ...
    @property
    def scaling(self) -> tuple[_Floats, _Floats]: ...

@final
class Step:
    """What became of one sample, in the data's units."""

    @property
    def sample(self) -> int:
        """Its number, from 1."""
    @property
    def mean(self) -> _Floats | None:
        """The next sample's mean, (channels,); None before the network's delay is over."""
    @property
    def variance(self) -> _Floats | None:
        """The next sample's variance, (channels,); None without variance units."""
    @property
    def forecast(self) -> _Floats:
        """Means of the samples after the next one, (ahead, channels)."""
    @property
    def forecast_variance(self) -> _Floats | None:
        """Their variances, (ahead, channels); None without variance units."""
    @property
    def smoothed(self) -> _Floats:
        """What the window now says about its samples, (window, channels)."""
    @property
    def contexts(self) -> _Floats | None:
        """The contexts that go with them, (window, units); None unless they were asked for."""
    @property
    def log_likelihood(self) -> tuple[float, float] | None:
        """Nats per observed value of the window in scaled units, before and after the updates."""
    @property
    def error(self) -> tuple[float, float] | None:
        """Half the mean squared error over the window in scaled units, before and after."""
    @property
    def locked(self) -> bool | None:
        """Whether the window is as likely as what was learned, but for one nat per step and channel."""
    @property
    def iterations(self) -> int:
        """Updates that were tried."""
    @property
    def given_up(self) -> bool:
        """Whether the network predicted the window better without regression, and goes on so."""
    @property
    def milliseconds(self) -> float:
        """How long it took."""
    @property
    def missing(self) -> list[str]:
        """Channels that had no value."""

@final
class Follower:
    def __new__(
        cls,
        model: Model,
        *,
        window: int = ...,
        iterations: int | None = ...,
        ahead: int = ...,
        optimiser: str | None = ...,
        rate: float | None = ...,
        momentum: float | None = ...,
        max_norm: float | None = ...,
        keep_best: bool = ...,
        tolerance: float | None = ...,
        guard: bool | None = ...,
        deadline: float | None = ...,
        closed_channels: Sequence[str] = ...,
        masked_channels: Sequence[str] = ...,
        begin: str | None = ...,
        sequence: str | None = ...,
        contexts: bool = ...,
        instruction_set: str | None = ...,
    ) -> Follower: ...
    def observe(self, sample: _Floats) -> Step: ...
    @property
    def taken(self) -> int: ...
    @property
    def channels(self) -> list[str]: ...
    @property
    def latency(self) -> tuple[float, float, float, float, int | None] | None: ...

def fit(
    settings: str,
    folder: str,
    way: str,
    *,
    samples: _Given | None = ...,
    kept: Model | None = ...,
    keep: bool = ...,
    threads: int = ...,
    instruction_set: str | None = ...,
    show: _Show | None = ...,
    say: _Say | None = ...,
) -> tuple[Model, dict[str, Any], BaseException | None]: ...
def train_paths(
    paths: Sequence[str],
    *,
    out: str | None = ...,
    way: str = ...,
    settings: Sequence[str] = ...,
    threads: int = ...,
    instruction_set: str | None = ...,
    show: _Show | None = ...,
    say: _Say | None = ...,
) -> tuple[Model, dict[str, Any], BaseException | None]: ...
def generate(
    model: Model,
    *,
    begin: str | tuple[list[str], list[list[float]]],
    sequence: str | None = ...,
    sensed: float = ...,
    open_channels: Sequence[str] = ...,
    noise: bool = ...,
    steps: int | None = ...,
    samples: int = ...,
    seed: int = ...,
    contexts: bool = ...,
    data: _Given | None = ...,
    threads: int = ...,
    instruction_set: str | None = ...,
    say: _Say | None = ...,
) -> dict[str, _Given]: ...
def go_on(
    model: Model,
    data: _Given,
    *,
    observed: int | None = ...,
    steps: int | None = ...,
    samples: int = ...,
    seed: int = ...,
    threads: int = ...,
    instruction_set: str | None = ...,
    say: _Say | None = ...,
) -> dict[str, _Given]: ...
def recognize(
    model: Model,
    data: _Given,
    *,
    starts: int = ...,
    epochs: int = ...,
    seed: int = ...,
    observed: int | None = ...,
    samples: int | None = ...,
    rate: float | None = ...,
    threads: int = ...,
    instruction_set: str | None = ...,
    say: _Say | None = ...,
) -> list[dict[str, Any]]: ...
def score(
    model: Model,
    data: _Given | None = ...,
    *,
    burn_in: float | None = ...,
    threads: int = ...,
    instruction_set: str | None = ...,
    say: _Say | None = ...,
) -> tuple[float | None, float]: ...
def evaluate(
    model: Model,
    data: _Given | None = ...,
    *,
    burn_in: float | None = ...,
    observed: float | None = ...,
    samples: int = ...,
    starts: int = ...,
    epochs: int = ...,
    seed: int = ...,
    threads: int = ...,
    instruction_set: str | None = ...,
    say: _Say | None = ...,
) -> tuple[str, str]: ...
def calibrate(
    model: Model,
    data: _Given | None = ...,
    *,
    burn_in: float | None = ...,
    seed: int = ...,
    threads: int = ...,
    instruction_set: str | None = ...,
    say: _Say | None = ...,
) -> tuple[Model, str, list[str]]: ...
def read(
    paths: Sequence[str],
    *,
    topics: Sequence[str] = ...,
    time: str | None = ...,
    period: float | None = ...,
    channels: Sequence[str] | None = ...,
    arrays_: Sequence[str] = ...,
    axes: str | None = ...,
    unwrap: Sequence[str] = ...,
) -> tuple[_Given, float | None, list[str], str]: ...
def write(path: str, data: Sequence[tuple[str, _Given]]) -> None: ...
def task(
    name: str,
    *,
    sequences: int | None = ...,
    steps: int | None = ...,
    seed: int = ...,
    threads: int = ...,
) -> tuple[_Given, _Given | None]: ...
def studies() -> list[tuple[str, str]]: ...
def sweep_plan(path: str, *, out: str | None = ..., say: _Say | None = ...) -> tuple[str, list[int]]: ...
def sweep_run(path: str, out: str, place: int, *, threads: int = ..., stale: float = ...) -> str: ...
def sweep_status(folder: str) -> tuple[str, str]: ...
def compare(paths: Sequence[str], out: str) -> tuple[str, str]: ...
def reproduce(
    name: str,
    *,
    preset: str = ...,
    seeds: int = ...,
    seed: int = ...,
    out: str | None = ...,
    epochs: int | None = ...,
    settings: Sequence[str] = ...,
    beyond: bool = ...,
    overwrite: bool = ...,
    threads: int = ...,
    show: _Show | None = ...,
    say: _Say | None = ...,
) -> tuple[str, str, bool, BaseException | None]: ...
def simulate_reach(
    model: Model,
    *,
    position: str = ...,
    cycles: int = ...,
    noise: bool = ...,
    seed: int = ...,
    shift_at: int | None = ...,
    to: str | None = ...,
) -> str: ...
def simulate_interact(
    model: Model,
    *,
    order: str | None = ...,
    begin: str = ...,
    trials: int = ...,
    ers: bool = ...,
    seed: int = ...,
    window: int = ...,
    iterations: int = ...,
    rate: float | None = ...,
) -> str: ...
