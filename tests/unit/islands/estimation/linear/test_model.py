"""Laws of the standard errors of quantities."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from islands.estimation.linear.identify import scale_signals
from islands.estimation.linear.model import make_model
from islands.estimation.linear.noise import WHITE
from islands.estimation.linear.regression import make_structure, minimise, project


@pytest.mark.parametrize("excess", [1, 2])
def test_gain_has_the_standard_error_of_the_levels_that_it_joins(excess):
    random, samples = np.random.default_rng(1), 4000
    u = np.repeat([-1.0, 1.0] * 4, samples // 8)
    # The poles exp(-0.2) and exp(-0.5) in series, with an input that is held.
    slow, fast = np.exp(-0.2), np.exp(-0.5)
    y = 5.0 / 3.0 * lfilter([0.0, 1.0 - slow], [1.0, -slow], u)
    y -= 2.0 / 3.0 * lfilter([0.0, 1.0 - fast], [1.0, -fast], u)
    signals, scales = scale_signals(u, y + random.normal(0.0, 0.05, samples), 1.0)
    delays = np.zeros((1, 1), np.int64)
    free = make_structure(
        (np.array([-slow - fast, slow * fast]),), 0, delays, delays > 0, (WHITE,), signals.first
    )
    start = project(signals, replace(free, excess=np.full((1, 1), excess)))
    model = make_model(signals, minimise(signals, start, 20), scales)
    place = [each.name for each in model.quantities[0]].index("static gain")
    assert model.errors[0][place] == pytest.approx(0.05 / np.sqrt(samples), rel=0.1)


def test_changes_of_dead_times_add_up_in_the_standard_errors():
    random = np.random.default_rng(2)
    u = np.repeat(random.normal(size=(40, 2)), 10, axis=0)
    y = lfilter([0.0, 0.1], [1.0, -0.9], u.sum(axis=1)) + random.normal(0.0, 0.1, 400)
    signals, scales = scale_signals(u, y, 1.0)
    delays = np.zeros((1, 2), np.int64)
    whole = make_structure((np.array([-0.9]),), 0, delays, delays > 0, (WHITE,), signals.first)
    changes = (np.array([[True, False]]), np.array([[False, True]]))
    structures = [whole, *(replace(whole, leads=leads, delays=delays + leads) for leads in changes)]
    fit, *rivals = [minimise(signals, project(signals, each), 20) for each in structures]
    alone, *single, both = [
        np.square(make_model(signals, fit, scales, (), few).errors[0])
        for few in ((), rivals[:1], rivals[1:], rivals)
    ]
    assert (single[0] > alone).any()
    np.testing.assert_allclose(both - alone, single[0] + single[1] - 2.0 * alone, atol=1e-12)
