"""The thesis' experiments, and trained networks in the simulated robots."""

from __future__ import annotations

import html
import json
import os
from typing import Any, Union

from scrnn import _scrnn
from scrnn._data import Path, say
from scrnn._estimators import Network, load
from scrnn._pictures import page, short_table
from scrnn._progress import Showing, Watch
from scrnn._results import Report


class Reproduced(Report):
    """What came of a study: its tables in words, `metrics.json` as a dict, and the folder with the page.

    Attributes:
        folder: Where it was written.
        page: Path of report.html, a page that needs nothing else.

    >>> scrnn.Reproduced("words", {"a": 1}, "runs/x").page.endswith("report.html")
    True
    """

    def __init__(self, words: str, values: Any, folder: str) -> None:
        super().__init__(words, values)
        self.folder = folder
        self.page = os.path.join(folder, "report.html")

    def __repr__(self) -> str:
        return f"<Reproduced: {self.page}>"

    def _repr_html_(self) -> str:
        return page(repr(self), f'<a href="{html.escape(self.page)}">the page</a><pre>{html.escape(self.words)}</pre>')


class Simulated(Report):
    """What a network did in a simulated world, as a dict.

    >>> scrnn.Simulated("reach", {"touched": 3})["touched"]
    3
    """

    def __repr__(self) -> str:
        return f"<Simulated {self.words}>"

    def __str__(self) -> str:
        return json.dumps(self.values, indent=2)

    def _repr_html_(self) -> str:
        rows = [(key, value) for key, value in self.values.items() if not isinstance(value, list)]
        return page(repr(self), short_table(("", ""), rows, 20))


def studies() -> dict[str, str]:
    """The studies that can be reproduced, with what they are.

    >>> "sinusoid" in scrnn.studies()
    True
    """
    return dict(_scrnn.studies())


def reproduce(
    name: str,
    *,
    preset: str = "fast",
    seeds: int = 1,
    seed: int = 1,
    out: Path | None = None,
    epochs: int | None = None,
    settings: list[str] | None = None,
    beyond: bool = False,
    overwrite: bool = False,
    threads: int = 0,
    progress: Watch = None,
) -> Reproduced:
    """Reproduces an experiment of the thesis from data to page, as ``scrnn reproduce``.

    Args:
        name: One of `studies`.
        preset: ``"fast"``, what gets there soonest; or ``"thesis"``, the thesis' optimiser and number of epochs.
        seeds: Networks, each with data and weights of its own, 1 to 1000.
        seed: The first seed.
        out: The folder; by default ``runs/reproduce/NAME-PRESET``. What is finished there is not repeated.
        epochs: Instead of the preset's.
        settings: Keys of the training or network, e.g. ``["training.adam.rate=1e-3"]``.
        beyond: With ``"interact"``: also conditions between the thesis' two.
        overwrite: Train and evaluate anew what is in the folder already.
        threads: 0 takes one for each core. No bit depends on it.
        progress: As in `Network.fit`.

    Raises:
        scrnn.Error: There is no such study, or a setting is out of range.
        scrnn.FileError: The disk refuses.
        KeyboardInterrupt: After Ctrl-C; the same call goes on.

    >>> found = scrnn.reproduce("sinusoid", epochs=20, out=folder / "sinusoid")
    >>> os.path.exists(found.page)
    True
    """
    folder = os.fspath(out) if out is not None else os.path.join("runs", "reproduce", f"{name}-{preset}")
    with Showing(progress) as show:
        text, metrics, interrupted, raised = _scrnn.reproduce(
            name,
            preset=preset,
            seeds=seeds,
            seed=seed,
            out=folder,
            epochs=epochs,
            settings=list(settings or []),
            beyond=beyond,
            overwrite=overwrite,
            threads=threads,
            show=show,
            say=say,
        )
    if raised is not None:
        raise raised
    return Reproduced(text, json.loads(metrics) if metrics and not interrupted else {}, folder)


def simulate(name: str, network: Union[Network, Path], **options: Any) -> Simulated:
    """Lets a trained network move the simulated robot NAO (thesis, chapters 4 and 5).

    Args:
        name: ``"reach"``: touch and retract; or ``"interact"``: follow another robot's object.
        network: A `Network` that learned such movements, or the path of its run.
        options: For ``"reach"``: ``position`` ("1", "2", "3" or metres), ``cycles``, ``noise``, ``seed``, ``shift_at``, ``to``. For
            ``"interact"``: ``order`` (letters L and R), ``begin`` ("mean", "corresponding" or an order), ``trials``, ``ers``, ``seed``,
            ``window``, ``iterations``, ``rate``.

    Returns:
        A `Simulated` with the numbers of ``scrnn simulate``: gaps in metres, times in seconds, reaction times in samples.

    Raises:
        scrnn.Error: There is no such experiment, the network learned other channels, or an option is out of range.

    >>> scrnn.simulate("reach", net)
    Traceback (most recent call last):
    ...
    scrnn.Error: the network predicts a, b
    needed: a network that learned HeadYaw, HeadPitch, RShoulderPitch, RShoulderRoll, RElbowYaw, RElbowRoll
    """
    if name not in ("reach", "interact"):
        raise _scrnn.Error(f"there is no simulation {name!r}\nthere are \"reach\" and \"interact\"")
    model = (network if isinstance(network, Network) else load(network))._trained()
    if name == "reach":
        for key in ("position", "to"):
            if options.get(key) is not None:
                options[key] = str(options[key])
        return Simulated(name, json.loads(_scrnn.simulate_reach(model, **options)))
    return Simulated(name, json.loads(_scrnn.simulate_interact(model, **options)))
