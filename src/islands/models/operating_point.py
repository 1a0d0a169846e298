"""Equilibria of a model at constant inputs, and its linearisation about an operating point.

A model y(k) = F(y(k-1), ..., u(k-1), ...) rests at ybar with the inputs ubar if ybar = F(ybar, ..., ubar).
Its linearisation has the coefficients dF/dy(k-i) and dF/du(k-j) there (Ljung, System Identification, 2nd ed.,
Prentice Hall 1999, section 5.4).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import isnan

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import ArrayLike, NDArray

from islands.errors import ModelError
from islands.expressions.derivatives import differentiate
from islands.expressions.evaluation import value
from islands.expressions.tree import Apply, Constant, Expression, Lagged, Primitive, remove_shifts, walk
from islands.models.equations import expressions_of_record, named_term, signal_names
from islands.models.narx import Model, measured_model, require_narx
from islands.models.protocol import DynamicModel
from islands.rounding import ROUNDING

#: Magnitudes of outputs between which equilibria are searched if they are not the roots of a polynomial.
_MAGNITUDES = np.concatenate([[0.0], np.logspace(-9, 9, 1081)])

#: Number of bisections of an interval with a change of sign: all bits of a float.
_BISECTIONS = 80


@dataclass(frozen=True, slots=True, eq=False)
class Linearisation:
    """Linear model of deviations from an operating point: y(k) = sum a_i y(k-i) + sum b_cj u_c(k-j).

    Attributes
    ----------
    y : float
        Output at the operating point.
    outputs : ndarray, shape (lags,)
        Coefficients of y(k-1), y(k-2), ...
    inputs : ndarray, shape (inputs, lags + 1)
        Coefficients of u(k), u(k-1), ... of every input.
    """

    y: float
    outputs: NDArray[np.float64]
    inputs: NDArray[np.float64]

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Poles; the operating point is stable if all are inside the unit circle."""
        poles: NDArray[np.complex128] = np.roots(np.concatenate([[1.0], -self.outputs])).astype(np.complex128)
        return poles

    @property
    def is_stable(self) -> bool:
        """Whether all poles are inside the unit circle."""
        return bool((np.abs(self.poles) < 1.0).all())


def differentiate_model(model: DynamicModel, u: ArrayLike, y: float | None = None) -> Linearisation:
    """Return the coefficients of the linear model about an operating point.

    Parameters
    ----------
    model : DynamicModel
        Model with parameters.
    u : float or sequence of float
        Constant value of every input.
    y : float, optional
        Output; by default the stable equilibrium at these inputs.

    Raises
    ------
    ModelError
        The model has no unique stable equilibrium at these inputs and no output is given, or it has a kink or
        a step at the operating point, such as that of ``sign(u(k-1) - u(k-2))`` at rest.
    """
    narx = measured_model(require_narx(model))
    levels = _read_levels(narx, u)
    if y is None:
        y = _find_rest(narx, levels)
    found = _differentiate(narx, levels, y)
    if np.isnan(found.outputs).any() or np.isnan(found.inputs).any():
        expressions = expressions_of_record(narx)
        kinked = next(
            named_term(narx, place)
            for place, expression in enumerate(expressions)
            if any(isnan(slope) for slope in _slopes(expression, y, levels).values())
        )
        raise ModelError(
            f"the term {kinked} has a kink or a step at this operating point, so there is no linear model: "
            "take another operating point; models of hysteresis have none"
        )
    return found


def static_characteristic(model: DynamicModel, inputs: ArrayLike) -> NDArray[np.float64]:
    """Return the output at rest for constant inputs.

    Parameters
    ----------
    model : DynamicModel
        Model with parameters.
    inputs : array_like, shape (points,) or (points, inputs)
        Constant inputs.

    Returns
    -------
    ndarray, shape (points,)
        The stable equilibrium at each point.

    Raises
    ------
    ModelError
        A point has no stable equilibrium, several of them, or a continuum.
    """
    narx = measured_model(require_narx(model))
    points = np.atleast_1d(np.asarray(inputs, dtype=np.float64))
    rows = points[:, None] if points.ndim == 1 else points
    return np.array([_find_rest(narx, _read_levels(narx, row)) for row in rows])


def find_equilibrium(model: Model, u: Sequence[float]) -> float:
    """Return the unique stable equilibrium at constant inputs.

    The equilibria are the roots of a polynomial, if the model is one in the output; otherwise those between
    1e-9 and 1e9 in magnitude.

    Raises
    ------
    ModelError
        There is no stable equilibrium, there are several, or every output in a range is one, as in models of
        hysteresis.
    """
    return _find_rest(measured_model(model), u)


def _find_rest(model: Model, u: Sequence[float]) -> float:
    """Return the unique stable equilibrium of a model of signals as measured."""
    where = ", ".join(f"{name} = {level:g}" for name, level in zip(signal_names(model)[1:], u, strict=True))
    roots = _find_roots(model, u, where)
    stable = []
    for root in roots:
        near = _differentiate(model, u, root)
        # At a kink the slopes are unknown; such a root is kept.
        if np.isnan(near.outputs).any() or (np.isfinite(near.outputs).all() and near.is_stable):
            stable.append(root)
    if len(stable) == 1:
        return stable[0]
    if stable:
        listed = ", ".join(f"{root:g}" for root in stable)
        raise ModelError(f"the model has several stable equilibria at {where}: {listed}; give the output y")
    raise ModelError(
        f"the model has no stable equilibrium at {where}: " + ("all are unstable" if roots else "it drifts")
    )


def _read_levels(model: Model, u: ArrayLike) -> list[float]:
    levels: list[float] = np.atleast_1d(np.asarray(u, dtype=np.float64)).tolist()
    if len(levels) != model.inputs:
        raise ModelError(
            f"the model has {model.inputs} inputs ({', '.join(model.column_names)}), got {levels}"
        )
    return levels


def _differentiate(model: Model, u: Sequence[float], y: float) -> Linearisation:
    lags = max(1, model.maximum_lag)
    slopes = np.zeros((1 + model.inputs, lags + 1))
    for parameter, expression in zip(model.parameters, expressions_of_record(model), strict=True):
        for (channel, lag), slope in _slopes(expression, y, u).items():
            slopes[channel, lag] += parameter * slope
    return Linearisation(y, slopes[0, 1:], slopes[1:])


def _slopes(expression: Expression, y: float, u: Sequence[float]) -> Mapping[tuple[int, int], float]:
    """Return the derivative with respect to every signal and lag that an expression reads."""
    whole = remove_shifts(expression)
    leaves = list(dict.fromkeys(node for node in walk(whole) if isinstance(node, Lagged)))
    levels = (y, *u)
    # Each leaf becomes a channel, so that the derivative along one channel is the partial derivative.
    numbered = _number_leaves(whole, leaves)
    return {
        (leaf.channel, leaf.lag): differentiate(
            numbered,
            lambda channel: levels[leaves[channel].channel],
            lambda channel, along=place: float(channel == along),  # type: ignore[misc]
        )[1]
        for place, leaf in enumerate(leaves)
    }


def _number_leaves(expression: Expression, leaves: Sequence[Lagged]) -> Expression:
    match expression:
        case Lagged():
            return Lagged(leaves.index(expression), 0)
        case Apply(primitive, arguments):
            return Apply(primitive, tuple(_number_leaves(each, leaves) for each in arguments))
    return expression


def _find_roots(model: Model, u: Sequence[float], where: str) -> list[float]:
    """Return the outputs at which the model rests."""
    pairs = list(zip(model.parameters, expressions_of_record(model), strict=True))
    polynomials = [_to_polynomial(expression, u) for _, expression in pairs]
    if any(each is None for each in polynomials):
        return _search_roots(pairs, u)
    excess, size = Polynomial([0.0, -1.0]), Polynomial([0.0, 1.0])
    for (parameter, _), each in zip(pairs, polynomials, strict=True):
        assert each is not None
        excess, size = excess + each * parameter, size + Polynomial(np.abs(each.coef)) * abs(parameter)
    # Sums drop leading zeros.
    smallest = ROUNDING * np.asarray(size.coef[: len(excess.coef)], dtype=np.float64)
    excess = Polynomial(np.where(np.abs(excess.coef) <= smallest, 0.0, excess.coef)).trim()
    if not excess.coef.any():
        raise ModelError(
            f"every output is an equilibrium at {where}, as in models of hysteresis: there is no static "
            "characteristic; give the output y"
        )
    try:
        with np.errstate(over="ignore"):
            roots = excess.roots()
    except np.linalg.LinAlgError:
        raise ModelError(f"the model overflows at {where}: give smaller inputs") from None
    scale = ROUNDING * np.maximum(1.0, np.abs(roots)) ** 0.5
    return sorted({float(root.real) for root in roots[np.abs(roots.imag) <= scale]})


def _to_polynomial(expression: Expression, u: Sequence[float]) -> Polynomial | None:
    """Return a steady state as a polynomial in the output, None if it is not one."""
    match expression:
        case Lagged(channel, _):
            return Polynomial([0.0, 1.0]) if channel == 0 else Polynomial([u[channel - 1]])
        case Constant(number):
            return Polynomial([number])
        case Apply(primitive, arguments):
            parts = [_to_polynomial(each, u) for each in arguments]
            known = [each for each in parts if each is not None]
            if len(known) < len(parts):
                return None
            if all(each.degree() == 0 for each in known):
                return Polynomial([_call(primitive, [float(each.coef[0]) for each in known])])
            if primitive.name not in _ARITHMETIC:
                return None
            found = known[0]
            for other in known[1:]:
                found = _ARITHMETIC[primitive.name](found, other)
            return found
    return None


def _call(primitive: Primitive, values: Sequence[float]) -> float:
    first, *others = values
    if not others:
        return primitive.scalar(first)
    for other in others:
        first = primitive.scalar(first, other)
    return first


#: Primitives of polynomials.
_ARITHMETIC: Mapping[str, Callable[[Polynomial, Polynomial], Polynomial]] = {
    "mul": lambda a, b: a * b,
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
}


def _search_roots(pairs: Sequence[tuple[float, Expression]], u: Sequence[float]) -> list[float]:
    """Return the roots with a change of sign, by bisection, and the zeros of the grid."""

    def excess(y: float) -> float:
        levels = (y, *u)
        return sum(p * value(each, lambda channel, _: levels[channel]) for p, each in pairs) - y

    grid = np.concatenate([-_MAGNITUDES[:0:-1], _MAGNITUDES])
    values = np.array([excess(float(y)) for y in grid])
    roots = [float(y) for y, at in zip(grid, values, strict=True) if at == 0.0]
    for place in np.flatnonzero(values[:-1] * values[1:] < 0.0):
        low, high = float(grid[place]), float(grid[place + 1])
        below = values[place] < 0.0
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            if (excess(middle) < 0.0) == below:
                low = middle
            else:
                high = middle
        # At a step of the model the sign changes without a root.
        if abs(excess(high) - excess(low)) <= 1e-6 * max(1.0, abs(high)):
            roots.append(0.5 * (low + high))
    if len(roots) > len(grid) // 2:
        raise ModelError(
            "every output is an equilibrium: there is no static characteristic; give the output y"
        )
    return sorted(roots)
