"""What calls give back: arrays with names, and how they show themselves."""

from __future__ import annotations

import html
import os
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, Union

import numpy as np

from scrnn import _scrnn
from scrnn._data import Floats, Path, frame, lengths
from scrnn._pictures import lines_picture, page, short_table

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

#: One array, or one for each sequence.
Arrays = Union[Floats, list[Floats]]


class History(Mapping[str, Floats]):
    """How a training went: columns of floats by name, a row for each epoch that was noted; NaN where nothing was measured.

    Columns: ``epoch``, ``nll`` (nats per step and channel, in scaled units), ``mse``, ``rate_shared``, ``rate_initial``,
    ``gradient_norm``, ``seconds``, ``recoveries``; with sequences that are held out also ``held_out_nll``, ``held_out_mse``,
    ``closed_loop_1`` and others.

    >>> net.history["nll"].shape == net.history["epoch"].shape
    True
    >>> bool(net.history["nll"][-1] < net.history["nll"][0])
    True
    """

    def __init__(self, columns: Mapping[str, Floats]) -> None:
        self._columns = dict(columns)

    def __getitem__(self, name: str) -> Floats:
        return self._columns[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __len__(self) -> int:
        return len(self._columns)

    @property
    def rows(self) -> int:
        """How many epochs were noted.

        >>> net.history.rows
        401
        """
        return len(self._columns["epoch"]) if "epoch" in self._columns else 0

    def to_pandas(self) -> pd.DataFrame:
        """As a table. Needs pandas.

        >>> list(net.history.to_pandas().columns[:2])
        ['epoch', 'nll']
        """
        import pandas as pd

        return pd.DataFrame(self._columns)

    def to_csv(self, path: Path) -> None:
        """Writes a table.

        >>> net.history.to_csv(folder / "history.csv")
        """
        names = list(self._columns)
        rows = zip(*self._columns.values())
        with open(path, "w", encoding="utf-8") as file:
            file.write(",".join(names) + "\n")
            file.writelines(",".join("" if np.isnan(x) else repr(float(x)) for x in row) + "\n" for row in rows)

    def __repr__(self) -> str:
        if self.rows == 0:
            return "<History: empty>"
        kind = "nll" if np.isfinite(self["nll"]).any() else "mse"
        return f"<History: {self.rows} rows, {kind} {self[kind][0]:.4f} to {self[kind][-1]:.4f} at epoch {int(self['epoch'][-1])}>"

    def _repr_html_(self) -> str:
        if self.rows == 0:
            return page(repr(self), "")
        kind = "nll" if np.isfinite(self["nll"]).any() else "mse"
        lines = [self[kind]]
        held_out = self._columns.get(f"held_out_{kind}")
        if held_out is not None:
            there = np.isfinite(held_out)
            lines.append(np.interp(self["epoch"], self["epoch"][there], held_out[there]) if there.any() else held_out)
        return page(repr(self), lines_picture(lines))


class Generated:
    """What a network generated, in the data's units.

    For one sequence ``mean``, ``variance`` and ``sample`` are arrays (steps, channels), or (samples, steps, channels) where samples were
    asked for. For several sequences they are lists of such arrays. Row 1 predicts the sample after the first ones, as many as the
    network's delay.

    Attributes:
        mean: Predicted means.
        variance: Predicted variances; None for a network without variance units.
        sample: Means plus noise of the predicted variance.
        contexts: Activations of the context units (steps, units), -1 to 1; None unless they were asked for.
        channels: Names of the channels.
        names: Names of the sequences.
        units: Names of the context units; empty unless contexts were asked for.

    >>> out = net.generate(sequence=1, steps=30, samples=3)
    >>> out.mean.shape, out.sample.shape
    ((3, 30, 2), (3, 30, 2))
    >>> bool((out.variance > 0).all())
    True
    """

    def __init__(
        self, fields: Mapping[str, tuple[list[str], list[str], list[Floats]]], samples: int | None, single: bool
    ) -> None:
        self._fields = dict(fields)
        self._samples, self._single = samples, single
        first = next(iter(self._fields.values()))
        self.channels: list[str] = first[0]
        rows: list[str] = first[1]
        self.names: list[str] = rows if samples in (None, 1) else [name.rpartition("/")[0] for name in rows[::samples]]
        self.units: list[str] = self._fields["context"][0] if "context" in self._fields else []
        self.mean: Any = self._shaped("mean")
        self.variance: Any = self._shaped("variance")
        self.sample: Any = self._shaped("sample")
        self.contexts: Any = self._shaped("context")

    def _shaped(self, field: str) -> Any:
        if field not in self._fields:
            return None
        arrays = self._fields[field][2]
        if self._samples is not None:
            count = self._samples
            arrays = [np.stack(arrays[k : k + count]) for k in range(0, len(arrays), count)]
        return arrays[0] if self._single else arrays

    def to_pandas(self) -> pd.DataFrame:
        """One table, indexed by sequence and step (from 1), with columns ``mean_CHANNEL``, ``variance_CHANNEL``, ``sample_CHANNEL``.

        >>> list(net.generate(sequence=1, steps=5).to_pandas().columns)
        ['mean_a', 'mean_b', 'variance_a', 'variance_b', 'sample_a', 'sample_b']
        """
        fields = {field: arrays for field, (_, _, arrays) in self._fields.items() if field != "context"}
        return frame(self.channels, next(iter(self._fields.values()))[1], fields)

    def to_csv(self, path: Path) -> None:
        """Writes the file that ``scrnn generate --out`` writes, to the byte; ``.npz`` and ``.txt`` too.

        Raises:
            scrnn.FileError: The file cannot be written.

        >>> net.generate(sequence=1, steps=5).to_csv(folder / "wave.csv")
        """
        _scrnn.write(os.fspath(path), list(self._fields.items()))

    def _first(self) -> tuple[Floats, Floats | None, Floats]:
        fields = [self._fields[name][2][0] if name in self._fields else None for name in ("mean", "variance", "sample")]
        mean, variance, sample = fields
        assert mean is not None and sample is not None
        return mean, variance, sample

    def __repr__(self) -> str:
        arrays = self._fields["mean"][2]
        many = f"{lengths(arrays[:: self._samples or 1])}"
        samples = "" if self._samples is None else f", {self._samples} samples of each"
        return f"<Generated: {many} on {', '.join(self.channels[:6])}{samples}>"

    def _repr_html_(self) -> str:
        mean, variance, sample = self._first()
        channel = int(np.argmax(np.nanstd(mean, axis=0)))
        line = mean[:, channel]
        band = None
        if variance is not None:
            deviation = np.sqrt(variance[:, channel])
            band = (line - 2 * deviation, line + 2 * deviation)
        return page(f"{self!r}: {self.channels[channel]}", lines_picture([line, sample[:, channel]], band))

    def plot(self, channel: str | int = 0, ax: Axes | None = None) -> Axes:
        """Draws mean, two standard deviations and samples of one channel of the first sequence. Needs matplotlib.

        >>> ax = net.generate(sequence=1, steps=20).plot("a")
        """
        from scrnn import _plots

        return _plots.generated(self, channel, ax)


class Ranked(NamedTuple):
    """A learned sequence beside a new one.

    >>> scrnn.Ranked("reach", 1, -0.5, None).sequence
    'reach'
    """

    #: Name of the learned sequence.
    sequence: str
    #: Its number, from 1.
    number: int
    #: Nats per step and channel in scaled units from its initial state; None where all sequences share one state.
    log_likelihood: float | None
    #: Mean squared distance of the contexts, 0 to 4, where all sequences share one state.
    distance: float | None


class Completed:
    """The rest of a sequence as a distribution, in the data's units; rows begin after the observed samples.

    Attributes:
        mean: (steps, channels).
        variance: (steps, channels); None for a network without variance units, and where no samples were asked for.
        samples: (samples, steps, channels); None where none were asked for.
        effective_states: How many recognised states count: 1 where one explains what was observed far better than all others.
        nll: Nats per step and channel of what really followed, in scaled units; None where that is not known.
        within_one, within_two: Shares of it within one and two standard deviations.

    >>> rest = net.recognize(wave, observed=20, samples=5, starts=4, epochs=20).completed
    >>> rest.mean.shape == rest.samples[0].shape == rest.variance.shape
    True
    """

    def __init__(self, found: Mapping[str, Any]) -> None:
        self.mean: Floats = found["mean"]
        self.variance: Floats | None = found.get("variance")
        self.samples: Floats | None = found.get("samples")
        self.effective_states: float | None = found.get("effective_states")
        self.nll: float | None = found.get("nll")
        self.within_one: float | None = found.get("within_one")
        self.within_two: float | None = found.get("within_two")

    def __repr__(self) -> str:
        samples = "" if self.samples is None else f", {len(self.samples)} samples"
        return f"<Completed: {len(self.mean)} steps on {self.mean.shape[1]} channels{samples}>"

    def _repr_html_(self) -> str:
        if self.mean.size == 0:
            return page(repr(self), "")
        channel = int(np.argmax(np.std(self.mean, axis=0)))
        line, band = self.mean[:, channel], None
        if self.variance is not None:
            deviation = np.sqrt(self.variance[:, channel])
            band = (line - 2 * deviation, line + 2 * deviation)
        return page(repr(self), lines_picture([line], band))


class Recognition:
    """The initial state that explains a sequence best, and what follows from it.

    Attributes:
        sequence: Name of the sequence.
        initial_state: u_0, (units,); empty for a mixture.
        log_likelihood: Nats per step and channel in scaled units; None for a network without variance units.
        error: Half the mean squared error one step ahead, in the data's units.
        start: The kind of start that ended best: "zero", "mean", "learned K" or "random".
        ranking: The learned sequences, the most likely (or most alike) first, a list of `Ranked`.
        trials: Each start with the log-likelihood that it ended at, best first.
        completed: The rest of the sequence, where a part of it was observed; else None.
        completion_error: Half the mean squared error over that rest, in the data's units.

    >>> found = net.recognize(wave, starts=4, epochs=20)
    >>> found.initial_state.shape, found.ranking[0].sequence in net.sequences
    ((6,), True)
    """

    def __init__(self, found: Mapping[str, Any]) -> None:
        self.sequence: str = found["sequence"]
        self.initial_state: Floats = found["initial_state"]
        self.log_likelihood: float | None = found["log_likelihood"]
        self.error: float = found["error"]
        self.start: str = found["start"]
        self.ranking: list[Ranked] = [Ranked(name, number, ll, d) for number, name, ll, d in found["ranking"]]
        self.trials: list[tuple[str, float | None]] = list(found["trials"])
        self.completed: Completed | None = Completed(found) if "mean" in found else None
        self.completion_error: float | None = found["completion_error"]

    def __repr__(self) -> str:
        likelihood = "" if self.log_likelihood is None else f", ln L {self.log_likelihood:.4f}"
        like = f", most like {self.ranking[0].sequence!r}" if self.ranking else ""
        return f"<Recognition of {self.sequence!r}: from {self.start}{likelihood}{like}>"

    def _repr_html_(self) -> str:
        rows = [(r.number, r.sequence, r.log_likelihood if r.distance is None else r.distance) for r in self.ranking]
        table = short_table(("number", "learned", "ln L" if not rows or self.ranking[0].distance is None else "distance"), rows)
        picture = lines_picture([[x for _, x in self.trials if x is not None]]) if len(self.trials) > 1 else ""
        rest = self.completed._repr_html_() if self.completed is not None else ""
        return page(repr(self), table + picture + rest)


class Report:
    """A result of the program: its words, and all its numbers as a dict."""

    def __init__(self, words: str, values: Any) -> None:
        self.words = words
        self.values: Any = values

    def __getitem__(self, key: str) -> Any:
        return self.values[key]

    def __str__(self) -> str:
        return self.words

    def _repr_html_(self) -> str:
        return page(type(self).__name__, f"<pre>{html.escape(self.words)}</pre>")


class Verdict(Report):
    """How a training ended, as ``scrnn train`` says it: ``print`` shows the words, ``verdict["nll"]`` and others the numbers.

    >>> print(net.verdict)  # doctest: +ELLIPSIS
    After 400 epochs the nll is ...
    >>> net.verdict["epoch"]
    400
    """

    def __repr__(self) -> str:
        if not self.values:
            return "<Verdict: none>"
        return f"<Verdict: {self.values.get('outcome', 'a mixture')}, epoch {self.values.get('epoch', '?')}>"


class Evaluation(Report):
    """How a network does on sequences that it did not learn, as ``scrnn evaluate`` says it.

    Numbers are in scaled units and nats per step and channel; ``rmse`` is in the data's units.

    >>> report = net.evaluate(new, samples=5, starts=2, epochs=10)
    >>> report["one_step"]["after_burn_in"]["nll"] < 5
    True
    """

    @property
    def calibration(self) -> Any:
        """Predicted standard deviations beside the errors', in scaled units: ``within_one``, ``within_two``, ``mean_square``, ``bins``;
        None without variance units.

        >>> net.evaluate(new, samples=1, starts=1, epochs=0).calibration["within_two"] <= 1
        True
        """
        return self.values["calibration"]

    def __repr__(self) -> str:
        after = self.values["one_step"]["after_burn_in"]
        score = f"mse {after['mse']:.4g}" if after["nll"] is None else f"nll {after['nll']:.4f}"
        return f"<Evaluation of {len(self.values['sequences'])} sequences: {score} one step ahead>"

    def _repr_html_(self) -> str:
        bins = (self.calibration or {}).get("bins", [])
        picture = ""
        if bins:
            predicted = [one.get("predicted", np.nan) for one in bins]
            observed = [one.get("observed", np.nan) for one in bins]
            picture = lines_picture([observed, predicted])
        return page(repr(self), picture + f"<pre>{html.escape(self.words)}</pre>")


class Calibration(NamedTuple):
    """A factor on each channel's predicted variance, and what it does to the nll.

    >>> found = scrnn.Calibration([1.5], 0.2, 0.1, None)
    >>> found.after < found.before
    True
    """

    #: One factor for each channel.
    factors: list[float]
    #: nll without it, in nats per step and channel.
    before: float
    #: nll with it, on the sequences that it was found from.
    after: float
    #: nll on each sequence with the factor of the others; None for a single sequence.
    left_out: float | None


def names_of(sequences: Sequence[str]) -> str:
    """The first names of a list."""
    return ", ".join(sequences[:5]) + (", ..." if len(sequences) > 5 else "")
