"""Figure of a static model: samples are as far from the curve as from the model."""

import numpy as np
import pytest

from islands.errors import ModelError
from islands.expressions.parsing import parse
from islands.models.narx import make_model
from islands.records.dataset import Dataset
from islands.records.input_lead import advance_all_inputs
from islands.report.figures.static_model import draw_static_curve
from islands.validation.ensemble import Ensemble, EnsembleStructure
from islands.validation.prediction_bands import PredictionBands

pytestmark = pytest.mark.usefixtures("without_layout")

INPUTS = ("opening+1", "p_bar+1")

#: Flow through a valve, and a model that has the same output at rest and a past.
FLOW = make_model([(parse("u1(k-1)*u2(k-1)^2"), 3.0)], INPUTS, "q_l/s")
SLOW = make_model([(parse("y(k-1)"), 0.5), (parse("u1(k-1)*u2(k-1)^2"), 1.5)], INPUTS, "q_l/s")


def compute_flow(opening, pressure):
    return 3.0 * opening * pressure**2


@pytest.fixture(scope="module")
def record():
    rng = np.random.default_rng(0)
    u = rng.uniform([0.1, 1.0], [1.0, 4.0], (200, 2))
    y = compute_flow(*u.T) + 0.1 * rng.standard_normal(200)
    return Dataset(u, y, 1.0, ("opening", "p_bar"), "q_l/s", segments=(120, 80))


def find_lines(axes):
    """Return samples and curve of an axes."""
    return [np.column_stack(line.get_data()) for line in axes.lines]


def test_each_input_has_the_curve_at_the_medians_of_the_others(record):
    above = draw_static_curve(FLOW, [record]).axes[:2]
    # The first sample of a recording is not predicted.
    medians = np.median(np.delete(record.u, [0, 120], axis=0), axis=0)
    for channel, axes in enumerate(above):
        _, curve = find_lines(axes)
        points = np.tile(medians, (len(curve), 1))
        points[:, channel] = curve[:, 0]
        assert curve[:, 1] == pytest.approx(compute_flow(*points.T))
        assert np.ptp(curve[:, 0]) == pytest.approx(np.ptp(record.u[:, channel]), rel=0.05)
    assert above[0].get_title(loc="left").startswith("samples moved to the median of p_bar = ")


@pytest.mark.parametrize("prepare", [lambda record: record, advance_all_inputs])
def test_samples_are_as_far_from_the_curve_as_from_the_model(record, prepare):
    opening, _, residual, _ = draw_static_curve(FLOW, [prepare(record)]).axes
    samples, curve = find_lines(opening)
    below, _ = find_lines(residual)
    measured = np.delete(record.y - compute_flow(*record.u.T), [0, 120])
    assert below[:, 1] == pytest.approx(measured, abs=1e-9)
    assert samples[:, 1] - np.interp(samples[:, 0], *curve.T) == pytest.approx(measured, abs=1e-9)


def test_members_with_a_past_do_not_widen_the_band(record):
    structures = (EnsembleStructure(each, 0.5, np.array([each.theta] * 10)) for each in (FLOW, SLOW))
    bands = PredictionBands(Ensemble(tuple(structures)), 0.1, 0.1, {0.9: 1.6, 0.95: 2.0})
    figure = draw_static_curve(FLOW, [record], 2, bands)
    for axes in figure.axes[2:]:
        (band,) = axes.collections
        heights = band.get_paths()[0].vertices[:, 1]
        assert np.ptp(heights) < 2.0 * 1.6 * 0.1 + 0.02 * np.ptp(record.y)


def test_records_are_drawn_together(record):
    residual = draw_static_curve(FLOW, [record[:120], record[120:]]).axes[2]
    assert len(find_lines(residual)[0]) == record.samples - 2


def test_a_model_with_a_past_has_no_static_curve(record):
    with pytest.raises(ModelError, match="has a past"):
        draw_static_curve(SLOW, [record])
