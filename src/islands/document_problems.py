"""Messages about invalid documents: those of pydantic, with names that are similar to an unknown one."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import fields, is_dataclass
from typing import Any, get_args

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from islands.errors import suggest


def explain_problem(problem: ErrorDetails, form: Any) -> str:
    """Return the message of a problem of a document, which suggests names that are similar to an unknown one.

    Parameters
    ----------
    problem : ErrorDetails
        An entry of ``ValidationError.errors()``.
    form : type
        Type of the document: a model, a union of models, or a data class.
    """
    message = problem["msg"].removeprefix("Value error, ")
    match problem["type"]:
        case "extra_forbidden" | "unexpected_keyword_argument":
            *place, name = problem["loc"]
            return message + suggest(str(name), _find_names(form, place))
        case "literal_error" | "enum":
            return message + suggest(problem["input"], _read_names(problem["ctx"]["expected"]))
        case "union_tag_invalid":
            return message + suggest(problem["ctx"]["tag"], _read_names(problem["ctx"]["expected_tags"]))
    return message


def find_problem(error: ValidationError, form: Any) -> tuple[str, str]:
    """Return the place and the message of the first problem, or of an unknown field, which may explain it."""
    problems = error.errors(include_url=False)
    problem = next((each for each in problems if each["type"] == "extra_forbidden"), problems[0])
    return ".".join(map(str, problem["loc"])), explain_problem(problem, form)


def _read_names(text: str) -> list[str]:
    """Return the names in a list such as ``'a', 'b' or 'c'``."""
    return re.findall(r"'([^']*)'", text)


def _find_names(form: Any, place: Sequence[int | str]) -> list[str]:
    """Return the names of the fields of the models at a place of a document."""
    if is_dataclass(form):
        return [each.name for each in fields(form)]
    forms = list(_expand(form))
    for part in place:
        # A part that names no field is an index, a key, or the tag of a member of a union.
        entered = [inner for each in forms for inner in _enter(each, part)]
        forms = entered or [each for each in forms if _has_tag(each, part)] or forms
    return [
        field.alias or name for each in forms if _is_model(each) for name, field in each.model_fields.items()
    ]


def _enter(form: Any, part: int | str) -> Iterator[Any]:
    if _is_model(form):
        for name, field in form.model_fields.items():
            if part in (name, field.alias):
                yield from _expand(field.annotation)


def _has_tag(form: Any, part: int | str) -> bool:
    return _is_model(form) and any(part in get_args(each.annotation) for each in form.model_fields.values())


def _expand(form: Any) -> Iterator[Any]:
    """Yield the models of a type: members of a union, items of a collection, values of a mapping."""
    if _is_model(form):
        yield form
    for inner in get_args(form):
        yield from _expand(inner)


def _is_model(form: Any) -> bool:
    return isinstance(form, type) and issubclass(form, BaseModel)
