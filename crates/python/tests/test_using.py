"""Generation, recognition, evaluation: shapes, units, and what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import scrnn
from conftest import movement


# ---- generation -----------------------------------------------------------------------------------------------------------


def test_one_sequence_is_an_array_and_several_are_a_list(trained: scrnn.SCTRNN) -> None:
    one = trained.generate("slow", steps=12)
    assert one.mean.shape == one.variance.shape == one.sample.shape == (12, 2) and one.names == ["slow"]
    all_of_them = trained.generate()
    assert [len(mean) for mean in all_of_them.mean] == [39, 29] and all_of_them.names == ["slow", "fast"]
    several = trained.generate("slow", steps=12, samples=4)
    assert several.sample.shape == (4, 12, 2) and several.names == ["slow"]
    many = trained.generate(steps=5, samples=3)
    assert [one.shape for one in many.sample] == [(3, 5, 2)] * 2 and many.names == ["slow", "fast"]


def test_a_sequence_is_called_by_its_name_or_number_from_one(trained: scrnn.SCTRNN) -> None:
    assert (trained.generate("fast").sample == trained.generate(2).sample).all()
    assert (trained.generate("fast").sample == trained.generate(np.int64(2)).sample).all()
    for unknown in ["nobody", 0, 3, -1]:
        with pytest.raises(scrnn.Error, match="slow, fast"):
            trained.generate(unknown)


def test_samples_are_in_the_units_of_the_data(trained: scrnn.SCTRNN) -> None:
    sample = trained.generate("slow").sample
    assert 15 < sample[:, 1].mean() < 25 and abs(sample[:, 0].mean()) < 2


def test_the_seed_decides_the_noise_and_without_noise_samples_are_means(trained: scrnn.SCTRNN) -> None:
    assert (trained.generate(1, seed=5).sample == trained.generate(1, seed=5).sample).all()
    assert (trained.generate(1, seed=5).sample != trained.generate(1, seed=6).sample).any()
    silent = trained.generate(1, noise=False)
    assert (silent.sample == silent.mean).all()


def test_modes_feed_what_they_say(trained: scrnn.SCTRNN) -> None:
    wave = movement(4.0)
    opened = trained.generate("slow", mode="open", data=wave)
    assert opened.mean.shape == (39, 2)
    mixed = trained.generate("slow", mode="mixed", mixing=1.0, data=wave)
    assert (mixed.mean == opened.mean).all()
    closed = trained.generate("slow", data=wave)
    assert (trained.generate("slow", mode="mixed", mixing=0.0, data=wave).sample == closed.sample).all()
    one_channel = trained.generate("slow", open_channels="a", data=wave)
    assert (one_channel.mean != closed.mean).any()
    learned = trained.generate("slow", mode="open")
    assert (learned.mean == opened.mean).all()


def test_it_starts_where_it_is_told(trained: scrnn.SCTRNN) -> None:
    assert trained.generate(begin="mean", steps=4).mean.shape == (4, 2)
    state = trained.initial_states[0]
    assert trained.generate(initial_state=state, steps=4).mean.shape == (4, 2)
    assert len(trained.generate(initial_state=trained.initial_states, steps=4).mean) == 2
    with pytest.raises(scrnn.Error, match="6 context units"):
        trained.generate(initial_state=state[:3], steps=4)


def test_contexts_are_given_when_asked_for(trained: scrnn.SCTRNN) -> None:
    out = trained.generate("slow", steps=7, contexts=True)
    assert out.contexts.shape == (7, 6) and (abs(out.contexts) <= 1).all() and out.units[0] == "context1"
    assert trained.generate("slow", steps=7).contexts is None


@pytest.mark.parametrize(
    "options, words",
    [
        ({"mode": "ajar"}, "no mode"),
        ({"begin": "anywhere"}, "no way to begin"),
        ({"mode": "mixed", "mixing": 1.5}, "share"),
        ({"open_channels": ["c"]}, "channels are a, b"),
        ({"steps": 0}, "steps is 0"),
        ({"steps": -3}, "steps is -3"),
        ({"steps": 2.5}, "steps is 2.5"),
        ({"steps": True}, "steps is True"),
        ({"samples": 0}, "samples is 0"),
        ({"samples": "many"}, "samples is 'many'"),
        ({"seed": -1}, "seed is -1"),
        ({"seed": 2**64}, "seed is"),
        ({"data": np.zeros((5, 3))}, "3 .* channels"),
        ({"data": [movement(4.0)] * 3}, "2 initial states, but 3 recorded"),
        ({"steps": 10**9, "samples": 10**6}, "this machine has"),
    ],
    ids=lambda one: str(one)[:30],
)
def test_what_cannot_be_generated_is_refused_in_words(trained: scrnn.SCTRNN, options: Any, words: str) -> None:
    with pytest.raises(scrnn.Error, match=words):
        trained.generate(**options)


def test_tables_and_files_hold_what_was_generated(trained: scrnn.SCTRNN, tmp_path: Path) -> None:
    out = trained.generate(steps=6, samples=2)
    table = out.to_pandas()
    assert table.shape == (2 * 2 * 6, 6) and table.index.names == ["sequence", "step"]
    assert (table.loc["slow/1"]["mean_a"].to_numpy() == out.mean[0][0][:, 0]).all()
    out.to_csv(tmp_path / "out.csv")
    assert list(pd.read_csv(tmp_path / "out.csv").columns) == ["sequence", "step", *table.columns]
    out.to_csv(tmp_path / "out.npz")
    assert "mean_000" in np.load(tmp_path / "out.npz")
    with pytest.raises(scrnn.Error):
        out.to_csv(tmp_path / "out.xlsx")
    with pytest.raises(scrnn.FileError):
        out.to_csv(tmp_path / "no" / "such" / "out.csv")


# ---- forecasts and recognition ----------------------------------------------------------------------------------------------


def test_a_forecast_goes_on_where_the_samples_end(trained: scrnn.SCTRNN) -> None:
    wave = movement(4.0)
    rest = trained.forecast(wave, steps=5, samples=6)
    assert rest.mean.shape == rest.variance.shape == (5, 2) and rest.sample.shape == (6, 5, 2)
    to_the_end = trained.forecast([wave, wave[:35]], samples=2, observed=20)
    assert [len(one) for one in to_the_end.mean] == [20, 15]
    with pytest.raises(scrnn.Error, match="heard to its end"):
        trained.forecast(wave)
    with pytest.raises(scrnn.Error, match="at least 2 samples"):
        trained.forecast(wave, observed=1)


def test_recognition_of_one_is_one_and_of_several_a_list(trained: scrnn.SCTRNN) -> None:
    found = trained.recognize(movement(4.0), starts=3, epochs=10)
    assert found.initial_state.shape == (6,) and found.completed is None and len(found.trials) == 3
    assert found.ranking[0].sequence == "slow" and found.ranking[0].number == 1
    several = trained.recognise([movement(4.0), movement(2.0)], starts=3, epochs=10)
    assert [one.sequence for one in several] == ["1", "2"] and several[1].ranking[0].sequence == "fast"
    assert isinstance(trained.recognize([movement(4.0)], starts=1, epochs=0), list)


def test_what_was_not_observed_is_completed(trained: scrnn.SCTRNN) -> None:
    wave = movement(4.0)
    plain = trained.recognize(wave, observed=30, starts=3, epochs=10)
    assert plain.completed.mean.shape == (10, 2) and plain.completed.samples is None
    assert np.isfinite(plain.completion_error)
    rich = trained.recognize(wave, observed=30, samples=7, starts=3, epochs=10).completed
    assert rich.samples.shape == (7, 10, 2) and rich.variance.shape == (10, 2)
    assert rich.effective_states >= 1 and 0 <= rich.within_two <= 1 and np.isfinite(rich.nll)


def test_recognition_begins_the_same_generation(trained: scrnn.SCTRNN) -> None:
    wave = movement(4.0)
    found = trained.recognize(wave, starts=4, epochs=50)
    out = trained.generate(initial_state=found.initial_state, mode="open", data=wave, noise=False)
    assert np.mean((out.mean - wave[1:]) ** 2) / 2 == pytest.approx(found.error)


@pytest.mark.parametrize(
    "options, words",
    [
        ({"observed": 1}, "at least 2 samples"),
        ({"observed": 0}, "observed is 0"),
        ({"samples": 5}, "say with observed"),
        ({"observed": 20, "samples": 0}, "samples is 0"),
        ({"starts": 0}, "starts is 0"),
        ({"epochs": -1}, "epochs is -1"),
        ({"rate": -1.0}, "positive"),
        ({"rate": float("nan")}, "positive"),
    ],
    ids=lambda one: str(one)[:30],
)
def test_what_cannot_be_recognised_is_refused_in_words(trained: scrnn.SCTRNN, options: Any, words: str) -> None:
    with pytest.raises(scrnn.Error, match=words):
        trained.recognize(movement(4.0), **options)


def test_channels_are_matched_by_name(trained: scrnn.SCTRNN) -> None:
    wave = movement(4.0)
    straight = pd.DataFrame(wave, columns=["a", "b"])
    turned = straight[["b", "a"]]
    assert trained.score(straight) == trained.score(turned) == trained.score(wave)
    with pytest.raises(scrnn.Error, match="no channel `b`"):
        trained.score(straight.rename(columns={"b": "c"}))
    with pytest.raises(scrnn.Error, match="did not learn"):
        trained.score(straight.assign(c=1.0))


def test_files_are_read_as_what_was_learned(trained: scrnn.SCTRNN, tmp_path: Path) -> None:
    wave = movement(4.0)
    scrnn.Sequences([wave[:, ::-1]], ["b", "a"]).to_csv(tmp_path / "new.csv")
    assert trained.score(tmp_path / "new.csv") == trained.score(wave)
    assert len(trained.recognize(str(tmp_path / "new.csv"), starts=1, epochs=0)) == 1


def test_data_that_look_strange_beside_what_was_learned_are_warned_of(trained: scrnn.SCTRNN) -> None:
    with pytest.warns(scrnn.DataWarning, match="channel b reaches"):
        trained.score(movement(4.0) * [1, 40])
    with pytest.raises(scrnn.Error, match="times as far out"):
        trained.score(movement(4.0) * [1, 1e300])


def test_missing_values_do_not_count(trained: scrnn.SCTRNN) -> None:
    wave = movement(4.0)
    wave[10:15, 0] = np.nan
    assert np.isfinite(trained.score(wave)) and trained.recognize(wave, starts=2, epochs=5).log_likelihood > -20


# ---- scores -----------------------------------------------------------------------------------------------------------------


def test_a_score_is_higher_for_what_was_learned(trained: scrnn.SCTRNN) -> None:
    assert trained.score(movement(4.0)) > trained.score(np.roll(movement(1.1), 7, axis=0))


def test_without_variance_the_score_is_the_squared_error() -> None:
    net = scrnn.SCTRNN(units=4, variance=False, epochs=20).fit([movement(4.0)])
    assert net.score(movement(4.0)) < 0 and net.recognize(movement(4.0), starts=1, epochs=1).log_likelihood is None
    with pytest.raises(scrnn.Error, match="no variance"):
        net.calibrate([movement(4.5)])
    assert net.generate(1).variance is None and list(net.generate(1).to_pandas()) == ["mean_y1", "mean_y2", "sample_y1", "sample_y2"]


def test_an_evaluation_is_that_of_the_program_in_words_and_numbers(trained: scrnn.SCTRNN) -> None:
    report = trained.evaluate([movement(4.4), movement(2.2)], samples=3, starts=2, epochs=5)
    assert report["sequences"] == ["1", "2"] and report["burn_in"] == 0.1 and "one step ahead" in str(report).lower()
    assert report.calibration["bins"][0]["count"] > 0


@pytest.mark.parametrize(
    "call, words",
    [
        (lambda net: net.score(), "holds no sequences out"),
        (lambda net: net.evaluate(), "held_out=0.2"),
        (lambda net: net.score(movement(4.0)[:3]), "only 3 samples"),
        (lambda net: net.score(movement(4.0), burn_in=1.0), "0 to 0.99"),
        (lambda net: net.evaluate(movement(4.0), observed=-0.1), "0 to 0.99"),
        (lambda net: net.evaluate(movement(4.0), samples=0), "samples is 0"),
        (lambda net: net.calibrate([movement(4.0)]), "was learned"),
        (lambda net: net.calibrate([movement(4.0), movement(2.0, 30)]), "learned"),
    ],
)
def test_what_cannot_be_judged_is_refused_in_words(net: scrnn.SCTRNN, call: Any, words: str) -> None:
    with pytest.raises(scrnn.Error, match=words):
        call(net)


def test_calibration_belongs_to_the_network_and_is_saved(net: scrnn.SCTRNN, tmp_path: Path) -> None:
    before = net.generate(1, steps=3).variance
    found = net.calibrate([movement(4.3), movement(2.1, 30)])
    assert len(found.factors) == 2 and found.after <= found.before
    after = net.generate(1, steps=3).variance
    assert after[0] == pytest.approx(before[0] * found.factors)
    net.save(tmp_path / "run")
    assert (scrnn.load(tmp_path / "run").generate(1, steps=3).variance == after).all()


# ---- plots ------------------------------------------------------------------------------------------------------------------


def test_plots_are_drawn_on_axes_that_are_made_or_handed_in(trained: scrnn.SCTRNN) -> None:
    import matplotlib.pyplot as plt

    _, axes = plt.subplots(2, 2)
    assert trained.plot_history(axes[0, 0]) is axes[0, 0]
    assert trained.plot_generated("fast", channel="b", ax=axes[0, 1], steps=9, samples=3) is axes[0, 1]
    assert trained.plot_calibration([movement(4.4)], ax=axes[1, 0]) is axes[1, 0]
    assert trained.plot_initial_states(axes[1, 1]) is axes[1, 1]
    for ax in axes.ravel():
        assert ax.has_data() and ax.get_xlabel()
    assert trained.plot_history() is not axes[0, 0]
    for wrong in ["c", 2, -1]:
        with pytest.raises(scrnn.Error, match="no channel"):
            trained.plot_generated(channel=wrong)
    plt.close("all")


# ---- files and tasks ----------------------------------------------------------------------------------------------------------


def test_what_is_read_says_what_is_known_of_it(tmp_path: Path) -> None:
    rows = "".join(f"{k * 0.1:.1f},{np.sin(k / 3)}\n" for k in range(30))
    (tmp_path / "t.csv").write_text("time,angle\n" + rows)
    data = scrnn.read(tmp_path / "t.csv")
    assert data.period == pytest.approx(0.1) and data.channels == ["angle"] and data.facts["format"] == "CSV table"
    assert scrnn.read(tmp_path / "t.csv", time="rows", channels=["time", "angle"]).channels == ["time", "angle"]
    assert len(data[:1]) == 1 and data["1"].shape == (30, 1)
    with pytest.raises(KeyError):
        data["nobody"]
    for options in [{"time": "sun"}, {"axes": "xyz"}, {"period": -1.0}, {"channels": ["none"]}, {"topics": "/a"}]:
        with pytest.raises(scrnn.Error):
            scrnn.read(tmp_path / "t.csv", **options)


@pytest.mark.parametrize("name", ["sinusoid", "lissajous", "limit-cycle", "patterns"])
def test_tasks_of_the_thesis_are_made_with_their_truth(name: str) -> None:
    data, variances = scrnn.task(name, sequences=2, steps=30)
    assert len(data) == 2 and data[0].shape == variances[0].shape == (30, len(data.channels))
    assert (scrnn.task(name, sequences=2, steps=30, seed=2)[0][0] != data[0]).any()
    assert all((np.asarray(one) >= 0).all() for one in variances)


def test_tasks_and_studies_that_are_none_are_refused_with_the_list() -> None:
    for call in [scrnn.task, scrnn.reproduce]:
        with pytest.raises(scrnn.Error, match="sinusoid"):
            call("cosine")
    with pytest.raises(scrnn.Error, match="interact"):
        scrnn.simulate("dance", scrnn.SCTRNN())
    with pytest.raises(scrnn.Error, match="preset"):
        scrnn.reproduce("sinusoid", preset="slow")
    with pytest.raises(scrnn.Error, match="1 to 1000"):
        scrnn.reproduce("sinusoid", seeds=0)


def test_a_study_is_reproduced_in_a_folder(tmp_path: Path) -> None:
    found = scrnn.reproduce("sinusoid", epochs=30, out=tmp_path / "s", progress=False)
    assert (tmp_path / "s" / "report.html").exists() and found["experiment"] == "sinusoid"
    assert found.page == str(tmp_path / "s" / "report.html") and str(found)


def test_robots_are_moved_by_networks_that_learned_to() -> None:
    data, _ = scrnn.task("reach", sequences=1, steps=24)
    net = scrnn.SCTRNN(units=5, epochs=3).fit(data)
    found = scrnn.simulate("reach", net, cycles=1, position=2, noise=False)
    assert found["samples"] == 12 and found["expected"] == 1
    with pytest.raises(scrnn.Error, match="positions 1 and 3"):
        scrnn.simulate("reach", net, position=4.0)
    with pytest.raises(scrnn.Error, match="after the last"):
        scrnn.simulate("reach", net, cycles=1, shift_at=50, to=1)
