"""Method of a search for latent models: the text has the numbers of its settings."""

from dataclasses import asdict

import pytest

from islands.evolution.presets import resolve_settings
from islands.io.result_text.latent_method import describe_latent_search, is_latent


def describe(generations=7, **changes):
    settings = asdict(resolve_settings("latent", changes))
    return "\n".join(describe_latent_search(settings, generations))


def test_the_numbers_are_those_of_the_settings():
    text = describe(
        population=18, elite=0.5, crossover=0.4, tournament=5, islands=3, migrate_every=2, migrants=4
    )
    for part in (
        "on 3 islands for 7 generations of 18 offspring",
        "with probability 0.4",
        "the best one of 5",
        "the elite of an island has 9 systems",
        "topology ring, every 2 generations, 4 systems at most",
    ):
        assert part in text


def test_one_island_has_no_migration():
    text = describe(islands=1)
    assert "on 1 island for" in text
    assert "Migration" not in text


@pytest.mark.parametrize(
    ("structure", "excluded"), [("wiener", "acts on the states"), ("hammerstein", "reads a state")]
)
def test_a_structure_states_what_it_excludes(structure, excluded):
    assert f"no unit {excluded}" in describe(structure=structure)
    assert "no unit" not in describe()


def test_only_settings_of_latent_models_are_described():
    assert is_latent(asdict(resolve_settings("latent", {})))
    assert not is_latent(asdict(resolve_settings("narx", {})))
    assert not is_latent({})
