"""Small pictures and tables for notebooks, without any other package."""

from __future__ import annotations

import html
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

#: Colours of lines, readable on light and dark ground.
COLOURS = ("#2b7bba", "#d1762b", "#3d9a50", "#b4485b", "#7d63b5", "#8c7a5b")
#: Most points of a line: a small picture shows no more.
POINTS = 300


def lines_picture(
    lines: Sequence[npt.ArrayLike],
    band: tuple[npt.ArrayLike, npt.ArrayLike] | None = None,
    width: int = 360,
    height: int = 110,
) -> str:
    """Lines, and a band between two others, as a small SVG. Missing values are gaps."""
    values = [np.asarray(line, dtype=np.float64).ravel() for line in lines]
    limits = [np.asarray(edge, dtype=np.float64).ravel() for edge in band] if band is not None else []
    everything = np.concatenate([*values, *limits]) if values or limits else np.empty(0)
    finite = everything[np.isfinite(everything)]
    if finite.size == 0:
        return ""
    low, high = float(finite.min()), float(finite.max())
    span = (high - low) or 1.0
    longest = max(max(len(value) for value in [*values, *limits]), 2)

    def point(k: int, value: float) -> str:
        x = 4 + (width - 8) * k / (longest - 1)
        y = height - 4 - (height - 8) * (value - low) / span
        return f"{x:.1f},{y:.1f}"

    step = max(1, longest // POINTS)
    parts = []
    if limits:
        lower, upper = limits
        ks = [k for k in range(0, len(lower), step) if np.isfinite(lower[k]) and np.isfinite(upper[k])]
        around = [point(k, float(upper[k])) for k in ks] + [point(k, float(lower[k])) for k in reversed(ks)]
        parts.append(f'<polygon points="{" ".join(around)}" fill="{COLOURS[0]}" fill-opacity="0.2"/>')
    for index, value in enumerate(values):
        colour = COLOURS[index % len(COLOURS)]
        run: list[str] = []
        for k in range(0, len(value), step):
            if np.isfinite(value[k]):
                run.append(point(k, float(value[k])))
            elif run:
                parts.append(polyline(run, colour))
                run = []
        if run:
            parts.append(polyline(run, colour))
    body = "".join(parts)
    return f'<svg width="{width}" height="{height}" viewBox="0 0 {width} {height}" role="img">{body}</svg>'


def polyline(points: Sequence[str], colour: str) -> str:
    """One line without gaps."""
    return f'<polyline points="{" ".join(points)}" fill="none" stroke="{colour}" stroke-width="1.3"/>'


def short_table(head: Sequence[str], rows: Sequence[Sequence[Any]], most: int = 8) -> str:
    """The first rows of a table."""
    cells = "".join(f"<th>{html.escape(str(name))}</th>" for name in head)
    lines = [f"<tr>{cells}</tr>"]
    for row in rows[:most]:
        lines.append("<tr>" + "".join(f"<td>{html.escape(number(cell))}</td>" for cell in row) + "</tr>")
    if len(rows) > most:
        lines.append(f'<tr><td colspan="{len(head)}">and {len(rows) - most} more</td></tr>')
    return f"<table>{''.join(lines)}</table>"


def number(value: Any) -> str:
    """Four digits of a number; all else as it is."""
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def page(title: str, body: str) -> str:
    """A title over a body."""
    return f"<div><strong>{html.escape(title)}</strong><br>{body}</div>"
