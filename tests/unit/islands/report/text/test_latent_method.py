"""Method of a search for latent models: the text has the numbers of its settings."""

from dataclasses import asdict

from islands.evolution.presets import resolve_settings
from islands.report.text.latent_method import describe_latent_search, is_latent


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


def test_the_structure_is_stated_with_its_meaning():
    assert "Structure hammerstein: no unit reads a state." in describe(structure="hammerstein")
    assert "Structure auto: units read and act anywhere." in describe()


def test_only_settings_of_latent_models_are_described():
    assert is_latent(asdict(resolve_settings("latent", {})))
    assert not is_latent(asdict(resolve_settings("narx", {})))
    assert not is_latent({})
