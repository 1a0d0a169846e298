"""Frequency response of several inputs and outputs from blocks of any record, without an error of the ends.

The spectra of a block are those of the response, and of a transient that the unknown past and the end of the
block cause. Both are smooth over a few lines, so that a polynomial of the second degree describes them there
(local polynomial method: Pintelon and Schoukens, System Identification, 2nd ed., Wiley 2012, chapter 7). Of
whole periods in the steady state, the transient is zero.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

#: Terms of the polynomials.
_TERMS = 3

#: Equations for each unknown of the polynomials of the response.
_EQUATIONS = 1.5

#: Least power of an excited line, relative to the largest one, and of a combination of inputs.
_LEAST_POWER, _RIDGE = 1e-6, 1e-10


@dataclass(frozen=True, slots=True, eq=False)
class FrequencyResponse:
    """Response at some frequencies, with its weight in the free run.

    Attributes
    ----------
    frequencies : ndarray, shape (lines,)
        In radians per sample.
    values : ndarray of complex, shape (lines, outputs, inputs)
    power : ndarray of complex, shape (lines, inputs, inputs)
        A deviation d of the response of an output increases the squared error of its free run by
        ``d power d*``, summed over the lines.
    variances : ndarray, shape (outputs,)
        Mean variance of a line of the spectrum of each output that the response does not explain: noise, and
        nonlinear distortion.
    lines : int
        Lines of the spectra that the frequencies describe.
    """

    frequencies: NDArray[np.float64]
    values: NDArray[np.complex128]
    power: NDArray[np.complex128]
    variances: NDArray[np.float64]
    lines: int

    @property
    def spacing(self) -> int:
        """Number of equations that the values were made of, for one real number of each of them."""
        return max(1, self.lines // max(1, len(self.frequencies)))


def estimate_response(u: NDArray[np.float64], y: NDArray[np.float64]) -> FrequencyResponse | None:
    """Estimate the frequency response from blocks of equal length.

    Parameters
    ----------
    u : ndarray, shape (blocks, samples, inputs)
    y : ndarray, shape (blocks, samples, outputs)

    Returns
    -------
    FrequencyResponse or None
        None if the blocks are too short, or inputs depend on each other at all frequencies.
    """
    blocks, samples, inputs = u.shape
    # The transient of every block has its own polynomial.
    width = _TERMS + int(np.ceil(_EQUATIONS * _TERMS * inputs / blocks))
    width += 1 - width % 2
    spectra_u, spectra_y = (np.fft.rfft(each, axis=1) / np.sqrt(samples) for each in (u, y))
    # The first line is that of the means, and the last one is real. Periodic inputs excite some of the lines.
    excited = np.mean(np.abs(spectra_u) ** 2, axis=0).min(axis=1)[1 : samples // 2]
    lines = 1 + np.flatnonzero(excited > _LEAST_POWER * excited.max())
    first = np.arange(0, len(lines) - width + 1, width // 2 + 1)
    if len(first) < width:
        return None
    near = lines[first[:, None] + np.arange(width)]
    centres = near[:, width // 2]
    distances = (near - centres[:, None]) / np.abs(near - centres[:, None]).max(axis=1, keepdims=True)
    powers = distances[:, :, None] ** np.arange(_TERMS)
    basis = np.linalg.qr(powers)[0]
    rows_u, rows_y = spectra_u[:, near], spectra_y[:, near]
    terms = (rows_u[..., None, :] * powers[:, :, :, None]).reshape(blocks, len(centres), width, -1)
    terms, found_y = (_project(each, basis) for each in (terms, rows_y))
    normal = terms.conj().swapaxes(1, 2) @ terms
    sides = terms.conj().swapaxes(1, 2) @ found_y
    total = np.sum(np.abs(found_y) ** 2, axis=1)
    ridge = _RIDGE * np.einsum("fii->f", normal.real)[:, None, None] * np.eye(normal.shape[1])
    normal = normal + ridge
    found = np.linalg.solve(normal, sides)
    squares = total - np.einsum("fip,fip->fp", sides.conj(), found).real
    outer = normal[:, inputs:, :inputs]
    power = normal[:, :inputs, :inputs] - outer.conj().swapaxes(1, 2) @ np.linalg.solve(
        normal[:, inputs:, inputs:], outer
    )
    freedom = blocks * (width - _TERMS) - _TERMS * inputs
    variances = np.maximum(squares, 0.0).mean(axis=0) / freedom
    return FrequencyResponse(
        2.0 * np.pi * centres / samples,
        np.ascontiguousarray(found[:, :inputs].swapaxes(1, 2)),
        power,
        np.maximum(variances, np.finfo(float).tiny),
        len(lines),
    )


def _project(rows: NDArray[np.complex128], basis: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Remove polynomials over the lines, shape (blocks, centres, lines, columns); join the blocks' lines."""
    rows = rows - basis @ (basis.swapaxes(1, 2) @ rows)
    blocks, centres, width, columns = rows.shape
    return np.ascontiguousarray(rows.transpose(1, 0, 2, 3)).reshape(centres, blocks * width, columns)
