"""From what Python has (arrays, lists, tables, paths) to sequences of float64, and sequences as Python gets them."""

from __future__ import annotations

import json
import logging
import numbers
import os
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias, Union, overload

import numpy as np
import numpy.typing as npt

from scrnn import _scrnn
from scrnn._pictures import lines_picture, page, short_table

if TYPE_CHECKING:
    import pandas as pd

Floats: TypeAlias = npt.NDArray[np.float64]
#: A path, as `open` takes it.
Path: TypeAlias = Union[str, "os.PathLike[str]"]
#: What is taken as sequences; see `SCTRNN.fit`.
Data: TypeAlias = Any

LOG = logging.getLogger("scrnn")


class DataWarning(UserWarning):
    """Something looks wrong in data; what was asked for was done all the same.

    >>> issubclass(scrnn.DataWarning, UserWarning)
    True
    """


def say(message: str) -> None:
    """Tells a sentence of the program: warnings as such, all else in the log called ``scrnn``."""
    kind, _, rest = message.partition(": ")
    if kind == "warning":
        warnings.warn(rest, DataWarning, stacklevel=4)
    else:
        LOG.info(message)


class Gathered(NamedTuple):
    """Sequences as the compiled part takes them."""

    channels: list[str]
    names: list[str]
    arrays: list[Floats]
    #: Whether one sequence was given, and not a list of them.
    single: bool

    @property
    def given(self) -> tuple[list[str], list[str], list[Floats]]:
        """Without what only Python wants to know."""
        return self.channels, self.names, self.arrays


class Sequences(Sequence[Floats]):
    """Sequences on the same channels, as `read` gives them: a list of arrays (steps, channels) of float64, in the data's units.

    Attributes:
        channels: Names of the channels.
        names: Names of the sequences.
        period: Seconds between two samples, or None.
        remarks: What is worth saying about the files.
        facts: What else is known of them: format, clock, gaps, topics.

    Raises:
        scrnn.Error: Where lengths of lists do not fit.

    >>> data = scrnn.Sequences([np.zeros((4, 2)), np.ones((3, 2))], channels=["a", "b"], names=["still", "up"])
    >>> len(data), data["up"].shape, data[0].shape
    (2, (3, 2), (4, 2))
    """

    def __init__(
        self,
        arrays: Iterable[npt.ArrayLike],
        channels: Sequence[str] | None = None,
        names: Sequence[str] | None = None,
        *,
        period: float | None = None,
        remarks: Sequence[str] = (),
        facts: Mapping[str, Any] | None = None,
    ) -> None:
        found = gather(list(arrays), channels=channels, names=names)
        self.arrays: list[Floats] = found.arrays
        self.channels: list[str] = found.channels
        self.names: list[str] = found.names
        self.period = period
        self.remarks = list(remarks)
        self.facts: dict[str, Any] = dict(facts or {})

    def __len__(self) -> int:
        return len(self.arrays)

    @overload
    def __getitem__(self, index: int | str) -> Floats: ...

    @overload
    def __getitem__(self, index: slice) -> Sequences: ...

    def __getitem__(self, index: int | str | slice) -> Floats | Sequences:
        if isinstance(index, slice):
            return Sequences(self.arrays[index], self.channels, self.names[index], period=self.period)
        if isinstance(index, str):
            if index not in self.names:
                raise KeyError(f"there is no sequence {index!r}; there are {', '.join(self.names[:20])}")
            return self.arrays[self.names.index(index)]
        return self.arrays[index]

    def __iter__(self) -> Iterator[Floats]:
        return iter(self.arrays)

    def __repr__(self) -> str:
        return f"<Sequences: {lengths(self.arrays)} on {', '.join(self.channels[:8])}{', ...' if len(self.channels) > 8 else ''}>"

    def _repr_html_(self) -> str:
        rows = [(name, len(array)) for name, array in zip(self.names, self.arrays)]
        picture = lines_picture([array[:, k] for array in self.arrays[:1] for k in range(min(6, array.shape[1]))])
        return page(repr(self), picture + short_table(("sequence", "samples"), rows))

    def to_pandas(self) -> pd.DataFrame:
        """One table with the columns of the channels, indexed by sequence and step (from 1). Needs pandas.

        >>> scrnn.Sequences([np.zeros((4, 2))]).to_pandas().shape
        (4, 2)
        """
        return frame(self.channels, self.names, {"": self.arrays})

    def to_csv(self, path: Path) -> None:
        """Writes a table as the program does; other extensions (.npz, .npy, .txt) write other formats.

        Raises:
            scrnn.FileError: The file cannot be written.
            scrnn.Error: There is no such format.

        >>> scrnn.Sequences([np.zeros((4, 2))]).to_csv(folder / "still.csv")
        >>> scrnn.read(folder / "still.csv").channels
        ['y1', 'y2']
        """
        _scrnn.write(os.fspath(path), [("", (self.channels, self.names, self.arrays))])


def lengths(arrays: Sequence[Floats]) -> str:
    """`3 sequences of 20 to 40 samples`."""
    counts = [len(array) for array in arrays]
    many = f"{len(arrays)} sequence{'' if len(arrays) == 1 else 's'}"
    if not counts:
        return many
    span = str(counts[0]) if min(counts) == max(counts) else f"{min(counts)} to {max(counts)}"
    return f"{many} of {span} samples"


def frame(channels: Sequence[str], names: Sequence[str], fields: Mapping[str, Sequence[Floats]]) -> pd.DataFrame:
    """Fields side by side as one table, indexed by sequence and step."""
    import pandas as pd

    columns = [f"{field}_{channel}" if field else channel for field in fields for channel in channels]
    parts = [np.hstack(parts) for parts in zip(*fields.values())]
    keys = [(name, step + 1) for name, part in zip(names, parts) for step in range(len(part))]
    index = pd.MultiIndex.from_tuples(keys, names=["sequence", "step"])
    return pd.DataFrame(np.vstack(parts) if parts else np.empty((0, len(columns))), index=index, columns=columns)


def is_path(data: object) -> bool:
    """Whether it is a path or a list of some."""
    if isinstance(data, (list, tuple)):
        return bool(data) and all(isinstance(one, (str, os.PathLike)) for one in data)
    return isinstance(data, (str, os.PathLike))


def paths(data: Any) -> list[str]:
    """One path or several as a list."""
    return [os.fspath(one) for one in data] if isinstance(data, (list, tuple)) else [os.fspath(data)]


def is_table(data: object) -> bool:
    """Whether it is a DataFrame, without asking pandas, which is slow to import."""
    return hasattr(data, "columns") and hasattr(data, "to_numpy")


def is_number(data: object) -> bool:
    """Whether it is a single number or text."""
    return isinstance(data, (numbers.Number, str, bytes)) or getattr(data, "ndim", 1) == 0


def is_series(data: object) -> bool:
    """Whether it is a Series."""
    return hasattr(data, "to_numpy") and hasattr(data, "name") and not hasattr(data, "columns")


def floats(data: Any, place: str) -> Floats:
    """Float64 without a copy where it is that already. Masked values and None are missing, as NaN is."""
    if isinstance(data, np.ma.MaskedArray):
        data = np.ma.filled(data.astype(np.float64), np.nan)
    if hasattr(data, "to_numpy") and (is_table(data) or is_series(data)):
        try:
            return np.ascontiguousarray(data.to_numpy(dtype=np.float64, na_value=np.nan))
        except (TypeError, ValueError) as error:
            raise _scrnn.Error(f"{place} holds what is no number: {error}") from None
    try:
        array = np.asarray(data)
    except ValueError as error:
        raise _scrnn.Error(f"{place} is no array: {error}\ngive an array (steps, channels) for each sequence") from None
    if array.dtype.kind == "c":
        raise _scrnn.Error(f"{place} holds complex numbers\ngive real ones, e.g. real and imaginary part as two channels")
    if array.dtype.kind not in "fiubO":
        raise _scrnn.Error(f"{place} holds elements of type {array.dtype}\ngive numbers")
    try:
        return np.asarray(array, dtype=np.float64, order="C")
    except (TypeError, ValueError) as error:
        raise _scrnn.Error(f"{place} holds what is no number: {error}") from None


def sequence(data: Any, place: str) -> Floats:
    """One sequence, (steps, channels); a list of numbers has one channel."""
    array = floats(data, place)
    if array.ndim == 1:
        array = array.reshape(-1, 1)
    if array.ndim != 2:
        raise _scrnn.Error(f"{place} has {array.ndim} axes\na sequence is an array (steps, channels)")
    if array.shape[1] == 0:
        raise _scrnn.Error(f"{place} has no channel\na sequence is an array (steps, channels)")
    return array


def numbered(count: int) -> list[str]:
    """Names for channels that have none, as the program gives them."""
    return [f"y{k + 1}" for k in range(count)]


#: Columns of a table that tell sequences apart.
LABELS = ("sequence", "episode_index", "episode")


def of_table(data: Any, channels: Sequence[str] | None) -> tuple[list[str], list[str], list[Floats]]:
    """A DataFrame: one sequence, or one for each value of the outer index or of a column called `sequence`."""
    columns = [str(column) for column in data.columns]
    labels: Any = None
    if getattr(data.index, "nlevels", 1) == 2:
        labels = data.index.get_level_values(0)
    else:
        label = next((name for name in LABELS if name in columns and name not in (channels or ())), None)
        if label is not None:
            labels = data[data.columns[columns.index(label)]]
            data = data.drop(columns=[data.columns[columns.index(label)]])
            columns = [str(column) for column in data.columns]
    if channels is not None:
        missing = [name for name in channels if name not in columns]
        if missing:
            raise _scrnn.Error(f"the table has no column {', '.join(map(repr, missing))}\nthe columns are {', '.join(columns)}")
        data = data.iloc[:, [columns.index(name) for name in channels]]
        columns = list(channels)
    if labels is None:
        return columns, ["1"], [sequence(data, "the table")]
    keys = np.asarray(labels)
    order = list(dict.fromkeys(keys.tolist()))
    parts = [sequence(data[keys == key], f"sequence {key} of the table") for key in order]
    return columns, [str(key) for key in order], parts


def gather(
    data: Data, *, channels: Sequence[str] | str | None = None, names: Sequence[str] | None = None
) -> Gathered:
    """Sequences from whatever holds them, but paths."""
    if isinstance(channels, str):
        channels = [channels]
    wanted = None if channels is None else [str(channel) for channel in channels]
    if data is None:
        raise _scrnn.Error("there are no sequences\ngive a list of arrays (steps, channels), a table or a path")
    single = False
    found_channels: list[str] | None = None
    found_names: list[str] | None = None
    arrays: list[Floats]
    if isinstance(data, Sequences):
        columns = [column_of(data.channels, name) for name in wanted] if wanted is not None else None
        found_channels = data.channels if wanted is None else wanted
        found_names = data.names
        arrays = data.arrays if columns is None else [np.ascontiguousarray(array[:, columns]) for array in data.arrays]
    elif is_table(data):
        found_channels, found_names, arrays = of_table(data, wanted)
        single = len(arrays) == 1
    elif is_series(data):
        found_channels = [str(data.name)] if data.name is not None else None
        arrays, single = [sequence(data, "the series")], True
    elif isinstance(data, Mapping):
        return gather(list(data.values()), channels=channels, names=[str(key) for key in data] if names is None else names)
    elif isinstance(data, (list, tuple)) or (isinstance(data, Iterable) and not hasattr(data, "__array__")):
        items = list(data)
        if not items:
            raise _scrnn.Error("there are no sequences: the list is empty")
        if any(is_number(item) for item in items):
            raise _scrnn.Error("a list holds sequences, and this one holds single numbers\ngive an array for one sequence")
        if is_table(items[0]):
            tables = [of_table(item, wanted) for item in items]
            found_channels = tables[0][0]
            for k, (other, _, _) in enumerate(tables):
                if other != found_channels:
                    raise _scrnn.Error(
                        f"table {k + 1} has the columns {', '.join(other)}\nthe first has {', '.join(found_channels)}"
                    )
            arrays = [array for _, _, parts in tables for array in parts]
        else:
            arrays = [sequence(item, f"sequence {k + 1}") for k, item in enumerate(items)]
    else:
        array = floats(data, "the array")
        if array.ndim == 3:
            arrays = [sequence(part, f"sequence {k + 1}") for k, part in enumerate(array)]
            if not arrays:
                raise _scrnn.Error("there are no sequences: the array's first axis is empty")
        elif array.ndim == 0:
            raise _scrnn.Error("a single number is no sequence\ngive an array (steps, channels)")
        else:
            arrays, single = [sequence(array, "the array")], True
    count = arrays[0].shape[1]
    for k, other_array in enumerate(arrays):
        if other_array.shape[1] != count:
            raise _scrnn.Error(
                f"sequence {k + 1} has {other_array.shape[1]} channels, the first has {count}\n"
                "all sequences need the same channels"
            )
    if wanted is not None and (found_channels is None or is_series(data)):
        if len(wanted) != count:
            raise _scrnn.Error(f"{len(wanted)} channels are named ({', '.join(wanted)}), and the sequences have {count}")
        found_channels = wanted
    found_channels = numbered(count) if found_channels is None else found_channels
    twice = [name for k, name in enumerate(found_channels) if name in found_channels[:k]]
    if twice:
        raise _scrnn.Error(f"the channel {twice[0]!r} is there twice\nname each channel once")
    if names is not None:
        found_names = [str(name) for name in names]
    if found_names is None:
        found_names = [str(k + 1) for k in range(len(arrays))]
    if len(found_names) != len(arrays):
        raise _scrnn.Error(f"{len(found_names)} sequences are named, and there are {len(arrays)}")
    return Gathered(found_channels, found_names, arrays, single)


def column_of(channels: Sequence[str], name: str) -> int:
    """The place of a channel."""
    if name not in channels:
        raise _scrnn.Error(f"there is no channel {name!r}\nthe channels are {', '.join(channels)}")
    return list(channels).index(name)


def read(
    path: Path | Sequence[Path],
    *,
    topics: Sequence[str] | str = (),
    time: str | None = None,
    period: float | None = None,
    channels: Sequence[str] | None = None,
    arrays: Sequence[str] = (),
    axes: str | None = None,
    unwrap: Sequence[str] = (),
) -> Sequences:
    """Reads sequences as the program does: CSV and text, numpy, MCAP and ROS 2 bags, LeRobot, HDF5, MATLAB, BVH, .ts.

    Args:
        path: A file, a folder, a pattern with ``*``, or a list of these.
        topics: Topics of a recording, joined in this order.
        time: What tells the time: ``"header"``, ``"publish"``, ``"log"`` or ``"rows"``.
        period: Seconds between samples, to which recordings and tables with a clock are brought.
        channels: Channels to take, by name.
        arrays: Arrays of a file that holds several.
        axes: A letter for each axis of an array: ``n`` sequences, ``t`` steps, ``c`` channels.
        unwrap: Channels that are angles: jumps of a whole turn are taken out.

    Returns:
        `Sequences` of float64 in the data's units; NaN is a missing value.

    Raises:
        scrnn.FileError: The system refuses to read.
        scrnn.Error: The file is not what is needed; the message says where.

    >>> _ = (folder / "mine.csv").write_text("a,b\\n1,2\\n3,4\\n5,7\\n")
    >>> data = scrnn.read(folder / "mine.csv")
    >>> data.channels, data[0].tolist()
    (['a', 'b'], [[1.0, 2.0], [3.0, 4.0], [5.0, 7.0]])
    """
    found, seconds, remarks, facts = _scrnn.read(
        paths(path),
        topics=[topics] if isinstance(topics, str) else list(topics),
        time=time,
        period=period,
        channels=None if channels is None else list(channels),
        arrays_=list(arrays),
        axes=axes,
        unwrap=list(unwrap),
    )
    names, sequences = found[1], found[2]
    return Sequences(sequences, found[0], names, period=seconds, remarks=remarks, facts=json.loads(facts))


def task(
    name: str, *, sequences: int | None = None, steps: int | None = None, seed: int = 1, threads: int = 0
) -> tuple[Sequences, Sequences | None]:
    """Sequences of a task of the thesis, with the true variance of the noise in each sample.

    Args:
        name: ``"lissajous"``, ``"patterns"``, ``"sinusoid"``, ``"limit-cycle"``, ``"reach"`` or ``"interact"``.
        sequences: How many; by default as in the thesis.
        steps: Samples in each; by default as in the thesis.
        seed: Of the noise.
        threads: For robots that are simulated; 0 takes one for each core.

    Returns:
        The sequences and the variances, both `Sequences` of the same shapes; no variances for the robots' tasks, where they are not known.

    Raises:
        scrnn.Error: There is no such task, or its robot refuses.

    >>> data, variances = scrnn.task("sinusoid", sequences=2, steps=50)
    >>> data[0].shape == variances[0].shape == (50, 1)
    True
    """
    data, variances = _scrnn.task(name, sequences=sequences, steps=steps, seed=seed, threads=threads)
    truth = None if variances is None else Sequences(variances[2], variances[0], variances[1])
    return Sequences(data[2], data[0], data[1]), truth
