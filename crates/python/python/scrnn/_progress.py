"""How a training is coming along: a bar in a terminal and in a notebook, ten times a second at most; nothing in a pipe."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import Any, NamedTuple, TextIO, Union


class Progress(NamedTuple):
    """Where a training stands, as a function that watches it gets it.

    >>> seen = []
    >>> _ = scrnn.SCTRNN(units=3, epochs=20).fit([wave], progress=seen.append)
    >>> seen[-1].epoch, seen[-1].total
    (20, 20)
    """

    #: The network of a mixture or a study; empty for one network.
    label: str
    #: Updates made.
    epoch: int
    #: Updates to make.
    total: int
    #: Nats per step and channel, in scaled units; None without variance units.
    nll: float | None
    #: Mean squared error, in scaled units.
    mse: float
    #: nll (or mse) of what is held out, where it was looked at.
    held_out: float | None


#: None: a bar where somebody can see it. True: a bar. False: nothing. A function: it is called, and ends the training by True.
Watch = Union[None, bool, Callable[[Progress], Any]]
#: What the compiled part calls.
Show = Callable[[str, int, int, "float | None", float, "float | None"], bool]


def words(now: Progress, begun: float, first: int) -> str:
    """`nll -1.2345  held out -1.1  250 epochs/s  3 s left`."""
    parts = [f"mse {now.mse:.3e}" if now.nll is None else f"nll {now.nll:.4f}"]
    if now.held_out is not None:
        parts.append(f"held out {now.held_out:.4f}")
    speed = (now.epoch - first) / max(time.monotonic() - begun, 1e-9)
    if speed > 0:
        parts += [f"{speed:.0f} epochs/s", f"{max(now.total - now.epoch, 0) / speed:.0f} s left"]
    return "  ".join(parts)


class Terminal:
    """A bar in the last line of a terminal."""

    def __init__(self, stream: TextIO) -> None:
        self.stream = stream
        self.begun: dict[str, tuple[float, int]] = {}
        self.width = 0

    def __call__(self, now: Progress) -> None:
        begun, first = self.begun.setdefault(now.label, (time.monotonic(), now.epoch))
        share = now.epoch / max(now.total, 1)
        bar = ("#" * round(24 * share)).ljust(24, ".")
        line = f"{now.label}{bar} {now.epoch}/{now.total} epochs  {words(now, begun, first)}"
        self.stream.write("\r" + line.ljust(self.width)[:200])
        self.width = len(line)
        self.stream.flush()

    def close(self) -> None:
        """Leaves the line."""
        if self.width:
            self.stream.write("\n")
            self.stream.flush()


class Notebook:
    """A bar below a cell of a notebook."""

    def __init__(self, display: Callable[..., Any], html: Callable[[str], Any]) -> None:
        self.display, self.html = display, html
        self.handle: Any = None
        self.begun: dict[str, tuple[float, int]] = {}
        self.latest: dict[str, Progress] = {}

    def __call__(self, now: Progress) -> None:
        self.begun.setdefault(now.label, (time.monotonic(), now.epoch))
        self.latest[now.label] = now
        lines = [
            f'<progress value="{one.epoch}" max="{one.total}"></progress> {label} {one.epoch}/{one.total} '
            f"{words(one, *self.begun[label])}"
            for label, one in self.latest.items()
        ]
        shown = self.html("<br>".join(lines))
        if self.handle is None:
            self.handle = self.display(shown, display_id=True)
        else:
            self.handle.update(shown)

    def close(self) -> None:
        """Stays as it is."""


def in_notebook() -> bool:
    """Whether this is a notebook's kernel, without importing IPython."""
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython is not None else None
    return type(shell).__name__ == "ZMQInteractiveShell"


def chosen(watch: Watch) -> Terminal | Notebook | Callable[[Progress], Any] | None:
    """What shows a training."""
    if callable(watch):
        return watch
    if watch is False:
        return None
    if in_notebook():
        from IPython.display import HTML, display

        return Notebook(display, HTML)
    if watch is True or (sys.stderr is not None and sys.stderr.isatty()):
        return Terminal(sys.stderr)
    return None


class Showing:
    """Shows a training while it goes on: ``with Showing(watch) as show: ...``."""

    def __init__(self, watch: Watch) -> None:
        self.shown = chosen(watch)

    def __enter__(self) -> Show | None:
        if self.shown is None:
            return None
        shown = self.shown

        def show(
            label: str, epoch: int, total: int, nll: float | None, mse: float, held_out: float | None
        ) -> bool:
            return shown(Progress(label, epoch, total, nll, mse, held_out)) is True

        return show

    def __exit__(self, *_: object) -> None:
        if isinstance(self.shown, (Terminal, Notebook)):
            self.shown.close()
