"""Equilibria of a block at constant inputs, and its linear system about an operating point.

A block y(k) = F(y(k-1), ..., u(k-1), ...) rests at ybar with the inputs ubar if ybar = F(ybar, ..., ubar).
Its linear system has the coefficients dF/dy(k-i) and dF/du(k-j) there (Ljung, System Identification, 2nd ed.,
Prentice Hall 1999, section 5.4), in observer form: the first state of each equation is what its past adds to
its next value, and the others are what is left of it for later. The observer form of a state space is the
state space itself, so that one form serves every class of models.
"""

from collections.abc import Callable, Mapping, Sequence
from math import inf, isnan
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from islands.errors import ModelError
from islands.expressions.derivatives import differentiate
from islands.expressions.evaluation import value
from islands.expressions.printing import PlainSignals
from islands.expressions.tree import (
    Apply,
    Constant,
    Expression,
    Lagged,
    Primitive,
    remove_shifts,
    replace_leaves,
    substitute,
    walk,
)
from islands.models.block import Block
from islands.models.equations import name_columns
from islands.models.state_space import StateSpace
from islands.records.channel_names import parse_unit
from islands.rounding import ROUNDING

if TYPE_CHECKING:
    from numpy.polynomial import Polynomial

#: Magnitudes of outputs between which equilibria are searched if they are not the roots of a polynomial.
_MAGNITUDES = np.concatenate([[0.0], np.logspace(-9, 9, 1081)])

#: Points of the search within the range of the output.
_POINTS = 101

#: Number of bisections of an interval with a change of sign: all bits of a float.
_BISECTIONS = 80

#: Newton steps to the rest of a block of several equations, and the relative step that ends them.
_REST_STEPS, _STILL = 50, 1e-12

#: Range of an output that is not bounded.
EVERYWHERE = (-inf, inf)

#: Inputs of an operating point: values in the order of the model, one value, or values by column.
OperatingPoint = ArrayLike | Mapping[str, float]

#: Slopes of the equations of a block by channel and lag, each of shape (computed,).
_Slopes = dict[tuple[int, int], NDArray[np.float64]]


def linearise_block(
    block: Block, operating_point: OperatingPoint | None = None, y: ArrayLike | None = None
) -> StateSpace:
    """Return the linear system of a block about an operating point.

    Parameters
    ----------
    block : Block
        Block of the measured signals.
    operating_point : float, sequence of float or mapping, optional
        Constant value of every input, in the order of the block or by column; by default, and for columns
        that a mapping leaves out, those at which a program of the block starts (`Block.levels`).
    y : float or sequence of float, optional
        Outputs; by default the stable equilibrium at these inputs.

    Raises
    ------
    ModelError
        The block has no unique stable equilibrium at these inputs and no output is given, or it has a kink or
        a step at the operating point, such as that of ``sign(u(k-1) - u(k-2))`` at rest.
    """
    u = read_levels(block, operating_point)
    levels = [*(_choose_outputs(block, u) if y is None else _read_outputs(block, y)), *u]
    slopes = _differentiate(block, levels)
    for place, terms in enumerate(block.equations):
        if any(isnan(each[place]) for each in slopes.values()):
            kinked = next(
                term.expression
                for term in terms
                if any(map(isnan, _slopes(_insert_parameters(block, term.expression), levels).values()))
            )
            raise ModelError(
                f"the term {_write_term(block, kinked)} has a kink or a step at this operating point, so "
                "that there is no linear model: take another operating point; models of hysteresis have none"
            )
    computed, outputs = block.computed, block.outputs
    inputs = range(computed, len(block.signals))
    # An input that every equation reads late has a dead time; one sample is that of the discrete system.
    first = {c: min((lag for channel, lag in slopes if channel == c), default=1) for c in inputs}
    delays = [max(0, first[channel] - 1) for channel in inputs]
    A, B, C, D = _write_observer_form(block, slopes, delays)
    names = [block.columns[channel] for channel in inputs]
    return StateSpace(
        A=A,
        B=B,
        C=C,
        D=D,
        dt=block.dt,
        input_names=tuple(names),
        output_names=block.columns[:outputs],
        input_units=tuple(map(parse_unit, names)),
        output_units=tuple(map(parse_unit, block.columns[:outputs])),
        dead_times=tuple(delay * (1.0 if block.dt is None else block.dt) for delay in delays),
        operating_inputs=tuple(u),
        operating_outputs=tuple(map(float, levels[:outputs])),
    )


def _write_observer_form(
    block: Block, slopes: _Slopes, delays: Sequence[int]
) -> tuple[NDArray[np.float64], ...]:
    """Return A, B, C and D of the slopes, with inputs that are delayed by whole samples."""
    computed, inputs = block.computed, len(delays)
    direct, now = np.zeros((computed, computed)), np.zeros((computed, inputs))
    past: dict[int, tuple[NDArray[np.float64], NDArray[np.float64]]] = {}
    depths = np.zeros(computed, int)
    for (channel, sample), column in slopes.items():
        is_input = channel >= computed
        place = channel - computed if is_input else channel
        lag = sample - delays[place] if is_input else sample
        if lag:
            of = past.setdefault(lag, (np.zeros((computed, computed)), np.zeros((computed, inputs))))
            of[is_input][:, place] = column
            depths[column != 0.0] = np.maximum(depths[column != 0.0], lag)
        elif is_input:
            now[:, place] = column
        else:
            direct[:, place] = column
    # States of each equation, the first of which is what the past adds to its value; those of states first.
    order = [place for place in block.order if depths[place]]
    begins = dict(zip(order, np.cumsum([0, *(depths[place] for place in order)]).tolist(), strict=False))
    total = int(depths.sum())
    first = np.zeros((computed, total))
    for place, begin in begins.items():
        first[place, begin] = 1.0
    # An output may read sample k of the states, no state that of another.
    at_once = np.eye(computed) + direct
    on_states, on_inputs = at_once @ first, at_once @ now
    A, B = np.zeros((total, total)), np.zeros((total, inputs))
    for lag, (of_signals, of_inputs) in past.items():
        for place, begin in begins.items():
            if lag <= depths[place]:
                A[begin + lag - 1] += of_signals[place] @ on_states
                B[begin + lag - 1] += of_signals[place] @ on_inputs + of_inputs[place]
    for place, begin in begins.items():
        for row in range(begin, begin + depths[place] - 1):
            A[row, row + 1] += 1.0
    return A, B, on_states[: block.outputs], on_inputs[: block.outputs]


def read_levels(block: Block, operating_point: OperatingPoint | None) -> list[float]:
    """Return the value of every input of a block at an operating point; see `linearise_block`."""
    own = [block.levels.get(name, 0.0) for name in block.signals[block.computed :]]
    return choose_levels(block.columns[block.computed :], own, operating_point)


def choose_levels(
    names: Sequence[str], own: Sequence[float], operating_point: OperatingPoint | None
) -> list[float]:
    """Return the value of every input at an operating point; those of a model by default."""
    if operating_point is None:
        return list(own)
    if isinstance(operating_point, Mapping):
        if unknown := operating_point.keys() - set(names):
            raise ModelError(f"the model has no input {sorted(unknown)[0]}; it has {', '.join(names)}")
        return [float(operating_point.get(name, level)) for name, level in zip(names, own, strict=True)]
    levels: list[float] = np.atleast_1d(np.asarray(operating_point, dtype=np.float64)).tolist()
    if len(levels) != len(names):
        raise ModelError(f"the model has {len(names)} inputs ({', '.join(names)}), got {levels}")
    return levels


def _read_outputs(block: Block, y: ArrayLike) -> list[float]:
    levels: list[float] = np.atleast_1d(np.asarray(y, dtype=np.float64)).tolist()
    if block.computed > block.outputs:
        raise ModelError(
            "the states of this model determine its output: leave out the output of the operating point"
        )
    if len(levels) != block.outputs:
        raise ModelError(f"the model has {block.outputs} outputs ({block.title}), got {levels}")
    return levels


def _choose_outputs(block: Block, u: Sequence[float]) -> list[float]:
    """Return the rest; of a linear block without one, such as an integrator, the values of its start."""
    try:
        return find_rest(block, u)
    except ModelError:
        terms = (term.expression for equation in block.equations for term in equation)
        if all(_measure_degree(each) <= 1.0 for each in terms):
            return block.find_levels()[: block.computed]
        raise


def _measure_degree(expression: Expression) -> float:
    """Return the degree of an expression as a polynomial of the signals; infinite if it is none."""
    match expression:
        case Lagged():
            return 1.0
        case Apply(primitive, arguments):
            degrees = [_measure_degree(each) for each in arguments]
            if not any(degrees):
                return 0.0
            if primitive.name in ("add", "sub"):
                return max(degrees)
            return sum(degrees) if primitive.name == "mul" else inf
    return 0.0


def find_rest(block: Block, u: Sequence[float], within: tuple[float, float] = EVERYWHERE) -> list[float]:
    """Return the outputs and the states of a block at rest at constant inputs.

    The equilibria of one equation are the roots of a polynomial, if it is one in the output; otherwise those
    between 1e-9 and 1e9 in magnitude. That of several equations is the one that Newton's method finds from
    the values at which a program of the block starts. Of several stable ones of one equation, the only one
    ``within`` a range of the output is taken, which is searched first.

    Raises
    ------
    ModelError
        There is no stable equilibrium, there are several, or every output in a range is one, as in models of
        hysteresis.
    """
    where = ", ".join(
        f"{name} = {level:g}" for name, level in zip(block.columns[block.computed :], u, strict=True)
    )
    if block.computed > 1:
        return _find_joint_rest(block, u, where)
    roots = _find_roots(block, u, where, within)
    stable = []
    for root in roots:
        slopes = _differentiate(block, [root, *u])
        lags_read = range(1, 1 + max((lag for channel, lag in slopes if not channel), default=0))
        past = np.array([slopes.get((0, lag), np.zeros(1))[0] for lag in lags_read])
        # At a kink the slopes are unknown; such a root is kept.
        if np.isnan(past).any() or (
            np.isfinite(past).all() and (np.abs(np.roots(np.concatenate([[1.0], -past]))) < 1.0).all()
        ):
            stable.append(root)
    inside = [root for root in stable if within[0] <= root <= within[1]]
    if len(inside) == 1:
        return inside
    if within != EVERYWHERE:
        return find_rest(block, u)
    if stable:
        listed = ", ".join(f"{root:g}" for root in stable)
        raise ModelError(f"the model has several stable equilibria at {where}: {listed}; give the output y")
    raise ModelError(
        f"the model has no stable equilibrium at {where}: " + ("all are unstable" if roots else "it drifts")
    )


def _find_joint_rest(block: Block, u: Sequence[float], where: str) -> list[float]:
    """Return the outputs and the states at rest by Newton steps."""
    signals = np.array(block.find_levels()[: block.computed])
    for _ in range(_REST_STEPS):
        at = [*signals.tolist(), *u]
        total = np.zeros((block.computed, block.computed))
        for (channel, _lag), column in _differentiate(block, at).items():
            if channel < block.computed:
                total[:, channel] += column
        excess = np.array([block.evaluate(place, at) for place in range(block.computed)]) - signals
        if not excess.any():
            # An integrator rests anywhere.
            return at[: block.computed]
        try:
            step = np.linalg.solve(np.eye(block.computed) - total, excess)
        except np.linalg.LinAlgError:
            break
        signals = signals + step
        if not np.isfinite(signals).all():
            break
        if np.abs(step).max() <= _STILL * max(1.0, np.abs(signals).max()):
            found: list[float] = signals.tolist()
            return found
    raise ModelError(f"the model is not found to rest at {where}: give its outputs or states there")


def _differentiate(block: Block, levels: Sequence[float]) -> _Slopes:
    """Return the slopes of all equations by channel and lag of the record."""
    found: _Slopes = {}
    for place, terms in enumerate(block.equations):
        for term in terms:
            weight = block.parameters[term.weight] if term.weight else 1.0
            expression = _insert_parameters(block, term.expression)
            for (channel, lag), slope in _slopes(expression, levels).items():
                sample = channel, lag - block.leads[channel]
                column = found.setdefault(sample, np.zeros(block.computed))
                column[place] += weight * slope
    return found


def _insert_parameters(block: Block, expression: Expression) -> Expression:
    return substitute(expression, {name: Constant(number) for name, number in block.parameters.items()})


def _write_term(block: Block, expression: Expression) -> str:
    """Return a term with the signals of the record."""
    moved = replace_leaves(
        expression, lambda leaf: Lagged(leaf.channel, leaf.lag - block.leads[leaf.channel])
    )
    return PlainSignals(name_columns(block.columns[0], block.columns[1:])).write(moved)


def _slopes(expression: Expression, levels: Sequence[float]) -> Mapping[tuple[int, int], float]:
    """Return the derivative with respect to every signal and lag that an expression reads."""
    whole = remove_shifts(expression)
    leaves = list(dict.fromkeys(node for node in walk(whole) if isinstance(node, Lagged)))
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


def _find_roots(block: Block, u: Sequence[float], where: str, within: tuple[float, float]) -> list[float]:
    """Return the outputs at which a block of one equation rests."""
    from numpy.polynomial import Polynomial  # noqa: PLC0415 - ten modules, which few commands need

    pairs = [
        (block.parameters[term.weight] if term.weight else 1.0, _insert_parameters(block, term.expression))
        for term in block.equations[0]
    ]
    polynomials = [_to_polynomial(expression, u) for _, expression in pairs]
    if any(each is None for each in polynomials):
        return _search_roots(pairs, u, within)
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


def _to_polynomial(expression: Expression, u: Sequence[float]) -> "Polynomial | None":
    """Return a steady state as a polynomial in the output, None if it is not one."""
    from numpy.polynomial import Polynomial  # noqa: PLC0415 - as above

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
_ARITHMETIC: Mapping[str, "Callable[[Polynomial, Polynomial], Polynomial]"] = {
    "mul": lambda a, b: a * b,
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
}


def _search_roots(
    pairs: Sequence[tuple[float, Expression]], u: Sequence[float], within: tuple[float, float]
) -> list[float]:
    """Return the roots with a change of sign, by bisection, and the zeros of the grid."""

    def excess(y: float) -> float:
        levels = (y, *u)
        return sum(p * value(each, lambda channel, _: levels[channel]) for p, each in pairs) - y

    whole = np.concatenate([-_MAGNITUDES[:0:-1], _MAGNITUDES])
    grid = whole if within == EVERYWHERE else np.linspace(*within, _POINTS)
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
