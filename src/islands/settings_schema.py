"""Schema of settings: each one is declared once, for the library, the command line, REST and the page.

A class of settings is a data class whose fields `setting` makes; `settings_class` lets it check its values.
"""

from collections.abc import Callable, Iterable, Mapping
from copy import copy
from functools import wraps
from inspect import Parameter, Signature, cleandoc, signature
from numbers import Integral
from pathlib import Path
from reprlib import repr as abbreviate
from types import UnionType
from typing import Annotated, Any, TypeVar, Union, cast, dataclass_transform, get_args, get_origin

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    TypeAdapter,
    ValidationError,
    ValidationInfo,
    ValidatorFunctionWrapHandler,
    WithJsonSchema,
    WrapValidator,
    create_model,
)
from pydantic.dataclasses import dataclass
from pydantic.fields import FieldInfo
from pydantic_core import ArgsKwargs

from islands.errors import SettingsError, suggest

T = TypeVar("T")
F = TypeVar("F", bound=Callable[..., Any])


def _as_integer(value: Any) -> Any:
    return int(value) if isinstance(value, Integral) and not isinstance(value, bool) else value


def _as_tuple(value: Any) -> Any:
    return tuple(value) if isinstance(value, Iterable) and not isinstance(value, str | Mapping) else value


#: Lets an integer of NumPy be one, and any sequence a tuple.
AS_INTEGER, AS_TUPLE = BeforeValidator(_as_integer), BeforeValidator(_as_tuple)
Integer = Annotated[int, AS_INTEGER]

#: What the values of a type are, one or several.
_NOUNS = {
    int: ("an integer", "integers"),
    float: ("a number", "numbers"),
    str: ("a text", "texts"),
    bool: ("true or false", ""),
    Path: ("a path", "paths"),
}


def setting(
    default: Any,
    meaning: str,
    *,
    choices: Iterable[str] = (),
    unit: str = "",
    daily: bool | str = False,
    default_factory: Callable[..., Any] | None = None,
    **bounds: Any,
) -> Any:
    """Declare a setting: a field of a class of settings.

    Parameters
    ----------
    default
    meaning : str
        Its first sentence is the help of the command line.
    choices : iterable of str
        Permitted texts, besides the default; by default every text.
    unit : str
        Unit of the value.
    daily : bool or str
        Whether commands have an option for it, or what its help states as the default. All settings can be
        given by ``--set NAME=VALUE``.
    default_factory : callable, optional
        Makes the default.
    **bounds
        ``ge``, ``gt``, ``le``, ``lt``, ``max_length`` of pydantic.
    """
    choice = _Choice(default, choices) if choices else None
    extra = {"daily": daily, "unit": unit}
    made = {"default": default} if default_factory is None else {"default_factory": default_factory}
    info = Field(
        **made,
        description=meaning,
        json_schema_extra={name: value for name, value in extra.items() if value},
        **bounds,
    )
    if choice:
        names = {"enum": list(choice.names)}
        schema = names if None in choice.names else {"type": "string", **names}
        info.metadata += [AfterValidator(choice), WithJsonSchema(schema)]
    if isinstance(default, tuple):
        info.metadata.append(AS_TUPLE)
    return info


#: Types of the problems of a value that has the type of a setting.
_OUT_OF_RANGE = frozenset(
    {"greater_than_equal", "greater_than", "less_than_equal", "less_than", "value_error"}
)


class _Choice:
    """Check that a value is one of some names."""

    def __init__(self, default: Any, names: Iterable[str]) -> None:
        self._default, self._names = default, names

    @property
    def names(self) -> tuple[Any, ...]:
        """The default first; a table may have got further entries."""
        return tuple(dict.fromkeys((self._default, *self._names)))

    def __call__(self, value: Any, info: ValidationInfo) -> Any:
        if value not in self.names:
            raise ValueError(
                f"{info.field_name} is {self}, got {abbreviate(value)}{suggest(value, map(str, self.names))}"
            )
        return value

    def __str__(self) -> str:
        return f"one of {', '.join(str(name) for name in self.names if name)}"


def setting_of(cls: type, name: str, default: Any = ..., daily: bool | str = False) -> Any:
    """Declare a setting that another class declares, possibly with another default."""
    info = copy(_fields(cls)[name])
    assert isinstance(info.json_schema_extra, dict)
    info.json_schema_extra = {**info.json_schema_extra, "daily": daily}
    if not daily:
        del info.json_schema_extra["daily"]
    if default is not ...:
        info.default = default
    return info


@dataclass_transform(frozen_default=True)
def settings_class(cls: type[T]) -> type[T]:
    """Return a class of settings as a frozen data class that checks its values, and describes them.

    An invalid value and an unknown name raise `SettingsError`.
    """
    config = ConfigDict(extra="forbid", arbitrary_types_allowed=True, allow_inf_nan=False)
    made: Any = dataclass(frozen=True, slots=True, config=config)(cls)

    @wraps(made.__init__)
    def check(self: Any, *args: Any, **given: Any) -> None:
        try:
            # Strict, unlike a document, whose dates and classes are texts and objects.
            made.__pydantic_validator__.validate_python(
                ArgsKwargs(args, given), self_instance=self, strict=True
            )
        except ValidationError as error:
            raise SettingsError(_explain(error, made)) from None

    made.__init__ = check
    made.__signature__ = Signature(_parameters(made))
    made.__doc__ = f"{cleandoc(made.__doc__ or '')}\n\nAttributes\n----------\n{_describe(made)}\n"
    return cast("type[T]", made)


class _OfPreset:
    """Default that a preset has."""

    def __repr__(self) -> str:
        return "..."


_OF_PRESET = _OfPreset()


def document_settings(cls: type, name: str, *, of_preset: bool = False) -> Callable[[F], F]:
    """Let the signature and the docstring of a function list settings in place of ``**name``.

    Parameters
    ----------
    of_preset : bool
        Whether the defaults are those of a preset, which the signature does not state.
    """

    def decorate(function: F) -> F:
        declared = signature(function)
        own = [each for each in declared.parameters.values() if each.name != name]
        listed = [each.replace(default=_OF_PRESET) if of_preset else each for each in _parameters(cls)]
        function.__signature__ = declared.replace(parameters=[*own, *listed])  # type: ignore[attr-defined]
        function.__doc__ = str(function.__doc__).replace(
            f"**{name}\n", _describe(cls, "    ").lstrip() + "\n"
        )
        return function

    return decorate


def _parameters(cls: type) -> list[Parameter]:
    return [
        Parameter(name, Parameter.KEYWORD_ONLY, default=info.default) for name, info in _fields(cls).items()
    ]


def _describe(cls: type, indent: str = "") -> str:
    return "\n".join(
        f"{indent}{name} : {values}\n{indent}    {info.description}"
        for name, info, values in list_settings(cls)
    )


def _fields(cls: type) -> dict[str, FieldInfo]:
    found: dict[str, FieldInfo] = cls.__pydantic_fields__  # type: ignore[attr-defined]
    return found


def list_settings(cls: type) -> list[tuple[str, FieldInfo, str]]:
    """Return the settings of a class: name, declaration, and which values it takes."""
    return [(name, info, _describe_values(info)) for name, info in _fields(cls).items()]


def list_changes(settings: Any) -> dict[str, Any]:
    """Return the settings that differ from their defaults, by name."""
    given = {name: getattr(settings, name) for name in _fields(type(settings))}
    return {name: value for name, value in given.items() if value != _fields(type(settings))[name].default}


def state_default(info: FieldInfo) -> bool | str:
    """Return what the help of an option states as the default; False for nothing."""
    assert isinstance(info.json_schema_extra, dict)
    stated = info.json_schema_extra.get("daily")
    if isinstance(stated, str):
        return stated
    return False if info.default_factory or not info.default else str(info.default)


def is_daily(info: FieldInfo) -> bool:
    """Return whether commands have an option for a setting."""
    assert isinstance(info.json_schema_extra, dict)
    return bool(info.json_schema_extra.get("daily"))


def _find_choice(info: FieldInfo) -> _Choice | None:
    checks = [each.func for each in info.metadata if isinstance(each, AfterValidator)]
    return next((each for each in checks if isinstance(each, _Choice)), None)


def _describe_values(info: FieldInfo) -> str:
    if choice := _find_choice(info):
        return str(choice)
    unit = info.json_schema_extra.get("unit", "") if isinstance(info.json_schema_extra, dict) else ""
    return f"{_describe_type(info.annotation, info.metadata)} {unit}".rstrip()


def _describe_type(kind: Any, metadata: Iterable[Any] = (), place: int = 0) -> str:
    """Return what the values of a type are, with their bounds; ``place`` 1 for several of them."""
    origin, args = get_origin(kind), get_args(kind)
    if origin is Annotated:
        metadata = (*args[1:], *metadata)
        return _describe_type(
            args[0], [part for each in metadata for part in getattr(each, "metadata", [each])], place
        )
    if origin in (Union, UnionType):
        return " or ".join(_describe_type(each, metadata, place) for each in args if each is not type(None))
    if origin is tuple:
        return f"a list of {_describe_type(args[0], metadata, 1)}"
    if origin is dict:
        return f"NAME=VALUE, several with commas between them, each value {_describe_type(args[1])}"
    bounds = {
        name: getattr(each, name)
        for each in metadata
        for name in ("ge", "gt", "le", "lt")
        if hasattr(each, name)
    }
    noun = _NOUNS.get(kind, ("", ""))[place] or kind.__name__
    match bounds:
        case {"ge": low, "le": high}:
            return f"{noun} from {low:g} to {high:g}"
        case {"ge": low}:
            return f"{noun} of at least {low:g}"
        case {"gt": low, "lt": high}:
            return f"{noun} above {low:g} and below {high:g}"
        case {"gt": low}:
            return f"{noun} above {low:g}"
    return noun


def _explain(error: ValidationError, cls: type) -> str:
    """Return the message of the first problem, or of an unknown name, which may explain it."""
    problems = error.errors(include_url=False)
    unknown = [each for each in problems if each["type"] == "unexpected_keyword_argument"]
    problem = (unknown or problems)[0]
    place = problem["loc"][0]
    name = list(_fields(cls))[place] if isinstance(place, int) else place
    if unknown:
        return f"there is no setting {name!r}{suggest(name, _fields(cls))}"
    advice = f": write [{abbreviate(problem['input'])}]" if problem["type"] == "tuple_type" else ""
    return _explain_value(cls, name, problem["input"], problem) + advice


def _explain_value(cls: type, name: str, value: object, problem: Any) -> str:
    """Return what is wrong with a value: the message of its own check, or which values the setting takes."""
    if problem["type"] == "value_error" and _find_choice(_fields(cls)[name]) is None:
        return f"{name}: {str(problem['msg']).removeprefix('Value error, ')}"
    return _refuse(cls, name, value)


def _refuse(cls: type, name: str, value: object) -> str:
    info = _fields(cls)[name]
    choice = _find_choice(info)
    advice = suggest(str(value), map(str, choice.names)) if choice else ""
    return f"{name} is {_describe_values(info)}, got {abbreviate(value)}{advice}"


def parse_setting(cls: type, name: str, value: object) -> Any:
    """Return the value of a setting from a text or from a value of TOML.

    A text has commas between the items of a list; those of a mapping are ``NAME=VALUE``.

    Raises
    ------
    SettingsError
        It is none of the setting.
    """
    info = _fields(cls)[name]
    given: Any = value
    if isinstance(value, str) and has_items(info):
        given = [word.strip() for word in value.split(",")]
    if isinstance(given, list) and has_items(info, dict):
        given = {key.strip(): text for key, _, text in (str(each).partition("=") for each in given)}
    try:
        return TypeAdapter(_type(info)).validate_python(given)
    except ValidationError as error:
        raise SettingsError(_explain_value(cls, name, value, error.errors()[0])) from None


def has_items(info: FieldInfo, *kinds: type) -> bool:
    """Return whether the values of a setting are lists or mappings, or one of the given kinds of them."""
    return _has_items(info.annotation, kinds or (tuple, dict))


def _has_items(kind: Any, kinds: tuple[type, ...]) -> bool:
    return get_origin(kind) in kinds or any(_has_items(each, kinds) for each in get_args(kind))


def _type(info: FieldInfo) -> Any:
    return Annotated[(info.annotation, *info.metadata)] if info.metadata else info.annotation


def make_changes_model(cls: type, name: str, config: ConfigDict) -> type[BaseModel]:
    """Return the model of a document that has some of the settings of a class.

    A value out of range raises `SettingsError`, as it does in the class; one of another type is a problem of
    the document.
    """

    def check(value: Any, handler: ValidatorFunctionWrapHandler, info: ValidationInfo) -> Any:
        try:
            return handler(value)
        except ValidationError as error:
            if _OUT_OF_RANGE.isdisjoint(each["type"] for each in error.errors()):
                raise
            raise SettingsError(_refuse(cls, str(info.field_name), value)) from None

    types: dict[str, Any] = {
        key: (
            Annotated[_type(info) | None, WrapValidator(check)],
            Field(None, description=info.description, json_schema_extra=info.json_schema_extra),
        )
        for key, info in _fields(cls).items()
    }
    return create_model(name, __config__=config, **types)
