"""Fits of an interrupted diagnosis in its output folder, from which the same command continues."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from islands.cli.console import errors
from islands.cli.stop_requests import REPEAT
from islands.diagnosis.calibration.fit_journal import FitJournal, journal_from_document

#: File of the fits in the output folder.
FITS = "fits.json"

#: How to get the complete result of a diagnosis that has written its fits.
CONTINUE = "repeat the command with --force, which continues with its fits"


@contextmanager
def keep_fits(folder: Path) -> Iterator[FitJournal]:
    """Yield the fits of an interrupted diagnosis; write them again if this one is interrupted as well.

    They are deleted when the diagnosis has ended. Fits of another diagnosis, or a damaged file, cost only
    time.
    """
    path = folder / FITS
    journal = _read(path)
    try:
        yield journal
    except KeyboardInterrupt:
        write_fits(folder, journal)
        raise
    path.unlink(missing_ok=True)


def say_to_continue(folder: Path) -> None:
    """Say that a diagnosis without a result so far continues with its fits."""
    if (path := folder / FITS).exists():
        errors.print(f"interrupted; {path} keeps what is known: the same command continues", markup=False)


def write_fits(folder: Path, journal: FitJournal) -> None:
    """Write the fits into the output folder, if there are any."""
    if fits := journal.to_document():
        folder.mkdir(parents=True, exist_ok=True)
        (folder / FITS).write_text(json.dumps(fits))


def explain_continuation(folder: Path) -> str:
    """Say how to get the complete result of a diagnosis whose result so far is in a folder."""
    return CONTINUE if (folder / FITS).exists() else REPEAT


def _read(path: Path) -> FitJournal:
    if not path.exists():
        return FitJournal()
    try:
        return journal_from_document(json.loads(path.read_text()))
    except (ValueError, TypeError):
        errors.print(f"{path} is damaged: the diagnosis starts again", markup=False)
        return FitJournal()
