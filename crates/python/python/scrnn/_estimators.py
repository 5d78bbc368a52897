"""Networks as estimators: settings, training, and all that a trained network does."""

from __future__ import annotations

import inspect
import json
import os
import tempfile
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Union

import numpy as np
import numpy.typing as npt

from scrnn import _scrnn
from scrnn._data import Data, Floats, Gathered, Path, Sequences, gather, is_path, paths, say
from scrnn._following import Follower, names as names_in
from scrnn._pictures import page, short_table
from scrnn._progress import Showing, Watch
from scrnn._results import Calibration, Evaluation, Generated, History, Recognition, Verdict, names_of

if TYPE_CHECKING:
    from typing import Self

    from matplotlib.axes import Axes

#: How samples are scaled: a name, or a range [low, high] for each channel, or offsets and scales.
Scaling = Union[None, str, Sequence[Sequence[float]], Mapping[str, Sequence[float]]]

#: Where each parameter stands in an experiment file.
KEYS = {
    "delay": "network.delay",
    "variance": "network.variance",
    "variance_floor": "network.variance_floor",
    "initial_state_variance": "network.initial_state_variance",
    "mean": "network.mean",
    "skip": "network.skip",
    "velocity_inputs": "network.velocity_inputs",
    "scaling": "data.scaling",
    "rest": "data.rest",
    "epochs": "training.epochs",
    "optimiser": "training.optimiser",
    "members": "training.members",
    "patience": "training.patience",
    "closed_loop": "training.closed_loop",
    "recipe": "training.recipe",
    "seed": "seed",
}
#: Parameters that change nothing of what is learned.
MACHINE = ("threads", "instruction_set")


class NotTrainedError(_scrnn.Error, AttributeError):
    """Something was asked of a network that is not trained yet.

    >>> hasattr(scrnn.SCTRNN(), "history")
    False
    """


def plain(value: Any) -> Any:
    """Values as JSON has them: numpy's numbers and arrays are those of Python."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    return value


def put(table: dict[str, Any], key: str, value: Any) -> None:
    """Sets a dotted key; in a list of groups the name tells which."""
    first, _, rest = key.partition(".")
    if not rest:
        table[first] = value
        return
    inner = table.setdefault(first, {})
    if isinstance(inner, list):
        name, _, rest = rest.partition(".")
        inner = next((one for one in inner if one.get("name") == name), None)
        if inner is None or not rest:
            raise _scrnn.Error(f"the settings have no {key!r}")
    if not isinstance(inner, dict):
        raise _scrnn.Error(f"the settings have no {key!r}: {first!r} has no keys")
    put(inner, rest, value)


def taken(table: dict[str, Any], key: str) -> Any:
    """The value of a dotted key, which is taken out; None where there is none."""
    first, _, rest = key.partition(".")
    if not rest:
        return table.pop(first, None)
    inner = table.get(first)
    return taken(inner, rest) if isinstance(inner, dict) else None


def flat(table: Mapping[str, Any], before: str = "") -> dict[str, Any]:
    """Dotted keys of a nested dict."""
    out: dict[str, Any] = {}
    for key, value in table.items():
        if isinstance(value, dict) and value:
            out.update(flat(value, f"{before}{key}."))
        else:
            out[f"{before}{key}"] = value
    return out


class Network:
    """What all networks have in common. Make an `SCTRNN` or an `SMTRNN`, or `load` a run.

    As scikit-learn asks of an estimator: the constructor keeps its parameters as they are, `get_params`, `set_params` and
    ``sklearn.base.clone`` work, and `fit` returns the network.

    >>> isinstance(net, scrnn.Network)
    True
    """

    #: Parameters that make the groups of context units.
    _of_groups: ClassVar[tuple[str, ...]] = ()

    _model: _scrnn.Model | None
    _verdict: Verdict | None
    _at_fit: dict[str, Any] | None

    if TYPE_CHECKING:
        # Each class has them as parameters.
        epochs: int
        seed: int
        threads: int
        instruction_set: str | None
        settings: Mapping[str, Any] | None
        optimiser: str
        rate: float | None
        batch_size: int | None
        recipe: str | None

    # ---- parameters -------------------------------------------------------------------------------------------------

    @classmethod
    def _signature(cls) -> dict[str, Any]:
        """Names of the parameters and their defaults."""
        parameters = inspect.signature(cls.__init__).parameters.values()
        return {one.name: one.default for one in parameters if one.name != "self"}

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """The parameters of the constructor, by name.

        >>> scrnn.SCTRNN(units=7).get_params()["units"]
        7
        """
        return {name: getattr(self, name) for name in self._signature()}

    def set_params(self, **params: Any) -> Self:
        """Changes parameters. What was learned stays until the next `fit`.

        Raises:
            scrnn.Error: There is no such parameter.

        >>> scrnn.SCTRNN().set_params(units=7).units
        7
        """
        known = self._signature()
        for name, value in params.items():
            if name not in known:
                raise _scrnn.Error(f"{type(self).__name__} has no parameter {name!r}\nthere are {', '.join(known)}")
            setattr(self, name, value)
        return self

    def _groups(self) -> list[dict[str, Any]]:
        raise NotImplementedError

    def _experiment(self, files: list[str], **given: Any) -> dict[str, Any]:
        """The settings in the form of an experiment file."""
        params, defaults = {**self.get_params(), **given}, self._signature()
        automatic = params["recipe"] is not None
        table: dict[str, Any] = {"name": "python", "data": {"files": files}, "network": {}, "training": {}}
        for name, key in KEYS.items():
            value = plain(params.get(name))
            # A recipe chooses what nobody asked for.
            if value is None or (automatic and name not in given and name not in ("recipe", "seed") and value == defaults[name]):
                continue
            if name == "scaling" and isinstance(value, list):
                value = {"ranges": value}
            if name == "closed_loop":
                if value is False:
                    continue
                value = {} if value is True else value
            put(table, key, value)
        asked = any(params[name] != defaults[name] for name in self._of_groups)
        if not automatic or asked:
            table["network"]["groups"] = plain(self._groups())
        optimiser = params["optimiser"]
        for name in ("rate", "batch_size"):
            if params[name] is not None:
                put(table, f"training.{optimiser}.{name}", plain(params[name]))
        for key, value in (params["settings"] or {}).items():
            put(table, key, plain(value))
        if automatic and not table["network"]:
            del table["network"]
        return table

    # ---- training ---------------------------------------------------------------------------------------------------

    def fit(
        self,
        sequences: Data = None,
        y: object = None,
        *,
        channels: Sequence[str] | None = None,
        names: Sequence[str] | None = None,
        held_out: float | Sequence[str] | None = None,
        epochs: int | None = None,
        seed: int | None = None,
        out: Path | None = None,
        resume: bool = False,
        overwrite: bool = False,
        progress: Watch = None,
    ) -> Self:
        """Learns sequences. Ctrl-C (or a notebook's stop button) ends the epoch, keeps what was learned, and raises KeyboardInterrupt.

        Args:
            sequences: A list of arrays (steps, channels), which may differ in length; a 3-D array (sequences, steps, channels); one array
                (steps, channels) or (steps,) for a single sequence; a mapping from names to arrays; a DataFrame, where a column called
                ``sequence`` or an outer index tells sequences apart; a list of DataFrames; `Sequences`; or the path of files, folders or
                patterns, or a list of such. Any numbers are taken; NaN is a missing value. With `resume`, None is what was learned before.
            y: Is not used; for scikit-learn's pipelines.
            channels: Names of the channels. For tables and files, those to take, in this order.
            names: Names of the sequences.
            held_out: Sequences that are not learned but judged by: a share above 0 and below 1, or names.
            epochs: How often all sequences are seen, all calls with `resume` together; by default the constructor's. With Adam it shapes the
                rate from the first epoch on, and cannot change on the way.
            seed: Of the first weights; by default the constructor's.
            out: A folder that becomes a run of the program: `scrnn.load` and ``scrnn report`` take it. By default nothing is written.
            resume: Go on with the training, in `out` or of this network.
            overwrite: Throw away a run that is in `out`.
            progress: None shows a bar in terminals and notebooks, True anywhere, False nothing; a function gets a `Progress`, ten times a
                second at most, and ends the training by returning True.

        Returns:
            This network.

        Raises:
            scrnn.Error: What is wrong with data or settings.
            scrnn.RefusedError: `out` holds a run.
            scrnn.DivergedError: The training left the finite numbers; the last good state is kept.
            KeyboardInterrupt: After Ctrl-C; `fit(resume=True)` goes on.

        >>> small = scrnn.SCTRNN(units=5, time_constant=3.0, epochs=20, optimiser="momentum")
        >>> small.fit([wave, wave[:25]], channels=["a", "b"], names=["long", "short"]).epoch
        20
        >>> small.fit(resume=True, epochs=30).epoch
        30
        """
        given = {name: value for name, value in (("epochs", epochs), ("seed", seed)) if value is not None}
        with tempfile.TemporaryDirectory(prefix="scrnn-") as scratch:
            folder = os.path.abspath(os.fspath(out)) if out is not None else scratch
            gathered: Gathered | None = None
            kept: _scrnn.Model | None = None
            if resume and sequences is None:
                table, kept = self._resumed(given, None if out is None else folder)
                if out is None:
                    kept.spill(folder)
            else:
                table, gathered = self._begun(sequences, channels, names, folder, given)
                if held_out is not None:
                    held = plain(held_out)
                    table["data"]["held_out"] = [held] if isinstance(held, str) else held
                if resume and out is None:
                    if self._model is None:
                        raise _scrnn.Error("there is nothing to go on with\nfit without resume, or say with out where the run is")
                    table["data"]["files"] = json.loads(self._model.settings)["data"]["files"]
                    self._model.spill(folder)
            with Showing(progress) as show:
                model, told, raised = _scrnn.fit(
                    json.dumps(table),
                    folder,
                    "resume" if resume else "overwrite" if overwrite else "refuse",
                    samples=None if gathered is None else gathered.given,
                    kept=kept,
                    keep=out is not None,
                    threads=self.threads,
                    instruction_set=self.instruction_set,
                    show=show,
                    say=say,
                )
        return self._took(model, told, raised)

    def _begun(
        self,
        sequences: Data,
        channels: Sequence[str] | None,
        names: Sequence[str] | None,
        folder: str,
        given: dict[str, Any],
    ) -> tuple[dict[str, Any], Gathered | None]:
        """Settings and samples of a training that begins."""
        if is_path(sequences):
            table = self._experiment([os.path.abspath(path) for path in paths(sequences)], **given)
            if names is not None:
                raise _scrnn.Error("names are given, and the files have their own\nread them first: fit(scrnn.read(path), names=...)")
            if channels is not None:
                table["data"]["channels"] = names_in(channels)
            return table, None
        gathered = gather(sequences, channels=channels, names=names)
        return self._experiment([os.path.join(folder, "data.npz")], **given), gathered

    def _resumed(self, given: dict[str, Any], folder: str | None) -> tuple[dict[str, Any], _scrnn.Model]:
        """Settings and network of a training that goes on with what was learned before."""
        if folder is not None and self._model is None:
            self._adopt(load(folder))
        if self._model is None:
            raise NotTrainedError("there is nothing to go on with\nfit some sequences first")
        now = self.get_params()
        before = self._at_fit or now
        changed = [name for name in now if name not in ("epochs", *MACHINE) and not same(now[name], before[name])]
        if changed:
            raise _scrnn.Error(f"{names_of(changed)} changed since the training began\nfit without resume, or set it back")
        table: dict[str, Any] = json.loads(self._model.settings)
        table["training"]["epochs"] = plain(given.get("epochs", self.epochs))
        if "seed" in given and given["seed"] != table["seed"]:
            raise _scrnn.Error(f"the training began with seed {table['seed']}\nleave seed away to go on with it")
        return table, self._model

    def _adopt(self, other: Network) -> None:
        """Takes over what another network learned."""
        self._model, self._verdict = other._model, other._verdict

    def _took(self, model: _scrnn.Model, told: Mapping[str, Any], raised: BaseException | None) -> Self:
        """Keeps what a training made, and raises what came up in it."""
        self._model = model
        self._verdict = Verdict(told["words"], json.loads(told["json"])) if told["words"] else None
        self._at_fit = self.get_params()
        if raised is not None:
            raise raised
        if told["outcome"] == "diverged":
            raise _scrnn.DivergedError(told["message"])
        return self

    def _trained(self) -> _scrnn.Model:
        if self._model is None:
            raise NotTrainedError(f"this {type(self).__name__} is not trained yet\ncall fit, or scrnn.load a run")
        return self._model

    def __sklearn_is_fitted__(self) -> bool:
        return self._model is not None

    def __sklearn_tags__(self) -> Any:
        from sklearn.utils import InputTags, Tags, TargetTags

        return Tags(
            estimator_type=None,
            target_tags=TargetTags(required=False),
            transformer_tags=None,
            classifier_tags=None,
            regressor_tags=None,
            input_tags=InputTags(two_d_array=True, three_d_array=True, allow_nan=True),
        )

    # ---- what was learned ---------------------------------------------------------------------------------------------

    @property
    def epoch(self) -> int:
        """Updates made.

        >>> net.epoch
        400
        """
        return self._trained().epoch

    @property
    def channels(self) -> list[str]:
        """Names of the channels.

        >>> net.channels
        ['a', 'b']
        """
        return self._trained().channels

    @property
    def sequences(self) -> list[str]:
        """Names of the learned sequences.

        >>> net.sequences
        ['slow', 'fast']
        """
        return self._trained().sequences

    @property
    def history(self) -> History:
        """How the training went, by columns; of a mixture, that of its first member.

        >>> "nll" in net.history
        True
        """
        histories = self._trained().histories()
        return History(histories[0] if histories else {})

    @property
    def verdict(self) -> Verdict:
        """What the training came to; empty for a network that was loaded, and after Ctrl-C.

        >>> net.verdict["outcome"]
        'finished'
        """
        self._trained()
        return self._verdict if self._verdict is not None else Verdict("", {})

    @property
    def initial_states(self) -> Floats:
        """u_0 of each learned sequence, (sequences, units).

        >>> net.initial_states.shape
        (2, 6)
        """
        return self._trained().initial_states()[0]

    @property
    def initial_state_mean(self) -> Floats:
        """The mean of the initial states, (units,).

        >>> net.initial_state_mean.shape
        (6,)
        """
        return self._trained().initial_states()[1]

    @property
    def params(self) -> dict[str, Floats]:
        """Weights and biases by name, copies: ``context_from_input`` (units, inputs), ``context_from_context`` (units, units),
        ``context_bias``, ``mean_from_context`` (channels, units), ``mean_bias``, ``variance_from_context``, ``variance_bias``.

        >>> net.params["context_from_context"].shape
        (6, 6)
        """
        return self._trained().parameters()

    @property
    def experiment(self) -> str:
        """The experiment file of the training, with every value explicit.

        >>> "[network]" in net.experiment
        True
        """
        return self._trained().experiment

    @property
    def learned_data(self) -> Sequences:
        """The sequences that were learned, in the data's units.

        >>> net.learned_data.names
        ['slow', 'fast']
        """
        found = self._trained().learned_data()[0]
        return Sequences(found[2], found[0], found[1])

    @property
    def held_out_data(self) -> Sequences | None:
        """The sequences that were held out; None where none were.

        >>> net.held_out_data is None
        True
        """
        found = self._trained().learned_data()[1]
        return None if found is None else Sequences(found[2], found[0], found[1])

    def best(self) -> Self:
        """The best network of the same training: the lowest nll, on what was held out where something was.

        >>> net.best().epoch <= net.epoch
        True
        """
        other = type(self)(**self.get_params())
        other._model, other._at_fit = self._trained().best(), self._at_fit
        return other

    def save(self, path: Path, *, overwrite: bool = False) -> None:
        """Writes a run folder, which `load` and the program take. Samples that are in no file are written beside, as data.npz.

        Raises:
            scrnn.RefusedError: The folder holds a run, and `overwrite` is not set.
            scrnn.FileError: The folder cannot be written.

        >>> net.save(folder / "mine")
        >>> bool((scrnn.load(folder / "mine").params["mean_bias"] == net.params["mean_bias"]).all())
        True
        """
        self._trained().save(os.fspath(path), overwrite)

    # ---- use ----------------------------------------------------------------------------------------------------------

    def _new(self, data: Data, channels: Sequence[str] | None = None) -> Gathered:
        """New sequences from whatever holds them."""
        if is_path(data):
            found = self._trained().read_like(paths(data))
            return Gathered(found[0], found[1], found[2], False)
        return gather(data, channels=channels)

    def generate(
        self,
        sequence: str | int | None = None,
        steps: int | None = None,
        samples: int | None = None,
        *,
        mode: str = "closed",
        mixing: float = 0.5,
        begin: str = "learned",
        initial_state: npt.ArrayLike | None = None,
        data: Data = None,
        open_channels: Sequence[str] | str = (),
        noise: bool = True,
        contexts: bool = False,
        seed: int = 1,
    ) -> Generated:
        """Lets the network run: on its own predictions, on recorded samples, or on a mixture.

        Args:
            sequence: Start from the state of this learned sequence: its name, or its number from 1. By default each of them.
            steps: How many; by default as many as the data have.
            samples: How many times each sequence is generated, with noise of its own.
            mode: ``"closed"`` feeds predictions back, ``"open"`` feeds recorded samples, ``"mixed"`` a mixture.
            mixing: With ``"mixed"``: the recorded sample's share, 0 to 1.
            begin: ``"learned"``: from the states of learned sequences; ``"mean"``: from their mean.
            initial_state: Start from this state (units,), or from each of these (states, units).
            data: Recorded sequences for the open loop, and for the first samples of the closed one; by default what was learned.
            open_channels: Channels that are fed with recorded samples whatever the mode.
            noise: Whether noise of the predicted variance is fed back and in the samples.
            contexts: Give the context units' activations too.
            seed: Of the noise, 0 to 2**64 - 1.

        Returns:
            `Generated`, in the data's units.

        Raises:
            scrnn.Error: There is no such sequence, something does not fit, or values leave the finite numbers.

        >>> net.generate("slow", steps=40).mean.shape
        (40, 2)
        >>> [one.shape for one in net.generate(steps=10, samples=3).sample]
        [(3, 10, 2), (3, 10, 2)]
        >>> net.generate(mode="open", noise=False).mean[0].shape
        (39, 2)
        """
        shares = {"closed": 0.0, "open": 1.0, "mixed": float(mixing)}
        if mode not in shares:
            raise _scrnn.Error(f"there is no mode {mode!r}\ngive \"closed\", \"open\" or \"mixed\"")
        if begin not in ("learned", "mean"):
            raise _scrnn.Error(f"there is no way to begin {begin!r}\ngive \"learned\" or \"mean\"")
        whole("steps", steps, 1)
        whole("samples", samples, 1, 1_000_000)
        whole("seed", seed, 0, 2**64 - 1)
        given = None if data is None else self._new(data)
        place: str | tuple[list[str], list[list[float]]] = begin
        single = sequence is not None or begin == "mean"
        if initial_state is not None:
            states = np.asarray(initial_state, dtype=np.float64)
            single = states.ndim == 1
            rows = np.atleast_2d(states)
            place = ([str(k + 1) for k in range(len(rows))], rows.tolist())
        if given is not None and not given.single:
            single = single and len(given.arrays) == 1
        fields = _scrnn.generate(
            self._trained(),
            begin=place,
            sequence=None if sequence is None else str(sequence),
            sensed=shares[mode],
            open_channels=names_in(open_channels),
            noise=bool(noise),
            steps=steps,
            samples=1 if samples is None else samples,
            seed=seed,
            contexts=bool(contexts),
            data=None if given is None else given.given,
            threads=self.threads,
            instruction_set=self.instruction_set,
            say=say,
        )
        return Generated(fields, samples, single)

    def forecast(
        self,
        sequences: Data,
        steps: int | None = None,
        samples: int = 50,
        *,
        observed: int | None = None,
        seed: int = 1,
    ) -> Generated:
        """How sequences go on after their first `observed` samples: the state is recognised, then closed loops run from it.

        Args:
            sequences: One or several, as `fit` takes them.
            steps: How many after the observed ones; by default to the end of each sequence.
            samples: Closed loops; mean and variance are those of all of them.
            observed: Samples that are heard; by default all.
            seed: Of the search and the noise.

        Returns:
            `Generated`: ``mean`` and ``variance`` (steps, channels), ``sample`` (samples, steps, channels).

        Raises:
            scrnn.Error: Nothing is left to predict, or the sequences do not fit the network.

        >>> rest = net.forecast(wave, steps=6, samples=4, observed=30)
        >>> rest.mean.shape, rest.sample.shape
        ((6, 2), (4, 6, 2))
        """
        whole("steps", steps, 1)
        whole("samples", samples, 1, 1_000_000)
        whole("observed", observed, 1)
        given = self._new(sequences)
        fields = _scrnn.go_on(
            self._trained(),
            given.given,
            observed=observed,
            steps=steps,
            samples=samples,
            seed=seed,
            threads=self.threads,
            instruction_set=self.instruction_set,
            say=say,
        )
        out = Generated(fields, samples, given.single)
        # All loops of a sequence have the same moments.
        for name in ("mean", "variance"):
            value = getattr(out, name)
            if value is not None:
                setattr(out, name, value[0] if given.single else [one[0] for one in value])
        return out

    def recognize(
        self,
        sequences: Data,
        observed: int | None = None,
        samples: int | None = None,
        *,
        starts: int = 20,
        epochs: int = 300,
        rate: float | None = None,
        seed: int = 1,
    ) -> Any:
        """Finds the initial states from which the network predicts sequences best (thesis 2.9).

        Args:
            sequences: One or several, as `fit` takes them. Channels are matched by name where both sides have names.
            observed: Recognise from the first samples, and complete the rest.
            samples: Complete by so many closed loops, from several states that explain what was observed.
            starts: Of the search for each sequence, 1 to 10000.
            epochs: Updates from each start.
            rate: Of the ascent; by default one that suits most networks.
            seed: Of the random starts and the noise.

        Returns:
            A `Recognition` for one sequence, a list of them for several.

        Raises:
            scrnn.Error: The sequences do not fit the network.

        >>> found = net.recognize(wave, observed=30, starts=4, epochs=20)
        >>> found.completed.mean.shape
        (10, 2)
        """
        whole("observed", observed, 1)
        whole("samples", samples, 1, 10_000)
        whole("starts", starts, 1, 10_000)
        whole("epochs", epochs, 0, 1_000_000)
        if samples is not None and observed is None:
            raise _scrnn.Error("samples complete what was not observed\nsay with observed how many samples are heard")
        given = self._new(sequences)
        found = _scrnn.recognize(
            self._trained(),
            given.given,
            starts=starts,
            epochs=epochs,
            seed=seed,
            observed=observed,
            samples=samples,
            rate=rate,
            threads=self.threads,
            instruction_set=self.instruction_set,
            say=say,
        )
        all_found = [Recognition(one) for one in found]
        return all_found[0] if given.single else all_found

    recognise = recognize

    def follow(
        self,
        window: int = 50,
        iterations: int | None = None,
        ahead: int = 10,
        *,
        optimiser: str | None = None,
        rate: float | None = None,
        momentum: float | None = None,
        max_norm: float | None = None,
        keep_best: bool = False,
        tolerance: float | None = None,
        guard: bool | None = None,
        deadline: float | None = None,
        closed_channels: Sequence[str] | str = (),
        masked_channels: Sequence[str] | str = (),
        begin: str | None = None,
        sequence: str | int | None = None,
        contexts: bool = False,
    ) -> Follower:
        """Begins to follow a stream of samples by error regression (thesis 2.10.2).

        Args:
            window: Steps in the sliding window, 1 to 1000000.
            iterations: Updates of the internal state for each sample; by default 15 with ``"lbfgs"`` and 10 with the others.
            ahead: Samples to predict beyond the next one.
            optimiser: ``"lbfgs"`` (default), ``"adam"`` (default with ``rate`` or ``max_norm``) or ``"momentum"``, the thesis' (default with
                ``momentum``).
            rate: Of the ascent; not for ``"lbfgs"``.
            momentum: Of ``"momentum"``; by default 0.9.
            max_norm: Longest gradient; not for ``"lbfgs"``.
            keep_best: Keep the best state that was met, be it the one before the first update; ``"lbfgs"`` does so anyway.
            tolerance: End with an update that changes ln L of the window by less than so many nats a step. By default 2e-5 for ``"lbfgs"``, 0
                for the others.
            guard: Go on from the state without regression where its predictions made the window more likely than regression does. By
                default for ``"lbfgs"`` alone.
            deadline: Milliseconds that a sample may take: updates that do not fit are left out.
            closed_channels: Channels whose input is the network's own prediction, as those of an arm that it moves.
            masked_channels: Channels whose errors do not count.
            begin: ``"mean"`` starts from the mean of the learned states and stays with it. By default the first samples choose.
            sequence: Start from the state of this learned sequence: its name, or its number from 1.
            contexts: Tell the window's contexts with each step.

        Raises:
            scrnn.Error: An option is out of range, or this is a mixture.

        >>> net.follow(window=30, iterations=10).observe(wave[0]).sample
        1
        """
        whole("window", window, 1, 1_000_000)
        if iterations is not None:
            whole("iterations", iterations, 0, 1_000_000)
        whole("ahead", ahead, 0, 100_000)
        if begin not in (None, "mean", "likely"):
            raise _scrnn.Error(f"there is no way to begin {begin!r}\ngive \"mean\", or leave it away")
        return Follower(
            _scrnn.Follower(
                self._trained(),
                window=window,
                iterations=iterations,
                ahead=ahead,
                optimiser=optimiser,
                rate=rate,
                momentum=momentum,
                max_norm=max_norm,
                keep_best=bool(keep_best),
                tolerance=tolerance,
                guard=guard,
                deadline=deadline,
                closed_channels=names_in(closed_channels),
                masked_channels=names_in(masked_channels),
                begin=begin,
                sequence=None if sequence is None else str(sequence),
                contexts=bool(contexts),
                instruction_set=self.instruction_set,
            )
        )

    def score(self, sequences: Data = None, y: object = None, *, burn_in: float | None = None) -> float:
        """How well sequences are predicted one step ahead, from the mean initial state: the higher, the better.

        Args:
            sequences: As `fit` takes them; by default what was held out.
            y: Is not used.
            burn_in: Share of each sequence that is listened to before predictions count, 0 to 0.99; by default 0.1.

        Returns:
            The mean log-likelihood in nats per step and channel, in scaled units; for a network without variance units, minus the mean
            squared error.

        Raises:
            scrnn.Error: The sequences do not fit, or none were held out.

        >>> net.score(wave) > -5
        True
        """
        nll, mse = _scrnn.score(
            self._trained(),
            None if sequences is None else self._new(sequences).given,
            burn_in=burn_in,
            threads=self.threads,
            instruction_set=self.instruction_set,
            say=say,
        )
        return -mse if nll is None else -nll

    def evaluate(
        self,
        sequences: Data = None,
        *,
        burn_in: float | None = None,
        observed: float | None = None,
        samples: int = 50,
        starts: int = 20,
        epochs: int = 300,
        seed: int = 1,
    ) -> Evaluation:
        """Judges the network by sequences that it did not learn, beside simple models.

        Args:
            sequences: As `fit` takes them; by default what was held out.
            burn_in: Share that is listened to before predictions count; by default the training's, or 0.1.
            observed: Share that is heard before the closed loop; by default the training's, or 0.3.
            samples: Closed loops of each sequence.
            starts: Of the search for each state.
            epochs: Updates from each start.
            seed: Of the loops' noise.

        Returns:
            An `Evaluation`: printed, it says what ``scrnn evaluate`` says.

        Raises:
            scrnn.Error: The sequences do not fit or are too short, or none were held out.

        >>> net.evaluate(new, samples=5, starts=2, epochs=10)["observed"]
        0.3
        """
        whole("samples", samples, 1, 10_000)
        whole("starts", starts, 1, 10_000)
        words, values = _scrnn.evaluate(
            self._trained(),
            None if sequences is None else self._new(sequences).given,
            burn_in=burn_in,
            observed=observed,
            samples=samples,
            starts=starts,
            epochs=epochs,
            seed=seed,
            threads=self.threads,
            instruction_set=self.instruction_set,
            say=say,
        )
        return Evaluation(words, json.loads(values))

    def calibrate(self, sequences: Data = None, *, burn_in: float | None = None) -> Calibration:
        """Makes the predicted variances as large as the errors on sequences that were not learned: one factor for each channel.

        The factor belongs to the network from here on, and is saved with it. Going on with the training drops it.

        Args:
            sequences: As `fit` takes them, not those that were learned; by default what was held out.
            burn_in: As in `evaluate`.

        Returns:
            A `Calibration`, of the first member for a mixture.

        Raises:
            scrnn.Error: The sequences were learned, or the network predicts no variance.

        >>> import copy
        >>> other = copy.copy(net)
        >>> len(other.calibrate(new).factors)
        2
        """
        model, effects, _ = _scrnn.calibrate(
            self._trained(),
            None if sequences is None else self._new(sequences).given,
            burn_in=burn_in,
            threads=self.threads,
            instruction_set=self.instruction_set,
            say=say,
        )
        self._model = model
        first = json.loads(effects)[0]
        nll = first["nll"]
        return Calibration(first["factor"]["factors"], nll["before"], nll["after"], nll["left_out"])

    # ---- pictures -----------------------------------------------------------------------------------------------------

    def plot_history(self, ax: Axes | None = None) -> Axes:
        """Draws the learning curve. Needs matplotlib.

        Args:
            ax: Where; by default a figure is made.

        >>> net.plot_history().get_xlabel()
        'epoch'
        """
        from scrnn import _plots

        return _plots.history(self.history, ax)

    def plot_generated(
        self, sequence: str | int | None = None, channel: str | int = 0, ax: Axes | None = None, **options: Any
    ) -> Axes:
        """Draws one channel of what the network generates: mean, two standard deviations, samples. Needs matplotlib.

        Args:
            sequence: A learned sequence; by default the first.
            channel: Its name, or its place from 0.
            ax: Where; by default a figure is made.
            options: As `generate` takes them.

        >>> ax = net.plot_generated("slow", channel="b", steps=20, samples=3)
        """
        wanted = 1 if sequence is None and not {"begin", "initial_state"} & set(options) else sequence
        return self.generate(wanted, **options).plot(channel, ax)

    def plot_calibration(self, sequences: Data = None, ax: Axes | None = None) -> Axes:
        """Draws predicted standard deviations beside the errors' on sequences that were not learned. Needs matplotlib.

        Args:
            sequences: As in `evaluate`.
            ax: Where; by default a figure is made.

        >>> ax = net.plot_calibration(new)
        """
        from scrnn import _plots

        return _plots.calibration(self.evaluate(sequences, samples=1, starts=1, epochs=0), ax)

    def plot_initial_states(self, ax: Axes | None = None) -> Axes:
        """Draws the initial states on their first two principal components. Needs matplotlib.

        Args:
            ax: Where; by default a figure is made.

        >>> ax = net.plot_initial_states()
        """
        from scrnn import _plots

        return _plots.initial_states(self.initial_states, self.sequences, ax)

    def __repr__(self) -> str:
        defaults = self._signature()
        given = [f"{name}={value!r}" for name, value in self.get_params().items() if not same(value, defaults[name])]
        return f"{type(self).__name__}({', '.join(given)})"

    def _repr_html_(self) -> str:
        if self._model is None:
            return page(repr(self), "not trained yet")
        rows: list[Sequence[Any]] = [(name, f"{units} units, time constant {tau:g}") for name, units, tau in self._model.groups]
        rows += [("channels", names_of(self.channels)), ("sequences", names_of(self.sequences)), ("epoch", self.epoch)]
        picture = self.history._repr_html_() if self.history.rows else ""
        return page(repr(self), short_table(("", ""), rows, 12) + picture)


def same(a: Any, b: Any) -> bool:
    """Whether two parameters are equal, also where they are arrays."""
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        return bool(np.array_equal(np.asarray(a), np.asarray(b)))
    return bool(a is b or a == b)


def whole(name: str, value: Any, least: int, most: int = 1_000_000_000) -> None:
    """Refuses what is no whole number in a range."""
    if value is None:
        return
    ok = isinstance(value, (int, np.integer)) and not isinstance(value, bool) and least <= value <= most
    if not ok:
        raise _scrnn.Error(f"{name} is {value!r}\ngive a whole number from {least} to {most}")


class SCTRNN(Network):
    """A stochastic continuous-time recurrent network: one group of context units, which predicts means and variances.

    Args:
        units: Context units.
        time_constant: In steps, at least 1: how slowly the units change.
        delay: Predict the sample that many steps ahead.
        variance: Whether variances are predicted; False makes it a conventional CTRNN.
        variance_floor: Added to each predicted variance, in scaled units.
        initial_state_variance: Variance of the prior over initial states: large lets each sequence find its own, small keeps them together,
            and with 0 all share one.
        mean: ``"tanh"``, in -1 to 1, or ``"linear"``.
        skip: What the means add to: ``"none"``, ``"residual"``, ``"extrapolation"`` or ``"autoregressive"``.
        velocity_inputs: Whether the network sees differences of samples too.
        scaling: ``"fit"`` (default), ``"robust"``, ``"none"``, a range ``[low, high]`` for each channel, or ``{"offset": ..., "scale": ...}``.
        rest: Share of its length for which each sequence's last sample is held.
        epochs: How often all sequences are seen.
        optimiser: ``"adam"`` or ``"momentum"``, the thesis'.
        rate: Its largest rate; by default the optimiser's own.
        batch_size: Sequences of an update with Adam; by default all.
        members: Train so many networks side by side, a mixture.
        patience: End after so many looks at what is held out that brought nothing better.
        closed_loop: Learn a part in the closed loop: True, or a dict of its options.
        recipe: ``"auto"`` chooses, by the data, whatever is not given otherwise, as ``scrnn train DATA`` does.
        settings: Any other keys of an experiment file, e.g. ``{"training.adam.weight_decay": 0.01}``.
        seed: Of the first weights.
        threads: 0 takes one for each core. No bit depends on it.
        instruction_set: Vector instructions; by default the best. No bit depends on them.

    Values are checked by `fit`, which raises `scrnn.Error` for those out of range.

    >>> scrnn.SCTRNN(units=10, time_constant=2.0).fit([wave], epochs=5).epoch
    5
    """

    _of_groups = ("units", "time_constant")

    def __init__(
        self,
        units: int = 40,
        time_constant: float = 5.0,
        *,
        delay: int = 1,
        variance: bool = True,
        variance_floor: float = 0.0,
        initial_state_variance: float = 1.0,
        mean: str = "tanh",
        skip: str = "none",
        velocity_inputs: bool = False,
        scaling: Scaling = None,
        rest: float | None = None,
        epochs: int = 5000,
        optimiser: str = "adam",
        rate: float | None = None,
        batch_size: int | None = None,
        members: int | None = None,
        patience: int | None = None,
        closed_loop: bool | Mapping[str, float] = False,
        recipe: str | None = None,
        settings: Mapping[str, Any] | None = None,
        seed: int = 1,
        threads: int = 0,
        instruction_set: str | None = None,
    ) -> None:
        self.units = units
        self.time_constant = time_constant
        self.delay = delay
        self.variance = variance
        self.variance_floor = variance_floor
        self.initial_state_variance = initial_state_variance
        self.mean = mean
        self.skip = skip
        self.velocity_inputs = velocity_inputs
        self.scaling = scaling
        self.rest = rest
        self.epochs = epochs
        self.optimiser = optimiser
        self.rate = rate
        self.batch_size = batch_size
        self.members = members
        self.patience = patience
        self.closed_loop = closed_loop
        self.recipe = recipe
        self.settings = settings
        self.seed = seed
        self.threads = threads
        self.instruction_set = instruction_set
        self._model = None
        self._verdict = None
        self._at_fit = None

    def _groups(self) -> list[dict[str, Any]]:
        return [{"name": "context", "units": self.units, "time_constant": self.time_constant}]


class SMTRNN(Network):
    """A stochastic multiple-timescale recurrent network: fast units at the inputs and outputs, slow units behind them.

    Args:
        fast: Fast context units, which see inputs and drive outputs.
        slow: Slow context units, which neither see inputs nor drive outputs, and whose initial states tell sequences apart.
        fast_time_constant: In steps.
        slow_time_constant: In steps.

    The other parameters are those of `SCTRNN`.

    >>> net2 = scrnn.SMTRNN(fast=8, slow=3, epochs=5).fit([wave])
    >>> net2.params["context_bias"].shape
    (11,)
    """

    _of_groups = ("fast", "slow", "fast_time_constant", "slow_time_constant")

    def __init__(
        self,
        fast: int = 30,
        slow: int = 10,
        fast_time_constant: float = 5.0,
        slow_time_constant: float = 70.0,
        *,
        delay: int = 1,
        variance: bool = True,
        variance_floor: float = 0.0,
        initial_state_variance: float = 1.0,
        mean: str = "tanh",
        skip: str = "none",
        velocity_inputs: bool = False,
        scaling: Scaling = None,
        rest: float | None = None,
        epochs: int = 5000,
        optimiser: str = "adam",
        rate: float | None = None,
        batch_size: int | None = None,
        members: int | None = None,
        patience: int | None = None,
        closed_loop: bool | Mapping[str, float] = False,
        recipe: str | None = None,
        settings: Mapping[str, Any] | None = None,
        seed: int = 1,
        threads: int = 0,
        instruction_set: str | None = None,
    ) -> None:
        self.fast = fast
        self.slow = slow
        self.fast_time_constant = fast_time_constant
        self.slow_time_constant = slow_time_constant
        self.delay = delay
        self.variance = variance
        self.variance_floor = variance_floor
        self.initial_state_variance = initial_state_variance
        self.mean = mean
        self.skip = skip
        self.velocity_inputs = velocity_inputs
        self.scaling = scaling
        self.rest = rest
        self.epochs = epochs
        self.optimiser = optimiser
        self.rate = rate
        self.batch_size = batch_size
        self.members = members
        self.patience = patience
        self.closed_loop = closed_loop
        self.recipe = recipe
        self.settings = settings
        self.seed = seed
        self.threads = threads
        self.instruction_set = instruction_set
        self._model = None
        self._verdict = None
        self._at_fit = None

    def _groups(self) -> list[dict[str, Any]]:
        return [
            {
                "name": "fast",
                "units": self.fast,
                "time_constant": self.fast_time_constant,
                "learns_initial_state": False,
            },
            {
                "name": "slow",
                "units": self.slow,
                "time_constant": self.slow_time_constant,
                "receives_input": False,
                "drives_output": False,
            },
        ]


def of_model(model: _scrnn.Model) -> Network:
    """An estimator with the settings of a trained network."""
    table: dict[str, Any] = json.loads(model.settings) or {}
    groups = model.groups
    params: dict[str, Any] = {}
    fast_and_slow = [name for name, _, _ in groups] == ["fast", "slow"]
    if fast_and_slow:
        (_, fast, fast_tau), (_, slow, slow_tau) = groups
        params.update(fast=fast, slow=slow, fast_time_constant=fast_tau, slow_time_constant=slow_tau)
    else:
        params.update(units=groups[0][1], time_constant=groups[0][2])
    kind: type[Network] = SMTRNN if fast_and_slow else SCTRNN
    for name, key in KEYS.items():
        value = taken(table, key)
        if value is not None:
            params[name] = value
    scaling = params.get("scaling")
    if isinstance(scaling, dict) and "ranges" in scaling:
        params["scaling"] = scaling["ranges"]
    optimiser = params.get("optimiser", "adam")
    for name in ("rate", "batch_size"):
        value = taken(table, f"training.{optimiser}.{name}")
        if value is not None:
            params[name] = value
    listed = (table.get("network") or {}).get("groups")
    made = kind(**params)._groups()
    usual = {"receives_input": True, "drives_output": True, "learns_initial_state": True}
    if listed is not None and [{**usual, **one} for one in made] == [{**usual, **one} for one in listed]:
        del table["network"]["groups"]
    # Data are given anew; all else that has no parameter stays.
    table = {part: table[part] for part in ("network", "training", "evaluation") if table.get(part)}
    params["settings"] = flat(table) or None
    network = kind(**params)
    network._model = model
    network._at_fit = network.get_params()
    return network


def load(path: Path, *, best: bool = False) -> Network:
    """A trained network from a run folder or a checkpoint file, an `SMTRNN` where its groups are called fast and slow, else an `SCTRNN`.

    Args:
        path: A folder that ``scrnn train``, `Network.save` or ``fit(out=...)`` wrote, or a .safetensors file.
        best: Take the best network instead of the newest.

    Raises:
        scrnn.FileError: It cannot be read.
        scrnn.Error: It is no run and no checkpoint.

    >>> net.save(folder / "again")
    >>> scrnn.load(folder / "again").sequences
    ['slow', 'fast']
    """
    return of_model(_scrnn.Model.open(os.fspath(path), best))


def train(
    path: Path | Sequence[Path],
    *,
    out: Path | None = None,
    epochs: int | None = None,
    seed: int | None = None,
    settings: Mapping[str, Any] | Sequence[str] | None = None,
    resume: bool = False,
    overwrite: bool = False,
    threads: int = 0,
    progress: Watch = None,
) -> Network:
    """Trains as ``scrnn train`` does, into a run folder: from an experiment file, or from data files alone.

    Args:
        path: An experiment file, data files, folders of such or patterns, or with `resume` a run folder.
        out: The run folder; by default ``runs/NAME``.
        epochs: Instead of the experiment's.
        seed: Instead of the experiment's.
        settings: Other keys of the experiment, as a mapping or as ``["network.groups.context.units=20"]``.
        resume: Go on with the run in the folder.
        overwrite: Throw away a run that is there.
        threads: 0 takes one for each core. No bit depends on it.
        progress: As in `Network.fit`.

    Returns:
        The trained network.

    Raises:
        scrnn.Error, scrnn.RefusedError, scrnn.DivergedError, KeyboardInterrupt: As `Network.fit`.

    >>> scrnn.Sequences([wave], ["a", "b"]).to_csv(folder / "own.csv")
    >>> scrnn.train(folder / "own.csv", out=folder / "own", epochs=3).epoch
    3
    """
    changes = [f"{key}={json.dumps(plain(value))}" for key, value in settings.items()] if isinstance(settings, Mapping) else list(settings or [])
    changes += [f"training.epochs={epochs}"] if epochs is not None else []
    changes += [f"seed={seed}"] if seed is not None else []
    with Showing(progress) as show:
        model, told, raised = _scrnn.train_paths(
            paths(path),
            out=None if out is None else os.fspath(out),
            way="resume" if resume else "overwrite" if overwrite else "refuse",
            settings=changes,
            threads=threads,
            show=show,
            say=say,
        )
    return of_model(model)._took(model, told, raised)
