"""Figure of the curves of units: labels, ranges and bands."""

import numpy as np
import pytest

from islands.records.dataset import Dataset
from islands.report.figures.latent import draw_unit_curves
from islands.validation.ensemble import Ensemble, EnsembleStructure
from support.latent_systems import make_model, spring_record

# The kernels of state spaces are compiled at their first use.
pytestmark = [pytest.mark.ci, pytest.mark.usefixtures("without_layout")]


def test_the_curve_beyond_the_estimation_data_is_dashed():
    record = spring_record(400)
    louder = Dataset(1.5 * record.u, record.y, 0.01, ("u_V",), "y_mm")
    model = make_model({"a1_1": 0.8, "c1": 1.0, "e1_1": 0.3, "v1": 1.0}, ("tanh",), 1)
    (axes,) = draw_unit_curves(model, record, 20, further=louder).axes
    solid, *others = [line for line in axes.lines if len(line.get_xdata()) > 2]
    assert solid.get_linestyle() == "-"
    assert [line.get_linestyle() for line in others] == ["--", "--"]
    used = record.u[20:]
    assert np.ptp(solid.get_xdata()) == pytest.approx(np.ptp(used), rel=0.02)
    assert max(line.get_xdata().max() for line in others) == pytest.approx(1.5 * used.max())


def test_members_of_the_ensemble_give_a_band():
    model = make_model()
    draws = np.array(model.parameters) * np.linspace(0.99, 1.01, 20)[:, None]
    ensemble = Ensemble((EnsembleStructure(model, 1.0, draws),))
    record = spring_record(400)
    assert len(draw_unit_curves(model, record, 20, ensemble).axes[0].collections) == 1
    assert not draw_unit_curves(model, record, 20).axes[0].collections


def test_a_run_that_leaves_the_range_of_the_record_ends_there():
    unstable = {"a1_1": 1.05, "b1": 0.1, "c1": 1.0, "e1_1": 0.1, "w1_1": 1.0}
    record = spring_record(400)
    (axes,) = draw_unit_curves(make_model(unstable, ("tanh",), 1), record, 20).axes
    (line,) = [line for line in axes.lines if len(line.get_xdata()) > 2]
    # The argument is the state, which the output shows.
    assert axes.get_xlabel().startswith("y_mm, which")
    assert np.abs(line.get_xdata()).max() <= np.abs(record.y).max() + np.ptp(record.y)
