"""Table of presets. The presets `paper-*` are those of the paper."""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from types import MappingProxyType
from typing import Any

from islands.errors import SettingsError, lookup, suggest
from islands.estimation.parameter_constraints import CONSTRAINTS, constraint
from islands.evolution.settings import EFFORTS, LATENT, NARX, STRUCTURES_OF, Settings

#: Section 6.1, theoretical piezo: shooting over 500 steps, tolerance 1e-5. What the paper leaves open is as
#: in the authors' toolbox: tournaments of two, a distinct elite, parents in place of children that are too
#: long, and pruning of new individuals only.
_PAPER = Settings(tournament=2, distinct=True, niches=False, overlong="parent", prune_copies=False)

_SETTING_NAMES = dict.fromkeys(field.name for field in fields(Settings))

#: Appendix A, first system: one-step-ahead error, multiplication only, no constraint.
_APPENDIX = replace(
    _PAPER,
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
        "paper-case1-islands": replace(_PAPER, islands=2, topology="ring"),
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
        LATENT: Settings(
            model_class=LATENT,
            structure="auto",
            constraints="none",
            population=24,
            generations=10,
            elite=1.0,
            crossover=0.25,
            islands=6,
            topology="ring",
            migrate_every=3,
            migrants=2,
            emigrants="front",
        ),
    }
)

#: Summary of each preset.
PRESET_SUMMARIES: Mapping[str, str] = MappingProxyType(
    {
        "paper-case1": "Section 6.1 of the paper: theoretical piezo, no seeding",
        "paper-case1-islands": "The same on islands in a ring, between which the best individual migrates",
        "paper-case2": "Section 6.2 of the paper: measured micromanipulator, no seeding",
        "paper-appendix": "Appendix A of the paper, system S1: one-step-ahead error, no constraint",
        "paper-appendix-s2": "Appendix A of the paper, system S2: as for S1, with larger models",
        "hysteresis": "Systems with hysteresis: seeded by constrained forward selection, refined",
        "narx": "Smooth systems: seeded by forward selection, without constraints, refined",
        LATENT: "States that are not measured: state spaces with static curves in their feedback",
    }
)


#: Settings of latent models. Any other one has no effect on them, and cannot be changed.
LATENT_SETTINGS = frozenset(
    {
        *("model_class", "structure", "constraints", "population", "effort", "generations"),
        *("elite", "crossover"),
        *("tournament", "islands", "topology", "migrate_every", "migrants", "emigrants"),
        *("replaced", "max_evaluations", "target_error", "refit"),
    }
)

#: Settings with which the models of fits may compete with those of a search: its effort, and settings that a
#: fit has as well. Any other one says what a model is, or how it is selected.
_COMPETING_SETTINGS = (LATENT_SETTINGS - {"structure", "model_class"}) | {
    *("average", "feedthrough", "shooting", "max_terms", "initial_terms", "swap_search", "from_library"),
    *(
        "library",
        "library_degree",
        "library_lags",
        "library_delays",
        "mutation",
        "prune",
        "outer",
        "distinct",
    ),
}

#: Preset that is chosen among `KINDS` by trials on the record. It is the default of all commands.
AUTO = "auto"

#: Summary of the preset `AUTO`.
AUTO_SUMMARY = "Tries models of several kinds on the record, and states its choice with the reason"

#: Preset of several outputs, unless another one is chosen.
COUPLED_PRESET = "narx"

#: Names of the presets that a user may choose, the default first.
PRESET_NAMES = (AUTO, *PRESETS)


@dataclass(frozen=True, slots=True)
class RecordKind:
    """A kind of record that the preset ``auto`` distinguishes, and the search for it.

    Attributes
    ----------
    preset : str
        An entry of ``PRESETS``.
    changes : mapping
        Settings that differ from those of the preset. ``fit`` uses the library only.
    systems : str
        Systems of this kind, for the documentation.
    """

    preset: str
    changes: Mapping[str, Any]
    systems: str


#: Kinds in the order of preference between equal errors.
KINDS: Mapping[str, RecordKind] = MappingProxyType(
    {
        "smooth": RecordKind("narx", {}, "smooth dynamics: thermal, electrical and chemical processes"),
        "magnitude": RecordKind(
            "narx",
            {"library": "magnitude", "primitives": ("mul", "sqrt", "abs")},
            "square roots and absolute values: tanks, valves, rectifiers, drag",
        ),
        "friction": RecordKind(
            "narx",
            {"library": "friction", "primitives": ("mul", "sign")},
            "directions of motion: dry friction, drag, backlash",
        ),
        "hysteresis": RecordKind(
            "hysteresis", {}, "the output stays constant at constant input: piezo actuators, magnetics"
        ),
    }
)


def resolve_kind(kind: str, delays: tuple[int, ...], changes: Mapping[str, Any]) -> Settings:
    """Return the settings of a kind of record with dead times; changes take precedence over both.

    The kind ``latent`` has no dead times.

    Raises
    ------
    SettingsError
        The kind or a setting is unknown, or a setting is out of range.
    """
    if kind == LATENT:
        return resolve_settings(LATENT, changes)
    entry = lookup(KINDS, kind, "kind of record")
    return resolve_settings(entry.preset, {**entry.changes, "library_delays": delays, **changes})


def resolve_kinds(changes: Mapping[str, Any]) -> Mapping[str, Settings]:
    """Return the settings of every kind of record that a search with these changes permits.

    The constraint ``hysteresis`` permits hysteresis only, whose models are made of terms with which the
    constraint can be met.

    Raises
    ------
    SettingsError
        A setting is unknown, or out of range.
    """
    settings = {kind: resolve_kind(kind, (), changes) for kind in KINDS}
    if "constraints" in changes and constraint(changes["constraints"]).sums:
        return {"hysteresis": settings["hysteresis"]}
    return settings


def resolve_latent(changes: Mapping[str, Any]) -> Settings | None:
    """Return the settings of latent models with changes of NARX models; None if one has no effect on them.

    A structure of NARX models is none of latent models, and a constraint may be about their terms.
    """
    common = LATENT_SETTINGS - {"structure", "constraints"}
    return resolve_settings(LATENT, changes) if common.issuperset(changes) else None


def accepts_fits(changes: Mapping[str, Any]) -> bool:
    """Return whether models of fits meet the settings of a search with these changes of its preset."""
    return _COMPETING_SETTINGS.issuperset(changes)


def list_structures(preset: str) -> tuple[str, ...]:
    """Return the values of the setting ``structure`` of a preset."""
    return tuple(STRUCTURES_OF[LATENT if preset == LATENT else NARX])


def list_fixed_settings(preset: str) -> tuple[str, ...]:
    """Return the settings of a preset that cannot be changed, in the order of `Settings`."""
    fixed = set(_SETTING_NAMES) - LATENT_SETTINGS if preset == LATENT else set()
    return tuple(name for name in _SETTING_NAMES if name in fixed | {"model_class"})


def common_settings(preset: str) -> dict[str, Any]:
    """Return the settings of a preset; of `AUTO` those that all kinds have in common.

    Raises
    ------
    SettingsError
        The preset is unknown.
    """
    searches = list(resolve_kinds({}).values()) if preset == AUTO else [resolve_settings(preset, {})]
    first, *others = ({name: getattr(each, name) for name in _SETTING_NAMES} for each in searches)
    return {name: value for name, value in first.items() if all(other[name] == value for other in others)}


def resolve_settings(preset: str, changes: Mapping[str, Any]) -> Settings:
    """Return the settings of a preset with changes.

    Raises
    ------
    SettingsError
        The preset or a setting is unknown, or a setting is out of range.
    """
    if preset == AUTO:
        raise SettingsError("the preset auto needs the record of one output: name another preset")
    base = lookup({AUTO: _PAPER, **PRESETS}, preset, "preset")
    if changes.get("model_class", base.model_class) != base.model_class:
        raise SettingsError(
            f"the preset {preset} searches {base.model_class} models: leave model_class out, or take another"
        )
    for name, value in changes.items():
        lookup(_SETTING_NAMES, name, "setting")
        if base.model_class == LATENT and name not in LATENT_SETTINGS and value != getattr(base, name):
            raise SettingsError(
                f"{name} is a setting of NARX models, not of the preset {preset}: leave it out, or take "
                "another preset"
            )
    if "max_terms" in changes and "initial_terms" not in changes:
        fewest, most = (min(count, changes["max_terms"]) for count in base.initial_terms)
        changes = {**changes, "initial_terms": (max(1, fewest), max(1, most))}
    if "max_height" in changes and "initial_height" not in changes:
        changes = {**changes, "initial_height": max(0, min(base.initial_height, changes["max_height"]))}
    effort = changes.get("effort", base.effort)
    generations = base.generations * lookup(EFFORTS, effort, "effort")
    return replace(base, **{"generations": generations, **changes})


def resolve_coupled_settings(preset: str, changes: Mapping[str, Any]) -> Settings:
    """Return the settings of the search of every output of several; the preset auto is `COUPLED_PRESET`.

    Raises
    ------
    SettingsError
        As for `resolve_settings`, or a setting is for one output.
    """
    name = COUPLED_PRESET if preset == AUTO else preset
    settings = resolve_settings(name, {"feedthrough": "no", **without_automatic(changes)})
    check_coupled_settings(settings.constraints, settings.feedthrough, settings.refit)
    if settings.select != "validation":
        raise SettingsError(
            "select is 'validation' with several outputs: equations are chosen by their free run together"
        )
    return settings


def without_automatic(options: Mapping[str, Any]) -> dict[str, Any]:
    """Return options without those that are ``auto``, of which several outputs have other defaults."""
    return {name: value for name, value in options.items() if value not in (None, AUTO)}


def check_coupled_settings(constraints: str | None, feedthrough: str, refit: str) -> None:
    """Check settings that hold for every equation of several outputs.

    Raises
    ------
    SettingsError
        The settings are for one output.
    """
    if constraints is not None and constraints not in CONSTRAINTS:
        raise SettingsError(
            f"the constraints {constraints!r} are for one output: with several, each equation numbers its "
            f"inputs differently; take {', '.join(CONSTRAINTS)}{suggest(constraints, CONSTRAINTS)}"
        )
    if feedthrough != "no":
        raise SettingsError(
            "feedthrough is 'no' with several outputs, so that they do not depend on each other within a "
            "sample: name the inputs that act within the sample with +1, as u+1"
        )
    if refit != "none":
        raise SettingsError(
            "refit is 'none' with several outputs: the validation data choose among their equations"
        )


def with_tuples(changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return changed settings with tuples in place of lists."""
    return {name: tuple(value) if isinstance(value, list) else value for name, value in changes.items()}
