"""Probability that a column is an input of another one.

An input leads, and is a command: held between jumps, or free of noise. A response is later, smoother and
noisier, and other columns predict it. A logistic model weighs these properties; its weights are estimated
and its probabilities tested on simulated records by ``lab/inspection/column_roles.py``.
"""

from dataclasses import dataclass
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from islands.records.inspection.column_influence import ColumnInfluence, average_middle, measure_influence
from islands.records.inspection.column_shape import (
    NO_NOISE,
    find_computed,
    is_derived,
    is_feedback,
    measure_command,
    measure_noise_level,
    measure_precedence,
    measure_roughness,
)

#: Weights of the properties of a pair (source, target), and the constant.
WEIGHTS = {
    "leads": 0.56,
    "more visible": 0.51,
    "more direct": 0.98,
    "visible": 0.20,
    "source is a command": 1.08,
    "target is a command": -1.57,
    "target is noisier": 0.56,
    "target is smoother": 0.86,
    "target is smoother in means": 1.29,
    "source precedes": 1.72,
    "source is predicted": -0.90,
    "source is manipulated": 5.56,
    "target has independent sources": 1.37,
}
_CONSTANT = -0.73

#: Command-likeness from which on a column is a command.
_COMMAND = 0.5

#: Root mean square of the error of a controlled column, relative to the standard deviation of its set point.
_TRACKING = 0.8

#: Gain by which a column predicts a command that a controller computes from it, at least.
_LEAST_CONTROL = 0.05

#: Samples of a mean for the roughness of the slow part of a column.
_SLOW = 4

#: Sensitivity of the logarithm that compresses a gain.
_COMPRESSION = 20.0


@dataclass(frozen=True, slots=True, eq=False)
class ColumnDirection:
    """Direction of the influence between the columns of a record.

    Attributes
    ----------
    influence : ColumnInfluence
    logits : ndarray, shape (columns, columns)
        Logarithm of the odds that a column (row) is an input of another one (column). It applies only if the
        influence is visible.
    derived : ndarray of bool, shape (columns, columns)
        Whether one of two columns is a derivative of the other.
    manipulated : ndarray, shape (columns, columns)
        1 for the output of a controller and a column that it acts on, -1 for the set point and these.
    """

    influence: ColumnInfluence
    logits: NDArray[np.float64]
    derived: NDArray[np.bool_]
    manipulated: NDArray[np.float64]


def estimate_direction(signals: NDArray[np.float64]) -> ColumnDirection:
    """Estimate which columns are inputs of which.

    Parameters
    ----------
    signals : ndarray, shape (columns, samples)
        Columns without missing values, that are not constant in the middle of the record.
    """
    influence = measure_influence(signals)
    properties = measure_properties(signals, influence)
    count, middle = len(signals), average_middle(signals, 1)
    derived = np.zeros((count, count), dtype=bool)
    for one in range(count if count > 2 else 0):
        for other in range(one):
            found = is_derived(middle[one], middle[other]) or is_derived(middle[other], middle[one])
            derived[one, other] = derived[other, one] = found
    logits = np.einsum("ijk,k->ij", properties, np.array(list(WEIGHTS.values()))) + _CONSTANT
    manipulated = properties[:, :, list(WEIGHTS).index("source is manipulated")]
    return ColumnDirection(influence, logits, derived, manipulated)


def measure_properties(signals: NDArray[np.float64], influence: ColumnInfluence) -> NDArray[np.float64]:
    """Return the properties of all pairs, shape (columns, columns, properties), in the order of `WEIGHTS`."""
    middle, means = average_middle(signals, 1), average_middle(signals, _SLOW)
    leading, visible, direct = (
        np.log1p(_COMPRESSION * gains) for gains in (influence.leading, influence.visible, influence.direct)
    )
    command = np.array([measure_command(x) for x in middle])
    # Differences of a command are its jumps, not noise.
    noise = np.array([measure_noise_level(x) for x in middle])
    noise[command > _COMMAND] = NO_NOISE
    rough, slow = (np.array([measure_roughness(x) for x in part]) for part in (middle, means))
    manipulated = _find_manipulated(middle, influence, command)
    count = len(signals)
    found = np.zeros((count, count, len(WEIGHTS)))
    for source in range(count):
        for target in range(count):
            if source == target:
                continue
            others = [place for place in range(count) if place not in (source, target)]
            found[source, target] = (
                leading[source, target] - leading[target, source],
                visible[source, target] - visible[target, source],
                direct[source, target] - direct[target, source],
                visible[source, target],
                command[source],
                command[target],
                noise[target] - noise[source],
                rough[source] - rough[target],
                slow[source] - slow[target],
                measure_precedence(middle[source], middle[target]),
                max((leading[other, source] for other in others), default=0.0),
                manipulated[source, target],
                _rate_collision(visible, source, target, others)
                - _rate_collision(visible, target, source, others),
            )
    return found


def _rate_collision(visible: NDArray[np.float64], source: int, target: int, others: list[int]) -> float:
    """Return how visible a target is from two sources that are independent of each other."""
    independent = [
        min(visible[other, target], visible[source, target])
        for other in others
        if visible[source, other] == 0.0 and visible[other, source] == 0.0
    ]
    return float(max(independent, default=0.0))


def _find_tracked(signals: NDArray[np.float64], command: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return whether a column has the values of a command (row), as a controlled one of its set point."""
    count = len(signals)
    found = np.zeros((count, count), dtype=bool)
    for one in range(count):
        for other in range(count):
            if command[one] > _COMMAND >= command[other]:
                error = float(np.sqrt(np.mean((signals[one] - signals[other]) ** 2)))
                found[one, other] = error < _TRACKING * float(signals[one].std())
    return found


def _find_manipulated(
    signals: NDArray[np.float64], influence: ColumnInfluence, command: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return 1 for the output of a controller and the column that follows it, -1 for the set point instead.

    A command that another column predicts is the output of a controller, and so is one of three columns that
    determine each other exactly: the set point is the one that is predicted least.
    """
    count, leading, visible = len(signals), influence.leading, influence.visible
    tracked = _find_tracked(signals, command)
    found = np.zeros((count, count))
    places = list(permutations(range(count), 3))
    computed = find_computed(signals) if count > 2 else ()
    if len(computed) > 2:
        set_point = min(computed, key=lambda place: leading[:, place].max() - command[place])
        triples = [
            (reference, source, target)
            for reference, source, target in places
            if reference == set_point
            and {source, target} <= set(computed)
            and visible[reference, source] > 0.0
            and leading[source, target] > leading[target, source]
        ]
    else:
        triples = [
            (reference, source, target)
            for reference, source, target in places
            if command[source] > _COMMAND >= command[target]
            and leading[reference, source] > _LEAST_CONTROL
            and leading[source, reference] == 0.0
            and visible[source, target] > 0.0
        ]
    # A set point is recognised by its values if the columns of the loop are rounded.
    triples += [
        (reference, source, target)
        for reference, source, target in places
        if tracked[reference, target]
        and not tracked[source, target]
        and visible[reference, source] > 0.0
        and visible[source, target] > 0.0
        and is_feedback(signals[source], signals[reference], signals[target])
    ]
    for reference, source, target in triples:
        found[source, target] += 1.0
        found[reference, target] -= 1.0
        found[reference, source] -= 1.0
    return np.clip(found, -1.0, 1.0)
