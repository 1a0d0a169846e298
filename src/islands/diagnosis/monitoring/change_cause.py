"""Cause of a change: the parameter or the effect whose change explains the monitored values."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from islands.diagnosis.monitoring.effect_states import MonitorReference
from islands.effects.interface.context import Signal

#: Fraction of the change that a cause must explain.
MIN_FRACTION = 0.5

#: Difference in minus twice the log-likelihood within which causes are equivalent.
EQUIVALENCE = 6.0


@dataclass(frozen=True, slots=True)
class ChangeCause:
    """Explanation of a change by one cause.

    Attributes
    ----------
    name : str
        Parameter or effect.
    is_parameter : bool
    gain : float
        Decrease of minus twice the log-likelihood by this cause.
    fraction : float
        Fraction of the change that it explains.
    equivalents : tuple of str
        Further causes that explain the change as well, the best first.
    strength : tuple of (str, float, str)
        Name, value and unit of each parameter of an effect that was calibrated to a record; otherwise empty.
    """

    name: str
    is_parameter: bool
    gain: float
    fraction: float
    equivalents: tuple[str, ...]
    strength: tuple[tuple[str, float, str], ...] = ()


def explain_change(values: Signal, changes: Signal, since: int, reference: MonitorReference) -> ChangeCause:
    """Find the cause that explains a change of the mean best, by generalised least squares.

    Parameters
    ----------
    values : ndarray, shape (records, causes)
        Parameters and scores; the undisturbed state is the part before ``since``.
    changes : ndarray, shape (causes, causes)
        Row j is the change of the values if cause j alone changes, up to a factor.
    since : int
        First changed record.
    reference : MonitorReference
    """
    before, after = values[:since], values[since:]
    scale = np.std(before, axis=0, ddof=1)
    is_used = scale > 1e-9 * np.max(np.abs(values), axis=0)
    scale = scale[is_used]
    change = (np.mean(after, axis=0) - np.mean(before, axis=0))[is_used] / scale
    responses = changes[:, is_used] / scale
    solve = np.linalg.pinv(estimate_correlation(before[:, is_used]), hermitian=True)
    weight = len(before) * len(after) / len(values)
    weighted = responses @ solve
    sizes = np.sum(weighted * responses, axis=1)
    gains = weight * (weighted @ change) ** 2 / np.maximum(sizes, np.finfo(float).tiny)
    total = max(weight * float(change @ solve @ change), np.finfo(float).tiny)
    count = len(reference.parameters)
    found = [
        ChangeCause(name, index < count, float(gain), float(gain) / total, ())
        for index, (name, gain) in enumerate(zip(reference.names, gains, strict=True))
    ]
    return choose_cause(found)


def choose_cause(causes: Sequence[ChangeCause]) -> ChangeCause:
    """Return the cause with the largest gain, and the names of its equivalents."""
    best, *others = sorted(causes, key=lambda each: -each.gain)
    near = (each.name for each in others if each.gain > best.gain - EQUIVALENCE)
    return replace(best, equivalents=tuple(near))


def estimate_correlation(values: Signal) -> NDArray[np.float64]:
    """Estimate a correlation matrix from few records, shrunk towards the identity.

    Schaefer and Strimmer, A shrinkage approach to large-scale covariance matrix estimation, Statistical
    Applications in Genetics and Molecular Biology 4, 2005, target D.

    Parameters
    ----------
    values : ndarray, shape (records, sequences)
    """
    count, sequences = values.shape
    deviation = values - np.mean(values, axis=0)
    unit = deviation / np.maximum(np.std(values, axis=0), np.finfo(float).tiny)
    correlation: NDArray[np.float64] = unit.T @ unit / count
    variance = ((unit**2).T @ unit**2 / count - correlation**2) / (count - 1)
    is_other = ~np.eye(sequences, dtype=bool)
    energy = float(np.sum(correlation[is_other] ** 2))
    shrinkage = min(1.0, float(np.sum(variance[is_other])) / energy) if energy else 1.0
    return (1.0 - shrinkage) * correlation + shrinkage * np.eye(sequences)
