"""Many networks: sweeps on whatever hands out the work, and their comparison."""

from __future__ import annotations

import csv
import html
import io
import json
import os
from collections.abc import Callable, Iterable, Sequence
from typing import Any, Protocol, Union

from scrnn import _scrnn
from scrnn._data import Path, say
from scrnn._pictures import page, short_table
from scrnn._results import Report


class Submits(Protocol):
    """An executor: of `concurrent.futures`, a `dask.distributed.Client`, or anything else that submits a call."""

    def submit(self, fn: Callable[..., str], /, *args: Any, **kwargs: Any) -> Any:
        """Hands a call out; what comes back has ``result()``."""


#: None works in this process; an executor that submits; or the module ``ray``.
Executor = Union[None, Submits, Any]


class Swept(Report):
    """What a sweep came to, as a dict with the keys of ``scrnn sweep --json``, and its folder.

    Attributes:
        folder: Where it lies.

    >>> scrnn.Swept("words", {"runs": 2, "finished": 2}, "runs/x")["finished"]
    2
    """

    def __init__(self, words: str, values: Any, folder: str) -> None:
        super().__init__(words, values)
        self.folder = folder

    def __repr__(self) -> str:
        return f"<Swept {self.folder}: {self['finished']} of {self['runs']} networks>"

    def _repr_html_(self) -> str:
        return page(repr(self), f"<pre>{html.escape(self.words)}</pre>")

    def status(self) -> dict[str, Any]:
        """How far the sweep is now, as ``scrnn sweep --status --json``.

        >>> swept.status()["finished"]
        2
        """
        found: dict[str, Any] = json.loads(_scrnn.sweep_status(self.folder)[1])
        return found

    def compare(self) -> Compared:
        """The page and the numbers, as `scrnn.compare`.

        >>> len(swept.compare().rows)
        2
        """
        return compare(self.folder)


class Compared(Report):
    """The best setting over all seeds, as a dict (empty where nothing tells it), with the rows of metrics.csv.

    Attributes:
        page: Path of report.html, a page that needs nothing else.
        rows: A dict for each run: texts by the columns' names.

    >>> scrnn.Compared("", {}, "runs/x/report.html", "run,nll\\na,1.5\\n").rows
    [{'run': 'a', 'nll': '1.5'}]
    """

    def __init__(self, words: str, values: Any, where: str, text: str) -> None:
        super().__init__(words, values)
        self.page = where
        self.rows: list[dict[str, str]] = list(csv.DictReader(io.StringIO(text)))

    def __repr__(self) -> str:
        return f"<Compared: {self.page}>"

    def _repr_html_(self) -> str:
        rows = [(key, value) for key, value in self.values.items() if not isinstance(value, (list, dict))]
        return page(repr(self), short_table(("", ""), rows, 20))


def _one(path: str, out: str, place: int, threads: int, stale: float) -> str:
    """Trains one network; what every worker calls, in its own process."""
    import scrnn._scrnn

    return scrnn._scrnn.sweep_run(path, out, place, threads=threads, stale=stale)


def _results(executor: Executor, calls: Sequence[tuple[Any, ...]]) -> Iterable[str]:
    """Hands all calls out, and waits for each in turn."""
    if executor is None:
        return (_one(*call) for call in calls)
    if getattr(executor, "__name__", None) == "ray":
        ray: Any = executor
        # A worker that is lost is replaced, and its networks go on from their last checkpoints.
        one = ray.remote(max_retries=20)(_one)
        waiting = [one.remote(*call) for call in calls]
        return (ray.get(each) for each in waiting)
    options: dict[str, Any] = {}
    if type(executor).__module__.split(".")[0] == "distributed":
        # The same call twice is two looks at one run, not one result.
        options = {"pure": False, "retries": 20}
    futures = [executor.submit(_one, *call, **options) for call in calls]
    return (future.result() for future in futures)


def sweep(
    file: Path,
    *,
    out: Path | None = None,
    executor: Executor = None,
    threads: int = 1,
    stale: float = 120.0,
) -> Swept:
    """Trains all networks of a sweep file, each as one call of an executor. The same folders, files and bits as ``scrnn sweep``.

    Args:
        file: The sweep file. All workers must see it, and ``out``, under the same path.
        out: The folder; by default ``runs/NAME`` after the sweep's name. What is finished there is not repeated.
        executor: None works here, one network after the other. Else what hands out the work: an executor of `concurrent.futures`, a
            ``dask.distributed.Client``, or the module ``ray`` after ``ray.init()``. What a worker that is lost had begun goes on from its
            last checkpoint, whoever gets it next; a broken pool of `concurrent.futures` raises, and the same call goes on.
        threads: Threads of each network. No bit depends on it.
        stale: Seconds after which a network is taken over from another machine that gave no sign of life.

    Raises:
        scrnn.Error: There is something wrong with the sweep file, before anything is trained.
        scrnn.FileError: The disk refuses.
        KeyboardInterrupt: After Ctrl-C; networks are saved, and the same call goes on.

    >>> text = 'name = "two"\\nexperiment = "sine.toml"\\nseeds = 2\\n[then]\\nreport = false\\n'
    >>> experiment = 'name = "sine"\\n[data]\\ntask = "sinusoid"\\nsteps = 40\\n[[network.groups]]\\nname = "context"\\nunits = 3\\n'
    >>> experiment += 'time_constant = 2.0\\n[training]\\nepochs = 20\\noptimiser = "adam"\\n'
    >>> _ = (folder / "two.toml").write_text(text), (folder / "sine.toml").write_text(experiment)
    >>> swept = scrnn.sweep(folder / "two.toml", out=folder / "two")
    >>> swept["finished"], swept.compare()["measure"]
    (2, 'nll')
    """
    path = os.path.abspath(os.fspath(file))
    folder, order = _scrnn.sweep_plan(path, out=None if out is None else os.fspath(out), say=say)
    total: dict[str, Any] = {"runs": 0, "finished": 0, "diverged": 0, "killed": 0, "failed": [], "busy": 0, "interrupted": False}
    for text in _results(executor, [(path, folder, place, threads, stale) for place in order]):
        for key, value in json.loads(text).items():
            total[key] = (total[key] or value) if isinstance(value, bool) else total[key] + value
    return Swept(_scrnn.sweep_status(folder)[0], total, folder)


def compare(*paths: Path, out: Path | None = None) -> Compared:
    """Makes the page and metrics.csv of a sweep, or of several runs, as ``scrnn compare``.

    Args:
        paths: The folder of a sweep, or run folders.
        out: Where to write; by default the sweep's folder. For runs it has to be given.

    Raises:
        scrnn.Error: There is nothing to compare.
        scrnn.FileError: The disk refuses.

    >>> compared = scrnn.compare(swept.folder, out=folder / "page")
    >>> os.path.basename(compared.page), compared["measure"]
    ('report.html', 'nll')
    >>> scrnn.compare(folder / "nothing", out=folder / "page")
    Traceback (most recent call last):
    ...
    scrnn.FileError: ...
    """
    if out is None and len(paths) != 1:
        raise _scrnn.Error("runs have no common folder for their page\nsay where to write it: out=...")
    where = os.fspath(paths[0] if out is None else out)
    best, text = _scrnn.compare([os.fspath(path) for path in paths], where)
    values = json.loads(best) or {}
    words = f"best over all seeds by {values['measure']}: {values['setting']}" if values else "nothing tells which setting is best"
    return Compared(words, values, os.path.join(where, "report.html"), text)
