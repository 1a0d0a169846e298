"""Variation of state spaces: the sizes, the zeros and the simulation after each operation."""

from dataclasses import replace

import numpy as np
import pytest

from islands.estimation.latent_data import make_latent_data
from islands.estimation.latent_models import fit_linear_systems
from islands.evolution import latent_variation
from islands.evolution.latent_variation import begin_system, cross, mutate
from islands.models.unit_functions import parse_unit
from islands.progress import Steps
from support.latent_systems import spring_record

RECORD = spring_record(300, noise=0.02)


@pytest.fixture(scope="module")
def data():
    return make_latent_data(RECORD)


@pytest.fixture(scope="module")
def linear(data):
    return fit_linear_systems(RECORD, data, Steps())


@pytest.fixture(scope="module")
def system(data, linear):
    """A system of two states and two units."""
    draft = begin_system(linear[1], ("cube", "tanh"), "auto", np.random.default_rng(1))
    return draft.estimate(data)


def simulate(draft, data):
    """Return the errors on the rows of the estimation before any step."""
    return replace(draft, steps=0, effect_steps=0).estimate(data).mean_square


def test_new_units_change_a_linear_system_negligibly(data, linear):
    draft = begin_system(linear[1], ("cube", "tanh"), "auto", np.random.default_rng(1))
    assert simulate(draft, data) == pytest.approx(linear[1].mean_square, rel=0.05)
    assert draft.estimate(data).mean_square < linear[1].mean_square


def test_a_unit_of_the_same_system_has_the_same_argument(data, system):
    draft = cross(system, system, data, "auto", np.random.default_rng(0))
    assert draft.units in {("cube", "tanh", "cube"), ("cube", "tanh", "tanh")}
    blocks = draft.layout.split(draft.theta)
    place = draft.units.index(draft.units[2])
    assert blocks["W"][2] == pytest.approx(blocks["W"][place], rel=1e-6, abs=1e-9)
    assert blocks["s"][2] == pytest.approx(blocks["s"][place], rel=1e-6, abs=1e-9)
    assert blocks["E"][:, 2] == pytest.approx(0.5 * blocks["E"][:, place], rel=1e-6, abs=1e-9)


@pytest.mark.parametrize(
    ("operation", "order", "units"),
    [
        ("_add_unit", 2, 3),
        ("_replace_unit", 2, 2),
        ("_remove_unit", 2, 1),
        ("_add_state", 3, 2),
        ("_remove_state", 1, 2),
        ("_remove_connection", 2, 2),
        ("_disturb", 2, 2),
        ("_continue", 2, 2),
    ],
)
def test_a_mutation_has_the_sizes_of_its_name(system, operation, order, units):
    for seed in range(5):
        draft = getattr(latent_variation, operation)(system, np.random.default_rng(seed))
        assert (draft.layout.order, len(draft.units)) == (order, units)
        assert draft.theta.shape == draft.free.shape == (len(draft.layout.names),)
        assert draft.states.shape == (len(system.states), order)
        assert all(parse_unit(each).operations <= latent_variation.MOST_OPERATIONS for each in draft.units)


def test_a_state_that_is_added_hardly_changes_the_simulation(data, system):
    draft = latent_variation._add_state(system, np.random.default_rng(2))
    assert simulate(draft, data) == pytest.approx(system.mean_square, abs=1e-3)


def test_a_linear_system_has_no_unit_to_replace_remove_or_disturb(linear):
    for operation in ("_replace_unit", "_remove_unit", "_disturb"):
        assert getattr(latent_variation, operation)(linear[0], np.random.default_rng(0)) is None
    assert latent_variation._remove_state(linear[0], np.random.default_rng(0)) is None
    # A mutation that does not apply continues the estimation.
    assert all(mutate(linear[0], "auto", np.random.default_rng(seed)) is not None for seed in range(30))


@pytest.mark.parametrize(("structure", "name"), [("wiener", "E"), ("feedback", "F"), ("hammerstein", "W")])
def test_offspring_have_the_zeros_of_the_structure(data, linear, structure, name):
    rng = np.random.default_rng(4)
    system = begin_system(linear[1], ("cube", "tanh"), structure, rng).estimate(data)
    drafts = [mutate(system, structure, rng) for _ in range(40)]
    drafts.append(cross(system, system, data, structure, rng))
    for draft in drafts:
        block = draft.layout.split(draft.free)[name]
        assert not (block[:, : draft.layout.order] if name == "W" else block).any()
