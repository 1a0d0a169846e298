"""Numerators of sections that follow from few zeros in continuous time, and states that follow from rest.

An input that is held between samples drives poles ``p``. The residues are linear in the numerator in
continuous time, and the poles in discrete time are ``exp(p)``. Free numerators of the difference equation
would be more parameters, as most of its zeros follow from sampling (Astrom, Hagander & Sternby 1984).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from islands.estimation.linear.sections import Section, Signal

#: Least distance of two poles, as a part of their magnitude. The numerators are smooth at a double pole.
_SEPARATION = 1e-5


class Residues(NamedTuple):
    """Residues of poles in continuous time for each coefficient of a numerator.

    Attributes
    ----------
    poles, rates : ndarray, shape (points, order)
        In discrete and in continuous time, of several systems that are near the first one.
    growth : ndarray, shape (points, order)
        Response of each pole to an input of 1 for a sample.
    values : ndarray, shape (points, order, zeros + 1)
    """

    poles: NDArray[np.complex128]
    rates: NDArray[np.complex128]
    growth: NDArray[np.complex128]
    values: NDArray[np.complex128]


def find_residues(poles: NDArray[np.complex128], zeros: int) -> Residues | None:
    """Return the residues of poles in discrete time; None if one has no continuous time.

    Parameters
    ----------
    poles : ndarray, shape (points, order)
        In the order of the sections; of several systems that are near the first one.
    zeros : int
        Zeros in continuous time.
    """
    if np.any((poles.imag == 0.0) & (poles.real <= 0.0)):
        return None
    rates = np.log(poles)
    moving = np.abs(rates[0][rates[0] != 0.0])
    unit = float(np.exp(np.log(moving).mean())) if moving.size else 1.0
    rates = _separate((rates / unit).astype(np.complex128))
    differences = rates[:, :, None] - rates[:, None] + np.eye(rates.shape[1])
    values = rates[:, :, None] ** np.arange(zeros + 1) / differences.prod(axis=2)[:, :, None]
    rates *= unit
    return Residues(np.exp(rates), rates, _grow(rates), values)


def map_numerators(residues: Residues, sizes: Sequence[int], early: Signal | None) -> Signal | None:
    """Return what the numerators of sections are for each coefficient in continuous time.

    Parameters
    ----------
    residues : Residues
    sizes : sequence of int
        Orders of the sections.
    early : ndarray, shape (points,), optional
        Part of a sample by which the response begins before the sample that the numerators begin with; the
        direct term is then in the last row.

    Returns
    -------
    ndarray, shape (points, rows, zeros + 1), optional
        Rows of the coordinates of `regression.Fit.coefficients`. None if poles are so fast that numerators
        overflow.
    """
    poles, rates, weights, values = residues
    found = np.empty((len(poles), poles.shape[1] + (early is not None), values.shape[2]))
    if early is not None:
        parts = early[:, None] * _grow(early[:, None] * rates)
        found[:, -1] = (parts[:, :, None] * values).sum(axis=1).real
        weights = weights * np.exp(early[:, None] * rates)
    values = values * weights[:, :, None]
    at = 0
    for size in sizes:
        one = values[:, at]
        if size == 1:
            found[:, at] = one.real
        else:
            other, pole, last = values[:, at + 1], poles[:, at, None], poles[:, at + 1, None]
            found[:, at] = (one * (1.0 - last) + other * (1.0 - pole)).real
            found[:, at + 1] = (one * last + other * pole).real
        at += size
    return found if np.isfinite(found).all() else None


def _grow(rates: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return ``(exp(p) - 1) / p``, 1 for 0."""
    safe = np.where(rates == 0.0, 1.0, rates)
    return np.where(rates == 0.0, 1.0, np.expm1(safe) / safe)


def _separate(rates: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return the poles with pairs that coincide moved apart."""
    least = _SEPARATION * np.maximum(np.abs(rates), 0.01)
    near = np.abs(rates[:, :, None] - rates[:, None]) < least[:, :, None]
    if np.count_nonzero(near) == rates.size:
        return rates
    moved = rates.copy()
    for i in range(rates.shape[1]):
        for j in range(i):
            moved[:, i] += least[:, i] * near[:, i, j]
            moved[:, j] -= least[:, i] * near[:, i, j]
    return moved


def find_rest(section: Section) -> Signal:
    """Return the states of a section after an input of 1 for ever, for each of its coefficients."""
    sum_ = 1.0 + float(section.sum())
    if section.size == 1:
        return np.array([[1.0 / sum_]])
    return np.array([[(1.0 - section[1]) / sum_, -1.0], [section[1] / sum_, 1.0]])
