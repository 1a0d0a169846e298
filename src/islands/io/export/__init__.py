"""Export of models to text formats and programming languages.

Each format is an entry of `EXPORTS`. Read `parts` and `infix` first: all programs share them.
"""

from collections.abc import Callable, Mapping
from types import MappingProxyType

from islands.errors import lookup
from islands.io.export.c import c_source
from islands.io.export.matlab import matlab_source
from islands.io.export.python import python_source
from islands.io.models import model_json
from islands.model.equations import equation, latex_equation, mathml_equation
from islands.model.model import Model

EXPORTS: Mapping[str, Callable[[Model], str]] = MappingProxyType(
    {
        "plain": equation,
        "latex": latex_equation,
        "mathml": mathml_equation,
        "python": python_source,
        "c": c_source,
        "matlab": matlab_source,
        "json": model_json,
    }
)


def export(model: Model, kind: str) -> str:
    """Return a model as text in one of the formats of ``EXPORTS``.

    Raises
    ------
    SettingsError
        The format is unknown.
    """
    return lookup(EXPORTS, kind, "format")(model)
