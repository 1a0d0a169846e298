"""Points of a curve are told from a record of a dynamic system."""

import numpy as np
import pytest

import islands
from islands.records.inspection.static_curve import is_static_curve
from support.known_records import lag, slow, steps, white


def draw_points(seed, points=40):
    """A calibration: values of a thermistor in random order."""
    rng = np.random.default_rng(seed)
    u = rng.uniform(0.5, 90.0, points)
    return u, 80.0 - 25.0 * np.log(u) + 0.05 * rng.standard_normal(points)


@pytest.mark.parametrize("seed", range(3))
def test_a_curve_is_static_in_any_order_of_its_points(seed):
    u, y = draw_points(seed)
    order = np.argsort(u)
    assert is_static_curve(u, y)
    assert is_static_curve(u[order], y[order])
    assert is_static_curve(u[order][::-1], y[order][::-1])


@pytest.mark.parametrize("excite", [steps, slow, white])
@pytest.mark.parametrize("constant", [1.0, 5.0, 50.0])
def test_the_response_of_a_dynamic_system_is_no_curve(excite, constant):
    u = excite(500, 0)
    assert not is_static_curve(u, lag(u, constant))


def test_points_without_a_time_are_refused_as_a_curve_and_not_inspected_as_a_record(tmp_path):
    u, y = draw_points(0)
    path = tmp_path / "calibration.csv"
    np.savetxt(path, np.column_stack([u, y]), delimiter=",", header="R_kohm,T_degC", comments="")
    with pytest.raises(islands.RecordError, match="T_degC is a static curve over R_kohm"):
        islands.read_record(path, ["R_kohm"], "T_degC")
    found = islands.inspect_record(path, ["R_kohm"], "T_degC")
    assert (found.facts.facts, found.command) == ((), "")
    assert ["static curve" in text for text in found.warnings] == [True]
    assert islands.read_record(path, ["R_kohm"], "T_degC", dt=1.0).samples == 40
