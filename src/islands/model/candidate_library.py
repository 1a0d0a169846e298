"""The table of candidate libraries for forward selection: what a structure may be made of.

A library turns (degree, lags, inputs) into regressors. Add one here and it can be chosen by name.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import combinations_with_replacement
from types import MappingProxyType

from islands.errors import SettingsError, lookup
from islands.model.expression import Apply, Constant, Expression, Lagged
from islands.model.model import canonical_order
from islands.model.primitives import MUL, PRIMITIVES
from islands.model.regressor import Regressor, regressor

#: A Gram matrix of this many candidates takes 128 MB; more is a job for evolution.
MOST_CANDIDATES = 4000


@dataclass(frozen=True, slots=True)
class Library:
    """A family of candidate regressors and the settings that suit it.

    Attributes
    ----------
    build : callable
        ``build(degree, lags, inputs)`` returns the expressions, in any order.
    count : callable
        ``count(degree, lags, inputs)`` returns how many they are, before any is made.
    degree, lags : int
        Defaults.
    constraints : str
        The parameter constraint that usually goes with it.
    description : str
    """

    build: Callable[[int, int, int], list[Expression]]
    count: Callable[[int, int, int], int]
    degree: int
    lags: int
    constraints: str
    description: str


def candidates(name: str, degree: int, lags: int, inputs: int) -> tuple[Regressor, ...]:
    """Return a library's regressors in the order of their content.

    Raises
    ------
    SettingsError
        The library is unknown, a setting is out of range, or there would be too many candidates.
    """
    if degree < 1 or lags < 1:
        raise SettingsError(f"degree and lags are at least 1, got {degree} and {lags}")
    library = library_named(name)
    count = library.count(degree, lags, inputs)
    if count > MOST_CANDIDATES:
        raise SettingsError(
            f"{count} candidates are more than a library may have ({MOST_CANDIDATES}): take a smaller degree "
            "or fewer lags, or let evolution search"
        )
    made = (regressor(expression)[1] for expression in library.build(degree, lags, inputs))
    return tuple(canonical_order(item for item in made if item))


def library_named(name: str) -> Library:
    """Return a library by name.

    Raises
    ------
    SettingsError
        There is none of that name.
    """
    return lookup(LIBRARIES, name, "library")


def full_set(degree: int, output_lags: int, input_lags: int, inputs: int = 1) -> int:
    """Return how many candidate terms a full polynomial set has, the constant included: equation (5)."""
    candidates = term = 1
    for power in range(1, degree + 1):
        term = term * (output_lags + inputs * input_lags + power - 1) // power
        candidates += term
    return candidates


def polynomial(degree: int, lags: int, inputs: int) -> list[Expression]:
    """Return every monomial up to ``degree`` in all lagged signals, and the constant: equation (1)."""
    signals = [Lagged(channel, lag) for channel in range(inputs + 1) for lag in range(1, lags + 1)]
    return [_product(*factors) for factors in _monomials(signals, degree)]


def phi_polynomial(degree: int, lags: int, inputs: int) -> list[Expression]:
    """Return the terms of rate-independent hysteresis, a part of equation (9).

    They are y(k-1), and the products of one increment phi1 of an input, at most one direction phi2 of it,
    and a monomial in y(k-1) and the inputs u(k-1), together of ``degree``, a direction not counted. First
    differences alone are taken, down to lag ``lags``. Levels have lag 1 only: where the input is slow their
    lags are interchangeable, and a difference of outputs would be chosen for its one-step-ahead fit and
    diverge in a free run.
    """
    if lags < 2:
        raise SettingsError("phi-polynomial needs lags of at least 2: a first difference reads two samples")
    levels = [Lagged(channel, 1) for channel in range(inputs + 1)]
    made: list[Expression] = [Lagged(0, 1)]
    for channel in range(1, inputs + 1):
        steps = [(Lagged(channel, lag), Lagged(channel, lag + 1)) for lag in range(1, lags)]
        directions: list[tuple[Expression, ...]] = [
            (),
            *((Apply(PRIMITIVES["phi2"], step),) for step in steps),
        ]
        heads = [(Apply(PRIMITIVES["phi1"], step), *sign) for step in steps for sign in directions]
        made += [_product(*head, *level) for head in heads for level in _monomials(levels, degree - 1)]
    return made


def _count_phi_polynomial(degree: int, lags: int, inputs: int) -> int:
    # Any of lags - 1 steps, with no direction or any of theirs, before every monomial of the levels.
    return 1 + inputs * (lags - 1) * lags * full_set(degree - 1, 1, 1, inputs)


def _count_polynomial(degree: int, lags: int, inputs: int) -> int:
    return full_set(degree, lags, lags, inputs)


def _monomials(signals: list[Lagged], degree: int) -> list[tuple[Expression, ...]]:
    """Return the factors of every monomial, those of 1 (none) first."""
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
    }
)
