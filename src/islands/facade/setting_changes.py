"""Keyword arguments of `identify` that differ from a preset, with their types."""

from collections.abc import Sequence
from typing import TypedDict

from islands.expressions.tree import Primitive


class SettingChanges(TypedDict, total=False):
    """Settings that differ from those of a preset. `Settings` describes each of them."""

    population: int
    generations: int
    elite: float
    crossover: float
    mutation: float
    prune: float
    prune_copies: bool
    tolerance: float
    err_target: str
    max_terms: int
    max_height: int
    shifts: Sequence[int]
    primitives: Sequence[str | Primitive]
    structure: str
    constraints: str
    fitness: str
    shooting: int
    tournament: int
    high_level: float
    outer: float
    initial_terms: tuple[int, int]
    initial_height: int
    overlong: str
    library: str
    library_degree: int
    library_lags: int
    library_delays: Sequence[int]
    swap_search: bool
    from_library: float
    distinct: bool
    niches: bool
    refine: bool
    estimator: str
    refit: str
    select: str
    average: int | str
    feedthrough: str
    islands: int
    topology: str
    migrate_every: int | str
    migrants: int | str
    emigrants: str
    replaced: str
    characters: Sequence[str]
    max_evaluations: int
    target_error: float
    model_class: str
