#!/usr/bin/env python3
"""Draws docs/sinusoid.svg: what a network that learned the thesis' sine wave predicts.

    scrnn train assets/experiments/sinusoid_fast.toml
    scrnn data sinusoid --out wave.csv
    scrnn generate runs/sinusoid_fast --sequence 1 --mode open --data wave.csv --out open.csv
    scrnn generate runs/sinusoid_fast --sequence 1 --out closed.csv
    python3 docs/sinusoid_figure.py wave.csv wave.truth.csv open.csv closed.csv > docs/sinusoid.svg

Row 1 of the generated files predicts sample 2: the network's delay is 1. Needs no package.
"""

import csv
import math
import sys

STEPS = 100
WIDTH, LEFT, RIGHT = 860, 52, 18
TOPS, HEIGHTS = (34, 280), (180, 110)
GREY, BLUE, ORANGE = "#808890", "#3b82f6", "#e07b39"


def column(path, name):
    with open(path, newline="") as file:
        return [float(row[name]) for row in csv.DictReader(file)]


class Panel:
    """One axis of steps, one of values."""

    def __init__(self, index, low, high, ticks, title):
        self.top, self.height, self.low, self.high = TOPS[index], HEIGHTS[index], low, high
        self.parts = [f'<text x="{LEFT}" y="{self.top - 12}" fill="{GREY}">{title}</text>']
        for tick in ticks:
            y = self.y(tick)
            self.parts.append(f'<path d="M{LEFT} {y}H{WIDTH - RIGHT}" stroke="{GREY}" stroke-opacity=".25"/>')
            self.parts.append(f'<text x="{LEFT - 8}" y="{y + 4}" fill="{GREY}" text-anchor="end">{tick:g}</text>')
        for step in range(0, STEPS + 1, 25):
            y = self.top + self.height + 18
            self.parts.append(f'<text x="{self.x(step)}" y="{y}" fill="{GREY}" text-anchor="middle">{step}</text>')

    def x(self, step):
        return round(LEFT + (WIDTH - LEFT - RIGHT) * step / STEPS, 1)

    def y(self, value):
        return round(self.top + self.height * (self.high - value) / (self.high - self.low), 1)

    def points(self, pairs):
        return " ".join(f"{self.x(step)},{self.y(value)}" for step, value in pairs)

    def line(self, pairs, color, dash=""):
        style = f'stroke="{color}" stroke-width="1.8" stroke-dasharray="{dash}"'
        self.parts.append(f'<polyline points="{self.points(pairs)}" fill="none" {style}/>')

    def band(self, low, high, color):
        self.parts.append(f'<polygon points="{self.points(low + high[::-1])}" fill="{color}" fill-opacity=".28"/>')

    def dots(self, pairs, color):
        for step, value in pairs:
            self.parts.append(f'<circle cx="{self.x(step)}" cy="{self.y(value)}" r="2.2" fill="{color}"/>')


def main():
    wave, truth, opened, closed = sys.argv[1:]
    samples = column(wave, "y")
    true_sd = [math.sqrt(v) for v in column(truth, "variance_y")]
    mean = column(opened, "mean_y")
    sd = [math.sqrt(v) for v in column(opened, "variance_y")]
    own_sd = [math.sqrt(v) for v in column(closed, "variance_y")]
    # Sample t of the wave stands at index t - 1, its prediction at index t - 2.
    steps = range(2, STEPS + 1)

    above = Panel(0, -1.05, 1.05, (-0.8, 0, 0.8), "samples (dots), predicted mean and two standard deviations")
    edge = [[(t, mean[t - 2] + sign * 2 * sd[t - 2]) for t in steps] for sign in (-1, 1)]
    above.band(*edge, BLUE)
    above.line([(t, mean[t - 2]) for t in steps], BLUE)
    above.dots([(t, samples[t - 1]) for t in steps], ORANGE)

    title = "standard deviation by step: true (dashed), predicted while the network runs on its own"
    below = Panel(1, 0, 0.08, (0, 0.04, 0.08), title)
    below.line([(t, own_sd[t - 2]) for t in steps], BLUE)
    below.line([(t, true_sd[t - 1]) for t in steps], ORANGE, "5 4")

    height = TOPS[1] + HEIGHTS[1] + 30
    font = 'font-family="sans-serif" font-size="13"'
    print(f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" {font}>')
    print("<title>A noisy sine wave as a trained S-CTRNN predicts it</title>")
    print("\n".join(above.parts + below.parts))
    print("</svg>")


if __name__ == "__main__":
    main()
