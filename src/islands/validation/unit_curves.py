"""Static curves of the units of a latent model in units of the record, with their uncertainty.

The states of a model have any coordinates, and a unit may have any scale of its argument. A curve is
therefore stated between signals of the record. Its value is the effect of the unit on the output at rest
through the linear part A, ``F + C (I - A)^-1 E`` times the unit, which no change of coordinates alters.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from islands.models.latent import LatentModel
from islands.models.unit_functions import evaluate_curve
from islands.records.dataset import Dataset
from islands.rounding import ROUNDING
from islands.simulation.blocks import UnitRun, simulate_units
from islands.validation.ensemble import Ensemble

#: Points of a curve.
_POINTS = 401

#: Least number of members of an ensemble that give a band, and its half-width in standard deviations.
_LEAST_MEMBERS, _DEVIATIONS = 10, 1.96

#: Least part of the variance of an argument that the output explains, for a curve over the output.
_FOLLOWS = 0.99

#: Effect of units through the states, relative to the variation of the output, below which they have none.
_NEGLIGIBLE = 1e-3


class Abscissa(Enum):
    """What a curve is drawn over."""

    INPUT = "the only input that the unit reads"
    CONSTANT_INPUT = "the constant input with the same argument at rest"
    OUTPUT = "the output, which the argument follows"
    DEVIATION = "the argument, in standard deviations from its mean in the free run"


@dataclass(frozen=True, slots=True, eq=False)
class UnitCurve:
    """Curve of a unit.

    Attributes
    ----------
    unit : str
        Function of the unit, as of `parse_unit`.
    abscissa : Abscissa
    channel : int
        Number of the input of the abscissa, from 0; -1 if it is none.
    state : int
        Number of the state, from 0, on which the values are the effect in a sample; -1 for the output at
        rest.
    x, y : ndarray, shape (points,)
    half_width : ndarray, shape (points,), or None
        Half-width of the 95 % band. None if the ensemble has fewer than 10 members with the structure.
    reached : tuple of float
        Least and greatest abscissa in the free run of the estimation data; ``x`` may go beyond them.
    """

    unit: str
    abscissa: Abscissa
    channel: int
    state: int
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    half_width: NDArray[np.float64] | None
    reached: tuple[float, float]


@dataclass(frozen=True, slots=True)
class _Scale:
    """Argument of a unit as ``scale`` times the abscissa plus ``offset``, and factor of its value."""

    scale: float
    offset: float
    gain: float


def trace_unit_curves(
    model: LatentModel,
    record: Dataset,
    warm_up: int,
    ensemble: Ensemble | None = None,
    further: Dataset | None = None,
) -> tuple[UnitCurve, ...]:
    """Return the curve of every unit over the range of its argument in the free run of a record.

    There is none if the free run diverges at once.

    Parameters
    ----------
    model : LatentModel
    record : Dataset
        Estimation data.
    warm_up : int
        Number of samples before the first prediction.
    ensemble : Ensemble, optional
        Its members with the structure of the model give the bands.
    further : Dataset, optional
        Validation data: the curves also cover the arguments of their free run.

    Raises
    ------
    RecordError, SettingsError
        As in `free_run`.
    """
    own = np.array([model.parameters])
    drawn = _find_members(model, ensemble)
    models = [model, *(model.with_parameters(each.tolist()) for each in drawn)]
    runs = simulate_units(model, record, warm_up, np.concatenate([own, drawn]))
    if runs[0].output.size < 2:
        return ()
    beyond = runs[0]
    if further is not None and (found := simulate_units(model, further, warm_up, own)[0]).output.size:
        beyond = found
    variation = record.u.std(axis=0)
    return tuple(_trace(unit, models, runs, beyond, variation) for unit in range(len(model.units)))


def locate_arguments(
    model: LatentModel, unit: int, run: UnitRun, record: Dataset, arguments: Sequence[float]
) -> tuple[Abscissa, int, tuple[float, ...]]:
    """Return the abscissa of a unit, the number of its input, and the abscissas of some arguments.

    Parameters
    ----------
    model : LatentModel
    unit : int
        Place of the unit, from 0.
    run : UnitRun
        Free run of the model on a record.
    record : Dataset
    arguments : sequence of float
    """
    abscissa, channel = _choose_abscissa(model, unit, run, record.u.std(axis=0))
    scale, offset = _scale_argument(model, unit, abscissa, channel, run)
    return abscissa, channel, tuple((each - offset) / scale for each in arguments)


def _find_members(model: LatentModel, ensemble: Ensemble | None) -> NDArray[np.float64]:
    """Return the parameters of the members with the structure of a model; none if they are too few."""
    structures = () if ensemble is None else ensemble.structures
    for each in structures:
        same = each.model.parameter_names == model.names and getattr(each.model, "units", None) == model.units
        # Members that could not be drawn are copies of the model.
        if same and len(each.parameters) >= _LEAST_MEMBERS and np.ptp(each.parameters, axis=0).any():
            return each.parameters
    return np.empty((0, model.size))


def _trace(
    unit: int,
    models: Sequence[LatentModel],
    runs: Sequence[UnitRun],
    beyond: UnitRun,
    variation: NDArray[np.float64],
) -> UnitCurve:
    """Return the curve of a unit of the first model; the others are members."""
    abscissa, channel = _choose_abscissa(models[0], unit, runs[0], variation)
    state = _choose_state(models[0], unit)
    scales = [
        _Scale(*_scale_argument(each, unit, abscissa, channel, run), _find_gain(each, unit, state))
        for each, run in zip(models, runs, strict=True)
    ]
    reached = _find_range(runs[0].arguments[unit], scales[0])
    whole = [*reached, *_find_range(beyond.arguments[unit], scales[0])]
    x = np.linspace(min(whole), max(whole), _POINTS)
    name = models[0].units[unit]
    values = np.array([each.gain * evaluate_curve(name, each.scale * x + each.offset) for each in scales])
    half = _DEVIATIONS * np.sqrt(np.mean((values[1:] - values[0]) ** 2, axis=0)) if len(scales) > 1 else None
    return UnitCurve(name, abscissa, channel, state, x, values[0], half, reached)


def _find_range(arguments: NDArray[np.float64], scale: _Scale) -> tuple[float, float]:
    """Return the least and the greatest abscissa of arguments; a width of 2 if they are constant."""
    x = (np.array([arguments.min(), arguments.max()]) - scale.offset) / scale.scale
    low, high = float(x.min()), float(x.max())
    return (low, high) if high > low else (low - 1.0, high + 1.0)


def _choose_abscissa(
    model: LatentModel, unit: int, run: UnitRun, variation: NDArray[np.float64]
) -> tuple[Abscissa, int]:
    """Return what the curve of a unit is drawn over, and the number of the input."""
    of = model.matrices
    read = np.flatnonzero(of["V"][unit])
    if not of["W"][unit].any() and len(read) == 1:
        return Abscissa.INPUT, int(read[0])
    if (inverse := _invert(model)) is not None and not _act_on_states(model, run, inverse):
        effects = np.abs(of["W"][unit] @ inverse @ of["B"] + of["V"][unit]) * variation
        if effects.any():
            return Abscissa.CONSTANT_INPUT, int(effects.argmax())
    scale, offset = _regress(run.arguments[unit], run.output)
    left = run.arguments[unit] - scale * run.output - offset
    if scale and left.var() <= (1.0 - _FOLLOWS) * run.arguments[unit].var():
        return Abscissa.OUTPUT, -1
    return Abscissa.DEVIATION, -1


def _act_on_states(model: LatentModel, run: UnitRun, inverse: NDArray[np.float64]) -> bool:
    """Return whether units have an effect on the output through the states that is not negligible."""
    effects = model.matrices["C"] @ inverse @ model.matrices["E"]
    pairs = zip(effects, model.units, run.arguments, strict=True)
    changes = [abs(effect) * evaluate_curve(name, values).std() for effect, name, values in pairs if effect]
    return bool(sum(changes) > _NEGLIGIBLE * run.output.std())


def _scale_argument(
    model: LatentModel, unit: int, abscissa: Abscissa, channel: int, run: UnitRun
) -> tuple[float, float]:
    """Return the scale and the offset of the argument of a unit over an abscissa."""
    of, argument = model.matrices, run.arguments[unit]
    match abscissa:
        case Abscissa.INPUT:
            return float(of["V"][unit, channel]), float(of["s"][unit])
        case Abscissa.CONSTANT_INPUT if (inverse := _invert(model)) is not None:
            gains = of["W"][unit] @ inverse @ of["B"] + of["V"][unit]
            others = np.array(model.operating_inputs)
            others[channel] = 0.0
            offset = of["W"][unit] @ inverse @ of["o"] + gains @ others + of["s"][unit]
            return float(gains[channel]), float(offset)
        case Abscissa.OUTPUT if run.output.size:
            return _regress(argument, run.output)
        case Abscissa.DEVIATION if argument.size and argument.std() > 0.0:
            return float(argument.std()), float(argument.mean())
    return 1.0, 0.0


def _regress(values: NDArray[np.float64], over: NDArray[np.float64]) -> tuple[float, float]:
    """Return the slope and the offset of the least-squares line; a slope of 0 over constant values."""
    variance = float(over.var())
    if not variance > 0.0:
        return 0.0, float(values.mean())
    slope = float(np.mean((values - values.mean()) * (over - over.mean()))) / variance
    return slope, float(values.mean() - slope * over.mean())


def _choose_state(model: LatentModel, unit: int) -> int:
    """Return the state that the unit affects most, from 0; -1 if it has an effect on the output at rest."""
    of = model.matrices
    inverse = _invert(model)
    if not of["E"][:, unit].any():
        return -1
    if inverse is not None:
        parts = np.append(of["C"] * (inverse @ of["E"][:, unit]), of["F"][unit])
        if abs(parts.sum()) > ROUNDING * np.abs(parts).sum():
            return -1
    return int(np.abs(of["E"][:, unit]).argmax())


def _find_gain(model: LatentModel, unit: int, state: int) -> float:
    """Return the factor of the value of a unit in its effect on a state or on the output at rest."""
    of = model.matrices
    if state >= 0:
        return float(of["E"][state, unit])
    inverse = _invert(model)
    through = 0.0 if inverse is None else float(of["C"] @ inverse @ of["E"][:, unit])
    return through + float(of["F"][unit])


def _invert(model: LatentModel) -> NDArray[np.float64] | None:
    """Return the inverse of I - A; None if A has no rest that it approaches."""
    a = model.matrices["A"]
    if not np.abs(np.linalg.eigvals(a)).max() < 1.0 - ROUNDING:
        return None
    return np.linalg.inv(np.eye(len(a)) - a).astype(np.float64)
