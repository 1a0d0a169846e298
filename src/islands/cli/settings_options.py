"""Settings on the command line: options for those of daily work, and ``--set NAME=VALUE`` for all."""

from collections.abc import Callable, Iterable, Mapping
from functools import wraps
from inspect import Parameter, signature
from typing import Annotated, Any, get_args

import typer
from pydantic.fields import FieldInfo

from islands.errors import SettingsError, suggest
from islands.settings_schema import has_items, is_daily, list_settings, parse_setting, state_default

#: Parameter with the values of ``--set``.
GIVEN = "given_settings"

#: Settings that were given, by name: ``Annotated[Given, Settings]``.
Given = Mapping[str, Any]

_SET = typer.Option("--set", metavar="NAME=VALUE", help="Change a setting; islands settings lists them.")


def with_settings(command: Callable[..., None]) -> Callable[..., None]:
    """Replace parameters of a command that are settings by options of their classes.

    The annotation of such a parameter is a class of settings, or `Given` with one. Settings of the command
    line take precedence over those of a file.
    """
    declared = signature(command)
    groups = {
        name: cls for name, each in declared.parameters.items() if (cls := _find_class(each.annotation))
    }
    owners = {name: (group, cls) for group, cls in groups.items() for name, _, _ in list_settings(cls)}
    options = {
        group: [_make_option(*each) for each in list_settings(cls) if is_daily(each[1])]
        for group, cls in groups.items()
    }
    daily = {option.name for listed in options.values() for option in listed}

    @wraps(command)
    def run(context: typer.Context, **given: Any) -> None:
        texts = given.pop(GIVEN) or []
        from_file = context.lookup_default(GIVEN) or []
        values: dict[str, Any] = {**split_settings(from_file)}
        values |= {name: given[name] for name in daily if given[name] not in (None, False, [])}
        values |= split_settings(() if texts == from_file else texts)
        found: dict[str, dict[str, Any]] = {group: {} for group in groups}
        for name, value in values.items():
            if name not in owners:
                raise SettingsError(
                    f"--set {name}: not one of those that islands settings lists{suggest(name, owners)}"
                )
            group, cls = owners[name]
            found[group][name] = parse_setting(cls, name, value)
        if "context" in declared.parameters:
            given["context"] = context
        settings = {
            group: changes if get_args(declared.parameters[group].annotation) else groups[group](**changes)
            for group, changes in found.items()
        }
        command(**settings, **{name: value for name, value in given.items() if name not in daily})

    shown = [
        parameter
        for each in declared.parameters.values()
        for parameter in options.get(each.name, [each])
        if parameter.name != "context"
    ]
    context = Parameter("context", Parameter.KEYWORD_ONLY, annotation=typer.Context)
    annotation = Annotated[list[str] | None, _SET]
    last = Parameter(GIVEN, Parameter.KEYWORD_ONLY, default=None, annotation=annotation)
    run.__signature__ = declared.replace(parameters=[context, *shown, last])  # type: ignore[attr-defined]
    run.settings = tuple(groups.values())  # type: ignore[attr-defined]
    return run


def _find_class(annotation: Any) -> type | None:
    """Return the class of settings of a parameter; None for other parameters."""
    *_, cls = get_args(annotation) or (annotation,)
    return cls if isinstance(cls, type) and hasattr(cls, "__pydantic_fields__") else None


def list_classes(command: Any) -> tuple[type, ...]:
    """Return the classes of settings of a command; none of a group."""
    classes: tuple[type, ...] = getattr(command.callback, "settings", ())
    return classes


def list_names(command: Any) -> list[str]:
    """Return the names of the settings of a command."""
    return [name for cls in list_classes(command) for name, _, _ in list_settings(cls)]


def split_settings(texts: Iterable[str]) -> dict[str, str]:
    """Return the names and the texts of ``NAME=VALUE``; a dash of a name is an underscore.

    Raises
    ------
    SettingsError
        A text has no equals sign.
    """
    found = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals:
            raise SettingsError(f"--set {text}: write NAME=VALUE, for example --set {name}=1")
        found[name.strip().replace("-", "_")] = value
    return found


def _make_option(name: str, info: FieldInfo, values: str) -> Parameter:
    """Return the option of a setting: a flag for a Boolean one, texts for a mapping, else a text."""
    is_flag, is_mapping = info.annotation is bool, has_items(info, dict)
    first = str(info.description).partition(". ")[0].removesuffix(".")
    option = typer.Option(
        f"--{name.replace('_', '-')}",
        help=f"{first}." if is_flag or values in ("a text", "a path") else f"{first}: {values}.",
        metavar=None if is_flag else "NAME=VALUE" if is_mapping else "VALUE",
        show_default=state_default(info),
    )
    kind: Any = bool if is_flag else list[str] | None if is_mapping else str | None
    return Parameter(
        name,
        Parameter.KEYWORD_ONLY,
        default=False if is_flag else None,
        annotation=Annotated[kind, option],
    )
