"""Fits of an interrupted diagnosis: the same command continues with them."""

from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
import pytest

from islands.cli.runs.diagnosis_fits import CONTINUE, FITS, explain_continuation, keep_fits, write_fits
from islands.cli.stop_requests import REPEAT
from islands.diagnosis.calibration.fit_journal import FitJournal
from islands.diagnosis.inference.screening import StartFinder
from islands.diagnosis.procedure import diagnose
from islands.effects.catalogue import CATALOGUE
from islands.parallel import ParallelMap
from islands.records.dataset import Dataset
from islands.report.documents.diagnosis_json import as_json, diagnosis_document
from islands.simulators.external import RecordedOutput
from support.simulated_records import recorded, wave

U = wave(400)
RECORD = recorded(U, 1.0 + U + 0.5 * np.random.default_rng(1).standard_normal(U.size))
EFFECTS = [CATALOGUE[name] for name in ("offset", "linear-drift", "even-nonlinearity")]


def run(record: Dataset, journal: FitJournal, parallel_map: ParallelMap = map) -> str:
    found = diagnose(
        record, RecordedOutput("theirs", U), parallel_map=journal.record(parallel_map), catalogue=EFFECTS
    )
    return as_json(diagnosis_document(found))


def interrupted_map(function: object, arguments: Iterable[object]) -> Iterator[object]:
    """Interrupt after the first fit."""
    if isinstance(function, StartFinder):
        yield from map(function, arguments)
        return
    yield function(next(iter(arguments)))  # type: ignore[operator]
    raise KeyboardInterrupt


@pytest.mark.ci
def test_interrupted_diagnosis_continues_with_its_fits(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt), keep_fits(tmp_path / "out") as journal:
        run(RECORD, journal, interrupted_map)
    assert (tmp_path / "out" / FITS).exists()
    with keep_fits(tmp_path / "out") as journal:
        continued = run(RECORD, journal)
    assert journal.dropped == 0
    whole = FitJournal()
    assert continued == run(RECORD, whole)
    assert journal.computed == whole.computed - 1
    assert not (tmp_path / "out" / FITS).exists()


def test_damaged_file_costs_only_time(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / FITS).write_text('[["digest"')
    with keep_fits(tmp_path) as journal:
        assert journal.to_document() == []
    assert "the diagnosis starts again" in capsys.readouterr().err


def test_a_diagnosis_without_fits_leaves_no_file_and_promises_none(tmp_path: Path) -> None:
    write_fits(tmp_path, FitJournal())
    assert not (tmp_path / FITS).exists()
    assert explain_continuation(tmp_path) == REPEAT
    with pytest.raises(KeyboardInterrupt), keep_fits(tmp_path) as journal:
        run(RECORD, journal, interrupted_map)
    assert explain_continuation(tmp_path) == CONTINUE
