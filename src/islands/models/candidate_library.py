"""Table of candidate libraries for forward selection.

A library maps (degree, lags, inputs) to candidate regressors. An entry of `LIBRARIES` can be chosen by name.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import combinations_with_replacement
from types import MappingProxyType

from islands.errors import SettingsError, check_integers, lookup
from islands.expressions.primitives import MUL, PRIMITIVES, SIGN, SUB
from islands.expressions.tree import Apply, Constant, Expression, Lagged
from islands.models.narx import canonical_order
from islands.models.regressor import Regressor, regressor

#: Maximum number of candidates of a library; their Gram matrix takes 128 MB. Use evolution for more.
MAX_CANDIDATES = 4000


@dataclass(frozen=True, slots=True)
class Library:
    """A family of candidate regressors and its default settings.

    Attributes
    ----------
    build : callable
        ``build(degree, lags, inputs)`` returns the expressions, in any order.
    count : callable
        ``count(degree, lags, inputs)`` returns the number of expressions without building them.
    degree, lags : int
        Default degree and default maximum lag in samples.
    constraints : str
        Default parameter constraint.
    description : str
        One-line description.
    """

    build: Callable[[int, int, int], list[Expression]]
    count: Callable[[int, int, int], int]
    degree: int
    lags: int
    constraints: str
    description: str


def candidates(name: str, degree: int, lags: int, inputs: int) -> tuple[Regressor, ...]:
    """Return the regressors of a library in canonical order.

    Raises
    ------
    SettingsError
        The library is unknown, a setting is out of range, or the library has more than `MAX_CANDIDATES`.
    """
    check_library(name, degree, lags, inputs)
    library = get_library(name)
    regressors = (regressor(expression)[1] for expression in library.build(degree, lags, inputs))
    return tuple(canonical_order(item for item in regressors if item))


def count_inputs(name: str, degree: int, lags: int, inputs: int) -> int:
    """Return the number of inputs that a library can combine in products, at least 1 of several inputs.

    The library of these inputs, with the candidates of degree 1 of the others, has at most `MAX_CANDIDATES`.

    Raises
    ------
    SettingsError
        The library is unknown, a setting is out of range, or the library of one input, or that of degree 1 of
        all inputs, has more than `MAX_CANDIDATES`.
    """
    check_library(name, degree, lags, min(inputs, 1))
    check_library(name, 1, lags, inputs)
    count = get_library(name).count
    if count(degree, lags, inputs) <= MAX_CANDIDATES:
        return inputs
    room = MAX_CANDIDATES - count(1, lags, inputs)
    return max([1, *(some for some in range(1, inputs) if count(degree, lags, some) <= room)])


def largest_degree(name: str, degree: int, lags: int, inputs: int) -> int:
    """Return the largest degree up to ``degree`` whose library of all inputs has at most `MAX_CANDIDATES`.

    It is at least 1, even if that library is too large.
    """
    count = get_library(name).count
    return max(
        [1, *(lower for lower in range(2, degree + 1) if count(lower, lags, inputs) <= MAX_CANDIDATES)]
    )


def check_library(name: str, degree: int, lags: int, inputs: int) -> None:
    """Check that a library is known, and not too large.

    Raises
    ------
    SettingsError
        As in `candidates`.
    """
    check_integers(degree=degree, lags=lags)
    if degree < 1 or lags < 1:
        raise SettingsError(f"degree and lags are at least 1, got {degree} and {lags}")
    count = get_library(name).count(degree, lags, inputs)
    if count > MAX_CANDIDATES:
        raise SettingsError(
            f"{count} candidates are more than a library may have ({MAX_CANDIDATES}): take a smaller degree "
            "or fewer lags"
        )


def get_library(name: str) -> Library:
    """Return a library by name.

    Raises
    ------
    SettingsError
        No library has that name.
    """
    return lookup(LIBRARIES, name, "library")


def full_set(degree: int, output_lags: int, input_lags: int, inputs: int = 1) -> int:
    """Return the number of terms of a full polynomial set, including the constant: equation (5)."""
    candidates = term = 1
    for power in range(1, degree + 1):
        term = term * (output_lags + inputs * input_lags + power - 1) // power
        candidates += term
    return candidates


def polynomial(degree: int, lags: int, inputs: int) -> list[Expression]:
    """Return all monomials up to ``degree`` in the lagged signals, including the constant: equation (1)."""
    signals = [Lagged(channel, lag) for channel in range(inputs + 1) for lag in range(1, lags + 1)]
    return [_product(*factors) for factors in _monomials(signals, degree)]


def phi_polynomial(degree: int, lags: int, inputs: int) -> list[Expression]:
    """Return the terms of rate-independent hysteresis, a part of equation (9).

    The terms are y(k-1) and products of one increment phi1 of an input, at most one direction phi2 of the
    same input, and a monomial in y(k-1) and the inputs u(k-1). The total degree, not counting the direction,
    is at most ``degree``. Increments are first differences down to lag ``lags``. Levels have lag 1 only. If
    the input is slow, the lags of a level are interchangeable, and the selection would choose a difference
    of outputs for its one-step-ahead fit; such a model diverges in a free run.

    Raises
    ------
    SettingsError
        ``lags`` is less than 2.
    """
    if lags < 2:
        raise SettingsError("phi-polynomial needs lags of at least 2: a first difference uses two samples")
    levels = [Lagged(channel, 1) for channel in range(inputs + 1)]
    terms: list[Expression] = [Lagged(0, 1)]
    for channel in range(1, inputs + 1):
        steps = [(Lagged(channel, lag), Lagged(channel, lag + 1)) for lag in range(1, lags)]
        directions: list[tuple[Expression, ...]] = [
            (),
            *((Apply(PRIMITIVES["phi2"], step),) for step in steps),
        ]
        heads = [(Apply(PRIMITIVES["phi1"], step), *sign) for step in steps for sign in directions]
        terms += [_product(*head, *level) for head in heads for level in _monomials(levels, degree - 1)]
    return terms


def friction(degree: int, lags: int, inputs: int) -> list[Expression]:
    """Return the monomials of `polynomial`, and terms of dry friction and of quadratic drag.

    A term of friction is a direction times a monomial, of degree ``degree - 1`` at most, in y(k-1), y(k-2)
    and the inputs u(k-1). A direction is the sign of y(k-1), of its increment, or of that of an input.
    """
    moving = [_increment(channel) for channel in range(inputs + 1)] if lags > 1 else []
    directions: list[Expression] = [Apply(SIGN, (each,)) for each in (Lagged(0, 1), *moving)]
    return _add_products(directions, degree, lags, inputs)


def magnitude(degree: int, lags: int, inputs: int) -> list[Expression]:
    """Return the monomials of `polynomial`, and terms of outflow, valves and rectifiers.

    Such a term is the square root or the absolute value of y(k-1), y(k-2) or an input u(k-1), times a
    monomial in the same signals, of degree ``degree - 1`` at most.
    """
    functions = [PRIMITIVES[name] for name in ("sqrt", "abs")]
    sizes: list[Expression] = [Apply(each, (signal,)) for each in functions for signal in _near(lags, inputs)]
    return _add_products(sizes, degree, lags, inputs)


def _add_products(factors: list[Expression], degree: int, lags: int, inputs: int) -> list[Expression]:
    levels = _monomials(_near(lags, inputs), degree - 1)
    return polynomial(degree, lags, inputs) + [_product(head, *level) for head in factors for level in levels]


def _near(lags: int, inputs: int) -> list[Lagged]:
    return [
        Lagged(0, 1),
        *([Lagged(0, 2)] if lags > 1 else []),
        *(Lagged(i, 1) for i in range(1, inputs + 1)),
    ]


def _increment(channel: int) -> Expression:
    return Apply(SUB, (Lagged(channel, 1), Lagged(channel, 2)))


def _count_friction(degree: int, lags: int, inputs: int) -> int:
    directions = inputs + 2 if lags > 1 else 1
    return full_set(degree, lags, lags, inputs) + directions * full_set(degree - 1, min(lags, 2), 1, inputs)


def _count_magnitude(degree: int, lags: int, inputs: int) -> int:
    sizes = 2 * (min(lags, 2) + inputs)
    return full_set(degree, lags, lags, inputs) + sizes * full_set(degree - 1, min(lags, 2), 1, inputs)


def _count_phi_polynomial(degree: int, lags: int, inputs: int) -> int:
    # Each of lags - 1 increments, with no direction or one of lags - 1, times each monomial of the levels.
    return 1 + inputs * (lags - 1) * lags * full_set(degree - 1, 1, 1, inputs)


def _count_polynomial(degree: int, lags: int, inputs: int) -> int:
    return full_set(degree, lags, lags, inputs)


def _monomials(signals: list[Lagged], degree: int) -> list[tuple[Expression, ...]]:
    """Return the factors of every monomial; the constant (no factors) comes first."""
    return [
        factors for power in range(degree + 1) for factors in combinations_with_replacement(signals, power)
    ]


def _product(*factors: Expression) -> Expression:
    if not factors:
        return Constant(1.0)
    return factors[0] if len(factors) == 1 else Apply(MUL, factors)


LIBRARIES: Mapping[str, Library] = MappingProxyType(
    {
        "phi-polynomial": Library(
            phi_polynomial,
            _count_phi_polynomial,
            degree=5,
            lags=3,
            constraints="hysteresis",
            description="increments and directions of the input times monomials",
        ),
        "polynomial": Library(
            polynomial,
            _count_polynomial,
            degree=3,
            lags=3,
            constraints="none",
            description="all monomials of the lagged signals",
        ),
        "friction": Library(
            friction,
            _count_friction,
            degree=3,
            lags=3,
            constraints="none",
            description="the monomials, and directions of motion times monomials",
        ),
        "magnitude": Library(
            magnitude,
            _count_magnitude,
            degree=3,
            lags=3,
            constraints="none",
            description="the monomials, and square roots and absolute values times monomials",
        ),
    }
)
