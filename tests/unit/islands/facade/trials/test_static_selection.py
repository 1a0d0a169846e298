"""A static record is told from one with dynamics, also if its inputs are slow."""

import numpy as np
import pytest

import islands
from islands.facade.trials.library import take_library
from islands.facade.trials.static_selection import find_static
from islands.models.form import name_form
from islands.progress import Steps
from islands.records.dataset import Dataset
from islands.records.split import split
from support.known_records import lag, slow, steps, white

NOISE = 0.01


def measure(u, respond, seed=5):
    y = respond(u)
    return Dataset(u, y + NOISE * np.ptp(y) * np.random.default_rng(seed).standard_normal(len(y)), 1.0)


def curve(u):
    return np.tanh(1.5 * u) + 0.3 * u


def drive(excite, seed):
    u = excite(600, seed)
    return u / np.std(u)


@pytest.mark.ci
@pytest.mark.parametrize("excite", [steps, slow, white])
@pytest.mark.parametrize(
    ("respond", "places"),
    [
        (curve, (0,)),
        (lambda u: 3.0 - 2.0 * u, (0,)),
        (lambda u: curve(lag(u, 3.0)), ()),
        (lambda u: lag(curve(u), 3.0), ()),
    ],
    ids=["curve", "gain", "curve behind a lag", "lag behind a curve"],
)
def test_inputs_are_read_at_the_same_sample_if_a_static_model_has_as_much_evidence(excite, respond, places):
    data = split(measure(drive(excite, 0), respond))
    found = find_static(data, take_library("polynomial", None, None, None), Steps())
    assert (found.early if found else ()) == places


@pytest.mark.ci
@pytest.mark.parametrize("excite", [steps, slow])
def test_the_curve_of_a_sensor_is_recommended_as_static(excite):
    """The output of held inputs rests as that of hysteresis does, and slow inputs follow from their past."""
    found = islands.fit(measure(drive(excite, 0), curve))
    assert name_form(found.best.model) == "static"
    choice, physics = found.search_result.recommendation.reasons
    assert choice.startswith("static: y depends on the inputs of the same sample only; ")
    assert physics.startswith("bounded at inputs held")
    fresh = drive(excite, 1)
    error = found.best.simulate(fresh).y - curve(fresh)
    assert np.sqrt(np.mean(error**2)) < 0.5 * NOISE * np.ptp(curve(fresh))
