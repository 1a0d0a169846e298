"""Laws of the curves of a latent model: the simple functions that the data do not distinguish from them.

A curve is replaced by every function of `LAWS`, with an argument, a gain and a constant of its own, and all
parameters are estimated again. The law is that of the smallest models with as much evidence as the curve
(see `islands.validation.evidence`); if two laws are equally good and equally large, none is named.

A curve is known but for a line, which the linear part takes: a dead zone beside a line is a saturation. A
replacement therefore has either this line, or, of a curve of one input, no linear path of this input, and the
one without is smaller. Units that read the same signal are one curve.

A unit is a law by itself, also if it is only the nearest function to another curve. The data prefer a curve
if a further function of the same signal adds evidence to the law.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from math import inf
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from islands.estimation.latent_models import transform_states
from islands.estimation.latent_refit import refit_latent
from islands.estimation.modal_form import find_modal_form
from islands.models.latent import LatentModel
from islands.models.unit_functions import evaluate_curve, parse_unit
from islands.records.dataset import Dataset
from islands.records.split import Split
from islands.rounding import RESOLUTION, ROUNDING
from islands.simulation.blocks import UnitRun, simulate_units
from islands.validation.evidence import (
    DECISIVE,
    ErrorNoise,
    measure_errors,
    measure_lack,
    measure_size,
)
from islands.validation.unit_curves import Abscissa, locate_arguments

#: Steps of the estimation of a replacement.
_STEPS = 30

#: Effect of a further function at the begin of its estimation, relative to that of the law.
_START = 1e-3

#: Arguments at which a law is first fitted to a curve, places of its zero, and its scales in ranges.
_POINTS, _PLACES = 200, 21
_SCALES = (0.5, 1.0, 2.0, 4.0, 8.0, 32.0)

#: Name of each law, and the arguments at which it bends or turns: they lie within the data, else it is any
#: smooth curve, or another law. A square root may begin beyond the data, as a level that is never zero.
LAWS: Mapping[str, tuple[str, tuple[float, ...]]] = MappingProxyType(
    {
        "root": ("square root", ()),
        "square": ("square", (0.0,)),
        "s*abs": ("signed square", (0.0,)),
        "cube": ("cube", (0.0,)),
        "abs": ("absolute value", (0.0,)),
        "hinge": ("one-sided line", (0.0,)),
        "saturation": ("saturation", (-1.0, 1.0)),
        "dead zone": ("dead zone", (-1.0, 1.0)),
        "tanh": ("smooth saturation (tanh)", (0.0,)),
        "bell": ("bell (Gaussian)", (0.0,)),
    }
)

#: Laws whose scale of the argument is a gain.
_HOMOGENEOUS = frozenset({"root", "square", "s*abs", "cube", "abs", "hinge"})

#: Laws that are others beside a line: a saturation, a one-sided line, and any smooth curve to second order.
_WITHOUT_LINE = frozenset({"dead zone", "abs", "square"})

#: Laws that are steps if they are steep, and their name then.
_STEPS_IF_STEEP, _SIGN = frozenset({"saturation", "tanh"}), "sign (dry friction)"

#: Name of a one-sided line beside a line.
_KINK = "kink between two lines"

#: Magnitude of a pole that halves a deviation within a sample.
_HALF = 0.5


@dataclass(frozen=True, slots=True)
class UnitLaw:
    """Law of a curve.

    Attributes
    ----------
    units : tuple of int
        Numbers of the units whose sum is the curve, from 1.
    law : str
        Name of the law.
    over : str
        Name of the signal that the curve reads; behind "constant" if it does so at rest.
    unit : str
        Unit of this signal.
    places : tuple of float
        Values of the signal at which the law bends, turns, begins or jumps.
    has_line : bool
        Whether there is a line beside the law.
    deviation_percent : float
        Root mean square of the distance of the curve from the law over the data, but for a line, relative to
        the range of the curve.
    """

    units: tuple[int, ...]
    law: str
    over: str
    unit: str
    places: tuple[float, ...]
    has_line: bool
    deviation_percent: float


@dataclass(frozen=True, slots=True, eq=False)
class _Curve:
    """A curve of a model: ``effect`` times its values and ``rest`` act on the states and the output.

    Its signal is ``weights (x, u) + offset``.
    """

    units: tuple[int, ...]
    weights: NDArray[np.float64]
    offset: float
    effect: NDArray[np.float64]
    rest: NDArray[np.float64]
    signal: NDArray[np.float64]
    values: NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class _Candidate:
    """A model with its free runs on all data and its size; of one with a law, its name and free run."""

    model: LatentModel
    errors: NDArray[np.float64]
    size: float
    name: str
    has_line: bool
    run: UnitRun


def name_unit_laws(model: LatentModel, split: Split, warm_up: int) -> tuple[UnitLaw, ...]:
    """Name the laws of the curves of a model.

    Parameters
    ----------
    model : LatentModel
    split : Split
        Data that the parameters are estimated from, and validation data; the evidence is that of both.
    warm_up : int
        Number of samples before the first prediction.

    Returns
    -------
    tuple of UnitLaw
        One for each curve of a signal of the record that has a law.

    Raises
    ------
    RecordError, SettingsError
        As in `free_run`.
    """
    kept = _measure(model, split, warm_up)
    named = (_name(kept, curve, split, warm_up) for curve in _list_curves(kept))
    return tuple(each for each in named if each is not None)


def _list_curves(kept: _Candidate) -> Iterator[_Curve]:
    """Yield the curve of each signal that units read."""
    model, of, arguments = kept.model, kept.model.matrices, kept.run.arguments
    if kept.run.output.size < _POINTS:
        return
    weights, left = np.hstack([of["W"], of["V"]]), list(range(len(model.units)))
    while left:
        first = left[0]
        norms = np.linalg.norm(weights, axis=1) * np.linalg.norm(weights[first])
        units = [
            unit for unit in left if abs(weights[unit] @ weights[first]) >= (1.0 - ROUNDING) * norms[unit]
        ]
        left = [unit for unit in left if unit not in units]
        effects = np.vstack([of["E"], of["F"]])[:, units]
        acting = effects @ [evaluate_curve(model.units[unit], arguments[unit]) for unit in units]
        rest = acting.mean(axis=1)
        effect = np.linalg.svd(acting - rest[:, None], full_matrices=False)[0][:, 0]
        effect[~effects.any(axis=1)] = 0.0
        values = effect @ (acting - rest[:, None])
        yield _Curve(
            tuple(units), weights[first], float(of["s"][first]), effect, rest, arguments[first], values
        )


def _name(kept: _Candidate, curve: _Curve, split: Split, warm_up: int) -> UnitLaw | None:
    """Return the law of a curve; None if the data prefer the curve, or do not distinguish two laws."""
    found = [kept]
    for law, has_line in product(LAWS, (False, True)):
        start = _replace(kept.model, curve, law, has_line)
        if start is not None and (fitted := _estimate(start, split, warm_up, has_line)) and fitted.name:
            found.append(fitted)
    lack = _measure_lack(found, split)
    pairs = zip(found[1:], lack[1:].tolist(), strict=True)
    equal = [
        (each.size, own, place) for place, (each, own) in enumerate(pairs, 1) if own <= lack.min() + DECISIVE
    ]
    smallest = [found[place] for size, _, place in sorted(equal) if size <= min(equal)[0]]
    if len({each.name for each in smallest}) != 1:
        return None
    chosen = smallest[0]
    if chosen.name == _SIGN:  # The samples do not show how steep it is.
        return _describe(chosen, curve, split.estimation)
    further = [_estimate(_append(chosen, law), split, warm_up, chosen.has_line) for law in LAWS]
    lack = _measure_lack([chosen, *(each for each in further if each is not None)], split)
    return _describe(chosen, curve, split.estimation) if lack[0] <= lack.min() + DECISIVE else None


def _estimate(model: LatentModel, split: Split, warm_up: int, has_line: bool) -> _Candidate | None:
    """Return a model with estimated parameters; None if its free run diverges."""
    fitted = refit_latent(model, split.estimation, _STEPS, lambda: False)
    if not isinstance(fitted, LatentModel):
        return None
    found = _measure(fitted, split, warm_up, has_line)
    return None if np.isinf(found.errors).any() else found


def _measure_lack(candidates: Sequence[_Candidate], split: Split) -> NDArray[np.float64]:
    """Return the information criteria of models, with the noise of the closest one."""
    noise = ErrorNoise.fit_closest((each.errors for each in candidates), split.segments)
    models, sizes = [each.model for each in candidates], [each.size for each in candidates]
    squares = [noise.measure(each.errors) for each in candidates]
    return measure_lack(models, sizes, squares, noise.samples, 1)


def _measure(model: LatentModel, split: Split, warm_up: int, has_line: bool = False) -> _Candidate:
    """Return a model with its errors; its last unit is the law."""
    errors = measure_errors(model, split, warm_up)
    operations = sum(parse_unit(each).operations - 1 for each in model.units if each not in LAWS)
    redundant = sum(each in _HOMOGENEOUS for each in model.units)
    size = measure_size(model) + operations - redundant
    (run,) = simulate_units(model, split.estimation, warm_up, np.array([model.parameters]))
    return _Candidate(model, errors, size, _find_name(model, run, split.estimation, has_line), has_line, run)


def _find_name(model: LatentModel, run: UnitRun, record: Dataset, has_line: bool) -> str:
    """Return the name of the law that the last unit of a model is; empty if it bends outside of the data."""
    law = model.units[-1]
    if law not in LAWS or not run.output.size:
        return ""
    name, bends = LAWS[law]
    low, high = run.arguments[-1].min(), run.arguments[-1].max()
    if law == "root" and low < 0.0 < high:
        return f"signed {name}"
    if law == "hinge" and has_line:
        name = _KINK
    if not all(low < each < high for each in bends):
        return ""
    if law in _STEPS_IF_STEEP and _is_step(model, run):
        abscissa, *_ = locate_arguments(model, len(model.units) - 1, run, record, ())
        return _SIGN if abscissa is Abscissa.OUTPUT else ""
    return "" if _is_too_fast(model, run) else name


def _is_step(model: LatentModel, run: UnitRun) -> bool:
    """Return whether samples do not show the zone between the limits of a saturation in a feedback.

    A change by half of the zone in a sample leaves fewer than two samples in it whenever it is passed.
    """
    arguments = run.arguments[-1]
    inside = np.abs(arguments) < 1.0
    touching = np.diff(arguments)[inside[1:] | inside[:-1] | (np.diff(np.sign(arguments)) != 0.0)]
    in_feedback = model.matrices["W"][-1].any() and touching.size
    return bool(in_feedback and np.sqrt(np.mean(touching**2)) > 1.0)


def _is_too_fast(model: LatentModel, run: UnitRun) -> bool:
    """Return whether a pole halves a deviation within a sample at some slope of the law, and not at others.

    What the samples show is then another curve than that between samples.
    """
    of, arguments = model.matrices, np.sort(run.arguments[-1])
    arguments = arguments[:: max(1, len(arguments) // _POINTS)]
    step = RESOLUTION * max(float(np.ptp(arguments)), 1.0)
    ahead, behind = (evaluate_curve(model.units[-1], arguments + shift) for shift in (step, -step))
    slopes = (ahead - behind) / (2.0 * step)
    by_size = slopes[np.argsort(np.abs(slopes))]
    flat, steep = (
        np.abs(np.linalg.eigvals(of["A"] + slope * np.outer(of["E"][:, -1], of["W"][-1]))).min(initial=1.0)
        for slope in by_size[[0, -1]].tolist()
    )
    return bool((flat < _HALF) != (steep < _HALF))


def _replace(model: LatentModel, curve: _Curve, law: str, has_line: bool) -> LatentModel | None:
    """Return a model with a law in place of a curve, near to it; None if there is no such model."""
    order, kept = model.order, [unit for unit in range(len(model.units)) if unit not in curve.units]
    blocks = model.layout.split(model.theta)
    linear = np.vstack([np.hstack([blocks["A"], blocks["B"]]), np.append(blocks["C"], blocks["D"])])
    read, values = np.flatnonzero(curve.weights), curve.values
    beside = linear[np.ix_(np.flatnonzero(curve.effect), read)]
    if has_line:
        # Zeros between two modes are those of the coordinates.
        others = np.flatnonzero(curve.effect)[:, None] >= order
        if law in _WITHOUT_LINE or not (beside.astype(bool) | ~(others | (read >= order))).all():
            return None
    elif len(read) == 1 and read[0] >= order:
        # The part of the linear path along the effect of the curve belongs to the law.
        share = linear[:, read[0]] @ curve.effect / (curve.effect @ curve.effect)
        values = values + share * (curve.signal - curve.offset) / curve.weights[read[0]]
        linear[:, read[0]] = 0.0
    elif beside.any():
        return None
    scale, offset, gain, constant, *slopes = _fit(law, curve.signal, values, has_line)
    slope = sum(slopes)
    linear += slope * np.outer(curve.effect, curve.weights)
    shift = curve.rest + curve.effect * (constant + slope * curve.offset)
    found = _make_model(
        model,
        (*(model.units[unit] for unit in kept), law),
        {
            "A": linear[:order, :order],
            "B": linear[:order, order:],
            "C": linear[order, :order],
            "D": linear[order, order:],
            "E": np.column_stack([blocks["E"][:, kept], gain * curve.effect[:order]]),
            "F": np.append(blocks["F"][kept], gain * curve.effect[order]),
            "W": np.vstack([blocks["W"][kept], scale * curve.weights]),
            "s": np.append(blocks["s"][kept], scale * curve.offset + offset),
            "o": blocks["o"] + shift[:order],
            "level": blocks["level"] + shift[order:],
        },
    )
    return _write_in_modes(found) if slope and read[0] < order else found


def _write_in_modes(model: LatentModel) -> LatentModel | None:
    """Return a model with one or two states for each mode, as those of a search; None if that fails."""
    modes = find_modal_form(model.matrices["A"])
    if modes is None:
        return None
    theta = transform_states(model.theta, model.layout, modes[1])
    blocks = model.layout.split(theta)
    blocks["A"][...] = modes[0]
    return _make_model(model, model.units, blocks)


def _append(candidate: _Candidate, law: str) -> LatentModel:
    """Return a model with a further function of the signal of its law, before it, with hardly an effect."""
    model, of, arguments = candidate.model, candidate.model.matrices, candidate.run.arguments[-1]
    blocks = model.layout.split(model.theta)
    low, high = float(arguments.min()), float(arguments.max())
    scale = 4.0 / ((high - low) or 1.0)
    own = {
        "E": _START * of["E"][:, -1:],
        "F": _START * of["F"][-1:],
        "W": scale * blocks["W"][-1:],
        "s": scale * (of["s"][-1:] - 0.5 * (low + high)),
    }
    axes = {"E": 1, "F": 0, "W": 0, "s": 0}
    joined = {name: np.concatenate([own[name], blocks[name]], axis) for name, axis in axes.items()}
    return _make_model(model, (law, *model.units), {**blocks, **joined})


def _make_model(
    model: LatentModel, units: tuple[str, ...], blocks: Mapping[str, NDArray[np.float64]]
) -> LatentModel:
    """Return a model with other units and parameters; those that are zero are left out."""
    layout = replace(model.layout, units=len(units))
    theta = layout.join(blocks)
    return replace(
        model,
        units=units,
        wiring=tuple(name for name, value in zip(layout.names, theta, strict=True) if value),
        parameters=tuple(value for value in theta.tolist() if value),
        quantity_errors=None,
    )


def _fit(
    law: str, signal: NDArray[np.float64], values: NDArray[np.float64], has_line: bool
) -> tuple[float, ...]:
    """Return scale and offset of the argument of a law that is near a curve, its gain, constant and slope."""
    x, y = _thin(signal, values)
    width, best, found = float(np.ptp(x)) or 1.0, inf, (1.0, 0.0, 0.0, 0.0)
    signs = (1.0,) if parse_unit(law).parity else (1.0, -1.0)
    scales = (1.0,) if law in _HOMOGENEOUS else _SCALES
    for place, relative, sign in product(np.linspace(x.min(), x.max(), _PLACES).tolist(), scales, signs):
        scale = sign * relative / width
        curve = evaluate_curve(law, scale * (x - place))
        left, coefficients = _regress(y, [curve, np.ones(len(x)), *([x] if has_line else [])])
        if (error := float(left @ left)) < best:
            best, found = error, (scale, -scale * place, *coefficients)
    return found


def _thin(signal: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return samples of a curve in the order of its signal."""
    chosen = np.argsort(signal, kind="stable")[:: max(1, len(signal) // _POINTS)]
    return np.array([signal[chosen], values[chosen]])


def _regress(
    y: NDArray[np.float64], columns: list[NDArray[np.float64]]
) -> tuple[NDArray[np.float64], list[float]]:
    """Return the residual and the coefficients of least squares."""
    design = np.column_stack(columns)
    solved = np.linalg.lstsq(design, y, rcond=None)[0]
    return y - design @ solved, solved.tolist()


def _describe(candidate: _Candidate, curve: _Curve, record: Dataset) -> UnitLaw | None:
    """Return the law of a curve; None of a signal that is none of the record."""
    model, run, law = candidate.model, candidate.run, candidate.model.units[-1]
    bends = (0.0,) if law == "root" or candidate.name == _SIGN else LAWS[law][1]
    abscissa, channel, places = locate_arguments(model, len(model.units) - 1, run, record, bends)
    if abscissa is Abscissa.DEVIATION:
        return None
    over, unit = record.output_name, record.output_unit
    if abscissa is not Abscissa.OUTPUT:
        at_rest = "constant " * (abscissa is Abscissa.CONSTANT_INPUT)
        over, unit = at_rest + model.column_names[channel], record.input_units[channel]
    # A free run may end early.
    size = min(run.output.size, curve.signal.size)
    columns = [np.ones(size), curve.signal[:size], evaluate_curve(law, run.arguments[-1][:size])]
    left, _ = _regress(curve.values[:size], columns)
    deviation = 100.0 * float(np.sqrt(np.mean(left**2)) / (np.ptp(curve.values) or 1.0))
    units = tuple(each + 1 for each in curve.units)
    return UnitLaw(units, candidate.name, over, unit, tuple(sorted(places)), candidate.has_line, deviation)
