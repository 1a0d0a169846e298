"""Journal of the fits of a diagnosis, with which an interrupted diagnosis continues."""

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from islands.diagnosis.calibration.starts_calibrator import (
    CalibratedStart,
    CalibrationTask,
    StartsCalibrator,
)
from islands.effects.interface.context import Signal
from islands.parallel import ParallelMap, intercepted_map


@dataclass(frozen=True, slots=True, eq=False)
class RecordedFit:
    """Result of a calibration task.

    Attributes
    ----------
    digest : str
        Digest of the task, see `StartsCalibrator.make_digest`.
    values : list of ndarray, each of shape (parameters,)
        Values that the calibrator returned.
    """

    digest: str
    values: list[Signal]


class FitJournal:
    """Fits of a diagnosis in their order, recorded by a parallel map.

    A diagnosis is deterministic: its fits depend on its arguments and on the fits before them. A diagnosis
    with the same arguments and the known fits of an interrupted one therefore continues where that one
    ended, and gives the same result, bit for bit. A known fit whose task differs from the one that is due is
    dropped together with all later ones, so that a journal of another diagnosis costs only time.

    Parameters
    ----------
    known : sequence of RecordedFit
        Fits of an interrupted diagnosis.

    Attributes
    ----------
    computed : int
        Number of fits that were not known.
    dropped : int
        Number of known fits that belong to another diagnosis.
    """

    def __init__(self, known: Sequence[RecordedFit] = ()) -> None:
        self._known, self._ended = deque(known), list[RecordedFit]()
        self.computed = self.dropped = 0

    def record(self, parallel_map: ParallelMap) -> ParallelMap:
        """Return a map that takes known fits from the journal and records the others."""

        def continue_fits(
            calibrator: StartsCalibrator, tasks: Sequence[CalibrationTask]
        ) -> Iterator[list[CalibratedStart]]:
            first = 0
            while first < len(tasks) and (known := self._take_known(calibrator, tasks[first])):
                self._ended.append(known)
                simulation, _ = tasks[first]
                first += 1
                yield [CalibratedStart(values, simulation.simulate(values)) for values in known.values]
            remaining = tasks[first:]
            if remaining:
                for digest, fits in parallel_map(partial(_calibrate, calibrator), remaining):
                    self._ended.append(RecordedFit(digest, [fit.values for fit in fits]))
                    self.computed += 1
                    yield fits

        return intercepted_map(parallel_map, StartsCalibrator, continue_fits)

    def _take_known(self, calibrator: StartsCalibrator, task: CalibrationTask) -> RecordedFit | None:
        """Return the next known fit if it is that of a task; otherwise drop all known fits."""
        if not self._known:
            return None
        if self._known[0].digest == calibrator.make_digest(task):
            return self._known.popleft()
        self.dropped = len(self._known)
        self._known.clear()
        return None

    def to_document(self) -> list[Any]:
        """Return the fits as JSON values; floats are exact."""
        return [
            [fit.digest, [values.tolist() for values in fit.values]] for fit in (*self._ended, *self._known)
        ]


def _calibrate(calibrator: StartsCalibrator, task: CalibrationTask) -> tuple[str, list[CalibratedStart]]:
    """Calibrate the starts of a task; return its digest and the results."""
    return calibrator.make_digest(task), calibrator(task)


def journal_from_document(document: Sequence[Any]) -> FitJournal:
    """Make a journal from the list that `FitJournal.to_document` returns.

    Raises
    ------
    TypeError, ValueError
        The list does not describe fits.
    """
    return FitJournal(
        [
            RecordedFit(str(digest), [np.array(values, dtype=np.float64) for values in results])
            for digest, results in document
        ]
    )
