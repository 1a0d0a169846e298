"""A primitive is protected, finite for every argument, and keeps what it declares: here it is tried."""

import math

from islands.errors import ModelError
from islands.model.expression import Primitive

#: Arguments on which a new primitive has to be finite and keep what it declares.
_PROBES = (0.0, 1.0, -1.0, 0.3, -0.7, 2.5, -41.0, 1e3, -1e3, 1e-12, 1e6)


def check(entry: Primitive) -> None:
    """Verify that a primitive is finite everywhere and keeps the parity, degree and symmetry it declares.

    Raises
    ------
    ModelError
        It does not: the message names the argument. Or its LaTeX is no format of its arguments.
    """
    if entry.arity == 2 and (entry.parity or entry.degree is not None):
        raise ModelError(f"primitive {entry.name!r} has two arguments: parity and degree are for one")
    try:
        entry.latex.format(*"ab"[: entry.arity])
    except (LookupError, ValueError) as error:
        raise ModelError(
            f"the LaTeX of primitive {entry.name!r} is no format of {{0}}: double every other brace"
        ) from error
    probes = [(a,) for a in _PROBES] if entry.arity == 1 else [(a, b) for a in _PROBES for b in _PROBES]
    for arguments in probes:
        result = _finite(entry, arguments)
        if entry.parity and not _close(result * entry.parity, _finite(entry, tuple(-a for a in arguments))):
            raise ModelError(
                f"primitive {entry.name!r} declares parity {entry.parity}, not so at {arguments}"
            )
        if entry.commutative and result != _finite(entry, arguments[::-1]):
            raise ModelError(f"primitive {entry.name!r} declares that it commutes, not so at {arguments}")
        if entry.degree is not None:
            scaled = _finite(entry, tuple(3.0 * a for a in arguments))
            if not _close(scaled, 3.0**entry.degree * result):
                raise ModelError(
                    f"primitive {entry.name!r} declares degree {entry.degree}, not so at {arguments}"
                )


def _finite(entry: Primitive, arguments: tuple[float, ...]) -> float:
    try:
        result = float(entry.scalar(*arguments))
    except (ArithmeticError, ValueError, TypeError) as error:
        raise ModelError(
            f"primitive {entry.name!r} fails at {arguments} ({error}): protect it there"
        ) from error
    if not math.isfinite(result):
        raise ModelError(f"primitive {entry.name!r} is {result} at {arguments}: protect it there")
    return result


def _close(a: float, b: float) -> bool:
    return math.isclose(a, b, rel_tol=1e-12, abs_tol=1e-300)
