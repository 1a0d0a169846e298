"""Probabilities of the first lags at which an output responds to its inputs.

The output is the sum of the responses to all inputs and of noise. The response to an input begins at one of
many lags, and is that of a gain with two time constants, with or without a zero. Models with all lags of all
inputs are compared by the information criterion of Schwarz, which approximates the logarithm of the
probability of the record. A slow input makes neighbouring lags, or a lag and a time constant, equally
probable; correlated inputs do so for pairs of lags. The noise is autoregressive: all signals are filtered by
its inverse, so that correlated errors do not count as independent ones.

A part of the evidence is not counted, since real responses are only similar to the models (`_POWER`).

The cost of a model does not depend on the length of the record. Each input is filtered by low-passes with
time constants at equal ratios, whose inner products at all lags are computed once. The response of any other
time constant is interpolated between them. The time constants minimise the squared error with the gains
eliminated (variable projection: Golub and Pereyra, 1973).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, log

import numpy as np
from numpy.typing import NDArray

from islands.records.dataset import Dataset, join
from islands.records.noise_model import MAX_ORDER, NoiseModel, fit_noise
from islands.records.segments import find_bounds

Array = NDArray[np.float64]

#: Largest lag of one comparison, relative to the smallest, and inputs that are compared jointly, at most.
LARGEST, TOGETHER = 60, 3

#: Rows of a comparison, at most, parts of a longer record that contain them, and rows for each parameter.
_ROWS, _PARTS, _ROWS_PER_PARAMETER = 6000, 4, 5

#: Samples that are filtered at once.
_BLOCK = 64

#: Segments that are used, at most: the longest, because each has an initial state.
_SEGMENTS = 16

#: Time constant of the fastest low-pass in samples, ratio of two, low-passes of an interpolation, and
#: tabulated time constants between two.
_FASTEST, _RATIO, _NEIGHBOURS, _FINE = 0.25, 2.0, 6, 64

#: Assumed accuracy of a signal relative to its standard deviation.
_ACCURACY = 3e-5

#: Time constants from which a minimisation starts, in samples.
_STARTS = np.log([[3.0, 0.5], [10.0, 3.0], [40.0, 5.0], [150.0, 20.0]])

#: Steps of a minimisation, and step of a derivative.
_STEPS, _DIFFERENCE = 8, 1e-3

#: Gain in the logarithm of the likelihood, and relative to the best model, that ends a minimisation, and the
#: damping at which steps do not succeed any more.
_LEAST_GAIN, _LARGEST_DAMPING = 1e-2, 1e2

#: Distance of the lags of pairs of inputs that are tried first.
_STRIDE = 5

#: Probability beforehand of a response without dead time, at lag 0 or 1. Later lags are equally probable.
_AT_ONCE = 1.0 / 3.0

#: Power of the likelihood. Real responses are only similar to the models, and the time constants and the
#: noise are estimates: with a power of 1, values that are stated with 60 to 80 % are right in 20 to 50 %
#: (Grünwald and van Ommen, 2017, on the likelihood of models that are not exact).
_POWER = 0.4

#: Probability beyond each end of an interval.
_TAIL = 0.025

#: Standard deviations of a correlation that is not one by chance.
_VISIBLE = 5.0

#: Noise models that are estimated in turn.
_NOISE_MODELS = 2

#: Combinations of lags whose neighbours are compared, at most, and the logarithm of their probability
#: relative to the largest, at least.
_EXPANDED, _LEAST_LOG = 12, -6.0

#: Time constants and relative lags at which further inputs are read, which are not compared.
_FURTHER_CONSTANTS, _FURTHER_LAGS = (1.0, 8.0, 64.0), (0, 15, 30, 60)


@dataclass(frozen=True, slots=True)
class LagProbabilities:
    """Probabilities of the first lags of the response to an input.

    Attributes
    ----------
    first : int
        Lag of the first probability.
    values : ndarray, shape (lags,)
        Their sum is one.
    is_visible : bool
        Whether a model with a response to the input is more probable than one without.
    may_be_later : bool
        Whether the last lag is probable, or what the models leave of the output is correlated with the input
        at later lags.
    """

    first: int
    values: Array
    is_visible: bool
    may_be_later: bool

    @property
    def interval(self) -> tuple[int, int]:
        """Lags between which the response begins with a probability of 95 %."""
        low, high = np.searchsorted(np.cumsum(self.values), [_TAIL, 1.0 - _TAIL])
        return self.first + int(low), self.first + min(int(high), self.values.size - 1)


def weigh_lags(
    record: Dataset, places: Sequence[int], smallest: Sequence[int]
) -> tuple[LagProbabilities, ...] | None:
    """Return the probabilities of the first lags of some inputs; None if the record is too short.

    Parameters
    ----------
    record : Dataset
        Record without missing values.
    places : sequence of int
        Indices of at most `TOGETHER` inputs that vary, from 0.
    smallest : sequence of int
        Smallest lag of each of them that is compared.
    """
    record = _choose_parts(record)
    further = [u for place, u in enumerate(record.u.T) if place not in places and np.ptp(u) > 0.0]
    largest = min(LARGEST, max(record.segments) // 8)
    signals = _Signals.make(record, places, smallest, largest, further)
    if signals is None:
        return None
    return _Comparison(signals, smallest, largest).weigh()


def _choose_parts(record: Dataset) -> Dataset:
    """Return parts of a long record at equal distances, or the longest segments."""
    if record.samples > _ROWS:
        length = _ROWS // _PARTS
        starts = [part * (record.samples - length) // (_PARTS - 1) for part in range(_PARTS)]
        record = join(tuple(record[start : start + length] for start in starts))
    if len(record.segments) > _SEGMENTS:
        longest = sorted(record.bounds, key=lambda bounds: bounds[0] - bounds[1])[:_SEGMENTS]
        record = join(tuple(record[begin:end] for begin, end in sorted(longest)))
    return record


def _standardise(signals: Array) -> Array:
    largest = np.abs(signals).max(axis=-1, keepdims=True)
    signals = signals / np.where(largest > 0.0, largest, 1.0)
    centred = signals - signals.mean(axis=-1, keepdims=True)
    size = centred.std(axis=-1, keepdims=True)
    scaled: Array = centred / np.where(size > 0.0, size, 1.0)
    return scaled


@dataclass(frozen=True, slots=True)
class _Signals:
    """Output, low-passed inputs and disturbing columns of the compared rows.

    Attributes
    ----------
    y : ndarray, shape (samples,)
    filtered : ndarray, shape (inputs, low-passes, samples)
        The inputs with their smallest lag.
    others : ndarray, shape (columns, samples)
        Constant, responses to initial states, and further inputs.
    bounds : list of tuple of int
        First compared sample of every segment, and the one after the last.
    segments : tuple of int
    """

    y: Array
    filtered: Array
    others: Array
    bounds: list[tuple[int, int]]
    segments: tuple[int, ...]

    @staticmethod
    def make(
        record: Dataset,
        places: Sequence[int],
        smallest: Sequence[int],
        largest: int,
        further: Sequence[Array],
    ) -> "_Signals | None":
        """Filter the signals of a record; None if it has too few samples."""
        first = max(smallest) + largest + MAX_ORDER
        bounds = [(begin + first, end) for begin, end in record.bounds if end - begin > first]
        longest = max(record.segments)
        constants = _FASTEST * _RATIO ** np.arange(ceil(log(longest / _FASTEST) / log(_RATIO)) + 1)
        inputs = _standardise(record.u[:, list(places)].T)
        others = [np.ones(record.samples)]
        for begin, end in record.bounds:
            # Faster responses to the initial state have ended at the first compared sample.
            for constant in constants[constants > first / 8.0]:
                response = np.zeros(record.samples)
                response[begin:end] = np.exp(-np.arange(end - begin) / constant)
                others.append(response)
        for constant in _FURTHER_CONSTANTS if further else ():
            for signal in _low_pass(_standardise(np.array(further)), constant, record.bounds):
                others += [_delay(signal, lag, record.bounds) for lag in _FURTHER_LAGS if lag <= largest]
        rows = sum(end - begin for begin, end in bounds)
        if rows < _ROWS_PER_PARAMETER * (4 * len(places) + len(others)):
            return None
        late = np.array(
            [_delay(signal, lag, record.bounds) for signal, lag in zip(inputs, smallest, strict=True)]
        )
        filtered = np.array([_low_pass(late, constant, record.bounds) for constant in constants])
        return _Signals(
            _standardise(record.y), filtered.swapaxes(0, 1), np.array(others), bounds, record.segments
        )

    def take(self, series: Array) -> Array:
        """Return the compared samples of series."""
        return np.concatenate([series[..., begin:end] for begin, end in self.bounds], axis=-1)


def _delay(signal: Array, lag: int, bounds: Sequence[tuple[int, int]]) -> Array:
    """Return a signal that is late by a number of samples, and before that equal to its first value."""
    late = np.empty_like(signal)
    for begin, end in bounds:
        start = min(begin + lag, end)
        late[begin:start] = signal[begin]
        late[start:end] = signal[begin : end - lag] if start < end else signal[:0]
    return late


def _low_pass(signals: Array, constant: float, bounds: Sequence[tuple[int, int]]) -> Array:
    """Filter signals by a low-pass with a gain of one that is in equilibrium at the start of a segment."""
    pole = float(np.exp(-1.0 / constant))
    # By blocks, since the import of a compiled filter takes longer than an inspection.
    decay = pole ** np.arange(1, _BLOCK + 1)
    lags = np.subtract.outer(np.arange(_BLOCK), np.arange(_BLOCK))
    response = np.where(lags >= 0, (1.0 - pole) * pole ** np.maximum(lags, 0), 0.0)
    filtered = np.empty_like(signals)
    for begin, end in bounds:
        state = signals[:, begin]
        for first in range(begin, end, _BLOCK):
            block = signals[:, first : min(first + _BLOCK, end)]
            size = block.shape[1]
            filtered[:, first : first + size] = (
                np.outer(state, decay[:size]) + block @ response[:size, :size].T
            )
            state = filtered[:, first + size - 1]
    return filtered


class _Products:
    """Inner products of the low-passed inputs at all lags, of the output and of the disturbing columns."""

    def __init__(self, signals: _Signals, noise: NoiseModel | None, largest: int) -> None:
        def whiten(series: Array) -> Array:
            if noise is None:
                return series
            return np.array([noise.whiten(row, signals.segments) for row in series])

        inputs, series, samples = signals.filtered.shape
        x = whiten(signals.filtered.reshape(-1, samples))
        basis = _orthogonalise(signals.take(whiten(signals.others)))
        y = signals.take(whiten(signals.y[None]))[0]
        self.residual = y - (basis @ y) @ basis
        target = np.vstack([basis, self.residual])
        lags, row = largest + 1, 0
        # The first lag is at most the second one, at first.
        products = np.zeros((lags, lags, inputs, inputs, series, series))
        self._projections = np.zeros((lags, inputs * series, len(target)))
        for begin, end in signals.bounds:
            part = target[:, row : row + end - begin]
            row += end - begin
            for lag in range(lags):
                late = x[:, begin - lag : end - lag]
                product = (x[:, begin:end] @ late.T).reshape(inputs, series, inputs, series)
                products[0, lag] += product.swapaxes(1, 2)
                self._projections[lag] += late @ part.T
            # Products one lag later have one more row at the start, and one less at the end.
            more, less = (
                x[:, at - largest : at][:, ::-1].T.reshape(largest, inputs, series) for at in (begin, end)
            )
            for lag in range(largest):
                for sign, edge in ((1.0, more), (-1.0, less)):
                    outer = edge[lag][:, None, :, None] * edge[lag:, None, :, None, :]
                    products[lag + 1, lag + 1 :] += sign * outer
        for lag in range(largest):
            products[lag + 1, lag + 1 :] += products[lag, lag:-1]
            products[lag + 1 :, lag] = products[lag, lag + 1 :].transpose(0, 2, 1, 4, 3)
        self._products = products
        self.rows = row
        self.energy = float(self.residual @ self.residual) + _ACCURACY**2 * row

    def take(self, lags: NDArray[np.int64]) -> tuple[Array, Array]:
        """Return the products of inputs at some lags, and with the output, without the disturbing columns.

        Parameters
        ----------
        lags : ndarray of int, shape (cases, inputs)

        Returns
        -------
        tuple of ndarray
            Shapes (cases, n, n) and (cases, n), where n is the number of inputs times that of low-passes.
        """
        inputs, series = self._products.shape[2::2]
        every = np.arange(inputs)
        blocks = self._products[lags[:, :, None], lags[:, None, :], every[:, None], every]
        products = blocks.swapaxes(2, 3).reshape(len(lags), inputs * series, inputs * series)
        projections = self._projections[np.repeat(lags, series, axis=1), np.arange(inputs * series)]
        basis = projections[..., :-1]
        return products - basis @ basis.swapaxes(1, 2), projections[..., -1]


def _orthogonalise(columns: Array) -> Array:
    """Return an orthonormal basis of columns; those that depend on others are left out."""
    norms = np.sqrt(np.sum(columns**2, axis=1, keepdims=True))
    basis, triangle = np.linalg.qr((columns / np.where(norms > 0.0, norms, 1.0)).T)
    kept: Array = basis[:, np.abs(np.diag(triangle)) > 1e-6].T
    return kept


@dataclass(frozen=True, slots=True)
class _Fits:
    """Models of several cases: logarithms of the time constants, gains, and squared errors."""

    lags: NDArray[np.int64]
    constants: Array
    gains: Array
    squares: Array

    def pick(self, case: int) -> "_Fits":
        """Return one case."""
        one = slice(case, case + 1)
        return _Fits(self.lags[one], self.constants[one], self.gains[one], self.squares[one])


class _Comparison:
    """Comparison of the lags of some inputs, relative to their smallest lags."""

    def __init__(self, signals: _Signals, smallest: Sequence[int], largest: int) -> None:
        self._signals, self._smallest, self._largest = signals, smallest, largest
        self._inputs, self._series, _ = signals.filtered.shape
        self._products = _Products(signals, None, largest)
        self._weights = _tabulate_weights(self._series)
        lags = np.arange(largest + 1)
        self._prior = np.array([_weigh_beforehand(least + lags) for least in smallest])

    def weigh(self) -> tuple[LagProbabilities, ...]:
        """Return the probabilities of the lags of all inputs."""
        shape = (1, self._inputs)
        lags = np.maximum(0, np.ones(shape, dtype=np.int64) - np.array(self._smallest))
        start = _Fits(lags, np.broadcast_to(_STARTS[1], (*shape, 2)).copy(), np.zeros(shape), np.ones(1))
        found = self._descend(self._try_pairs(start), zeros=0)
        for _ in range(_NOISE_MODELS):
            self._whiten(found)
            found = self._descend(found, zeros=0)
        kinds = {zeros: found if zeros == 0 else self._descend(found, zeros) for zeros in (0, 1)}
        marginal = self._add_up(kinds)
        best, zeros = max(
            ((fits, zeros) for zeros, fits in kinds.items()), key=lambda kind: self._judge(*kind)[0]
        )
        later = self._is_correlated_later(found)
        return tuple(
            LagProbabilities(
                self._smallest[place],
                values,
                self._is_visible(best, zeros, place),
                later[place] or float(values[-1]) > _TAIL,
            )
            for place, values in enumerate(marginal)
        )

    def _judge(self, fits: _Fits, zeros: int) -> Array:
        """Return the logarithms of the probabilities of models, up to a constant."""
        rows, count = self._products.rows, zeros * self._inputs
        prior = self._prior[np.arange(self._inputs), fits.lags].sum(axis=1)
        judged: Array = prior - 0.5 * _POWER * (rows * np.log(fits.squares) + count * log(rows))
        return judged

    def _whiten(self, fits: _Fits) -> None:
        """Estimate the noise from the residual of a model, and filter all signals by its inverse."""
        signals, left = self._signals, self._subtract(fits)
        others, rows = signals.take(signals.others), signals.take(left)
        rows = rows - np.linalg.lstsq(others.T, rows, rcond=1e-8)[0] @ others
        lengths = [end - begin for begin, end in signals.bounds]
        self._noise = fit_noise(rows, segments=lengths, difference_orders=())
        self._products = _Products(signals, self._noise, self._largest)

    def _subtract(self, fits: _Fits) -> Array:
        """Return the output without the responses of a model without zeros."""
        left = self._signals.y.copy()
        shapes = self._make_shapes(fits.constants, zeros=0)[0, :, :, 0] * fits.gains[0][:, None]
        for place, lag in enumerate(fits.lags[0].tolist()):
            response = shapes[place] @ self._signals.filtered[place]
            left -= _delay(response, lag, find_bounds(self._signals.segments, left.size))
        return left

    def _is_correlated_later(self, fits: _Fits) -> list[bool]:
        """Return whether the residual is correlated with inputs at lags after those that are compared."""
        signals, samples = self._signals, self._signals.y.size
        others = _orthogonalise(signals.take(self._filter(signals.others)))
        rows = signals.take(self._filter(self._subtract(fits)[None]))[0]
        rows = rows - (others @ rows) @ others
        residual = np.zeros(samples)
        residual[np.concatenate([np.arange(begin, end) for begin, end in signals.bounds])] = rows
        inputs = self._filter(signals.filtered[:, 0])
        spectrum = np.conj(np.fft.rfft(inputs - inputs.mean(axis=1, keepdims=True), 2 * samples))
        correlation = np.fft.irfft(np.fft.rfft(residual, 2 * samples) * spectrum)
        later = np.abs(correlation[:, self._largest + 1 : samples // 2])
        by_chance = np.sqrt(np.mean(rows**2) * rows.size * np.var(inputs, axis=1))
        return [bool(each) for each in (later > _VISIBLE * by_chance[:, None]).any(axis=1)]

    def _filter(self, series: Array) -> Array:
        return np.array([self._noise.whiten(row, self._signals.segments) for row in series])

    def _try_pairs(self, fits: _Fits) -> _Fits:
        """Return the best model in which the lags of every pair of inputs were changed together."""
        grid = np.arange(0, self._largest + 1, _STRIDE)
        for one in range(self._inputs):
            for two in range(one):
                lags = np.broadcast_to(fits.lags[0], (grid.size, grid.size, self._inputs)).copy()
                lags[..., one], lags[..., two] = grid[:, None], grid
                lags = np.vstack([fits.lags, lags.reshape(-1, self._inputs)])
                tried = []
                for start in _STARTS:
                    constants = np.broadcast_to(fits.constants, (len(lags), self._inputs, 2)).copy()
                    constants[1:, [one, two]] = start
                    tried.append(self._take_best(self._minimise(lags, constants, 0, steps=3), 0))
                fits = min(tried, key=lambda each: float(each.squares[0]))
        return fits

    def _take_best(self, fits: _Fits, zeros: int) -> _Fits:
        return fits.pick(int(np.argmax(self._judge(fits, zeros))))

    def _descend(self, fits: _Fits, zeros: int) -> _Fits:
        """Return the most probable model, found by changes of the lag of one input at a time."""
        is_first = True
        while True:
            before = fits.lags
            for place in range(self._inputs):
                fits = self._take_best(self._scan(fits, place, zeros, is_first and zeros == 0), zeros)
            if (fits.lags == before).all() or self._inputs == 1:
                return fits
            is_first = False

    def _scan(self, fits: _Fits, place: int, zeros: int, is_started: bool = False) -> _Fits:
        """Return the models with all lags of one input; ``is_started`` tries several time constants."""
        count = self._largest + 1
        lags = np.broadcast_to(fits.lags, (count, self._inputs)).copy()
        lags[:, place] = np.arange(count)
        constants = np.broadcast_to(fits.constants, (count, self._inputs, 2)).copy()
        if is_started:
            starts = np.array([constants] * (1 + len(_STARTS)))
            starts[1:, :, place] = _STARTS[:, None]
            squares = np.array([self._minimise(lags, each, zeros, steps=0).squares for each in starts])
            constants = starts[np.argmin(squares, axis=0), np.arange(count)]
        return self._minimise(lags, constants, zeros)

    def _add_up(self, kinds: dict[int, _Fits]) -> Array:
        """Return the probabilities of the lags of every input, shape (inputs, lags).

        The neighbours of the most probable combinations of lags are compared until those that are left are
        improbable.
        """
        judged: dict[tuple[int, ...], float] = {}
        expanded: set[tuple[int, ...]] = set()
        waiting = {tuple(map(int, fits.lags[0])): 0.0 for fits in kinds.values()}
        while waiting and len(expanded) < _EXPANDED:
            lags = max(waiting, key=waiting.__getitem__)
            expanded.add(lags)
            for place in range(self._inputs):
                for zeros, fits in kinds.items():
                    scanned = self._scan(
                        _Fits(np.array([lags]), fits.constants, fits.gains, fits.squares), place, zeros
                    )
                    for each, value in zip(
                        scanned.lags.tolist(), self._judge(scanned, zeros).tolist(), strict=True
                    ):
                        at = (zeros, *each)
                        judged[at] = max(value, judged.get(at, -np.inf))
            most = max(judged.values())
            waiting = {
                at[1:]: value
                for at, value in judged.items()
                if value > most + _LEAST_LOG and at[1:] not in expanded
            }
        marginal = np.zeros((self._inputs, self._largest + 1))
        most = max(judged.values())
        for at, value in judged.items():
            marginal[np.arange(self._inputs), at[1:]] += np.exp(value - most)
        normalised: Array = marginal / marginal.sum(axis=1, keepdims=True)
        return normalised

    def _is_visible(self, fits: _Fits, zeros: int, place: int) -> bool:
        """Return whether the response to an input makes a model more probable."""
        without = self._minimise(fits.lags, fits.constants, zeros, silent=place)
        rows = self._products.rows
        # A gain, two time constants, a lag, and the zeros.
        return bool(rows * np.log(without.squares / fits.squares)[0] > (4 + zeros) * log(rows))

    def _interpolate(self, constants: Array) -> Array:
        """Return the weights of the low-passes whose sum has given time constants, (..., low-passes)."""
        place = (constants - log(_FASTEST)) * (_FINE / log(_RATIO))
        before = np.minimum(place.astype(np.int64), len(self._weights) - 2)
        part = (place - before)[..., None]
        weights: Array = (1.0 - part) * self._weights[before] + part * self._weights[before + 1]
        return weights

    def _make_shapes(self, constants: Array, zeros: int) -> Array:
        """Return the weights of the low-passes in responses of gain one, (..., inputs, low-passes, gains)."""
        weights = self._interpolate(constants)
        if zeros:
            return weights.swapaxes(-1, -2)
        one, two = np.moveaxis(np.exp(-np.exp(-constants)), -1, 0)
        gap = np.where(np.abs(one - two) < 1e-6, 1e-6, one - two)
        share = ((1.0 - two) * one / gap)[..., None]
        shapes: Array = (share * weights[..., 0, :] + (1.0 - share) * weights[..., 1, :])[..., None]
        return shapes

    def _minimise(
        self,
        lags: NDArray[np.int64],
        constants: Array,
        zeros: int,
        steps: int = _STEPS,
        silent: int | None = None,
    ) -> _Fits:
        """Return the models with the least squared error near some time constants.

        Parameters
        ----------
        lags : ndarray of int, shape (cases, inputs)
        constants : ndarray, shape (cases, inputs, 2)
            Logarithms of the time constants.
        zeros : int
            Zeros of the response to an input, 0 or 1.
        steps : int
            Steps of Levenberg and Marquardt, at most.
        silent : int, optional
            Index of an input without response.
        """
        products, projected = self._products.take(lags)
        cases, inputs, rows = len(lags), self._inputs, self._products.rows
        every = np.arange(inputs)

        def place(shapes: Array) -> Array:
            placed = np.zeros((cases, inputs, self._series, inputs, shapes.shape[-1]))
            placed[:, every, :, every] = np.moveaxis(shapes, 1, 0)
            if silent is not None:
                placed[:, silent] = 0.0
            return placed.reshape(cases, inputs * self._series, -1)

        def multiply(columns: Array) -> tuple[Array, Array]:
            transposed = columns.swapaxes(1, 2)
            gram, moment = transposed @ (products @ columns), (transposed @ projected[..., None])[..., 0]
            diagonal = np.einsum("cii->ci", gram)
            diagonal += 1e-9 * diagonal + _ACCURACY**2 * rows
            return gram, moment

        def solve(constants: Array) -> tuple[Array, Array, Array]:
            columns = place(self._make_shapes(constants, zeros))
            gram, moment = multiply(columns)
            gains = np.linalg.solve(gram, moment[..., None])[..., 0].astype(np.float64)
            left = self._products.energy - np.sum(gains * moment, axis=1)
            squares: Array = np.maximum(left, np.finfo(np.float64).tiny)
            return columns, gains, squares

        columns, gains, squares = solve(constants)
        damping = np.full(cases, 1e-3)
        for _ in range(steps):
            ahead = np.array([[_DIFFERENCE, 0.0], [0.0, _DIFFERENCE]])
            moved = self._make_shapes(constants[:, None, None] + np.array([ahead, -ahead])[:, :, None], zeros)
            slopes = (
                (moved[:, 0] - moved[:, 1]) / (2.0 * _DIFFERENCE) @ gains.reshape(cases, 1, inputs, -1, 1)
            )
            gram, moment = multiply(
                np.concatenate([columns, place(np.moveaxis(slopes[..., 0], 1, -1))], axis=2)
            )
            count = gains.shape[1]
            moment -= (gram[:, :, :count] @ gains[..., None])[..., 0]
            diagonal = np.einsum("cii->ci", gram)[:, count:]
            diagonal += damping[:, None] * (diagonal + (squares / rows)[:, None])
            step = np.linalg.solve(gram, moment[..., None])[:, count:, 0].reshape(constants.shape)
            longest = log(_FASTEST) + (self._series - 1) * log(_RATIO)
            trial = np.clip(constants + np.clip(step, -1.0, 1.0), log(_FASTEST), longest)
            new_columns, new_gains, new_squares = solve(trial)
            better = new_squares < squares
            gain = 0.5 * rows * np.log(squares / np.where(better, new_squares, squares))
            lack = 0.5 * rows * np.log(squares / squares.min())
            constants = np.where(better[:, None, None], trial, constants)
            columns = np.where(better[:, None, None], new_columns, columns)
            gains = np.where(better[:, None], new_gains, gains)
            squares = np.where(better, new_squares, squares)
            damping = np.where(better, damping / 10.0, damping * 10.0)
            # A model whose gain is small relative to its deficit remains improbable.
            if (np.where(better, gain < _LEAST_GAIN * (1.0 + lack), damping > _LARGEST_DAMPING)).all():
                break
        return _Fits(lags, constants, gains, squares)


def _tabulate_weights(series: int) -> Array:
    """Return the weights of Lagrange between the time constants of low-passes, (rows, low-passes)."""
    place = np.arange((series - 1) * _FINE + 1) / _FINE
    first = np.clip(place.astype(np.int64) - _NEIGHBOURS // 2 + 1, 0, series - _NEIGHBOURS)
    weights = np.zeros((place.size, series))
    for one in range(_NEIGHBOURS):
        others = [two for two in range(_NEIGHBOURS) if two != one]
        factors = [(place - first - two) / (one - two) for two in others]
        weights[np.arange(place.size), first + one] = np.prod(factors, axis=0)
    return weights


def _weigh_beforehand(lags: NDArray[np.int64]) -> Array:
    """Return the logarithms of the probabilities of lags before the record is known."""
    at_once = lags <= 1
    count = np.count_nonzero(at_once)
    if count in (0, lags.size):
        return np.full(lags.size, -log(lags.size))
    return np.where(at_once, log(_AT_ONCE / count), log((1.0 - _AT_ONCE) / (lags.size - count)))
