"""Transfer functions of few zeros in continuous time near a model, by weighted iterations.

The equation error of a transfer function, divided by the denominator of the iteration before, is linear in
the coefficients (Sanathanan & Koerner 1963). Partial fractions of the poles before keep it well conditioned
(Gustavsen & Semlyen 1999). The weights are those of the deviance that the difference of the models costs.
"""

from collections.abc import Iterator, Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from islands.estimation.linear.regression import Fit
from islands.estimation.linear.sections import Signal, Signals
from islands.estimation.linear.starts import HighOrder

Spectrum = NDArray[np.complexfloating[Any, Any]]

#: Frequencies that are taken one by one, and the part by which the others grow.
_SINGLE, _GROWTH = 30, 0.03

#: Samples by which the dead times are shorter than those of the model.
_EARLIER = (-40, -28, -20, -14, -9, -6, -4, -2, -1, 0, 1, 2, 3, 5, 8, 12, 20)

#: Least damping ratio, so that no frequency is a pole.
_LEAST_DAMPING = 1e-3

#: Transfer functions of each input that are combined.
_OWN = 2

#: Iterations.
_ITERATIONS = 5


class Reduced(NamedTuple):
    """A transfer function near a model.

    Attributes
    ----------
    poles : ndarray, shape (order,)
        In continuous time and samples, without integrators.
    drives : ndarray of bool, shape (outputs, inputs, order)
        Whether a pole is in the response of an output to an input.
    loss : float
        Increase of the deviance that is expected.
    integrators, zeros, delays : ndarray of int64, shape (outputs, inputs)
    """

    poles: Spectrum
    drives: NDArray[np.bool_]
    loss: float
    integrators: NDArray[np.int64]
    zeros: NDArray[np.int64]
    delays: NDArray[np.int64]

    @property
    def size(self) -> int:
        """Number of poles and zeros."""
        return self.poles.size + int(self.zeros.sum())

    @property
    def excess(self) -> NDArray[np.int64]:
        """Poles of every response less its zeros."""
        orders: NDArray[np.int64] = self.drives.sum(axis=2) + self.integrators
        return orders - self.zeros


class Response(NamedTuple):
    """Frequency response of a model, and what its difference to another one costs.

    Attributes
    ----------
    frequencies : ndarray
        In radians for each sample.
    values : ndarray, shape (outputs, inputs, frequencies)
    weights : ndarray, shape (outputs, inputs, frequencies)
        The squares of weighted differences add up to a deviance.
    delays : ndarray of int64, shape (outputs, inputs)
        Dead times near those of the process.
    """

    frequencies: Signal
    values: Spectrum
    weights: Signal
    delays: NDArray[np.int64]

    def take_input(self, place: int) -> "Response":
        """Return the response to one input."""
        own = np.s_[:, [place]]
        return Response(self.frequencies, self.values[own], self.weights[own], self.delays[own])


def reduce_inputs(
    response: Response, orders: Sequence[int], integrators: NDArray[np.int64], penalty: float
) -> Iterator[Reduced]:
    """Yield transfer functions whose inputs have poles of their own.

    Parameters
    ----------
    response : Response
    orders : sequence of int
        Without the integrators.
    integrators : ndarray of int64, shape (inputs,)
    penalty : float
        Cost of a parameter. Of every input, the transfer functions of the two least costs are taken.
    """
    choices = []
    for place, count in enumerate(integrators.tolist()):
        own = reduce_model(response.take_input(place), [order + count for order in orders], count, 1)
        choices.append(sorted(own, key=lambda each: each.loss + penalty * each.size)[:_OWN])
    for parts in product(*choices):
        drives = np.zeros((*response.delays.shape, sum(part.poles.size for part in parts)), bool)
        end = 0
        for place, part in enumerate(parts):
            drives[:, place, end : end + part.poles.size] = True
            end += part.poles.size
        yield Reduced(
            np.concatenate([part.poles for part in parts]),
            drives,
            sum(part.loss for part in parts),
            np.hstack([part.integrators for part in parts]),
            np.hstack([part.zeros for part in parts]),
            np.hstack([part.delays for part in parts]),
        )


def reduce_model(
    response: Response,
    orders: Sequence[int],
    integrators: int = 0,
    excess: int = 2,
    bound: tuple[float, float] = (0.0, np.inf),
) -> Iterator[Reduced]:
    """Yield a transfer function for each order and each number of zeros, less by an excess or more.

    The bound is the cost of a parameter, and the largest cost of interest. Transfer functions are left out
    that exceed it with the loss of the largest one, as no part of that one has a smaller loss.
    """
    frequencies = response.frequencies
    s = 1j * frequencies
    # In units of the integrators, and of the input that is held.
    held = (1.0 - np.exp(-s)) / s
    target = response.values / held * s**integrators * np.exp(s * response.delays[:, :, None])
    weights = response.weights * np.abs(held) / frequencies**integrators
    power = (np.square(weights) * np.abs(target) ** 2).sum(axis=(0, 1))
    if not power.any() or not np.isfinite(power).all():
        return
    share = np.cumsum(power) / power.sum()
    low, high = frequencies[np.searchsorted(share, [0.02, 0.98])]

    def begin(order: int) -> Spectrum:
        return -np.geomspace(max(low, 1e-4), 2.0 * max(high, low), order - integrators) + 0.0j

    def search(poles: Spectrum, zeros: int, place: int) -> tuple[Reduced, int]:
        """Return the best transfer function over the dead times near those of the model, and its place."""
        found: dict[int, Reduced] = {}
        # The loss has one minimum.
        waiting = [place, place - 1, place + 1]
        while waiting:
            at = waiting.pop(0)
            if at in found or not 0 <= at < len(_EARLIER):
                continue
            delays = np.maximum(response.delays - _EARLIER[at], 0)
            moved = target * np.exp(-s * (response.delays - delays)[:, :, None])
            moving, loss = _iterate(s, moved, weights, poles, zeros)
            drives = np.ones((*delays.shape, poles.size), bool)
            own, all_zeros = np.full_like(delays, integrators), np.full_like(delays, zeros)
            found[at] = Reduced(moving, drives, loss, own, all_zeros, delays)
            place = min(found, key=lambda each: found[each].loss)
            waiting += [each for each in (place - 1, place + 1) if each not in found and each not in waiting]
        return found[place], place

    place, (penalty, largest) = _EARLIER.index(0), bound
    least = 0.0
    if orders and np.isfinite(largest):
        least = search(begin(max(orders)), max(orders) - excess, place)[0].loss
    for order in orders:
        poles = begin(order)
        for zeros in range(order - excess + 1):
            if least + penalty * (poles.size + zeros * response.delays.size) > largest:
                break
            found, place = search(poles, zeros, place)
            poles = found.poles
            yield found


def sample_fit(fit: Fit) -> Response:
    """Return the frequency response of a fit."""
    structure = fit.structure
    frequencies, power = _measure_inputs(fit.signals)
    q = np.exp(-1j * frequencies)
    values = np.zeros((*structure.delays.shape, frequencies.size), np.complex128)
    weights = np.empty(values.shape)
    for output, coefficients in enumerate(fit.coefficients):
        at = 0
        for place, delay in enumerate(structure.delays[output]):
            for part in structure.parts:
                own = coefficients[at : at + part.size]
                numerator = own[0] * q if part.size == 1 else (own[0] + own[1]) * q - own[1] * q**2
                values[output, place] += numerator / np.polyval([*part[::-1], 1.0], q)
                at += part.size
            if structure.leads[output, place]:
                # A direct path is no response of the modes.
                values[output, place] += coefficients[at] if delay else 0.0
                at += 1
            values[output, place] *= q**delay
        past, moving = structure.noise[output]
        noise = np.abs(np.polyval([*moving[::-1], 1.0], q) / np.polyval([*-past[::-1], 1.0], q)) ** 2
        weights[output] = np.sqrt(power / (fit.squares[output] / fit.counts[output] * noise + 1e-300))
    return Response(frequencies, values, weights, structure.delays)


def sample_high_order(signals: Signals, high: HighOrder) -> Response:
    """Return the frequency response of a high-order ARX model."""
    frequencies, power = _measure_inputs(signals)
    q, values, weights = np.exp(-1j * frequencies), [], []
    for denominator, numerators, variance in high.polynomials:
        divisor = np.polyval(denominator[::-1], q)
        # A direct path is no response of the modes.
        values.append([np.polyval(row[::-1], q) / divisor - row[0] for row in numerators])
        # Where an input has no power, the noise of the model may be much too small.
        weights.append(np.sqrt(power / (variance + 1e-300)) * np.minimum(np.abs(divisor), 1.0))
    return Response(frequencies, np.array(values), np.array(weights), high.delays)


def _measure_inputs(signals: Signals) -> tuple[Signal, Signal]:
    """Return frequencies, and the squares that a response of 1 to an input adds to the output."""
    half = signals.samples // 2
    edges = [*range(1, min(_SINGLE, half) + 1)]
    while edges[-1] < half:
        edges.append(max(edges[-1] + 1, round(edges[-1] * (1.0 + _GROWTH))))
    edges = [edge for edge in edges if edge < half]
    # A window, as the jump from the end of a record to its beginning is not in the input.
    window = np.hanning(signals.samples) * np.sqrt(8.0 / 3.0)
    moving = signals.u - signals.u.mean(axis=1, keepdims=True)
    power = np.abs(np.fft.rfft(window * moving)[:, :half]) ** 2
    bins = np.add.reduceat(np.arange(half), edges) / np.diff([*edges, half])
    return 2.0 * np.pi / signals.samples * bins, 2.0 / signals.samples * np.add.reduceat(power, edges, axis=1)


def _iterate(
    s: Spectrum, target: Spectrum, weights: Signal, poles: Spectrum, zeros: int
) -> tuple[Spectrum, float]:
    """Return the best poles of some iterations, and the weighted square of the error that they leave."""
    unit = float(np.exp(np.log(np.abs(poles) + 1e-12).mean()))
    powers, wanted = (s / unit) ** np.arange(zeros + 1)[:, None], target * weights
    best = poles, np.inf
    for left in range(_ITERATIONS, -1, -1):
        numerators = powers / np.prod((s - poles[:, None]) / unit, axis=0)
        fractions, mix = _list_fractions(s, poles)
        # The numerators are eliminated, and the last column is the error with those of these poles.
        parts = np.concatenate(
            [weights[:, :, None] * numerators, wanted[:, :, None] * fractions, wanted[:, :, None]], axis=2
        )
        columns = np.concatenate([parts.real, parts.imag], axis=3).reshape(-1, parts.shape[2], 2 * s.size)
        factors = np.asarray(np.linalg.qr(columns.swapaxes(1, 2), mode="r"))
        matrix = factors[:, zeros + 1 :, zeros + 1 :].reshape(-1, poles.size + 1)
        if not np.isfinite(matrix).all():
            break
        loss = float(matrix[:, -1] @ matrix[:, -1])
        best = (poles, loss) if loss < best[1] else best
        if not left:
            break
        norms = np.linalg.norm(matrix, axis=0) + 1e-300
        change = np.linalg.lstsq(matrix[:, :-1] / norms[:-1], -matrix[:, -1], rcond=1e-12)[0] / norms[:-1]
        if not np.isfinite(change).all():
            break
        # The zeros of one plus the partial fractions.
        try:
            moved = np.linalg.eigvals(np.diag(poles) - mix @ change)
        except np.linalg.LinAlgError:  # The changes are so large that they overflow.
            break
        real, pairs = moved[np.abs(moved.imag) < 1e-9].real, moved[moved.imag >= 1e-9]
        pairs = np.column_stack([pairs, pairs.conj()]).ravel()
        moved = np.concatenate([real, pairs])
        if moved.size != poles.size:  # Poles that are equal but for rounding are not in pairs.
            break
        poles = -np.maximum(np.abs(moved.real), _LEAST_DAMPING * np.abs(moved)) + 1j * moved.imag
        if not poles.all():
            break
    return best


def _list_fractions(s: Spectrum, poles: Spectrum) -> tuple[Spectrum, Spectrum]:
    """Return real sums of partial fractions, shape (order, frequencies), and what they add up."""
    mix, at = np.zeros((poles.size, poles.size), np.complex128), 0
    while at < poles.size:
        if poles[at].imag == 0.0:
            mix[at, at] = 1.0
            at += 1
        else:
            mix[at, at : at + 2] = 1.0, 1.0j
            mix[at + 1, at : at + 2] = 1.0, -1.0j
            at += 2
    fractions = 1.0 / (s - poles[:, None])
    return (mix.T @ fractions), mix
