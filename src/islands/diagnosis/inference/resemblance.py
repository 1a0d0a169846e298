"""Resemblance: the simple law whose shape the values of a free curve have within their intervals."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from islands.effects.free_forms import RATE_RANGE
from islands.effects.interface.context import Signal, SimulationContext
from islands.kernels.curve import VALUES

#: Largest distance of a value from a law, relative to the curve, if its interval is smaller: a smooth curve
#: through seven values has no kink.
TOLERANCE = 0.1

#: Largest half width of the interval of a value that the record determines, relative to the curve.
_DETERMINED = 0.25

#: Least number of determined values in excess of the coefficients of a law.
_SPARE_VALUES = 2

#: Largest ratio of the squared distances of the nearest law and of the next one.
MAX_RATIO = 0.5

#: Ratio of the linear part to the absolute value below which a law is the absolute value alone.
_NO_LINEAR_PART = 0.05

#: Number of values of the parameter of a law that are compared.
_STEPS = 200


class CurveSignal(NamedTuple):
    """Signal of a free curve: its name, symbol, unit and range, and whether the curve is a force."""

    name: str
    symbol: str
    unit: str
    peak: float
    is_force: bool


@dataclass(frozen=True, slots=True)
class Resemblance:
    """The law that a free curve resembles.

    Attributes
    ----------
    law : str
        Name of the law, such as "absolute value".
    formula : str
        The law of the signal, as ``y + 0.98 |y|``; a gain and an offset are left out.
    parameter : str
        Name of its parameter.
    value : float
    unit : str
        Unit of the parameter; empty if it has none.
    """

    law: str
    formula: str
    parameter: str
    value: float
    unit: str


@dataclass(frozen=True, slots=True)
class _Law:
    """A law with one parameter that changes its shape, relative to the range of the signal."""

    name: str
    parameter: str
    formula: str
    apply: Callable[[Signal, float], Signal]
    parameters: Signal = field(repr=False)
    has_unit: bool = True


def _round(x: Signal, step: float) -> Signal:
    return step * np.round(x / step)


def _raise(x: Signal, exponent: float) -> Signal:
    return np.sign(x) * np.abs(x) ** exponent


#: The absolute value next to a linear part, which has its ratio to that in place of a parameter.
ABSOLUTE = _Law("absolute value", "factor", "", lambda x, _: np.abs(x), np.ones(1), has_unit=False)

DEAD_ZONE = _Law(
    "dead zone",
    "half width",
    "|{x}| reduced by {value}, zero below",
    lambda x, width: np.sign(x) * np.maximum(np.abs(x) - width, 0.0),
    np.linspace(0.05, 0.8, _STEPS),
)

#: The laws other than the absolute value.
LAWS = (
    _Law(
        "saturation",
        "limit",
        "{x} limited to {value} in size",
        lambda x, limit: np.clip(x, -limit, limit),
        np.linspace(0.1, 0.9, _STEPS),
    ),
    DEAD_ZONE,
    _Law("quantiser", "step", "{x} rounded to steps of {value}", _round, np.linspace(0.3, 1.5, _STEPS)),
    _Law(
        "power law",
        "exponent",
        "sign({x}) |{x}|^{value}",
        _raise,
        np.concatenate([np.linspace(0.2, 0.8, _STEPS // 2), np.linspace(1.3, 5.0, _STEPS // 2)]),
        has_unit=False,
    ),
)


def describe_curve_signal(form: str, context: SimulationContext) -> CurveSignal | None:
    """Return the signal of a free curve; None for another free form."""
    coordinate = context.force_coordinate
    rate, rate_unit = RATE_RANGE * coordinate.rate, f"{coordinate.unit}/s"
    return {
        "input-curve": CurveSignal("input", "u", context.input_unit, context.input_peak, False),
        "output-curve": CurveSignal("output", "y", context.output_unit, context.output_peak, False),
        "stiffness-curve": CurveSignal("coordinate", "x", coordinate.unit, coordinate.peak, True),
        "damping-curve": CurveSignal("rate", "v", rate_unit, rate, True),
    }.get(form)


def find_resemblance(values: Signal, half_widths: Signal, signal: CurveSignal) -> Resemblance | None:
    """Return the law that a free curve resembles.

    The gain and the offset of a law are free, and those of a linear part next to a force: the simulation has
    them as well.

    Parameters
    ----------
    values, half_widths : ndarray, shape (values,)
        Values of the curve, and half widths of their 95 % intervals.
    signal : CurveSignal

    Returns
    -------
    Resemblance or None
        None if no law is within the intervals of all values that the record determines, or too few are.
    """
    # Flattened ends are equal to a neighbour: the record does not determine them.
    is_flat = np.diff(values) == 0.0
    is_determined = ~(np.append(is_flat, False) | np.append(False, is_flat))
    largest = float(np.max(np.abs(values), where=is_determined, initial=0.0))
    if largest == 0.0:
        return None
    is_determined &= half_widths <= _DETERMINED * largest
    # A curve is zero at the ends of its range, which it has if the record determines the values next to them.
    places, is_determined = np.linspace(-1.0, 1.0, VALUES + 2), np.pad(is_determined, 1, "edge")
    accepted = np.maximum(np.pad(half_widths, 1, "edge"), TOLERANCE * largest)
    total = np.pad(values, 1) / signal.peak + (0.0 if signal.is_force else places)
    weights = is_determined * signal.peak / accepted
    constant = np.ones(places.size)
    candidates = [(ABSOLUTE, 1.0, [constant, places, np.abs(places)])]
    linear = [places] if signal.is_force else []
    candidates += [
        (law, parameter, [constant, *linear, law.apply(places, parameter)])
        for law in LAWS
        # Next to a linear part, a dead zone is a saturation.
        if not (signal.is_force and law is DEAD_ZONE)
        for parameter in law.parameters.tolist()
    ]
    found = list[tuple[float, Resemblance]]()
    for law, parameter, columns in candidates:
        if is_determined.sum() >= len(columns) + _SPARE_VALUES:
            design = np.column_stack(columns)
            solved = np.linalg.lstsq(design * weights[:, None], total * weights, rcond=None)[0]
            coefficients = solved.astype(np.float64)
            distances = np.abs(total - design @ coefficients) * weights
            if distances.max() <= 1.0:
                described = (
                    _describe_absolute(coefficients, signal)
                    if law is ABSOLUTE
                    else _describe(law, parameter, signal)
                )
                found.append((float(distances @ distances), described))
    return _choose(found)


def _choose(found: Sequence[tuple[float, Resemblance]]) -> Resemblance | None:
    """Return the nearest law, given each with its squared distance; None if another law is about as near."""
    nearest = dict[str, tuple[float, Resemblance]]()
    for distance, law in sorted(found, key=itemgetter(0)):
        nearest.setdefault(law.law, (distance, law))
    if not nearest:
        return None
    first, *others = nearest.values()
    return first[1] if all(first[0] < MAX_RATIO * distance for distance, _ in others) else None


def _describe(law: _Law, parameter: float, signal: CurveSignal) -> Resemblance:
    value, unit = (parameter * signal.peak, signal.unit) if law.has_unit else (parameter, "")
    written = f"{value:.3g} {unit}".rstrip()
    return Resemblance(
        *(law.name, law.formula.format(x=signal.symbol, value=written), law.parameter, value, unit)
    )


def _describe_absolute(coefficients: Signal, signal: CurveSignal) -> Resemblance:
    """Describe an absolute value, whose parameter is its factor relative to the linear part."""
    _, linear, absolute = coefficients.tolist()
    size = f"|{signal.symbol}|"
    if signal.is_force or abs(linear) < _NO_LINEAR_PART * abs(absolute):
        return Resemblance(ABSOLUTE.name, size, ABSOLUTE.parameter, 1.0, "")
    factor = absolute / linear
    sign = "-" if factor < 0.0 else "+"
    return Resemblance(
        *(ABSOLUTE.name, f"{signal.symbol} {sign} {abs(factor):.3g} {size}", ABSOLUTE.parameter, factor, "")
    )
