"""Standard errors of the modes and gains of latent models: coverage, independence of the coordinates."""

from dataclasses import replace

import numpy as np
import pytest

from islands.estimation.quantity_errors import with_quantity_errors
from islands.estimation.refinement import refine
from islands.models.latent import StateSpaceLayout
from islands.records.dataset import Dataset
from islands.simulation.predictors import free_run
from support.latent_systems import make_model, smooth_input, spring_record

# The kernels of state spaces are compiled at their first use.
pytestmark = pytest.mark.ci

#: Lag before a saturating curve of the output; the unit of the state is free.
WIENER = make_model(
    {"a1_1": 0.9, "b1": 0.2, "f1": 1.5, "w1_1": 1.2, "level": 0.1},
    ("tanh",),
    1,
    operating_inputs=(0.2,),
    memory=9,
)

#: Resonance with a cubic spring.
SPRING = make_model()


def make_record(model, seed, samples=500, pole=0.0):
    """Return a record of a model with white noise, or with coloured noise of a pole, of 0.05."""
    u, noise = smooth_input(samples + 100, seed), np.random.default_rng(seed + 1000).standard_normal(samples)
    for k in range(1, samples):
        noise[k] = pole * noise[k - 1] + np.sqrt(1.0 - pole**2) * noise[k]
    whole = Dataset(u, np.zeros(len(u)), 0.01, ("u_V",), "y_mm")
    y = free_run(replace(model, memory=1), whole).y[100:]
    return Dataset(u[100:], y + 0.05 * noise, 0.01, ("u_V",), "y_mm")


def count_inside(model, seeds, pole=0.0):
    """Return the fraction of the quantities of all records within 1.96 standard errors of the truth."""
    true = np.array([each.value for each in model.quantities])
    inside = []
    for seed in seeds:
        data = make_record(model, seed, pole=pole)
        found = with_quantity_errors(refine(model, data, None, max_steps=20).model, data)
        values = np.array([each.value for each in found.quantities])
        inside.append(np.abs(values - true) <= 1.96 * np.array(found.quantity_errors))
    return np.mean(inside)


def test_the_truth_is_within_two_standard_errors_in_some_records():
    assert count_inside(SPRING, range(8)) >= 0.7


@pytest.mark.nightly
@pytest.mark.parametrize("pole", [0.0, 0.8])
@pytest.mark.parametrize("model", [WIENER, SPRING], ids=["wiener", "spring"])
def test_the_truth_is_within_two_standard_errors_in_19_of_20_records(model, pole):
    assert 0.85 <= count_inside(model, range(40), pole) <= 0.99


def test_standard_errors_do_not_depend_on_the_coordinates_of_the_states():
    of, layout = SPRING.matrices, StateSpaceLayout(2, 1, 1)
    found = []
    for change in (np.array([[1.0, 0.3], [0.2, 1.0]]), np.array([[-2.0, 1.0], [1.0, 2.05]])):
        inverse = np.linalg.inv(change)
        blocks = {
            "A": change @ of["A"] @ inverse,
            "B": change @ of["B"],
            "C": of["C"] @ inverse,
            "E": change @ of["E"],
            "W": np.append(of["W"] @ inverse, 0.0),
            "level": of["level"],
        }
        values = {
            name: value
            for block, names in layout.blocks.items()
            for name, value in zip(names, np.ravel(blocks.get(block, np.zeros(len(names)))), strict=True)
            if value
        }
        found.append(with_quantity_errors(make_model(values), spring_record(600, 0.05)))
    one, other = ([each.value for each in model.quantities] for model in found)
    assert one == pytest.approx(other, rel=1e-9)
    assert found[0].quantity_errors == pytest.approx(found[1].quantity_errors, rel=1e-3)


@pytest.mark.parametrize("poles", [(0.9, 0.9), (0.7, 1.0 - 1e-9)])
def test_a_mode_that_changes_its_kind_within_a_step_has_no_standard_error(poles):
    """Equal poles become a resonance or two time constants; a pole next to 1 does not decay any more."""
    data, found = make_record(SPRING, 0), []
    for one, other in (poles, (0.7, 0.9)):
        values = {"a1_2": 1.0, "a2_1": -one * other, "a2_2": one + other, "b2": 0.01, "c1": 1.0}
        found.append(with_quantity_errors(make_model(values, (), 2), data).quantity_errors)
    assert found[0] is None
    assert found[1] is not None


def test_a_model_without_a_time_or_with_few_samples_has_none():
    data = make_record(SPRING, 0)
    assert with_quantity_errors(replace(SPRING, dt=None), data).quantity_errors is None
    assert with_quantity_errors(SPRING, data[:25]).quantity_errors is None
    unstable = SPRING.with_parameters([1.5, *SPRING.parameters[1:]])
    assert with_quantity_errors(unstable, data) is unstable


def test_constraints_determine_quantities():
    model, data = replace(SPRING, operating_inputs=(0.0,)), make_record(SPRING, 3)
    free = with_quantity_errors(model, data)
    text = "gain = 0.564"
    constrained = with_quantity_errors(model, data, None, text)
    assert [each.name for each in model.quantities] == ["frequency", "damping ratio", "static gain"]
    assert constrained.quantity_errors[2] == 0.0
    assert 0.0 < constrained.quantity_errors[0] <= free.quantity_errors[0]
    # At another operating point, the gain is only partly determined.
    moved = [
        with_quantity_errors(replace(SPRING, operating_inputs=(1.0,)), data, None, each).quantity_errors[2]
        for each in ("none", text)
    ]
    assert 0.0 < moved[1] < moved[0]


def test_a_dead_time_of_whole_samples_has_no_standard_error():
    late = replace(WIENER, delays=(3,))
    found = with_quantity_errors(late, make_record(WIENER, 2))
    names = [each.name for each in found.quantities]
    known = np.isfinite(found.quantity_errors)
    assert known.tolist() == [name != "dead time" for name in names]
    assert "dead time" in names
