#!/usr/bin/env python3
"""Draws docs/report.svg: four figures of a page of `scrnn report`, two in a row.

    scrnn train assets/experiments/sinusoid_fast.toml
    scrnn report runs/sinusoid_fast
    python3 docs/report_figure.py runs/sinusoid_fast/figures > docs/report.svg

Needs no package.
"""

import re
import sys
from pathlib import Path

NAMES = ("learning", "calibration", "ahead-1", "on-its-own-1")
WIDTH, GAP = 680, 20
FONT = 'font-family="sans-serif" font-size="19" font-weight="bold" fill="#22262B"'


def figure(folder, name):
    """The figure's height at WIDTH, its title and its own text."""
    text = (Path(folder) / f"{name}.svg").read_text()
    width, height = map(float, re.search(r'viewBox="0 0 (\S+) (\S+)"', text).groups())
    title = re.search(r"<title>(.*?)</title>", text).group(1)
    return round(WIDTH * height / width), title, text.replace("<svg ", "<svg {place} ", 1)


def main():
    figures = [figure(sys.argv[1], name) for name in NAMES]
    parts, top = [], 0
    for row in (figures[:2], figures[2:]):
        for column, (height, title, text) in enumerate(row):
            x = GAP + column * (WIDTH + GAP)
            parts.append(f'<text x="{x}" y="{top + 28}" {FONT}>{title}</text>')
            place = f'x="{x}" y="{top + 42}" width="{WIDTH}" height="{height}"'
            parts.append(text.replace("{place}", place, 1).strip())
        top += 42 + max(height for height, _, _ in row) + GAP
    width = 2 * WIDTH + 3 * GAP
    print(f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {top}">')
    print("<title>Four figures of the page that scrnn report writes</title>")
    print('<rect width="100%" height="100%" fill="#FFFFFF"/>')
    print("\n".join(parts))
    print("</svg>")


if __name__ == "__main__":
    main()
