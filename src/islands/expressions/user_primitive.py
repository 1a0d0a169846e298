"""Primitives of users, made from scalar functions."""

import inspect
import keyword
import math
import re
import textwrap
from collections.abc import Callable, Iterable, Mapping

from islands.errors import ModelError, SettingsError, lookup
from islands.expressions.primitives import PRIMITIVES
from islands.expressions.tree import Primitive

#: Arguments at which a new primitive is checked.
_PROBES = (0.0, 1.0, -1.0, 0.3, -0.7, 2.5, -41.0, 1e3, -1e3, 1e-12, 1e6)


def check(entry: Primitive) -> None:
    """Check that a primitive is finite and has the parity, degree and symmetry that it declares.

    Raises
    ------
    ModelError
        A check failed (the message names the argument), or the LaTeX is not a format string of the arguments.
    """
    if entry.arity == 2 and (entry.parity or entry.degree is not None):
        raise ModelError(
            f"primitive {entry.name!r} has two arguments: parity and degree require one argument"
        )
    try:
        entry.latex.format(*"ab"[: entry.arity])
    except (LookupError, ValueError) as error:
        raise ModelError(
            f"the LaTeX of primitive {entry.name!r} is not a format string of {{0}}: double every other brace"
        ) from error
    probes = [(a,) for a in _PROBES] if entry.arity == 1 else [(a, b) for a in _PROBES for b in _PROBES]
    for arguments in probes:
        result = _evaluate(entry, arguments)
        if entry.parity and not _is_close(
            result * entry.parity, _evaluate(entry, tuple(-a for a in arguments))
        ):
            raise ModelError(
                f"primitive {entry.name!r} declares parity {entry.parity}, which is false at {arguments}"
            )
        if entry.commutative and result != _evaluate(entry, arguments[::-1]):
            raise ModelError(
                f"primitive {entry.name!r} declares that it commutes, which is false at {arguments}"
            )
        if entry.degree is not None:
            scaled = _evaluate(entry, tuple(3.0 * a for a in arguments))
            if not _is_close(scaled, 3.0**entry.degree * result):
                raise ModelError(
                    f"primitive {entry.name!r} declares degree {entry.degree}, which is false at {arguments}"
                )


def _evaluate(entry: Primitive, arguments: tuple[float, ...]) -> float:
    try:
        result = float(entry.scalar(*arguments))
    except (ArithmeticError, ValueError, TypeError) as error:
        raise ModelError(
            f"primitive {entry.name!r} fails at {arguments} ({error}): protect it there"
        ) from error
    if not math.isfinite(result):
        raise ModelError(f"primitive {entry.name!r} is {result} at {arguments}: protect it there")
    return result


def _is_close(a: float, b: float) -> bool:
    return math.isclose(a, b, rel_tol=1e-12, abs_tol=1e-300)


#: Names of signals, time and back-shifts in text.
_SIGNALS = re.compile(r"y|u\d*|k|q\d+")


def primitive(
    name: str,
    scalar: Callable[..., float],
    latex: str = "",
    parity: int = 0,
    commutative: bool = False,
    c: str = "",
    matlab: str = "",
) -> Primitive:
    """Make a user-defined primitive from a scalar function, and check its declared properties.

    Parameters
    ----------
    name : str
        A Python identifier that differs from the names of built-in primitives and signals.
    scalar : callable
        Maps one or two floats to a float with arithmetic and the functions of ``math``.
    latex : str
        Format string with ``{0}`` and ``{1}``. If empty, it is derived from the name.
    parity : -1, 0 or 1
        Parity as in `Primitive`.
    commutative : bool
        Whether the arguments can be exchanged, as in `Primitive`.
    c, matlab : str
        Function bodies as in `Primitive`. Required only to export models to C or MATLAB.

    Raises
    ------
    ModelError
        The name is taken or invalid, the function does not take one or two arguments, it is not finite at
        zero, a negative or a large argument, it lacks a declared property, or the LaTeX is not a format
        string.
    """
    free = name not in PRIMITIVES and not keyword.iskeyword(name) and not _SIGNALS.fullmatch(name)
    if not (free and name.isidentifier()):
        raise ModelError(
            f"{name!r} cannot name a primitive: use an identifier that is not in use and not y, u, k, q1 .."
        )
    arity = _count_arguments(name, scalar)
    if arity not in (1, 2):
        raise ModelError(f"primitive {name!r} takes {arity} arguments: a primitive must take one or two")
    upright = name.replace("_", r"\_")
    entry = Primitive(
        name,
        arity,
        scalar,
        latex or rf"\operatorname{{{{{upright}}}}}(" + ", ".join(f"{{{i}}}" for i in range(arity)) + ")",
        c=c,
        matlab=matlab,
        parity=parity,
        commutative=commutative,
    )
    check(entry)
    return entry


def primitive_table(entries: Iterable[str | Primitive]) -> Mapping[str, Primitive]:
    """Return the built-in primitives and those of the user among the entries, by name.

    Parameters
    ----------
    entries : iterable of str or Primitive
        Names of built-in primitives, and primitives of the user.

    Raises
    ------
    SettingsError
        A name is unknown, or two primitives have the same name.
    """
    table = dict(PRIMITIVES)
    for entry in entries:
        if not isinstance(entry, Primitive):
            lookup(PRIMITIVES, entry, "primitive")
        elif table.setdefault(entry.name, entry).scalar is not entry.scalar:
            raise SettingsError(f"two primitives have the name {entry.name!r}: rename one of them")
    return table


def get_source(entry: Primitive) -> str:
    """Return the source of a primitive's function, or its qualified name if the source is not available."""
    try:
        return textwrap.dedent(inspect.getsource(entry.scalar))
    except (OSError, TypeError):
        return f"{entry.scalar.__module__}.{entry.scalar.__qualname__}"


def _count_arguments(name: str, scalar: Callable[..., float]) -> int:
    try:
        return len(inspect.signature(scalar).parameters)
    except ValueError as error:
        raise ModelError(
            f"primitive {name!r} has no signature: wrap it in a function of one or two arguments"
        ) from error
