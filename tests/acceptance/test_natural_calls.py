"""Calls of the library as a newcomer writes them: what is wrong is said, with what to do instead."""

from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import islands
from islands.errors import IslandsError
from islands.models.sympy_expression import to_sympy
from islands.simulation.input_response import step_response

N = 200
U = np.repeat(np.random.default_rng(0).uniform(-1.0, 1.0, N // 5), 5)
Y = np.cumsum(U)
FRAME = pd.DataFrame({"t": 0.01 * np.arange(N), "u": U, "y": Y})
RECORD = islands.Dataset(U, Y, 0.01)
MODEL = islands.make_model([(islands.parse("y(k-1)"), 0.5), (islands.parse("u(k-1)"), 1.0)])


def fit(frame: object = FRAME, *arguments: object, **changes: object) -> object:
    """Fit the columns of a frame, or two arrays."""
    names = {} if arguments else {"inputs": "u", "output": "y"}
    return islands.fit(frame, *arguments, **{**names, **changes})


def fit_linear(**changes: object) -> object:
    return fit(**{"library": "polynomial", "degree": 1, "lags": 1, "certificate": 0, **changes})


def identify(**changes: object) -> object:
    return islands.identify(FRAME, inputs="u", output="y", preset="narx", **changes)


#: Calls, with a part of the message.
CALLS: dict[str, tuple[Callable[[], object], str]] = {
    "ragged-rows": (lambda: fit([[1, 2], [3]], [1, 2], 0.01), "the inputs are not an array: every row"),
    "three-dimensions": (
        lambda: fit(U.reshape(-1, 1, 1), Y, 0.01),
        r"\(samples, inputs\), got \(200, 1, 1\)",
    ),
    "channels-in-rows": (lambda: fit(np.array([U, U]), Y, 0.01), r"give the transpose \(u.T\)"),
    "empty-arrays": (lambda: fit([], [], 0.01), "the record has no samples"),
    "words": (lambda: fit(["a", "b"] * (N // 2), Y, 0.01), r"holds text \('a' in sample 0\)"),
    "none-among-numbers": (lambda: fit([None, *U[1:]], Y, 0.01), "sample 0, column u is empty"),
    "times-as-dt": (lambda: fit(U, Y, 0.01 * np.arange(N)), r"seconds, got array\(\[.{1,40}$"),
    "timedelta-as-dt": (lambda: fit(U, Y, np.timedelta64(10, "ms")), "a positive number of seconds"),
    "series-as-input": (lambda: fit(inputs=FRAME["u"]), "inputs names columns, got .*a float"),
    "series-as-output": (lambda: fit(output=FRAME["y"]), "output names columns, got .*a float"),
    "set-of-inputs": (lambda: fit(inputs={"u"}), "inputs have an order, got a set"),
    "no-inputs": (lambda: fit(inputs=None), "no input is given: name one or more of the columns t, u, y"),
    "library": (lambda: fit(library="polinomial"), "one of auto, .*Did you mean 'polynomial'"),
    "class-of-models": (lambda: fit(model="narxx"), "one of narx.*Did you mean 'narx'"),
    "degree": (lambda: fit(library="polynomial", degree="2"), "degree is an integer, got '2'"),
    "lags": (lambda: fit(library="polynomial", lags=[1, 2]), r"lags is an integer, got \[1, 2\]"),
    "delays": (lambda: fit(delays=2), r"delays is a list of .* got 2: write \[2\]"),
    "seed": (lambda: fit(seed="1"), "seed is an integer, got '1'"),
    "negative-seed": (lambda: fit(seed=-1), "a seed is not negative, got -1"),
    "no-seed": (lambda: fit(seed=None), "seed is an integer, got None"),
    "constraints": (lambda: fit(constraints=["gain = 2"]), "constraints is a text"),
    "progress": (lambda: fit_linear(progress=True), "progress is a function, got True"),
    "no-validation": (lambda: fit(validation=None), "validation is a fraction such as 0.25, or a record"),
    "rows-as-validation": (lambda: fit(validation=slice(100, 200)), "cut rows by record"),
    "generations": (lambda: identify(generations="20"), "generations is an integer of at least 0, got '20'"),
    "shifts": (lambda: identify(shifts=3), r"shifts is a list of .* got 3: write \[3\]"),
    "primitives": (
        lambda: identify(primitives="tanh"),
        r"primitives is a list of .* got 'tanh': write \['tanh'\]",
    ),
    "target": (lambda: identify(target_error="0.1"), "target_error is a number of at least 0, got '0.1'"),
    "cores": (lambda: islands.Ray(cpus="4"), "cpus is an integer, got '4'"),
    "dataset-of-words": (
        lambda: islands.Dataset(["a"], [1.0], 0.1),
        "the inputs are not an array of numbers",
    ),
    "segments": (lambda: islands.Dataset(U, Y, 0.01, segments=N), "segments is a sequence"),
    "sample-of-a-record": (lambda: RECORD[0], r"write record\[start:stop\]"),
    "join": (lambda: islands.join(RECORD), r"write join\(\(one, other\)\)"),
    "split": (lambda: islands.split(FRAME), "split takes a Dataset, got a DataFrame"),
    "fraction": (lambda: islands.split(RECORD, "0.2"), "fraction is a number, got '0.2'"),
    "frame-as-file": (lambda: islands.read_record(FRAME, inputs="u", output="y"), "are read by as_record"),
    "frame-to-write": (lambda: islands.write_record(FRAME, "a.csv"), "write_record takes a Dataset"),
    "terms-as-text": (lambda: islands.make_model([("y(k-1)", 0.5)]), r"islands.parse\('y\(k-1\)'\)"),
    "expression": (lambda: islands.parse(None), "an expression is a text"),
    "warm-up": (lambda: islands.simulate(MODEL, RECORD, warm_up="5"), "warm_up is an integer"),
    "model-to-write": (lambda: islands.write_model(RECORD, "a.json"), "a Dataset is no model"),
    "record-to-simulate": (
        lambda: islands.simulate(RECORD, RECORD),
        "a Dataset is no model: give result.best.model, or the name of a simulation",
    ),
    "text-to-linearise": (lambda: islands.linearise("y(k-1)", [0.0]), "a str is no model: give result.best"),
    "record-as-formula": (lambda: to_sympy(RECORD), "a Dataset is no model"),
    "text-as-step-response": (
        lambda: step_response("y(k-1)", 0.0, 1.0),
        "a str is no model",
    ),
    "effects": (
        lambda: islands.diagnose(RECORD, "linear:1", effects=["friction"]),
        "effects takes a Effect, got a str",
    ),
    "column": (lambda: islands.diagnose(RECORD, "column:z"), "unknown column 'z': there is none"),
}


@pytest.mark.parametrize("call", CALLS)
def test_a_wrong_call_is_refused_with_advice(
    call: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    function, message = CALLS[call]
    with pytest.raises(IslandsError, match=message):
        function()


@pytest.mark.parametrize("kind", ["texts", "datetimes", "periods"])
def test_times_of_a_frame_that_pandas_has_not_converted_are_read(kind: str) -> None:
    """pandas.read_csv returns dates as texts, unless it is asked to parse them."""
    begin = datetime(2026, 3, 1, 12, tzinfo=UTC)
    stamps = [begin + timedelta(seconds=2 * place) for place in range(N)]
    frame = FRAME[["u", "y"]]
    if kind == "periods":
        frame = frame.set_index(pd.period_range("2026-03-01", periods=N, freq="2s"))
    else:
        times = [str(stamp) for stamp in stamps] if kind == "texts" else stamps
        frame = frame.assign(time=pd.Series(times, dtype=object))
    assert islands.as_record(frame, inputs="u", output="y").dt == 2.0
