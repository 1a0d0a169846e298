"""Check of a new primitive on sample arguments: finite values and the declared properties."""

import math

from islands.errors import ModelError
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
