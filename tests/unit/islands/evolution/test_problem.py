"""Search problem: seeds, pool and profiles of the islands."""

from dataclasses import replace

import numpy as np
import pytest

from islands.errors import RecordError, SettingsError
from islands.estimation.forward_selection import forward_selection
from islands.evolution.gene_structure import with_phi
from islands.evolution.individual import make_regressor
from islands.evolution.problem import Problem, make_problem
from islands.evolution.settings import ISLAND_PROFILES, Settings
from islands.expressions.parsing import parse
from islands.models.candidate_library import candidates
from islands.models.narx import canonical_order
from islands.records.dataset import Dataset
from support.searches import distinct_genes

SETTINGS = Settings(library="phi-polynomial", library_degree=3, library_lags=3)


def record(**changes):
    rng = np.random.default_rng(2)
    u = np.cumsum(rng.normal(size=400)) / 10
    y = np.zeros(400)
    for k in range(2, 400):
        y[k] = y[k - 1] + (u[k - 1] - u[k - 2]) * (0.8 - 0.1 * u[k - 1] ** 2)
    return Dataset(u, y + 1e-3 * rng.normal(size=400), 0.1, **changes)


def test_pool_is_the_library_and_seeds_are_its_forward_selection():
    search_problem = make_problem(record(), SETTINGS)
    library = candidates("phi-polynomial", 3, 3, 1)
    assert [make_regressor(gene) for gene in search_problem.pool] == list(library)
    expected = forward_selection(library, record(), "hysteresis", SETTINGS.max_terms)
    assert [tuple(canonical_order(distinct_genes(genes))) for genes in search_problem.seeds] == list(expected)


@pytest.mark.parametrize(
    ("canonical", "written"),
    [
        ("u(k-1) - u(k-2)", "phi1(u(k-1), u(k-2))"),
        ("y(k-1)*sign(u(k-1) - u(k-3))*u(k-2)", "y(k-1)*phi2(u(k-1), u(k-3))*u(k-2)"),
        ("tanh(u2(k-1) - u2(k-4))", "tanh(phi1(u2(k-1), u2(k-4)))"),
        # Other differences are not replaced.
        ("u1(k-1) - u2(k-1)", "u1(k-1) - u2(k-1)"),
        ("sign(y(k-1) - y(k-2))", "sign(y(k-1) - y(k-2))"),
        ("sign(u(k-1))", "sign(u(k-1))"),
    ],
)
def test_with_phi_replaces_differences_of_one_input(canonical, written):
    assert with_phi(parse(canonical)) == parse(written)
    assert make_regressor(parse(written)) == make_regressor(parse(canonical))


def test_profiles_are_assigned_to_the_islands_in_turn():
    search_problem = Problem(record(), Settings(islands=5, characters=("plain", "explorer", "pruner")))
    plain_, explorer, pruner = (
        replace(search_problem.settings, **ISLAND_PROFILES[name])
        for name in search_problem.settings.characters
    )
    assert plain_ == search_problem.settings
    assert [search_problem.settings_of(island) for island in range(5)] == [
        plain_,
        explorer,
        pruner,
        plain_,
        explorer,
    ]
    assert len({plain_, explorer, pruner}) == 3


def test_too_large_library_and_incomplete_record_raise_an_error():
    with pytest.raises(SettingsError, match="more than a library may have"):
        make_problem(record(), replace(SETTINGS, library="polynomial", library_degree=5, library_lags=11))
    whole = record()
    y = whole.y.copy()
    y[100] = np.nan
    with pytest.raises(RecordError, match="missing at sample 100"):
        make_problem(replace(whole, y=y), SETTINGS)
