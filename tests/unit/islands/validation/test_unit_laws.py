"""Laws of curves: the law of a plant is named, whichever unit its model has, and another curve has none."""

from dataclasses import replace

import numpy as np
import pytest

from islands.estimation.latent_refit import refit_latent
from islands.models.latent import LatentModel, StateSpaceLayout
from islands.records.dataset import Dataset
from islands.records.split import split
from islands.validation.unit_laws import name_unit_laws
from support.latent_systems import SPRING, make_model, spring_record

# The kernels of state spaces are compiled at their first use.
pytestmark = pytest.mark.ci

NOISE, WARM_UP = 0.01, 20

#: A lag behind a curve of the input: the state, the linear path and the unit.
LAG = {"a1_1": 0.8, "b1": 0.01, "c1": 1.0, "e1_1": 0.3, "v1": 1.0, "s1": 0.01, "o1": 0.01, "level": 0.01}

#: A spring with a place of its zero.
SPRING_AND_PLACE = {
    name: (SPRING | dict.fromkeys(("s1", "o1", "o2"), 1e-4))[name]
    for name in (*list(SPRING)[:-1], "s1", "o1", "o2", "level")
}


def measure(law, feedback=np.zeros_like, seed=0):
    """Return the split record of a lag behind a law of the input, with a feedback."""
    rng = np.random.default_rng(seed)
    u, x, y = np.repeat(rng.uniform(-3.0, 3.0, 200), 5), 0.0, []
    for value in law(u):
        y.append(x)
        x = 0.8 * x + 0.3 * value - feedback(x)
    measured = np.array(y) + NOISE * np.std(y) * rng.standard_normal(len(y))
    return split(Dataset(u, measured, 0.01, ("u_V",), "y_mm", ("V",), "mm"))


def fit(parts, parameters, *units):
    """Return the model of units, estimated from parameters."""
    model = replace(make_model(parameters, units, 1), memory=WARM_UP)
    found = refit_latent(model, parts.estimation, 100, lambda: False)
    assert isinstance(found, LatentModel)
    return found


@pytest.mark.parametrize(
    ("law", "unit", "changes", "name", "places"),
    [
        (lambda u: np.clip(u, -1.0, 2.0), "saturation", {}, "saturation", [-1.0, 2.0]),
        # With a line, the other one is the same curve.
        (lambda u: np.clip(u, -1.0, 2.0), "dead zone", {"b1": 0.3, "e1_1": -0.3}, "saturation", [-1.0, 2.0]),
        (
            lambda u: u - np.clip(u, -1.0, 1.0),
            "saturation",
            {"b1": 0.3, "e1_1": -0.3},
            "dead zone",
            [-1.0, 1.0],
        ),
        (lambda u: np.maximum(u - 0.5, 0.0), "hinge", {}, "one-sided line", [0.5]),
        (lambda u: u * np.abs(u), "s*abs", {}, "signed square", [0.0]),
    ],
)
def test_the_law_of_an_input_is_named_with_its_places(law, unit, changes, name, places):
    parts = measure(law)
    (found,) = name_unit_laws(fit(parts, LAG | changes, unit), parts, WARM_UP)
    assert (found.units, found.law, found.over, found.unit) == ((1,), name, "u_V", "V")
    assert not found.has_line
    assert found.places == pytest.approx(places, abs=0.05)
    assert found.deviation_percent < 1.0


def test_dry_friction_is_a_sign_beside_viscous_friction():
    parts = measure(lambda u: u, lambda x: np.clip(x, -0.1, 0.1))
    feedback = {"a1_1": 0.8, "b1": 0.3, "c1": 1.0, "e1_1": -0.1, "w1_1": 10.0, "s1": 0.01, "level": 0.01}
    (found,) = name_unit_laws(fit(parts, feedback, "saturation"), parts, WARM_UP)
    assert (found.law, found.over, found.has_line) == ("sign (dry friction)", "y_mm", True)
    assert found.places == pytest.approx([0.0], abs=0.05)


@pytest.mark.parametrize("law", [lambda u: np.arcsinh(5.0 * u), lambda u: np.sin(2.0 * u)])
def test_another_curve_has_no_law(law):
    parts = measure(law)
    both = LAG | {"e1_2": 0.1, "v2": 0.5, "s2": 0.5}
    ordered = {name: both[name] for name in StateSpaceLayout(1, 1, 2).names if name in both}
    for parameters, units in ((LAG, ("tanh",)), (ordered, ("tanh", "bell"))):
        assert name_unit_laws(fit(parts, parameters, *units), parts, WARM_UP) == ()


def test_a_spring_is_a_cube_of_the_output():
    parts = split(spring_record(1200, noise=0.01))
    (found,) = name_unit_laws(make_model(SPRING_AND_PLACE), parts, WARM_UP)
    assert (found.law, found.over, found.has_line) == ("cube", "y_mm", True)
