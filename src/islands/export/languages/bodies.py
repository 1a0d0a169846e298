"""Names of the functions of primitives, and their bodies in C and MATLAB."""

import re

from islands.errors import ModelError
from islands.expressions.tree import Primitive

#: C and MATLAB distinguish the first 63 characters of a name and allow ASCII letters only.
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,59}")

#: Example of a function body for error messages, by the field of `Primitive`.
_EXAMPLES = {"c": "return a / (1.0 + fabs(a));", "matlab": "r = a / (1 + abs(a));"}


def body(primitive: Primitive, language: str) -> str:
    """Return the body of a primitive's function in C or MATLAB.

    Parameters
    ----------
    language : str
        The field of `Primitive`: c or matlab.

    Raises
    ------
    ModelError
        The primitive has no body, or its name is not a valid identifier of the language.
    """
    name, text = primitive.name, getattr(primitive, language)
    if not text:
        raise ModelError(
            f"primitive {name!r} has no body in this language: pass the body of its function when you create "
            f"it, primitive({name!r}, ..., {language}={_EXAMPLES[language]!r})"
        )
    if not _NAME.fullmatch(name):
        raise ModelError(
            f"primitive {name!r} can't be exported in this language: name it with at most 60 of the "
            "characters A-Z, a-z, 0-9 and _"
        )
    return str(text)


def function_name(primitive: Primitive) -> str:
    """Return the name of a primitive's function in C, MATLAB and Modelica."""
    # The prefix avoids names of libraries (tanh) and reserved names (leading underscore).
    return f"f_{primitive.name}"
