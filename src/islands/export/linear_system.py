"""Linear systems as text, MATLAB (Control System Toolbox) and JSON, as state space or transfer functions."""

import json
from collections.abc import Callable, Mapping, Sequence
from math import isfinite
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from islands.errors import lookup
from islands.models.state_space import FORMS, StateSpace


def write_linear_system(system: StateSpace, form: str, notation: str = "text") -> str:
    """Return a linear system as text.

    Parameters
    ----------
    system : StateSpace
    form : str
        ``state-space`` or ``transfer-function``.
    notation : str
        ``text``, ``matlab`` or ``json``; numbers of the last two are exact.

    Raises
    ------
    SettingsError
        The form or the notation is unknown.
    """
    lookup(dict.fromkeys(FORMS), form, "form")
    return lookup(NOTATIONS, notation, "notation")(system, form)


def find_notation(path: Path | None) -> str:
    """Return the notation of a file by its suffix: MATLAB of ``.m``, JSON of ``.json``, text of others."""
    return {".m": "matlab", ".json": "json"}.get(path.suffix if path else "", "text")


def list_linear_system(system: StateSpace, form: str = FORMS[0]) -> dict[str, Any]:
    """Return a system as JSON values: matrices or coefficients, names, modes and gains.

    A value that is not finite, such as the gain of an integrator, is null.
    """
    document: dict[str, Any] = {
        "schema": "islands.linear-system/1",
        "dt": system.dt,
        "inputs": list(system.input_names),
        "outputs": list(system.output_names),
        "input_units": list(system.input_units),
        "output_units": list(system.output_units),
        "dead_times": system.delays.tolist(),
        "operating_inputs": list(system.operating_inputs),
        "operating_outputs": list(system.operating_outputs),
        "poles": [[pole.real, pole.imag] for pole in system.poles.tolist()],
        "natural_frequencies": _list_finite(system.natural_frequencies),
        "damping": _list_finite(system.damping),
        "static_gain": [_list_finite(row) for row in system.static_gain],
        "words": list(system.describe()),
    }
    if form == FORMS[0]:
        return document | {name: getattr(system, name).tolist() for name in "ABCD"}
    numerators, denominator = system.transfer_functions()
    return document | {"numerators": numerators.tolist(), "denominator": denominator.tolist()}


def _list_finite(values: NDArray[np.float64]) -> list[float | None]:
    return [value if isfinite(value) else None for value in values.tolist()]


def _write_json(system: StateSpace, form: str) -> str:
    return json.dumps(list_linear_system(system, form), indent=2, allow_nan=False)


def _write_text(system: StateSpace, form: str) -> str:
    variable = "s" if system.is_continuous else "z"
    time = "continuous" if system.is_continuous else f"sampling time {system.step:.10g} s"
    lines = [
        f"Linear system about {system.describe_point()}, {time if system.dt is not None else 'in samples'}",
        f"inputs {', '.join(system.input_names)}; outputs {', '.join(system.output_names)}",
        *system.describe(),
    ]
    if form == FORMS[0]:
        for name in "ABCD":
            matrix = getattr(system, name)
            lines += ["", f"{name} ="]
            lines += ["  " + "  ".join(f"{value:14.7g}" for value in row) for row in matrix]
        return "\n".join(lines)
    numerators, denominator = system.transfer_functions()
    below = _write_polynomial(denominator, variable)
    # Numerators are differences of polynomials of the size of the denominator.
    rounding = len(denominator) ** 2 * np.finfo(np.float64).eps
    for row, output in zip(numerators, system.output_names, strict=True):
        for numerator, name in zip(row, system.input_names, strict=True):
            size = max(np.abs(denominator).max(), np.abs(numerator).max())
            above = _write_polynomial(np.where(np.abs(numerator) > rounding * size, numerator, 0.0), variable)
            lines += ["", f"{output} over {name} =", f"  {above}", f"  {'-' * max(len(above), len(below))}"]
            lines += [f"  {below}"]
    return "\n".join(lines)


def _write_polynomial(coefficients: NDArray[np.float64], variable: str) -> str:
    top = len(coefficients) - 1
    powers = [f"{variable}^{power}" if power > 1 else variable * power for power in range(top, -1, -1)]
    terms = [
        power if value == 1.0 and power else f"{value:.7g} {power}".rstrip()
        for value, power in zip(coefficients.tolist(), powers, strict=True)
        if value
    ]
    return " + ".join(terms).replace("+ -", "- ") or "0"


def _write_matlab(system: StateSpace, form: str) -> str:
    names = [
        f"% Linear system about {_comment(system.describe_point())}: deviations from the operating point.",
        f"% u0 = {_vector(system.operating_inputs)}, y0 = {_vector(system.operating_outputs)}",
    ]
    # -1 is a discrete system without a sampling time.
    time = "-1" if system.dt is None else repr(float(system.dt))
    if form == FORMS[0]:
        made = [f"{name} = {_matrix(getattr(system, name))};" for name in "ABCD"]
        call = f"sys = ss(A, B, C, D, {time});"
    else:
        numerators, denominator = system.transfer_functions()
        cells = "; ".join(", ".join(_vector(each) for each in row) for row in numerators)
        made = [f"num = {{{cells}}};", f"den = {_vector(denominator)};"]
        call = f"sys = tf(num, repmat({{den}}, size(num)), {time});"
    delays = system.delays if system.is_continuous else np.rint(system.delays / system.step)
    return "\n".join(
        [
            *names,
            *made,
            call,
            f"sys.InputDelay = {_vector(delays)}';" if delays.any() else "% no dead time",
            f"sys.InputName = {_cell(system.input_names)};",
            f"sys.OutputName = {_cell(system.output_names)};",
            f"sys.InputUnit = {_cell(system.input_units)};",
            f"sys.OutputUnit = {_cell(system.output_units)};",
        ]
    )


def _matrix(matrix: NDArray[np.float64]) -> str:
    if not matrix.size:
        return f"zeros({matrix.shape[0]}, {matrix.shape[1]})"
    return "[" + "; ".join(" ".join(map(repr, row)) for row in matrix.tolist()) + "]"


def _vector(values: Sequence[float] | NDArray[np.float64]) -> str:
    return "[" + " ".join(repr(float(value)) for value in values) + "]"


def _cell(names: Sequence[str]) -> str:
    return "{" + "; ".join("'" + name.replace("'", "''") + "'" for name in map(_comment, names)) + "}"


def _comment(text: str) -> str:
    """Return a text on one line."""
    return " ".join(text.split())


#: Functions that write a linear system, by notation.
NOTATIONS: Mapping[str, Callable[[StateSpace, str], str]] = MappingProxyType(
    {"text": _write_text, "matlab": _write_matlab, "json": _write_json}
)
