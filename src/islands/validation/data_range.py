"""Range of the signals that calibrate prediction bands, and the widening of the bands outside of it.

Inside of the range, the residual shows the error of a model. Outside, an error of the structure grows: the
best approximation by a polynomial of degree ``n - 1`` on an interval has an error of equal extremes, which
grows as the Chebyshev polynomial ``T_n`` beyond it (Rivlin, Chebyshev Polynomials (1990), section 2.7). A
band takes ``T_4`` for the part of the residual that the past of the signals predicts. The other part is
noise, which does not depend on the range.

A signal that has left the range has an effect on the states. The excess therefore decays over the correlation
time of the residual, which is the time that an error of the model lasts.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from islands.records.dataset import Dataset

#: Excess in ranges above which a band has the same width: it is of no use, but finite.
_LARGEST_EXCESS = 1e6

#: Least and largest value of a signal.
Interval: TypeAlias = tuple[float, float]


@dataclass(frozen=True, slots=True)
class DataRange:
    """Ranges of the signals of the data of a model.

    Attributes
    ----------
    output : tuple of float
        Least and largest value of the measured and the simulated output, in the unit of the output.
    inputs : tuple of tuple of float
        Least and largest value of every input.
    predictable : float
        Part of the mean square of the free-run residual that the past of the signals predicts, from 0 to 1.
    memory : float
        Samples over which an excess decays.
    """

    output: Interval
    inputs: tuple[Interval, ...]
    predictable: float
    memory: float

    def increase(self, record: Dataset, run: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the increase of the mean square of the residual outside of the range.

        Parameters
        ----------
        record : Dataset
            Inputs in the order of the model.
        run : ndarray, shape (samples,)
            Simulated output of the record.

        Returns
        -------
        ndarray, shape (samples,)
            As a multiple of the mean square on the data, finite; zero inside of the range.
        """
        u, offset = measure_signals(record)
        excess = np.zeros(record.samples)
        signals = zip((run + offset, *u.T), (self.output, *self.inputs), strict=True)
        for signal, (least, largest) in signals:
            if largest > least:
                beyond = np.maximum(signal - largest, least - signal) / (largest - least)
                excess = np.fmax(excess, np.minimum(beyond, _LARGEST_EXCESS))
        # A half-range is the unit of Chebyshev polynomials.
        squares = (1.0 + 2.0 * self._decay(excess, record.bounds)) ** 2
        increase: NDArray[np.float64] = (8.0 * squares**2 - 8.0 * squares + 1.0) ** 2 - 1.0
        return self.predictable * increase

    def _decay(self, excess: NDArray[np.float64], bounds: Sequence[tuple[int, int]]) -> NDArray[np.float64]:
        """Return the largest excess so far in every segment, which decays."""
        decayed = np.zeros_like(excess)
        for begin, end in bounds:
            if excess[begin:end].any():
                time = np.arange(end - begin) / self.memory
                with np.errstate(divide="ignore"):
                    grown = np.maximum.accumulate(np.log(excess[begin:end]) + time)
                decayed[begin:end] = np.exp(grown - time)
        return decayed


def measure_signals(record: Dataset) -> tuple[NDArray[np.float64], float]:
    """Return the inputs of a record as measured, and the value that makes its output a measured one."""
    done = record.preprocessing
    return (record.u, 0.0) if done is None else (record.u + done.input_offsets, done.output_offset)


def measure_range(
    records: Sequence[Dataset], runs: Sequence[NDArray[np.float64]], predictable: float, memory: float
) -> DataRange:
    """Return the range of the signals of some records.

    Parameters
    ----------
    records : sequence of Dataset
        Records with the inputs in the order of the model.
    runs : sequence of ndarray, shape (samples,)
        Simulated outputs.
    predictable, memory : float
        As of `DataRange`.
    """
    outputs, inputs = [], []
    for record, run in zip(records, runs, strict=True):
        u, offset = measure_signals(record)
        inputs.append(u)
        outputs += [record.y + offset, run + offset]
    y, columns = np.concatenate(outputs), np.concatenate(inputs).T
    ranges = tuple((float(each.min()), float(each.max())) for each in columns)
    return DataRange((float(np.nanmin(y)), float(np.nanmax(y))), ranges, predictable, memory)
