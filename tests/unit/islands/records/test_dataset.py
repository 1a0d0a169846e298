"""Records: validation, read-only arrays, segments, slices and joins."""

from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest

from islands.errors import RecordError
from islands.records.averaging import average_samples
from islands.records.channel_names import parse_unit
from islands.records.dataset import Dataset, join
from islands.records.preprocessing import preprocess


def record(samples: int = 10, **changes: object) -> Dataset:
    fields: dict[str, object] = {
        "u": np.arange(samples, dtype=float),
        "y": np.arange(samples, dtype=float) ** 2,
        "dt": 0.5,
    }
    return Dataset(**(fields | changes))


def error_message(**changes: object) -> str:
    with pytest.raises(RecordError) as caught:
        record(**changes)
    return str(caught.value)


@pytest.mark.parametrize(
    "change",
    [
        lambda given: given[3:40],
        lambda given: join((given, record())),
        lambda given: average_samples(given, 3),
        lambda given: preprocess(given, lowpass=0.3),
        lambda given: preprocess(given, decimate=2),
    ],
    ids=["slice", "join", "means", "filter", "decimation"],
)
def test_gross_errors_pass_through_the_steps_of_the_output(change):
    measured = np.sin(np.arange(60.0))
    measured[[20, 31]] = 50.0
    y = np.where(measured == 50.0, np.nan, measured)
    found, expected = change(record(60, y=y, measured=measured)), change(record(60, y=measured))
    np.testing.assert_array_equal(found.measured, expected.y)
    assert not found.measured.flags.writeable


def test_record_is_read_only():
    made = record()
    with pytest.raises(ValueError, match="read-only"):
        made.u[0, 0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        made.y[0] = 1.0
    with pytest.raises(FrozenInstanceError):
        made.dt = 1.0


@pytest.mark.parametrize(
    ("u", "y"),
    [
        (np.ones(9), np.ones(10)),
        (np.ones((2, 10)), np.ones(10)),
        (np.ones((10, 1, 1)), np.ones(10)),
        (np.ones(10), np.ones((10, 1))),
    ],
)
def test_error_for_inconsistent_arrays_shows_their_shapes(u, y):
    message = error_message(u=u, y=y)
    assert f"got {u.shape} and {y.shape}" in message
    assert "(samples, inputs)" in message


def test_record_without_samples_is_refused():
    assert "0 samples" in error_message(samples=0)


@pytest.mark.parametrize("dt", [0.0, -1.0, float("nan"), float("inf")])
def test_sampling_time_that_is_not_positive_and_finite_is_refused(dt):
    message = error_message(dt=dt)
    assert "positive number of seconds" in message
    assert str(dt) in message


@pytest.mark.parametrize("segments", [(4, 5), (11,), (10, 0), (12, -2)])
def test_segments_must_be_positive_and_sum_to_the_samples(segments):
    message = error_message(segments=segments)
    assert str(segments) in message
    assert "10 samples" in message


def test_names_or_units_that_do_not_match_the_inputs_are_refused():
    two = np.ones((10, 2))
    assert "2 inputs need 2 names, got ('a', 'b', 'c')" in error_message(u=two, input_names=("a", "b", "c"))
    assert "2 inputs need 2 units, got ('V',)" in error_message(u=two, input_units=("V",))


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_error_for_a_non_finite_input_names_input_and_sample(value):
    u = np.ones((10, 2))
    u[6, 1] = value
    message = error_message(u=u, input_names=("a_V", "b_V"))
    assert "input b_V is not finite at sample 6" in message
    assert "repair or cut" in message


def test_error_for_an_infinite_output_names_output_and_sample():
    y = np.ones(10)
    y[4] = -np.inf
    message = error_message(y=y, output_name="y_um")
    assert "output y_um is infinite at sample 4" in message


def test_slice_cuts_segments_and_joins_none():
    made = record(segments=(3, 5, 2))
    assert made[1:9].segments == (2, 5, 1)
    assert made[3:8].segments == (5,)
    assert made[:4].segments == (3, 1)


@pytest.mark.parametrize("rows", [slice(5, 5), slice(7, 3), slice(20, 30), slice(None, None, 2)])
def test_slice_that_is_empty_or_skips_samples_is_refused(rows):
    with pytest.raises(RecordError, match="non-empty slice of step 1 of the record's 10 samples"):
        record()[rows]


def test_cutting_and_joining_at_a_boundary_returns_the_record():
    made = record(segments=(3, 7))
    again = join((made[:3], made[3:]))
    assert again.segments == made.segments
    assert again.recordings == ("1", "2")
    assert np.array_equal(again.u, made.u)
    assert np.array_equal(again.y, made.y)


def test_a_step_of_reading_has_the_names_of_its_recordings():
    common, own = "time in column t", "level is flat in 5 % of the samples"
    one, two = (
        replace(record(20), recordings=(name,), reading=(common, *steps))
        for name, steps in (("a.csv", ()), ("b.csv", (own,)))
    )
    assert join((one, two)).reading == (common, f"b.csv: {own}")
    assert join((two,)).reading == two.reading
    third = replace(record(20), recordings=("c.csv",))
    assert join((join((one, two)), third)).reading == (f"a.csv, b.csv: {common}", f"b.csv: {own}")


def test_recordings_with_different_columns_or_units_are_not_joined():
    for change in ({"output_name": "z"}, {"output_unit": "um"}, {"input_names": ("v",)}):
        with pytest.raises(RecordError, match="same columns and units: rename or convert"):
            join((record(), record(**change)))


def test_join_without_recordings_is_refused():
    with pytest.raises(RecordError, match="there is no recording to join"):
        join(())


@pytest.mark.parametrize(
    ("name", "unit"),
    [("y_um", "mm"), ("y (V)", "mV"), ("speed_rad_s", "rpm"), ("p/bar", "Pa")],
)
def test_a_unit_that_contradicts_the_name_is_refused(name, unit):
    """It was accepted; the model took the unit of the name and refused its own record."""
    expected = f"{name} is named in {parse_unit(name)}, but its unit is {unit}: rename the column"
    assert expected in error_message(output_name=name, output_unit=unit)
    assert expected in error_message(input_names=(name,), input_units=(unit,))


@pytest.mark.parametrize(
    ("name", "unit"),
    [("y_um", "\u00b5m"), ("T_C", "\u00b0C"), ("y_um", ""), ("y", "mm"), ("y_um", "counts"), ("y_est", "mm")],
)
def test_a_unit_that_agrees_with_the_name_is_kept(name, unit):
    made = record(output_name=name, output_unit=unit)
    assert (made.output_name, made.output_unit) == (name, unit)


def test_sampling_times_are_stated_as_they_were_meant():
    recordings = [record(dt=0.3 - 0.2), record(dt=0.2)]
    with pytest.raises(RecordError, match=r"sampled at 0\.1 s and 0\.2 s"):
        join(recordings)
