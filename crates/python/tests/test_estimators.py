"""Networks as estimators: parameters, training, saving, copies."""

from __future__ import annotations

import copy
import io
import json
import pickle
import threading
import time
from pathlib import Path
from typing import Any

import joblib
import numpy as np
import pandas as pd
import pytest
import sklearn.base
from sklearn.utils import estimator_checks

import scrnn
from conftest import movement

KINDS = [scrnn.SCTRNN, scrnn.SMTRNN]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    "check",
    [
        "check_estimator_cloneable",
        "check_estimator_repr",
        "check_no_attributes_set_in_init",
        "check_parameters_default_constructible",
        "check_get_params_invariance",
        "check_set_params",
        "check_do_not_raise_errors_in_init_or_set_params",
        "check_valid_tag_types",
    ],
)
def test_it_passes_checks_of_scikit_learn(kind: Any, check: str) -> None:
    function = getattr(estimator_checks, check)
    if check == "check_no_attributes_set_in_init":
        # Private attributes hold what was learned: scikit-learn lets only its own base class have such.
        own = kind()
        assert {name for name in vars(own) if not name.startswith("_")} == set(own.get_params())
        return
    function(kind.__name__, kind())


@pytest.mark.parametrize("kind", KINDS)
def test_clone_gives_an_untrained_network_of_the_same_parameters(kind: Any) -> None:
    net = kind(epochs=2, rate=0.01, settings={"training.adam.clip_norm": 2.0}).fit([movement(4.0)])
    other = sklearn.base.clone(net)
    assert other.get_params() == net.get_params()
    with pytest.raises(scrnn.Error, match="not trained yet"):
        other.epoch


def test_parameters_are_got_and_set() -> None:
    net = scrnn.SCTRNN(7, 2.5)
    assert net.get_params()["units"] == 7 and net.get_params(deep=False)["time_constant"] == 2.5
    assert net.set_params(units=9, epochs=3).units == 9
    with pytest.raises(scrnn.Error, match="no parameter 'unit'"):
        net.set_params(unit=3)


def test_fit_gives_the_network_itself() -> None:
    net = scrnn.SCTRNN(units=3, epochs=1)
    assert net.fit([movement(4.0)]) is net


def test_options_of_fit_go_before_those_of_the_constructor() -> None:
    net = scrnn.SCTRNN(units=3, epochs=50, seed=1)
    assert net.fit([movement(4.0)], epochs=2).epoch == 2
    assert net.epochs == 50
    other = net.fit([movement(4.0)], epochs=2, seed=5).params["context_bias"]
    assert (other != net.fit([movement(4.0)], epochs=2).params["context_bias"]).any()


WRONG = {
    "units": 0,
    "time_constant": 0.5,
    "delay": 0,
    "variance_floor": -1.0,
    "initial_state_variance": -1.0,
    "mean": "relu",
    "skip": "resnet",
    "scaling": "standard",
    "epochs": -3,
    "optimiser": "sgd",
    "rate": -0.1,
    "batch_size": -1,
    "members": 0,
    "patience": 0,
    "closed_loop": {"copy": 3},
    "recipe": "mine",
    "settings": {"training.adam.rat": 0.1},
    "seed": -1,
    "instruction_set": "mmx",
    "rest": -1.0,
}


@pytest.mark.parametrize("name, value", WRONG.items())
def test_a_parameter_out_of_range_is_refused_by_fit_in_words(name: str, value: Any) -> None:
    net = scrnn.SCTRNN(units=3, epochs=2).set_params(**{name: value})
    with pytest.raises(scrnn.Error) as raised:
        net.fit([movement(4.0), movement(2.0)])
    assert len(str(raised.value)) > 10


@pytest.mark.parametrize(
    "options",
    [
        {"delay": 3},
        {"variance": False},
        {"variance_floor": 1e-3},
        {"initial_state_variance": 0.0},
        {"mean": "linear"},
        {"skip": "residual"},
        {"skip": "autoregressive", "velocity_inputs": True, "mean": "linear"},
        {"scaling": "robust"},
        {"scaling": [[-1, 1], [10, 30]]},
        {"scaling": {"offset": [0.0, 20.0], "scale": [1.0, 0.1]}},
        {"rest": 0.2},
        {"optimiser": "momentum", "rate": 1e-3},
        {"rate": 0.02, "batch_size": 1},
        {"closed_loop": True},
        {"closed_loop": {"copies": 2}},
        {"settings": {"training.adam.weight_decay": 0.1, "training.lbfgs": {}}},
        {"seed": 2**62},
        {"threads": 1},
        {"threads": 2},
        {"instruction_set": "portable"},
        {"units": np.int64(5), "time_constant": np.float32(2.0)},
    ],
    ids=lambda one: ",".join(one),
)
def test_every_setting_trains_and_generates(options: dict[str, Any]) -> None:
    net = scrnn.SCTRNN(**{"units": 4, "epochs": 4, **options}).fit([movement(4.0), movement(2.0)])
    assert net.epoch == 4 and net.generate(1, steps=5).mean.shape == (5, 2)
    assert (net.generate(1, steps=5).variance is None) == (not net.variance)


def test_threads_and_instruction_sets_change_no_bit() -> None:
    data = [movement(4.0 + k / 7) for k in range(8)]
    bits = {
        scrnn.SCTRNN(units=9, epochs=5, threads=threads, instruction_set=one).fit(data).params["context_bias"].tobytes()
        for threads in (0, 1, 2)
        for one in (None, "portable")
    }
    assert len(bits) == 1


def test_fast_and_slow_units_are_groups_of_their_own() -> None:
    net = scrnn.SMTRNN(fast=5, slow=2, epochs=2).fit([movement(4.0)])
    params = net.params
    assert params["context_from_context"].shape == (7, 7)
    # Slow units see no input and drive no output.
    assert (params["context_from_input"][5:] == 0).all() and (params["mean_from_context"][:, 5:] == 0).all()


def test_a_recipe_chooses_what_is_not_given() -> None:
    chosen = scrnn.SCTRNN(recipe="auto").fit([movement(4.0, 60), movement(2.0, 60)], epochs=3)
    assert "Chosen and written" in chosen.experiment and "autoregressive" in chosen.experiment
    mine = scrnn.SCTRNN(units=5, time_constant=4.0, recipe="auto").fit([movement(4.0, 60)], epochs=3)
    assert mine.initial_states.shape[1] == 5


def test_held_out_sequences_are_judged_by() -> None:
    data = [movement(3.0 + k / 3) for k in range(5)]
    net = scrnn.SCTRNN(units=4, epochs=20).fit(data, held_out=0.4)
    assert len(net.sequences) == 3 and len(net.held_out_data or []) == 2
    assert np.isfinite(net.history["held_out_nll"]).any()
    assert np.isfinite(net.score()) and net.evaluate(samples=2, starts=1, epochs=2)["members"] == 1
    assert net.best().epoch <= 20
    named = scrnn.SCTRNN(units=4, epochs=2).fit(data, names=list("abcde"), held_out=["b"])
    assert (named.held_out_data or scrnn.Sequences([movement(2.0)])).names == ["b"]


def test_a_mixture_trains_generates_and_is_saved_by_out(tmp_path: Path) -> None:
    data = [movement(4.0), movement(2.0), movement(3.0)]
    net = scrnn.SCTRNN(units=4, epochs=3, members=2).fit(data, out=tmp_path / "mixture")
    assert net.generate(1, steps=5, samples=4).sample.shape == (4, 5, 2)
    found = net.recognize(data[0], starts=2, epochs=2)
    assert found.initial_state.shape == (0,)
    with pytest.raises(scrnn.Error, match="mixture"):
        net.params
    with pytest.raises(scrnn.Error, match="mixture"):
        net.follow()
    assert scrnn.load(tmp_path / "mixture").epoch == 3


# ---- going on, and stopping ---------------------------------------------------------------------------------------------


def test_a_training_that_was_stopped_goes_on_to_the_same_bits() -> None:
    data = [movement(4.0), movement(2.0)]
    whole = scrnn.SCTRNN(units=20, epochs=20000).fit(data)
    stopped = scrnn.SCTRNN(units=20, epochs=20000)
    stopped.fit(data, progress=lambda now: True)
    assert 0 < stopped.epoch < 20000
    stopped.fit(resume=True)
    assert stopped.epoch == 20000 and stopped.params["context_bias"].tobytes() == whole.params["context_bias"].tobytes()


def test_what_changed_is_not_gone_on_with() -> None:
    net = scrnn.SCTRNN(units=3, epochs=2, optimiser="momentum").fit([movement(4.0)])
    net.rate = 1e-5
    with pytest.raises(scrnn.Error, match="rate changed"):
        net.fit(resume=True, epochs=4)
    net.rate = None
    assert net.fit(resume=True, epochs=4).epoch == 4
    with pytest.raises(scrnn.Error, match="data changed|changed since"):
        net.fit([movement(5.0)], resume=True, epochs=6)
    with pytest.raises(scrnn.Error, match="nothing to go on"):
        scrnn.SCTRNN().fit(resume=True)


def test_an_exception_in_the_watcher_ends_the_training_and_keeps_the_state() -> None:
    def watch(now: Any) -> None:
        raise RuntimeError("enough")

    net = scrnn.SCTRNN(units=20, epochs=100_000)
    with pytest.raises(RuntimeError, match="enough"):
        net.fit([movement(4.0)], progress=watch)
    assert 0 < net.epoch < 100_000 and net.generate(1, steps=3).mean.shape == (3, 2)


def test_ctrl_c_ends_the_epoch_and_keeps_the_state() -> None:
    import os
    import signal

    net = scrnn.SCTRNN(units=20, epochs=10_000_000)
    timer = threading.Timer(0.4, lambda: os.kill(os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        net.fit([movement(4.0)])
    timer.join()
    assert 0 < net.epoch < 10_000_000


def test_ctrl_c_ends_a_study_and_the_same_call_goes_on(tmp_path: Path) -> None:
    import os
    import signal

    timer = threading.Timer(0.5, lambda: os.kill(os.getpid(), signal.SIGINT))
    timer.start()
    begun = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        scrnn.reproduce("sinusoid", epochs=10_000_000, out=tmp_path / "s", progress=False)
    timer.join()
    assert time.monotonic() - begun < 20 and list((tmp_path / "s").rglob("checkpoint.safetensors"))


@pytest.mark.parametrize("attended", [False, True])
def test_a_panic_is_an_exception(attended: bool) -> None:
    from scrnn import _scrnn

    with pytest.raises(scrnn.InternalError, match="broken down on purpose"):
        _scrnn.break_down(attended)
    assert issubclass(scrnn.InternalError, ValueError)


def test_other_threads_run_while_it_computes() -> None:
    counted = 0
    done = threading.Event()

    def count() -> None:
        nonlocal counted
        while not done.is_set():
            counted += 1
            time.sleep(0.001)

    thread = threading.Thread(target=count)
    thread.start()
    begun = time.monotonic()
    scrnn.SCTRNN(units=30, epochs=400).fit([movement(4.0, 200)])
    seconds = time.monotonic() - begun
    done.set()
    thread.join()
    assert counted > 100 * seconds


def test_two_threads_train_at_once() -> None:
    nets = [scrnn.SCTRNN(units=5, epochs=50, seed=k) for k in range(2)]
    threads = [threading.Thread(target=lambda net=net: net.fit([movement(4.0)])) for net in nets]
    [one.start() for one in threads]
    [one.join() for one in threads]
    alone = scrnn.SCTRNN(units=5, epochs=50, seed=1).fit([movement(4.0)])
    assert nets[1].params["context_bias"].tobytes() == alone.params["context_bias"].tobytes()


def test_a_training_that_diverges_says_so_and_keeps_the_last_good_state() -> None:
    net = scrnn.SCTRNN(units=5, epochs=500, optimiser="momentum", rate=50.0, settings={"training.on_divergence": "stop"})
    with pytest.raises(scrnn.DivergedError, match="smaller rate"):
        net.fit([movement(4.0)])
    assert np.isfinite(net.params["context_bias"]).all()


def test_progress_is_told_ten_times_a_second_at_most_and_to_the_end() -> None:
    seen: list[Any] = []
    begun = time.monotonic()
    scrnn.SCTRNN(units=20, epochs=20000).fit([movement(4.0)], progress=seen.append)
    assert seen[-1].epoch == seen[-1].total == 20000 and seen[-1].nll is not None
    assert len(seen) <= 12 * (time.monotonic() - begun) + 2


def test_a_pipe_sees_no_bar(capfd: pytest.CaptureFixture[str]) -> None:
    scrnn.SCTRNN(units=5, epochs=50).fit([movement(4.0)])
    assert capfd.readouterr() == ("", "")
    scrnn.SCTRNN(units=5, epochs=50).fit([movement(4.0)], progress=True)
    assert "50/50 epochs" in capfd.readouterr().err


# ---- saving, copies -------------------------------------------------------------------------------------------------------


def equal(a: scrnn.Network, b: scrnn.Network) -> bool:
    return all((a.params[name] == b.params[name]).all() for name in a.params) and bool(
        (a.generate(1, steps=9).sample == b.generate(1, steps=9).sample).all()
    )


@pytest.mark.parametrize(
    "copied",
    [
        lambda net: pickle.loads(pickle.dumps(net)),
        lambda net: pickle.loads(pickle.dumps(net, protocol=2)),
        copy.copy,
        copy.deepcopy,
        lambda net: joblib.load(_dumped(net)),
    ],
    ids=["pickle", "pickle-2", "copy", "deepcopy", "joblib"],
)
def test_a_copy_is_the_same_network(trained: scrnn.SCTRNN, copied: Any) -> None:
    other = copied(trained)
    assert equal(trained, other) and other.get_params() == trained.get_params()
    assert (other.history["nll"] == trained.history["nll"]).all()
    assert other.learned_data.names == ["slow", "fast"]
    assert other.generate(mode="open", noise=False).mean[1].shape == (29, 2)


def _dumped(net: Any) -> io.BytesIO:
    file = io.BytesIO()
    joblib.dump(net, file)
    file.seek(0)
    return file


def test_joblib_works_with_networks_in_other_processes(trained: scrnn.SCTRNN) -> None:
    jobs = [joblib.delayed(_score)(trained, movement(4.0 + k)) for k in range(2)]
    found = joblib.Parallel(n_jobs=2)(jobs)
    assert found == [trained.score(movement(4.0 + k)) for k in range(2)]


def _score(net: scrnn.Network, data: Any) -> float:
    return net.score(data)


def test_untrained_networks_are_copied_too() -> None:
    assert pickle.loads(pickle.dumps(scrnn.SMTRNN(fast=3))).fast == 3


def test_a_saved_network_is_loaded_the_same(trained: scrnn.SCTRNN, tmp_path: Path) -> None:
    trained.save(tmp_path / "run")
    other = scrnn.load(tmp_path / "run")
    assert isinstance(other, scrnn.SCTRNN) and equal(trained, other)
    assert (other.history["nll"] == trained.history["nll"]).all()
    assert (other.learned_data[0] == trained.learned_data[0]).all()
    assert sorted(one.name for one in (tmp_path / "run").iterdir()) == [
        "best.safetensors", "checkpoint.safetensors", "data.npz", "experiment.toml", "history.csv", "lock",
    ]  # fmt: skip


def test_a_saved_folder_may_be_moved(trained: scrnn.SCTRNN, tmp_path: Path) -> None:
    trained.save(tmp_path / "run")
    (tmp_path / "run").rename(tmp_path / "moved")
    assert scrnn.load(tmp_path / "moved").learned_data.names == ["slow", "fast"]


def test_a_run_is_not_written_over_unless_asked(trained: scrnn.SCTRNN, tmp_path: Path) -> None:
    trained.save(tmp_path / "run")
    with pytest.raises(scrnn.RefusedError, match="already holds a run"):
        trained.save(tmp_path / "run")
    trained.save(tmp_path / "run", overwrite=True)
    with pytest.raises(scrnn.RefusedError, match="overwrite=True"):
        scrnn.SCTRNN(epochs=1).fit([movement(4.0)], out=tmp_path / "run")
    scrnn.SCTRNN(units=3, epochs=1).fit([movement(4.0)], out=tmp_path / "run", overwrite=True)
    assert scrnn.load(tmp_path / "run").epoch == 1


def test_a_loaded_network_can_be_trained_anew_by_its_parameters(trained: scrnn.SCTRNN, tmp_path: Path) -> None:
    trained.save(tmp_path / "run")
    again = scrnn.load(tmp_path / "run").fit(trained.learned_data)
    assert equal(trained, again)
    twice = sklearn.base.clone(scrnn.load(tmp_path / "run")).fit(trained.learned_data)
    assert equal(trained, twice)


def test_a_loaded_training_of_fast_and_slow_units_is_one_again(tmp_path: Path) -> None:
    scrnn.SMTRNN(fast=4, slow=2, slow_time_constant=30.0, epochs=2).fit([movement(4.0)], out=tmp_path / "run")
    other = scrnn.load(tmp_path / "run")
    assert isinstance(other, scrnn.SMTRNN) and (other.fast, other.slow, other.slow_time_constant) == (4, 2, 30.0)


@pytest.mark.parametrize("what", ["nothing", "folder", "text.txt", "broken.safetensors"])
def test_what_is_no_run_is_refused(what: str, tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "text.txt").write_text("hello")
    (tmp_path / "broken.safetensors").write_bytes(b"\x08\0\0\0\0\0\0\0{}      ")
    with pytest.raises(scrnn.Error):
        scrnn.load(tmp_path / what)


def test_folders_that_cannot_be_written_are_told(trained: scrnn.SCTRNN, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(scrnn.Error):
        trained.save(tmp_path / "file" / "below")


def test_train_is_that_of_the_program(tmp_path: Path) -> None:
    scrnn.Sequences([movement(4.0, 60)], ["a", "b"]).to_csv(tmp_path / "own.csv")
    net = scrnn.train(tmp_path / "own.csv", epochs=3, seed=4, settings={"network.groups.context.units": 5})
    assert net.epoch == 3 and net.initial_states.shape == (1, 5) and net.seed == 4
    assert (tmp_path / "runs" / "own" / "report.html").exists() is False
    assert scrnn.train(tmp_path / "own.csv", epochs=2, overwrite=True, settings=["seed=9"]).seed == 9
    with pytest.raises(scrnn.RefusedError):
        scrnn.train(tmp_path / "own.csv")
    with pytest.raises(scrnn.Error, match="no `=`"):
        scrnn.train(tmp_path / "own.csv", settings=["seed"])
    with pytest.raises(scrnn.Error):
        scrnn.train(tmp_path / "nothing.toml")


# ---- what was learned -----------------------------------------------------------------------------------------------------


def test_weights_have_names_and_shapes(trained: scrnn.SCTRNN) -> None:
    shapes = {name: value.shape for name, value in trained.params.items()}
    assert shapes == {
        "context_from_input": (6, 2),
        "context_from_context": (6, 6),
        "context_bias": (6,),
        "mean_from_context": (2, 6),
        "mean_bias": (2,),
        "variance_from_context": (2, 6),
        "variance_bias": (2,),
    }
    trained.params["mean_bias"][:] = 0
    assert (trained.params["mean_bias"] != 0).any()


def test_the_history_has_columns(trained: scrnn.SCTRNN, tmp_path: Path) -> None:
    history = trained.history
    assert list(history)[:3] == ["epoch", "nll", "mse"] and history.rows == 401
    assert isinstance(history.to_pandas(), pd.DataFrame) and len(history.to_pandas()) == 401
    history.to_csv(tmp_path / "h.csv")
    head, *rows = (tmp_path / "h.csv").read_text().splitlines()
    assert head.split(",") == list(history)
    assert [float(row.split(",")[1]) for row in rows] == history["nll"].tolist()


def test_the_verdict_is_that_of_the_program(trained: scrnn.SCTRNN) -> None:
    assert trained.verdict["outcome"] == "finished" and "nats per step and channel" in str(trained.verdict)


@pytest.mark.parametrize("name", ["epoch", "channels", "sequences", "history", "verdict", "initial_states", "params", "experiment"])
def test_a_network_that_is_not_trained_says_so(name: str) -> None:
    net = scrnn.SCTRNN()
    assert not hasattr(net, name)
    with pytest.raises(scrnn.Error, match="not trained yet"):
        getattr(net, name)


def test_everything_shows_itself(trained: scrnn.SCTRNN) -> None:
    wave = movement(4.0)
    things = [
        scrnn.SCTRNN(),
        trained,
        trained.history,
        trained.verdict,
        trained.learned_data,
        trained.generate(),
        trained.generate(1, steps=9, samples=2),
        trained.recognize(wave, observed=20, samples=3, starts=2, epochs=2),
        trained.recognize(wave, observed=20, samples=3, starts=2, epochs=2).completed,
        trained.evaluate([movement(5.0)], samples=2, starts=1, epochs=2),
        trained.follow(),
        scrnn.History({}),
    ]
    for thing in things:
        assert "\n" not in repr(thing) and len(repr(thing)) < 700
        assert thing._repr_html_().startswith("<div>")
    for pictured in (trained, trained.history, trained.learned_data, trained.generate()):
        assert "<svg" in pictured._repr_html_()


def test_settings_that_lead_nowhere_are_refused() -> None:
    for settings in [{"network.groups.fast.units": 3}, {"seed.x": 1}, {"nothing": 1}]:
        with pytest.raises(scrnn.Error):
            scrnn.SCTRNN(units=3, epochs=1, settings=settings).fit([movement(4.0)])


def test_json_of_settings_is_sound(trained: scrnn.SCTRNN) -> None:
    assert json.loads(trained._trained().settings)["network"]["groups"][0]["units"] == 6
