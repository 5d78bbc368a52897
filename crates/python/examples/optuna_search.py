"""A search for settings by Optuna: networks that do badly on what is held out are stopped early.

    python optuna_search.py [TRIALS]

Each trial trains one network; the observer tells Optuna the nll on sequences that are held out, and Optuna says whether to go on. A grid with
seeds is a sweep (`scrnn.sweep`): search first, then give the best settings several seeds, since one may be lucky.
"""

from __future__ import annotations

import sys

import numpy as np
import numpy.typing as npt

import scrnn

Floats = npt.NDArray[np.float64]


def movements() -> list[Floats]:
    """Two joints that swing at several speeds, seen with noise."""
    random = np.random.default_rng(1)
    steps = np.arange(60)
    clean = [np.column_stack([0.5 * np.sin(steps / speed), 0.3 * np.cos(steps / speed)]) for speed in np.linspace(3, 6, 8)]
    return [one + random.normal(scale=0.02, size=one.shape) for one in clean]


def main(trials: int = 8) -> None:
    try:
        import optuna
    except ImportError:
        print("Optuna is not installed (pip install optuna): nothing is searched")
        return
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    data = movements()

    def objective(trial: optuna.Trial) -> float:
        rate = trial.suggest_float("rate", 1e-4, 1e-1, log=True)
        units = trial.suggest_int("units", 4, 16)
        net = scrnn.SCTRNN(units=units, time_constant=3.0, epochs=3000, rate=rate, seed=1)
        pruned = False

        def watch(now: scrnn.Progress) -> bool:
            nonlocal pruned
            if now.held_out is not None:
                trial.report(now.held_out, now.epoch)
                pruned = trial.should_prune()
            return pruned

        net.fit(data, held_out=0.25, progress=watch)
        if pruned:
            raise optuna.TrialPruned
        score = net.verdict["best"]["held_out"]["nll"]
        return float(score)

    pruner = optuna.pruners.MedianPruner(n_startup_trials=2, n_warmup_steps=300)
    study = optuna.create_study(sampler=optuna.samplers.TPESampler(seed=1), pruner=pruner)
    study.optimize(objective, n_trials=trials)
    stopped = sum(trial.state == optuna.trial.TrialState.PRUNED for trial in study.trials)
    print(f"{len(study.trials)} networks, {stopped} stopped early; the best: {study.best_params}, nll {study.best_value:.4f}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 8)
