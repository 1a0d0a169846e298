"""`FitJournal`: a continued map gives the same bits and makes only the fits that are not known."""

import json
from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import islice
from typing import Any

import numpy as np
import pytest

from islands.diagnosis.calibration.fit_journal import FitJournal, RecordedFit, journal_from_document
from islands.diagnosis.calibration.starts_calibrator import (
    CalibratedStart,
    CalibrationTask,
    StartsCalibrator,
)
from islands.diagnosis.calibration.target import Target
from islands.effects.catalogue import CATALOGUE
from islands.records.noise_model import NoiseModel
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.external import RecordedOutput
from support.simulated_records import recorded, wave

Tasks = list[CalibrationTask]


@pytest.fixture(scope="module")
def due() -> tuple[StartsCalibrator, Tasks]:
    """A calibrator, and four tasks with different effects."""
    u = wave(100)
    record = recorded(u, u + 0.1 * np.random.default_rng(2).standard_normal(u.size))
    core = RecordedOutput("theirs", u)
    simulation = ExtendedSimulator(core, (), make_context(record, core, 75))
    extended = [
        simulation.with_effects((CATALOGUE[name],))
        for name in ("offset", "jump", "even-nonlinearity", "delay")
    ]
    target = Target(record.y, np.arange(100) < 75, None, {}, fitted=75)
    return StartsCalibrator(target), [(each, [each.nominal, each.nominal + 0.01]) for each in extended]


def interrupted(due: tuple[StartsCalibrator, Tasks], at: int) -> Any:
    """Return the stored journal of a map that was interrupted after some fits."""
    journal = FitJournal()
    assert len(list(islice(journal.record(map)(*due), at))) == at
    return json.loads(json.dumps(journal.to_document()))


def bits(results: Iterable[list[CalibratedStart]]) -> list[list[bytes]]:
    return [[numbers.tobytes() for end in each for numbers in end] for each in results]


def counted(made: list[CalibrationTask]) -> Any:
    def counted_map(function: Any, arguments: Iterable[Any]) -> Iterator[Any]:
        for each in arguments:
            made.append(each)
            yield function(each)

    return counted_map


@pytest.mark.parametrize("at", [0, 1, 3, 4])
def test_continued_map_makes_the_missing_fits_and_gives_the_same_bits(
    due: tuple[StartsCalibrator, Tasks], at: int
) -> None:
    journal, made = journal_from_document(interrupted(due, at)), list[CalibrationTask]()
    assert bits(journal.record(counted(made))(*due)) == bits(map(*due))
    assert [id(each) for each in made] == [id(each) for each in due[1][at:]]
    assert (journal.computed, journal.dropped) == (4 - at, 0)
    assert journal.to_document() == interrupted(due, 4)


def test_fits_from_the_first_different_one_on_are_dropped(due: tuple[StartsCalibrator, Tasks]) -> None:
    document = interrupted(due, 4)
    # The values of another task would give a wrong result.
    document[1] = [document[1][0][::-1], document[2][1]]
    journal = journal_from_document(document)
    assert bits(journal.record(map)(*due)) == bits(map(*due))
    assert (journal.computed, journal.dropped) == (3, 3)
    assert journal.to_document() == interrupted(due, 4)


def test_digest_depends_on_everything_that_a_fit_depends_on(due: tuple[StartsCalibrator, Tasks]) -> None:
    (calibrator, tasks), (simulation, starts) = due, due[1][0]
    target = calibrator.target
    noise = NoiseModel(np.array([0.5]), 1.0, 75.0)
    other = replace(simulation, simulator=RecordedOutput("theirs", simulation.context.u * (1 + 1e-12)))
    changed_targets = [
        replace(target, y=target.y + 1e-12),
        replace(target, estimation_part=np.arange(100) < 74),
        replace(target, noise=noise),
        replace(target, effective_samples=20.0),
        replace(target, segments=(50, 50)),
    ]
    changed_tasks = [
        tasks[1],
        (simulation, [starts[0], starts[1] + 1e-12]),
        (simulation, starts[:1]),
        (other, starts),
    ]
    digests = [
        calibrator.make_digest((simulation, starts)),
        *(StartsCalibrator(each).make_digest((simulation, starts)) for each in changed_targets),
        *(calibrator.make_digest(each) for each in changed_tasks),
    ]
    assert len(set(digests)) == len(digests) == 10
    again = ExtendedSimulator(simulation.simulator, simulation.effects, simulation.context)
    assert calibrator.make_digest((again, [start.copy() for start in starts])) == digests[0]


def test_stored_floats_are_exact() -> None:
    numbers = np.random.default_rng(1).integers(0, 2**64, 500, dtype=np.uint64).view(np.float64)
    values = [np.array([-0.0, 5e-324, 0.1, np.inf]), numbers[np.isfinite(numbers)], np.zeros(0)]
    document = json.loads(json.dumps(FitJournal([RecordedFit("a", values)]).to_document()))
    ((digest, stored),) = journal_from_document(document).to_document()
    assert digest == "a"
    assert [np.array(each, dtype=np.float64).tobytes() for each in stored] == [
        each.tobytes() for each in values
    ]
