#!/usr/bin/env python3
"""The tables of docs/benchmarks.md, from the results that are there: `python table.py [--results FOLDER]`."""

import argparse
import collections
import json
import pathlib
import statistics

import run

COLUMNS = [
    ("one step: nll", ("one", "nll"), 2), ("covers 1 sd", ("one", "cover1"), 2),
    ("ten steps: nll", ("ten", "nll"), 2),
    ("completion: nll", ("completion", "nll"), 2), ("worst", ("completion", "worst_nll"), 2),
    ("covers 1 sd", ("completion", "cover1"), 2), ("2 sd", ("completion", "cover2"), 2),
    ("rmse", ("completion", "rmse"), 2), ("DTW", ("completion", "dtw"), 2), ("end", ("completion", "end"), 2),
    ("leaves by, in 1000 steps", ("completion", "leaves"), 1), ("jerk of samples / data", ("completion", "jerk_of_samples"), 1),
    ("recognised", ("recognised",), 3), ("seconds", ("seconds",), 0),
]


def look_up(result, path):
    for key in path:
        result = result.get(key) if isinstance(result, dict) else None
    return result


def cell(runs, path, digits):
    """Mean over tasks and seeds, and half the range of the seeds' means."""
    seeds = collections.defaultdict(list)
    for result in runs:
        value = look_up(result, path)
        # For a recurrent rival only the training whose settings were found already counts.
        if path == ("seconds",):
            notes = result["notes"]
            value = notes.get("seconds_of_final_training", notes.get("seconds_of_training", value))
        if value is not None:
            seeds[result["seed"]].append(value)
    if not seeds:
        return ""
    means = [statistics.fmean(values) for values in seeds.values()]
    spread = (max(means) - min(means)) / 2
    return f"{statistics.fmean(means):.{digits}f}" + (f" ±{spread:.{digits}f}" if len(means) > 1 else "")


def table(title, results, methods):
    print(f"\n### {title}\n")
    print("| | " + " | ".join(name for name, _, _ in COLUMNS) + " |")
    print("|---" * (len(COLUMNS) + 1) + "|")
    for name in methods:
        runs = [result for result in results if result["method"] == name]
        if runs:
            print(f"| {name} | " + " | ".join(cell(runs, path, digits) for _, path, digits in COLUMNS) + " |")


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--results", type=pathlib.Path, default=run.HERE / "results" / "full")
    results = [json.loads(path.read_text()) for path in sorted(parser.parse_args().results.glob("*.json"))]
    groups = collections.defaultdict(list)
    for result in results:
        task = result["task"]
        groups["lasa (development)" if task.startswith("lasa-dev") else "lasa" if task.startswith("lasa") else task].append(result)
    for title, group in groups.items():
        tasks = sorted({result["task"] for result in group})
        # A mean over tasks compares only methods that have done all of them.
        missing = {name: [t for t in tasks if not any(r["task"] == t and r["method"] == name for r in group)] for name in run.methods()}
        table(f"{title}: {', '.join(tasks)}", group, run.methods())
        for name, tasks in missing.items():
            if tasks and any(result["method"] == name for result in group):
                print(f"\n{name} still lacks {', '.join(tasks)}.")


if __name__ == "__main__":
    main()
