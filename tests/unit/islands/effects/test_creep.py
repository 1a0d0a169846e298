"""Logarithmic creep: the records that show it."""

import numpy as np
import pytest
import scipy

from islands.effects.creep import LOGARITHMIC_CREEP
from islands.effects.interface.context import SimulationContext
from islands.effects.interface.effect import apply_map

SAMPLES = 900


@pytest.mark.parametrize(("dt", "is_offered"), [(0.02, True), (0.3, True), (4.0, False), (60.0, False)])
def test_logarithmic_creep_is_no_offset_where_it_is_offered(dt: float, is_offered: bool) -> None:
    rng = np.random.default_rng(0)
    y = scipy.signal.lfilter([0.05], [1.0, -0.95], np.repeat(rng.standard_normal(SAMPLES // 30), 30))
    context = SimulationContext(y, dt, {}, {}, 1.0, 1.0, "V", "um", 0.75 * SAMPLES * dt)
    response = apply_map(LOGARITHMIC_CREEP, y, np.array([0.01]), context) - y
    alike = np.column_stack([np.ones(SAMPLES), y])
    left = response - alike @ np.linalg.lstsq(alike, response, rcond=None)[0]
    assert LOGARITHMIC_CREEP.is_applicable(context) == is_offered
    assert (np.std(left) > 0.3 * np.std(response)) == is_offered
