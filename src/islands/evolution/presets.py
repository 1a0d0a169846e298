"""Table of presets. The presets `paper-*` are those of the paper."""

from collections.abc import Mapping
from dataclasses import asdict, replace
from types import MappingProxyType
from typing import Any

from islands.errors import lookup
from islands.evolution.settings import Settings

#: Section 6.1, theoretical piezo: shooting over 500 steps, tolerance 1e-5.
_PAPER = Settings()

#: Appendix A, first system: one-step-ahead error, multiplication only, no constraint.
_APPENDIX = Settings(
    population=200,
    generations=50,
    tolerance=1e-3,
    max_height=3,
    shifts=(1, 2, 3),
    primitives=("mul",),
    structure="free",
    constraints="none",
    fitness="one-step",
)

#: Small populations, seeded by forward selection; mostly outer mutation; refined parameters.
_SEEDED = Settings(
    elite=0.2,
    crossover=0.4,
    mutation=1.0,
    prune=0.1,
    tolerance=1e-5,
    err_target="increment",
    outer=0.7,
    from_library=0.6,
    distinct=True,
    refine=True,
    average="auto",
    feedthrough="auto",
    library="phi-polynomial",
    swap_search=True,
    topology="ring",
    migrate_every=5,
)

PRESETS: Mapping[str, Settings] = MappingProxyType(
    {
        "paper-case1": _PAPER,
        "paper-case2": replace(_PAPER, tolerance=1e-4, shooting=100),
        "paper-appendix": _APPENDIX,
        "paper-appendix-s2": replace(_APPENDIX, max_height=5, max_terms=30, initial_terms=(1, 30)),
        "hysteresis": replace(
            _SEEDED,
            population=300,
            generations=80,
            shooting=1000,
            max_terms=9,
            initial_terms=(2, 9),
            structure="increment",
            library_lags=4,
        ),
        "narx": replace(
            _SEEDED,
            population=200,
            generations=60,
            shooting=100,
            max_terms=15,
            initial_terms=(2, 15),
            max_height=4,
            shifts=(1, 2, 3),
            primitives=("mul",),
            structure="free",
            constraints="none",
            library="polynomial",
            library_degree=3,
        ),
    }
)

#: Summary of each preset.
PRESET_SUMMARIES: Mapping[str, str] = MappingProxyType(
    {
        "paper-case1": "Section 6.1 of the paper: theoretical piezo, no seeding",
        "paper-case2": "Section 6.2 of the paper: measured micromanipulator, no seeding",
        "paper-appendix": "Appendix A of the paper, system S1: one-step-ahead error, no constraint",
        "paper-appendix-s2": "Appendix A of the paper, system S2: as for S1, with larger models",
        "hysteresis": "Systems with hysteresis: seeded by constrained forward selection, refined",
        "narx": "Smooth systems: seeded by forward selection, without constraints, refined",
    }
)


def resolve_settings(preset: str, changes: Mapping[str, Any]) -> Settings:
    """Return the settings of a preset with changes.

    Raises
    ------
    SettingsError
        The preset or a setting is unknown, or a setting is out of range.
    """
    base = lookup(PRESETS, preset, "preset")
    for name in changes:
        lookup(asdict(base), name, "setting")
    if "max_terms" in changes and "initial_terms" not in changes:
        fewest, most = (min(count, changes["max_terms"]) for count in base.initial_terms)
        changes = {**changes, "initial_terms": (max(1, fewest), max(1, most))}
    if "max_height" in changes and "initial_height" not in changes:
        changes = {**changes, "initial_height": max(0, min(base.initial_height, changes["max_height"]))}
    return replace(base, **changes)
