"""Compatibility of records: columns are matched by name, and units and sampling times have to agree."""

import numpy as np
import pytest

from islands.errors import RecordError
from islands.expressions.parsing import parse
from islands.models.narx import make_model
from islands.records.compatibility import match_record
from islands.records.dataset import Dataset


def record(*names: str, output: str = "y_um", dt: float = 0.1, **changes: object) -> Dataset:
    """A record whose input columns are 0, 1, 2, ... in the order of the names."""
    u = np.tile(np.arange(float(len(names))), (3, 1))
    return Dataset(u, np.zeros(3), dt, names, output, **changes)


@pytest.mark.parametrize(
    ("expected", "given", "order"),
    [
        (("a_V", "b_V"), ("a_V", "b_V"), [0, 1]),
        (("a_V", "b_V"), ("b_V", "a_V"), [1, 0]),
        (("a", "b", "c"), ("c", "a", "b"), [1, 2, 0]),
        # Names without units.
        (("a_V", "b_V"), ("b", "a"), [1, 0]),
        # One signal in two units of one name, for example a displacement in two sensors.
        (("x_V", "x_um"), ("x_um", "x_V"), [1, 0]),
        (("u_V+1", "u_V"), ("u_V", "u_V+1"), [1, 0]),
        # No name occurs in both.
        (("u_est_V", "w_est_K"), ("u_val_V", "w_val_K"), [0, 1]),
        (("u_est",), ("u_val",), [0]),
        (("a_V", "b_V"), ("u1", "u2"), [0, 1]),
    ],
)
def test_inputs_are_matched_by_name_and_otherwise_by_position(expected, given, order):
    matched = match_record(record(*expected), record(*given))
    assert matched.u[0].tolist() == order
    assert matched.input_names == tuple(given[place] for place in order)


@pytest.mark.parametrize(
    ("expected", "given", "message"),
    [
        (("a_V", "b_V"), ("a_V", "c_V"), "some names occur in both.*rename the columns"),
        (("a_V", "b_V"), ("c_V", "a_V"), "some names occur in both"),
        (("a_V", "b_V"), ("a", "c"), "some names occur in both"),
        (("a", "b"), ("a",), r"has 2 inputs \(a, b\), the record 1 \(a\)"),
        (("u_V",), ("u_mV",), "u_V in V, the record u_mV in mV: multiply u_mV by 0.001"),
        (
            ("u_est_V",),
            ("u_val_um",),
            "in V, the record u_val_um in um: convert u_val_um and give it the unit V",
        ),
        (("u_V",), ("u_V+1",), r"\+1 is a column that is read one sample early: read the input u_V$"),
        (("u_V",), ("y_um",), "choose the same inputs and output"),
    ],
)
def test_inputs_that_do_not_match_are_refused(expected, given, message):
    with pytest.raises(RecordError, match=message):
        match_record(record(*expected), record(*given, output="z_um"))


def test_stated_units_precede_those_of_the_names():
    volts = record("u", input_units=("V",), output_unit="um")
    with pytest.raises(RecordError, match="has u in"):
        match_record(volts, record("u", input_units=("counts",), output_unit="um"))
    assert match_record(volts, record("u")).input_names == ("u",)
    # The last part of a name need not be a unit.
    assert match_record(record("u_est", output="y_est"), record("u_val", output="y_val")).inputs == 1


def test_units_in_the_names_of_a_model_are_compared():
    model = make_model([(parse("u(k-1)"), 1.0)], ("u_V",), "y_um")
    assert match_record(model, record("u_V", output="y_µm")).inputs == 1
    with pytest.raises(RecordError, match="multiply y_mm by 1000"):
        match_record(model, record("u_V", output="y_mm"))


@pytest.mark.parametrize("dt", [0.1, 0.100_009, 0.099_991])
def test_sampling_times_may_differ_by_rounding(dt):
    assert match_record(record("u"), record("u", dt=dt)).dt == dt


@pytest.mark.parametrize("dt", [0.1002, 0.0998, 1.0])
def test_different_sampling_times_are_refused_for_records_and_models(dt):
    model = make_model([(parse("u(k-1)"), 1.0)], ("u",), "y_um", 0.1)
    for reference in (record("u"), model):
        with pytest.raises(RecordError, match=r"sampling time of 0\.1 s, .*resample the record"):
            match_record(reference, record("u", dt=dt))
