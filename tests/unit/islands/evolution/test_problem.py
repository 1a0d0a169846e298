"""A problem: what a library gives to a search."""

from dataclasses import replace

import numpy as np
import pytest

from islands.data.dataset import Dataset
from islands.errors import RecordError, SettingsError
from islands.estimation.forward_selection import forward_selection
from islands.evolution.gp.gene_structure import with_phi
from islands.evolution.gp.individual import make_regressor
from islands.evolution.gp.island_profiles import ISLAND_PROFILES
from islands.evolution.problem import Problem, problem
from islands.evolution.settings import Settings
from islands.model.candidate_library import candidates
from islands.model.expression import Apply, height, walk
from islands.model.model import canonical_order
from islands.model.parsing import parse
from islands.model.rendering import plain
from support.searches import distinct_genes

SETTINGS = Settings(library="phi-polynomial", library_degree=3, library_lags=3)


def record(**changes):
    rng = np.random.default_rng(2)
    u = np.cumsum(rng.normal(size=400)) / 10
    y = np.zeros(400)
    for k in range(2, 400):
        y[k] = y[k - 1] + (u[k - 1] - u[k - 2]) * (0.8 - 0.1 * u[k - 1] ** 2)
    return Dataset(u, y + 1e-3 * rng.normal(size=400), 0.1, **changes)


def test_without_a_library_there_is_neither_seed_nor_pool():
    posed = problem(record(), Settings())
    assert (posed.seeds, posed.pool) == ((), ())


def test_the_pool_is_the_library_and_the_seeds_its_forward_selection():
    posed = problem(record(), SETTINGS)
    library = candidates("phi-polynomial", 3, 3, 1)
    assert [make_regressor(gene) for gene in posed.pool] == list(library)
    expected = forward_selection(library, record(), "hysteresis", SETTINGS.max_terms)
    assert [tuple(canonical_order(distinct_genes(genes))) for genes in posed.seeds] == list(expected)


def test_a_library_s_genes_are_written_with_phi_functions():
    """Variation would put anything into ``sub`` and ``sign``: constrained presets know no such node."""
    names = {
        node.primitive.name
        for gene in problem(record(), SETTINGS).pool
        for node in walk(gene)
        if isinstance(node, Apply)
    }
    assert names == {"mul", "phi1", "phi2"}


@pytest.mark.parametrize(
    ("canonical", "written"),
    [
        ("u(k-1) - u(k-2)", "phi1(u(k-1), u(k-2))"),
        ("y(k-1)*sign(u(k-1) - u(k-3))*u(k-2)", "y(k-1)*phi2(u(k-1), u(k-3))*u(k-2)"),
        ("tanh(u2(k-1) - u2(k-4))", "tanh(phi1(u2(k-1), u2(k-4)))"),
        # Differences of other things are none.
        ("u1(k-1) - u2(k-1)", "u1(k-1) - u2(k-1)"),
        ("sign(y(k-1) - y(k-2))", "sign(y(k-1) - y(k-2))"),
        ("sign(u(k-1))", "sign(u(k-1))"),
    ],
)
def test_differences_of_one_input_become_phi_functions_and_mean_the_same(canonical, written):
    assert with_phi(parse(canonical)) == parse(written)
    assert make_regressor(parse(written)) == make_regressor(parse(canonical))


@pytest.mark.parametrize(
    ("max_height", "pool"), [(0, ["y(k-1)"]), (1, ["y(k-1)", "phi1(u(k-1), u(k-2))", "phi1(u(k-2), u(k-3))"])]
)
def test_what_is_higher_than_a_gene_may_be_is_left_out_of_the_library(max_height, pool):
    setting = replace(SETTINGS, max_height=max_height, initial_height=0)
    posed = problem(record(), setting)
    assert sorted(plain(gene) for gene in posed.pool) == sorted(pool)
    assert all(height(gene) <= max_height for genes in posed.seeds for gene in genes)


def test_seeds_have_no_more_terms_than_an_individual():
    posed = problem(record(), replace(SETTINGS, max_terms=3, initial_terms=(1, 3)))
    assert [len(genes) for genes in posed.seeds] == [1, 2, 3]


def test_characters_are_given_to_the_islands_in_turn():
    posed = Problem(record(), Settings(islands=5, characters=("plain", "explorer", "pruner")))
    plain_, explorer, pruner = (
        replace(posed.settings, **ISLAND_PROFILES[name]) for name in posed.settings.characters
    )
    assert plain_ == posed.settings
    assert [posed.settings_of(island) for island in range(5)] == [plain_, explorer, pruner, plain_, explorer]
    assert len({plain_, explorer, pruner}) == 3


def test_without_characters_all_islands_are_alike():
    posed = Problem(record(), Settings(islands=3))
    assert all(posed.settings_of(island) == posed.settings for island in range(3))


def test_a_library_without_end_and_an_incomplete_record_are_refused():
    with pytest.raises(SettingsError, match="more than a library may have"):
        problem(record(), replace(SETTINGS, library="polynomial", library_degree=5, library_lags=11))
    whole = record()
    y = whole.y.copy()
    y[100] = np.nan
    with pytest.raises(RecordError, match="missing at sample 100"):
        problem(replace(whole, y=y), SETTINGS)
