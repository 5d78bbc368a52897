"""Sweeps on Python's engines: the same bytes on each, also when a worker is lost."""

from __future__ import annotations

import concurrent.futures
import multiprocessing
import os
import signal
import subprocess
import time
from pathlib import Path
from typing import Any

import pytest

import scrnn

from conftest import movement

EXPERIMENT = """
name = "sine"
[data]
task = "sinusoid"
steps = 40
[[network.groups]]
name = "context"
units = 4
time_constant = 2.0
[training]
epochs = {epochs}
optimiser = "adam"
[output]
checkpoint_every = 100
"""


def place(folder: Path, seeds: int, epochs: int = 60) -> Path:
    """A sweep of two rates."""
    (folder / "sine.toml").write_text(EXPERIMENT.format(epochs=epochs))
    sweep = folder / "s.toml"
    sweep.write_text(
        f'name = "s"\nexperiment = "sine.toml"\nseeds = {seeds}\n[grid]\n"training.adam.rate" = [1e-3, 1e-2]\n[then]\nreport = false\n'
    )
    return sweep


def same(one: Path, other: Path) -> None:
    """The same files with the same bytes, but for those that say when and where."""

    def files(folder: Path) -> dict[str, bytes]:
        found = {str(path.relative_to(folder)): path for path in folder.rglob("*") if path.is_file()}
        return {name: path.read_bytes() for name, path in found.items() if path.name not in ("times.json", "history.csv")}

    a, b = files(one), files(other)
    assert sorted(a) == sorted(b)
    assert [name for name in a if a[name] != b[name]] == []


def test_a_pool_of_processes_comes_to_the_bytes_of_the_program(tmp_path: Path, program: str) -> None:
    sweep = place(tmp_path, 2)
    subprocess.run([program, "sweep", "s.toml", "--out", "whole", "--quiet"], cwd=tmp_path, check=True, stdout=subprocess.DEVNULL)
    context = multiprocessing.get_context("spawn")
    with concurrent.futures.ProcessPoolExecutor(2, mp_context=context) as pool:
        swept = scrnn.sweep(sweep, out=tmp_path / "pool", executor=pool)
    assert (swept["runs"], swept["finished"]) == (4, 4)
    same(tmp_path / "whole", tmp_path / "pool")
    with concurrent.futures.ThreadPoolExecutor(2) as threads:
        scrnn.sweep(sweep, out=tmp_path / "threads", executor=threads)
    same(tmp_path / "whole", tmp_path / "threads")
    assert swept.status()["finished"] == 4


def test_a_comparison_names_the_best_setting_and_has_all_rows(tmp_path: Path) -> None:
    swept = scrnn.sweep(place(tmp_path, 2, 200), out=tmp_path / "out")
    compared = swept.compare()
    assert compared["setting"] == "rate=0.01" and len(compared.rows) == 4
    assert compared.rows[0]["outcome"] == "finished"
    assert os.path.exists(compared.page)
    with pytest.raises(scrnn.Error, match="say where to write"):
        scrnn.compare(tmp_path / "a", tmp_path / "b")


def test_what_is_wrong_with_a_sweep_is_told_before_anything_is_trained(tmp_path: Path) -> None:
    sweep = place(tmp_path, 1)
    sweep.write_text(sweep.read_text().replace("adam.rate", "adam.rat"))
    with pytest.raises(scrnn.Error, match="rate"):
        scrnn.sweep(sweep, out=tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_sixteen_networks_on_a_dask_cluster_that_loses_a_worker_come_to_the_same_bytes(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    sweep = place(tmp_path, 8, 3000)
    scrnn.sweep(sweep, out=tmp_path / "whole")
    begun = tmp_path / "dask" / "rate=1e-3" / "seed-1" / "checkpoint.safetensors"
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        with distributed.Client(cluster) as client, concurrent.futures.ThreadPoolExecutor(1) as aside:
            swept: Any = aside.submit(scrnn.sweep, sweep, out=tmp_path / "dask", executor=client)
            while not begun.exists():
                assert not swept.done(), swept.result()
                time.sleep(0.01)
            processes = list(client.run(os.getpid).values())
            os.kill(processes[0], signal.SIGKILL)
            assert swept.result()["finished"] == 16
    same(tmp_path / "whole", tmp_path / "dask")


def test_ray_comes_to_the_same_bytes_and_replaces_a_worker_that_is_lost(tmp_path: Path) -> None:
    ray = pytest.importorskip("ray")
    sweep = place(tmp_path, 2, 3000)
    scrnn.sweep(sweep, out=tmp_path / "whole")
    ray.init(num_cpus=2, include_dashboard=False, configure_logging=False)
    try:
        claim = tmp_path / "ray" / "rate=1e-3" / "seed-1"
        with concurrent.futures.ThreadPoolExecutor(1) as aside:
            swept: Any = aside.submit(scrnn.sweep, sweep, out=tmp_path / "ray", executor=ray)
            while not list(claim.glob("claim-*")) and not swept.done():
                time.sleep(0.01)
            for held in claim.glob("claim-*"):
                import json

                os.kill(json.loads(held.read_text().splitlines()[0])["process"], signal.SIGKILL)
            assert swept.result()["finished"] == 4
    finally:
        ray.shutdown()
    same(tmp_path / "whole", tmp_path / "ray")


def test_optuna_stops_networks_by_what_is_held_out(tmp_path: Path) -> None:
    optuna = pytest.importorskip("optuna")
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    data = [movement(period) for period in (2.0, 2.5, 3.0, 3.5, 4.0)]
    seen: list[int] = []

    def objective(trial: Any) -> float:
        rate = trial.suggest_categorical("rate", [1e-2, 1e-9])
        net = scrnn.SCTRNN(units=4, epochs=20_000 if seen else 2000, rate=rate)
        pruned = False

        def watch(now: scrnn.Progress) -> bool:
            nonlocal pruned
            if now.held_out is not None:
                trial.report(now.held_out, now.epoch)
                pruned = trial.should_prune()
            return pruned

        net.fit(data, held_out=0.4, progress=watch)
        seen.append(net.epoch)
        if pruned:
            raise optuna.TrialPruned
        return float(net.verdict["best"]["held_out"]["nll"])

    # What is worse than -0.2 nats after 1000 epochs is stopped: the first network gets below that, the second hardly learns.
    study = optuna.create_study(pruner=optuna.pruners.ThresholdPruner(upper=-0.2, n_warmup_steps=1000))
    for rate in (1e-2, 1e-9):
        study.enqueue_trial({"rate": rate})
    study.optimize(objective, n_trials=2)
    assert [trial.state.name for trial in study.trials] == ["COMPLETE", "PRUNED"]
    assert seen[0] == 2000 and 1000 <= seen[1] < 20_000
