"""What the Python package costs: a sample of `follow` beside the library's step, the import, and copies of the data.

    python benches/python_package.py        with an installed wheel: it prints tables for docs/performance.md

A sample's cost above the library is the time of `live.observe(x)` less the time that the library took for the same sample, which
`step.milliseconds` says.
"""

from __future__ import annotations

import gc
import resource
import subprocess
import sys
import time

import numpy as np

import scrnn

#: (context units, channels, window, iterations)
SIZES = [(20, 2, 30, 10), (60, 2, 30, 10), (60, 8, 50, 10), (60, 30, 100, 10)]
SAMPLES = 5000


def follow() -> None:
    """Percentiles of the cost above the library."""
    print("| units, channels, window, iterations | step (median) | above it: median | 99 % | 99.9 % | longest |")
    print("|---|---|---|---|---|---|")
    random = np.random.default_rng(1)
    for units, channels, window, iterations in SIZES:
        t = np.arange(300)[:, None]
        wave = np.sin(t / (5 + np.arange(channels))) + random.normal(scale=0.02, size=(300, channels))
        net = scrnn.SCTRNN(units=units, epochs=30).fit([wave], progress=False)
        live = net.follow(window=window, iterations=iterations, ahead=10)
        for x in wave[:200]:
            live.observe(x)
        above, steps = np.empty(SAMPLES), np.empty(SAMPLES)
        gc.collect()
        for k in range(SAMPLES):
            x = wave[k % 300]
            begun = time.perf_counter_ns()
            step = live.observe(x)
            above[k] = (time.perf_counter_ns() - begun) / 1e3 - 1e3 * step.milliseconds
            steps[k] = 1e3 * step.milliseconds
        found = [np.median(steps), np.median(above), *np.percentile(above, [99, 99.9]), above.max()]
        print(f"| {units}, {channels}, {window}, {iterations} | " + " | ".join(f"{value:.1f} us" for value in found) + " |")


def importing() -> None:
    """Seconds beyond numpy's."""
    script = "import numpy, time; t = time.perf_counter(); import scrnn; print(time.perf_counter() - t)"
    found = [float(subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout) for _ in range(9)]
    print(f"\nimport scrnn after numpy: median {1e3 * np.median(found):.0f} ms, longest {1e3 * max(found):.0f} ms")


def memory() -> None:
    """Peak memory of a training as multiples of the data."""
    script = """
import resource, sys
import numpy as np, scrnn
peak = lambda: resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
net = scrnn.SCTRNN(units=2, epochs=0, threads=1, settings={"training.recompute": True})
net.fit([np.sin(np.arange(2000.0)).reshape(-1, 2)], progress=False)
data = [np.sin(np.arange(1000000) / (50 + k)).reshape(-1, 10) for k in range(20)]
size, before = sum(one.nbytes for one in data), peak()
if sys.argv[1] == "gather":
    from scrnn._data import gather
    gather(data)
else:
    net.fit(data, progress=False)
print((peak() - before) / size)
"""
    for what in ("gather", "fit"):
        done = subprocess.run([sys.executable, "-c", script, what], capture_output=True, text=True, check=True)
        print(f"{what}: {float(done.stdout):.2f} times the data above the arrays themselves")


if __name__ == "__main__":
    print(f"scrnn {scrnn.__version__}, Python {sys.version.split()[0]}, numpy {np.__version__}\n")
    follow()
    importing()
    memory()
    print(f"peak of this process: {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MB")
