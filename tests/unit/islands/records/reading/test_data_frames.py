"""Records from data frames and arrays."""

import subprocess
import sys

import numpy as np
import pandas as pd
import polars as pl
import pytest
import xarray as xr

import islands
from support.searches import record

TIME = 0.04 * np.arange(400)
RECORD = islands.Dataset(record(400).u, record(400).y, 0.04, ("u_V",), "y")
COLUMNS = {"u_V": RECORD.u[:, 0], "y": RECORD.y}
CHOICE = {"inputs": ["u_V"], "output": "y"}
MOMENTS = pd.Timestamp("2026-03-29 00:59:55", tz="Europe/Berlin") + pd.to_timedelta(TIME, unit="s")
FRAME = pd.DataFrame(COLUMNS)

SAME = {
    "a column t_s": FRAME.assign(t_s=TIME),
    "an index of moments": FRAME.set_index(MOMENTS),
    "an index of durations": FRAME.set_index(pd.to_timedelta(TIME, unit="s")),
    "an index of seconds": FRAME.set_index(TIME),
    "an index of milliseconds": FRAME.set_index(pd.Index(1000 * TIME, name="time_ms")),
    "a column of moments": FRAME.assign(Datum=MOMENTS),
    "nullable numbers": FRAME.convert_dtypes().assign(t=TIME),
    "polars": pl.DataFrame(COLUMNS | {"t": TIME}),
    "polars with durations": pl.DataFrame(
        COLUMNS | {"at": pl.Series((1e6 * TIME).round().astype(int)).cast(pl.Duration("us"))}
    ),
    "a mapping": COLUMNS | {"t": TIME.tolist()},
    "a structured array": FRAME.assign(t=TIME).to_records(index=False),
    "xarray": xr.Dataset({name: ("t", values) for name, values in COLUMNS.items()}, coords={"t": TIME}),
    "xarray with moments": xr.Dataset(
        {name: ("at", values) for name, values in COLUMNS.items()}, coords={"at": MOMENTS.tz_convert(None)}
    ),
    "xarray with milliseconds": xr.Dataset(
        {name: ("t", values) for name, values in COLUMNS.items()},
        coords={"t": ("t", 1000 * TIME, {"units": "ms"})},
    ),
    "a labelled array": xr.DataArray(
        np.column_stack(list(COLUMNS.values())),
        {"time": TIME, "channel": list(COLUMNS)},
        dims=("time", "channel"),
    ),
    "a labelled array of rows": xr.DataArray(
        np.stack(list(COLUMNS.values())), {"channel": list(COLUMNS), "t": TIME}, dims=("channel", "t")
    ),
}


@pytest.mark.parametrize("data", SAME.values(), ids=SAME)
def test_the_same_columns_give_the_same_record_in_every_container(data):
    made = islands.as_record(data, **CHOICE)
    assert (made.input_names, made.input_units, made.output_name) == (("u_V",), ("V",), "y")
    assert made.dt == pytest.approx(0.04, rel=1e-12)
    assert np.array_equal(made.u, RECORD.u)
    assert np.array_equal(made.y, RECORD.y)


@pytest.mark.parametrize(
    ("u", "y", "names"),
    [
        (RECORD.u, RECORD.y, ("u1",)),
        (RECORD.u[:, 0], RECORD.y[:, None], ("u",)),
        (RECORD.u[:, 0].tolist(), RECORD.y.tolist(), ("u",)),
        (FRAME["u_V"], FRAME["y"], ("u_V",)),
        (FRAME[["u_V"]], FRAME["y"], ("u_V",)),
        (pl.Series("u_V", RECORD.u[:, 0]), pl.Series("y", RECORD.y), ("u_V",)),
    ],
)
def test_two_arrays_and_a_sampling_time_are_a_record(u, y, names):
    made = islands.as_record(u, y, 0.04)
    assert made.input_names == names
    assert np.array_equal(made.u, RECORD.u)
    assert np.array_equal(made.y, RECORD.y)


@pytest.mark.parametrize(
    ("unit", "step"), [("h", 3600.0), ("hours", 3600.0), ("days since 2025-01-01", 86_400.0), ("", 1.0)]
)
def test_a_coordinate_of_an_xarray_data_set_is_in_its_unit(unit, step):
    """Conventions for climate data state an origin."""
    data = xr.Dataset(
        {name: ("time", values) for name, values in COLUMNS.items()},
        coords={"time": ("time", 12.5 + np.arange(len(TIME)), {"units": unit})},
    )
    record = islands.as_record(data, **CHOICE)
    assert (record.dt, record.reading) == (pytest.approx(step), ())


@pytest.mark.parametrize("name", ["u_V", None])
def test_the_time_of_a_labelled_array_is_that_of_the_record(name):
    u, y = (xr.DataArray(values, {"time": TIME}, "time", name) for values in COLUMNS.values())
    for data in (y, RECORD.y):
        made = islands.as_record(u, data)
        assert made.dt == pytest.approx(0.04)
        assert made.input_names == (name or "u",)
        assert np.array_equal(made.y, RECORD.y)


@pytest.mark.parametrize("inputs", [0, [0], (0,), np.array([0])])
def test_columns_may_have_numbers_as_names(inputs):
    made = islands.as_record(pd.DataFrame({0: RECORD.u[:, 0], 1: RECORD.y}), dt=0.04, inputs=inputs, output=1)
    assert (made.input_names, made.output_name) == (("0",), "1")


#: Natural calls that raised an exception of Python, and what the message says.
UNUSUAL = [
    (lambda: islands.fit(FRAME, inputs="u_V", output=["y", "u_V"], dt=0.04), "u_V is an input and an output"),
    (lambda: islands.join((FRAME, FRAME)), "join takes Datasets, got a DataFrame"),
    (lambda: islands.as_record(FRAME, dt="0.04", **CHOICE), "dt must be a positive number .* got '0.04'"),
    (lambda: islands.as_record(FRAME, dt=True, **CHOICE), "dt must be a positive number .* got True"),
    (lambda: islands.fit(RECORD, max_terms="3"), "max_terms is an integer of at least 1, got '3'"),
    (lambda: islands.as_record(None, RECORD.y, 0.04), "no record is given"),
    (lambda: islands.as_record(3.0, RECORD.y, 0.04), "an array of numbers, got float"),
    (lambda: islands.inspect_record(FRAME), "takes a file or a Dataset, got a DataFrame"),
]


@pytest.mark.parametrize(("call", "words"), UNUSUAL)
def test_an_unusual_argument_is_refused_with_the_usual_one(call, words):
    with pytest.raises(islands.IslandsError, match=words):
        call()


def test_a_list_of_frames_is_a_record_of_recordings():
    made = islands.as_record([FRAME[:150], FRAME[150:]], dt=0.04, **CHOICE)
    assert made.segments == (150, 250)
    assert np.array_equal(made.y, RECORD.y)


GAP = np.where(TIME < 8.0, TIME, TIME + 1.0)

#: Data, arguments, and what the message says.
UNUSABLE = [
    (FRAME, {"dt": 0.04, "inputs": "volt", "output": "y"}, "no column volt; it has u_V, y"),
    (FRAME, {"dt": 0.04, "output": "y"}, "no input is given: name one or more of the columns u_V, y"),
    (FRAME, {"dt": 0.04, "inputs": "u_V"}, "no output is given: take one of the columns u_V, y"),
    (FRAME, CHOICE, "no time column"),
    (FRAME.set_index(MOMENTS), {**CHOICE, "dt": 0.1}, "0.04 s by column time and 0.1 s"),
    (FRAME.set_index(GAP), CHOICE, "the record, sample 200, column time follows a gap"),
    (FRAME.assign(u_V="mild"), {**CHOICE, "dt": 1.0}, "u_V holds .* where real numbers"),
    (
        FRAME.assign(u_V=FRAME["u_V"].astype(str).where(FRAME.index != 7, "mild")),
        {**CHOICE, "dt": 1.0},
        "sample 7, column u_V: 'mild' is not a number",
    ),
    (FRAME.assign(u_V=1.0), {**CHOICE, "dt": 1.0}, "column u_V is constant"),
    (
        FRAME.assign(u_V=FRAME["u_V"].where(FRAME.index != 7)),
        {**CHOICE, "dt": 1.0},
        "sample 7, column u_V is empty or NaN",
    ),
    (FRAME.set_axis(["y", "y"], axis=1), {**CHOICE, "dt": 1.0}, "two columns have the same name"),
    (pl.LazyFrame(COLUMNS), CHOICE, "collect it first"),
    (RECORD.u, {}, r"\(u, y, dt\)"),
    (RECORD.u, {"y": RECORD.y[1:], "dt": 0.04}, "column u1 has 400 samples, column y 399"),
    (RECORD.u, {"y": RECORD.y, "output": "y"}, "leave them out"),
    (RECORD.u, {"y": np.zeros((2, 400)), "dt": 0.04}, "outputs are an array of the shape"),
    (RECORD, {"dt": 0.04}, "give nothing else"),
    (RECORD, {"y": RECORD}, "validation="),
    (FRAME, {**CHOICE, "y": 0.25}, "validation="),
    (FRAME, {"y": "u_V"}, "inputs=..., output=..."),
    ("piezo.csv", CHOICE, r"islands.read_record\('piezo.csv'"),
]


@pytest.mark.parametrize(("data", "arguments", "message"), UNUSABLE, ids=[each[2] for each in UNUSABLE])
def test_unusable_data_are_refused_with_the_remedy(data, arguments, message):
    with pytest.raises(islands.IslandsError, match=message):
        islands.as_record(data, **arguments)


@pytest.mark.ci
def test_fit_of_a_frame_equals_fit_of_the_record():
    settings = {"library": "polynomial", "degree": 1, "max_terms": 3}
    ends = FRAME.iloc[:300], FRAME.iloc[300:]
    made = islands.fit(ends[0], **CHOICE, dt=0.04, validation=ends[1], **settings)
    same = islands.fit(RECORD[:300], validation=RECORD[300:], **settings)
    arrays = islands.fit(
        FRAME["u_V"].iloc[:300], FRAME["y"].iloc[:300], 0.04, validation=RECORD[300:], **settings
    )
    assert made.best.model == same.best.model == arrays.best.model


def test_arrays_import_no_library_of_frames():
    code = (
        "import sys, islands; islands.as_record([0.0, 1.0] * 20, [1.0, 2.0] * 20, 0.1);"
        "print({'pandas', 'polars', 'xarray'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"gap": "split"}, "there is no setting 'gap'. Did you mean 'gaps'"),
        ({"gaps": "cut"}, "gaps is one of split, interpolate, got 'cut'"),
        ({"decimal": "comma"}, "the record is not a table of text: leave decimal out"),
        ({"timezone": "Europe/Berlin"}, "the record is not a table of text: leave timezone out"),
    ],
)
def test_an_option_that_does_not_apply_to_a_frame_is_refused(options, words):
    with pytest.raises(islands.errors.SettingsError, match=words):
        islands.as_record(SAME["a column t_s"], **CHOICE, **options)


def test_options_of_reading_are_a_mapping():
    with pytest.raises(islands.errors.SettingsError, match="reading is a mapping of options"):
        islands.fit(FRAME, **CHOICE, reading="split")
