#!/usr/bin/env python3
"""Every method on every task and seed: one JSON file a job in the results folder; what is there is not done again.

    python run.py                      all of it (README.md says how long)
    python run.py --quick              two tasks, one seed, short trainings: does everything work?
    python run.py --methods promp,ours --tasks lasa-a
    python run.py --development        the shapes on which settings may be chosen
    python table.py                    the tables, from the results that are there
"""

import argparse
import concurrent.futures
import json
import multiprocessing
import os
import pathlib
import sys
import time
import traceback

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")

import numpy as np  # noqa: E402

import data  # noqa: E402
import measures  # noqa: E402

HERE = pathlib.Path(__file__).resolve().parent
COPIES = 50


def methods():
    """Name -> (module, class); imported only where needed, since PyTorch alone takes seconds."""
    return {
        "class-mean": ("simple", "ClassMean"),
        "linear": ("simple", "Linear"),
        "nearest": ("simple", "Nearest"),
        "promp": ("primitives", "ProMP"),
        "dmp": ("primitives", "DMP"),
        "gmr-time": ("mixtures", "TimeGMR"),
        "gmr-dynamics": ("mixtures", "DynamicsGMR"),
        "lstm": ("recurrent", "LSTM"),
        "gru": ("recurrent", "GRU"),
        "ours": ("ours", "Scrnn"),
        "ours-members": ("ours", "ScrnnMembers"),
    }


def method(name):
    module, kind = methods()[name]
    return getattr(__import__(module), kind)()


def measured(name, task, seed, quick):
    """One job: fits, then everything that the method offers."""
    model = method(name)
    begun, wall = time.process_time(), time.perf_counter()
    model.fit(task, seed, quick)
    result = {"method": name, "task": task.name, "seed": seed, "quick": quick}
    result["seconds"] = time.process_time() - begun
    result["wall_seconds"] = time.perf_counter() - wall
    held, labels = task.part(task.held_out)
    if quick:
        held, labels = held[:8], labels[:8]
    rng = np.random.default_rng([seed, 20261127])
    predictions = model.one_step(held, labels)
    if predictions:
        result["one"] = measures.one_step(held, predictions)
    shortest = measures.BURN_IN + measures.AHEAD + 1
    long = [(s, label) for s, label in zip(held, labels, strict=True) if len(s) >= shortest]
    # Only where a sequence is long enough for it; scored at every fifth sample, the same ones for everybody.
    if len(long) == len(held):
        predictions = model.ahead(held, labels, measures.AHEAD)
        if predictions:
            result["ten"] = measures.one_step(*every_fifth(held, predictions), first=0)
    completions, beyonds = [], []
    for s, label in zip(held, labels, strict=True):
        n = task.seen(s)
        done = model.complete(s[:n], len(s), label, COPIES, rng)
        if done is None:
            break
        completions.append(done)
        beyonds.append(model.beyond(s[:n], len(s), label, 1000) if task.ends else None)
    if completions:
        result["completion"] = measures.completion(task, held, completions, beyonds)
    told = model.recognise(held)
    if told is not None:
        result["recognised"] = measures.accuracy(labels, told)
    result["notes"] = model.notes()
    return result


def every_fifth(held, predictions):
    first = measures.BURN_IN + measures.AHEAD - 1
    chosen = [slice(first, None, 5)] * len(held)
    return (
        [s[c] for s, c in zip(held, chosen, strict=True)],
        [(mean[c], variance[c]) for (mean, variance), c in zip(predictions, chosen, strict=True)],
    )


def job(arguments):
    name, task_name, seed, quick, path = arguments
    try:
        result = measured(name, data.load(task_name), seed, quick)
    except Exception:
        return f"{path.name}: FAILED\n{traceback.format_exc()}"
    temporary = path.with_suffix(".part")
    temporary.write_text(json.dumps(result, indent=1) + "\n")
    temporary.replace(path)
    one, whole = result.get("one", {}), result.get("completion", {})
    return (
        f"{path.stem:30} one {one.get('nll', float('nan')):7.3f}  completion {whole.get('nll', float('nan')):7.3f} "
        f"rmse {whole.get('rmse', float('nan')):7.3f}  recognised {result.get('recognised', float('nan')):.3f}  {result['wall_seconds']:.0f} s"
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="two tasks, one seed, short trainings")
    parser.add_argument("--development", action="store_true", help="the tasks on which settings may be chosen")
    parser.add_argument("--methods", help="some of them, with commas between")
    parser.add_argument("--tasks", help="some of them, with commas between")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--workers", type=int, default=1, help="processes side by side, one core each")
    parser.add_argument("--results", type=pathlib.Path, default=HERE / "results")
    given = parser.parse_args()
    chosen = given.methods.split(",") if given.methods else list(methods())
    unknown = set(chosen) - set(methods())
    if unknown:
        parser.error(f"no such method: {', '.join(sorted(unknown))}; there are {', '.join(methods())}")
    tasks = given.tasks.split(",") if given.tasks else data.names(given.development)
    if given.quick and not given.tasks:
        tasks = ["lasa-dev-1", "basicmotions"]
    folder = given.results / ("quick" if given.quick else "full")
    folder.mkdir(parents=True, exist_ok=True)
    jobs = []
    for task in tasks:
        for name in chosen:
            seeds = method(name).seeds
            for seed in seeds[:1] if given.quick else seeds[: given.seeds]:
                path = folder / f"{task}.{name}.{seed}.json"
                if not path.exists():
                    jobs.append((name, task, seed, given.quick, path))
    print(f"{len(jobs)} jobs to do in {folder}", file=sys.stderr)
    failed = 0
    with concurrent.futures.ProcessPoolExecutor(given.workers, multiprocessing.get_context("spawn")) as pool:
        for line in pool.map(job, jobs):
            failed += "FAILED" in line
            print(line, flush=True)
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
