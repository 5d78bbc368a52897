"""Error regression: a network follows samples while they arrive (thesis 2.10.2)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from scrnn import _scrnn
from scrnn._scrnn import Step


class Latency(NamedTuple):
    """Milliseconds that samples took.

    >>> live = net.follow(window=5)
    >>> _ = live.observe(wave[0])
    >>> live.latency.longest >= live.latency.median
    True
    """

    #: Half of them took less.
    median: float
    #: 99 of 100 took less.
    p99: float
    #: The quickest.
    shortest: float
    #: The slowest.
    longest: float
    #: How many took longer than the deadline; None without one.
    missed: int | None


class Follower:
    """Follows a stream of samples, as `Network.follow` begins it.

    >>> live = net.follow(window=10, iterations=3, ahead=4)
    >>> for x in wave[:20]:
    ...     step = live.observe(x)
    >>> step.forecast.shape, step.smoothed.shape, step.mean.shape
    ((4, 2), (10, 2), (2,))
    >>> step.milliseconds >= 0
    True
    """

    def __init__(self, follower: _scrnn.Follower) -> None:
        self._follower = follower

    def observe(self, sample: npt.ArrayLike | Mapping[str, float]) -> Step:
        """Takes one sample, revises the window, and predicts what comes.

        Args:
            sample: One value for each channel, (channels,), in the data's units and the network's order, or a mapping from their names.
                NaN, an infinite value, and one far beyond what was learned are missing: the network's prediction stands in.

        Returns:
            A `Step`.

        Raises:
            scrnn.Error: The sample has another number of values.

        >>> net.follow(window=5).observe([0.1, 0.2]).sample
        1
        """
        if type(sample) is np.ndarray and sample.dtype == np.float64 and sample.ndim == 1:
            return self._follower.observe(sample)
        return self._follower.observe(self._array(sample))

    def _array(self, sample: Any) -> npt.NDArray[np.float64]:
        names = self._follower.channels
        if hasattr(sample, "keys"):
            unknown = [name for name in sample.keys() if name not in names]
            if unknown:
                raise _scrnn.Error(f"the network has no channel {unknown[0]!r}\nthe channels are {', '.join(names)}")
            sample = [sample[name] if name in sample else np.nan for name in names]
        try:
            array = np.asarray(sample, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise _scrnn.Error(f"the sample holds what is no number: {error}") from None
        return np.ascontiguousarray(array.reshape(-1) if array.ndim != 1 else array)

    @property
    def channels(self) -> list[str]:
        """Names of the channels, in the order of a sample's values.

        >>> net.follow().channels
        ['a', 'b']
        """
        return self._follower.channels

    @property
    def taken(self) -> int:
        """How many samples came.

        >>> net.follow().taken
        0
        """
        return self._follower.taken

    @property
    def latency(self) -> Latency | None:
        """How long samples took; None before the first.

        >>> net.follow().latency is None
        True
        """
        found = self._follower.latency
        return None if found is None else Latency(*found)

    def __repr__(self) -> str:
        latency = self.latency
        took = "" if latency is None else f", median {latency.median:.3f} ms"
        return f"<Follower: {self.taken} samples{took}>"

    def _repr_html_(self) -> str:
        from scrnn._pictures import page, short_table

        latency = self.latency
        return page(repr(self), "" if latency is None else short_table(Latency._fields, [latency]))


def names(channels: Sequence[str] | str) -> list[str]:
    """One name or several as a list."""
    return [channels] if isinstance(channels, str) else list(channels)


__all__ = ["Follower", "Latency", "Step"]
