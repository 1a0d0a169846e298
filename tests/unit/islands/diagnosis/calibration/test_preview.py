"""Preview of a diagnosis: the calibration of a simulation on a part of a record."""

import numpy as np
import pytest

from islands.diagnosis.calibration.preview import choose_stretch, preview_calibration
from islands.records.dataset import Dataset
from islands.simulators.specification.factory import make_simulator


def make_record(samples: int = 400, quiet: int = 0) -> Dataset:
    """Return a record of a first-order system, at rest in its first ``quiet`` samples."""
    u = np.random.default_rng(1).standard_normal(samples)
    u[:quiet] = 0.0
    y = np.zeros(samples)
    for k in range(1, samples):
        y[k] = 0.8 * y[k - 1] + 0.5 * u[k]
    return Dataset(u, y, 0.1)


def test_the_true_model_has_no_error() -> None:
    record = make_record()
    found = preview_calibration(record, make_simulator("linear:1", record))
    assert found.error_percent == pytest.approx(0.0, abs=1e-6)
    assert found.fitted == 300
    values = dict(zip((each.name for each in found.fit.simulation.parameters), found.fit.values, strict=True))
    assert values["a1"] == pytest.approx(0.8)


def test_a_short_record_is_taken_whole() -> None:
    assert choose_stretch(make_record(), 400) == slice(0, 400)


@pytest.mark.parametrize("quiet", [0, 700, 1500])
def test_a_stretch_is_where_the_output_varies(quiet: int) -> None:
    record = make_record(2000, quiet)
    chosen = choose_stretch(record, 300)
    assert chosen.stop - chosen.start == 300
    assert np.std(record.y[chosen]) >= np.std(record.y[1700:])
    assert chosen.start >= quiet - 300
