"""Whatever holds sequences is taken, and what does not is refused in words."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import scrnn
from conftest import movement


def learn(data: Any, **options: Any) -> scrnn.SCTRNN:
    return scrnn.SCTRNN(units=4, time_constant=3.0, epochs=3).fit(data, **options)


BITS = learn([movement(4.0), movement(2.0, 30)]).params["context_bias"].tobytes()


@pytest.mark.parametrize(
    "change",
    [
        lambda a: a,
        lambda a: a.copy(order="F"),
        lambda a: np.repeat(a, 2, axis=0)[::2],
        lambda a: np.c_[a, a][:, :2],
        lambda a: a[::-1][::-1],
        lambda a: a.tolist(),
        lambda a: a.astype(">f8"),
        lambda a: a.astype(object),
        lambda a: np.ma.masked_array(a),
        lambda a: a.astype(np.longdouble),
        lambda a: pd.DataFrame(a).to_numpy(),
    ],
    ids=["float64", "fortran", "strided", "columns", "reversed", "lists", "big-endian", "objects", "masked", "long", "of-pandas"],
)
def test_the_same_numbers_give_the_same_bits(change: Any) -> None:
    data = [change(movement(4.0)), change(movement(2.0, 30))]
    assert learn(data).params["context_bias"].tobytes() == BITS


@pytest.mark.parametrize("dtype", ["float32", "float16", "int64", "int32", "int16", "int8", "uint8", "bool"])
def test_any_type_of_numbers_is_taken_for_what_it_holds(dtype: str) -> None:
    data = [(movement(4.0)[:, :1] * 3).astype(dtype), (movement(2.0, 30)[:, :1] * 3).astype(dtype)]
    if dtype == "uint8":
        data = [np.abs(movement(4.0)[:, :1] * 3).astype(dtype), np.abs(movement(2.0, 30)[:, :1] * 3).astype(dtype)]
    if dtype == "bool":
        data = [movement(4.0)[:, :1] > 0, movement(2.0, 30)[:, :1] > 0]
    wide = [one.astype(np.float64) for one in data]
    assert learn(data).params["context_bias"].tobytes() == learn(wide).params["context_bias"].tobytes()


def test_containers_make_no_difference() -> None:
    parts = [movement(4.0), movement(2.0, 30)]
    named = {"1": parts[0], "2": parts[1]}
    for data in [tuple(parts), named, scrnn.Sequences(parts), iter(parts), (one for one in parts)]:
        assert learn(data).params["context_bias"].tobytes() == BITS


def test_a_three_dimensional_array_holds_sequences() -> None:
    block = np.stack([movement(4.0), movement(2.0)])
    assert learn(block).params["context_bias"].tobytes() == learn(list(block)).params["context_bias"].tobytes()
    assert len(learn(block).sequences) == 2


def test_one_array_is_one_sequence() -> None:
    assert learn(movement(4.0)).sequences == ["1"]
    assert learn(np.sin(np.arange(40) / 3)).channels == ["y1"]


def test_a_list_of_flat_arrays_holds_sequences_of_one_channel() -> None:
    net = learn([np.sin(np.arange(40) / 3), np.cos(np.arange(25) / 3)])
    assert (len(net.sequences), net.channels) == (2, ["y1"])


def test_a_table_gives_its_columns_as_channels() -> None:
    table = pd.DataFrame(movement(4.0), columns=["shoulder", "elbow"])
    assert learn(table).channels == ["shoulder", "elbow"]
    assert learn(table, channels=["elbow"]).channels == ["elbow"]
    assert learn([table, table[:30]]).sequences == ["1", "2"]


def test_a_column_tells_sequences_apart() -> None:
    table = pd.concat([pd.DataFrame(movement(4.0)), pd.DataFrame(movement(2.0, 30))], ignore_index=True)
    table.columns = ["a", "b"]
    table["sequence"] = ["slow"] * 40 + ["fast"] * 30
    net = learn(table)
    assert net.sequences == ["slow", "fast"] and net.channels == ["a", "b"]
    assert [len(one) for one in net.learned_data] == [40, 30]


def test_an_outer_index_tells_sequences_apart() -> None:
    data = scrnn.Sequences([movement(4.0), movement(2.0, 30)], ["a", "b"], ["slow", "fast"])
    net = learn(data.to_pandas())
    assert net.sequences == ["slow", "fast"]
    assert net.params["context_bias"].tobytes() == BITS


def test_a_series_is_a_channel() -> None:
    assert learn(pd.Series(np.sin(np.arange(40) / 3), name="angle")).channels == ["angle"]


def test_nullable_columns_and_missing_values_are_taken() -> None:
    table = pd.DataFrame(movement(4.0), columns=["a", "b"]).astype("Float64")
    table.loc[5, "a"] = pd.NA
    assert np.isnan(learn(table).learned_data[0][5, 0])


def test_missing_values_are_nan_none_and_masked() -> None:
    with_nan = movement(4.0)
    with_nan[5, 0] = np.nan
    with_none = with_nan.astype(object)
    with_none[5, 0] = None
    masked = np.ma.masked_array(movement(4.0), mask=np.isnan(with_nan))
    bits = {learn([data]).params["context_bias"].tobytes() for data in (with_nan, with_none, masked)}
    assert len(bits) == 1


def test_fractions_are_numbers() -> None:
    data = [[Fraction(k * k % 7, 7), Fraction(k * k % 11, 3)] for k in range(20)]
    assert learn([np.array(data)]).epoch == 3


def test_files_are_taken_as_the_program_takes_them(tmp_path: Path) -> None:
    data = scrnn.Sequences([movement(4.0), movement(2.0, 30)], ["a", "b"], ["slow", "fast"])
    for name in ["d.csv", "d.npz", "d.txt"]:
        data.to_csv(tmp_path / name)
        net = learn(tmp_path / name)
        assert net.channels == ["a", "b"] and net.params["context_bias"].tobytes() == BITS
    assert learn(str(tmp_path / "d.csv"), channels=["b"]).channels == ["b"]
    assert len(learn([tmp_path / "d.csv", tmp_path / "d.npz"]).sequences) == 4


REFUSED = {
    "nothing": (None, "there are no sequences"),
    "empty list": ([], "the list is empty"),
    "empty array": (np.empty((0, 5, 2)), "empty"),
    "numbers": ([1.0, 2.0, 3.0], "single numbers"),
    "a number": (np.float64(3.0), "single number"),
    "four axes": (np.zeros((2, 3, 4, 5)), "axes"),
    "no channel": ([np.empty((5, 0))], "no channel"),
    "no step": ([np.empty((0, 2))], "0 samples"),
    "one step": ([np.zeros((1, 2))], "1 samples"),
    "other channels": ([np.zeros((5, 2)), np.zeros((5, 3))], "has 3 channels, the first has 2"),
    "complex": ([np.zeros((5, 2), complex)], "complex"),
    "texts": ([np.array([["a", "b"]])], "elements of type"),
    "times": ([np.array([["2020-01-01"]], dtype="datetime64[D]")], "elements of type"),
    "objects": ([np.array([[object()]])], "no number"),
    "ragged": ([[[1.0, 2.0], [3.0]]], "no array"),
    "infinite": ([np.array([[0.0, 1.0], [np.inf, 2.0], [1.0, 1.0]])], "sample 2, channel y1 is inf"),
    "minus infinite": ([np.array([[0.0, 1.0], [1.0, -np.inf], [1.0, 1.0]])], "sample 2, channel y2 is -inf"),
    "texts in a table": (pd.DataFrame({"a": ["x", "y"], "b": [1, 2]}), "no number"),
    "no such file": ("nothing.csv", "nothing.csv"),
    "a spreadsheet": ("table.xlsx", "xlsx"),
    "only missing": ([np.full((20, 1), np.nan)], ""),
}


@pytest.mark.parametrize("data, words", REFUSED.values(), ids=REFUSED.keys())
@pytest.mark.filterwarnings("ignore::scrnn.DataWarning")
def test_what_holds_no_sequences_is_refused_in_words(data: Any, words: str) -> None:
    with pytest.raises(ValueError) as raised:
        learn(data)
    assert isinstance(raised.value, scrnn.Error) and words in str(raised.value)


@pytest.mark.parametrize(
    "options, words",
    [
        ({"channels": ["a"]}, "1 channels are named"),
        ({"channels": ["a", "b", "c"]}, "3 channels are named"),
        ({"channels": ["a", "a"]}, "twice"),
        ({"names": ["one"]}, "1 sequences are named"),
        ({"held_out": 1.5}, "held_out"),
        ({"held_out": 0.0}, "held_out"),
        ({"held_out": ["nobody"]}, "nobody"),
        ({"held_out": ["1", "2"]}, "all sequences are held out"),
        ({"epochs": -1}, "invalid value|epochs"),
        ({"epochs": 1.5}, "invalid type|epochs"),
        ({"seed": -1}, "invalid value|seed"),
    ],
)
def test_options_that_do_not_fit_are_refused_in_words(options: dict[str, Any], words: str) -> None:
    with pytest.raises(scrnn.Error, match=words):
        learn([movement(4.0), movement(2.0, 30)], **options)


def test_a_table_without_a_wanted_column_lists_those_there_are() -> None:
    with pytest.raises(scrnn.Error, match="the columns are a, b"):
        learn(pd.DataFrame(movement(4.0), columns=["a", "b"]), channels=["c"])


def test_tables_of_other_columns_do_not_go_together() -> None:
    tables = [pd.DataFrame(movement(4.0), columns=["a", "b"]), pd.DataFrame(movement(4.0), columns=["a", "c"])]
    with pytest.raises(scrnn.Error, match="table 2 has the columns a, c"):
        learn(tables)


def test_what_was_given_is_not_changed() -> None:
    data = movement(4.0)
    before = data.copy()
    learn([data])
    assert (data == before).all()
    data.flags.writeable = False
    learn([data])


def test_a_channel_that_never_moves_is_refused_or_floored() -> None:
    still = np.c_[movement(4.0)[:, 0], np.full(40, 3.0)]
    with pytest.warns(scrnn.DataWarning):
        with pytest.raises(scrnn.Error, match="never changes"):
            learn([still])


def test_what_is_mostly_or_wholly_missing_is_told() -> None:
    data = movement(4.0)
    data[::2, 0] = np.nan
    data[1:6, 0] = np.nan
    with pytest.warns(scrnn.DataWarning, match="channel y1: 23 of 40 samples are missing"):
        learn([data])
    data[:, 0] = np.nan
    with pytest.warns(scrnn.DataWarning, match="never observed"):
        with pytest.raises(scrnn.Error, match="channel y1 was never observed"):
            learn([data])
