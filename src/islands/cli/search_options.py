"""Options of a search, for ``islands identify`` and ``islands jobs submit``, generated from `Settings`."""

from collections.abc import Callable, Mapping
from dataclasses import Field, dataclass, field, fields
from inspect import Parameter
from types import MappingProxyType
from typing import Annotated, Any, get_args

import typer

from islands.cli.option_groups import group_options, make_option
from islands.evolution.presets import AUTO, PRESET_NAMES
from islands.evolution.settings import Settings, get_text_type
from islands.persistence.models import MODEL_CLASSES, NARX

Preset = Annotated[str, typer.Option("--preset", help=", ".join(PRESET_NAMES))]
ModelClass = Annotated[
    str,
    typer.Option(
        "--model",
        help=f"Class of the models: {', '.join([NARX, *MODEL_CLASSES])}.",
        # An option with one value is of no use.
        hidden=not MODEL_CLASSES,
    ),
]
Seed = Annotated[int, typer.Option("--seed", min=0, help="Seed of the random generator.")]


@dataclass(frozen=True, slots=True)
class SearchOptions:
    """Preset, seed and changed settings from the command line.

    Attributes
    ----------
    changes : mapping
        Settings that were given, by name. All others have the value of the preset.
    """

    preset: str = AUTO
    seed: int = 0
    changes: Mapping[str, Any] = field(default_factory=dict)


#: Default of the parameter that `with_search_options` replaces.
DEFAULTS = SearchOptions()


def _option_fields() -> Mapping[str, Field[Any]]:
    """Return the fields of `Settings` that are options, in the order of the help."""
    names: list[str] = []
    found = {each.name: each for each in fields(Settings) if "command_line" in each.metadata}
    for name, each in found.items():
        after = each.metadata["command_line"]["after"]
        names.insert(names.index(after) + 1 if after else len(names), name)
    return MappingProxyType({name: found[name] for name in names})


_FIELDS = _option_fields()

#: Settings that are options, in the order of the help.
SETTINGS = tuple(_FIELDS)


def _setting_parameter(setting: Field[Any]) -> Parameter:
    """Return the parameter of a setting: repeatable for a tuple, text for a union of types."""
    declared = setting.metadata["command_line"]
    kind = get_text_type(setting)
    members = get_args(kind)
    if members:
        kind = list[members[0]] if Ellipsis in members else str  # type: ignore[valid-type]
    option = typer.Option(
        declared["option"] or f"--{setting.name.replace('_', '-')}",
        help=declared["help"],
        show_default="that of the preset",
    )
    return make_option(setting.name, Annotated[kind | None, option])


def with_search_options(command: Callable[..., None]) -> Callable[..., None]:
    """Replace the parameter ``search`` of a command by the options of a search.

    The command receives their values as one `SearchOptions`.
    """
    options = [
        make_option("preset", Preset, DEFAULTS.preset),
        *map(_setting_parameter, _FIELDS.values()),
        make_option("seed", Seed, DEFAULTS.seed),
    ]

    return group_options(command, "search", options, _collect)


def _collect(values: dict[str, Any]) -> SearchOptions:
    changes = {name: values[name] for name in SETTINGS if values[name] is not None}
    return SearchOptions(values["preset"], values["seed"], changes)
