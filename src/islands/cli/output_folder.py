"""Output folder of a command: the check before the work and the message after it."""

import os
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import islands
from islands.cli.console import output
from islands.errors import SettingsError

if TYPE_CHECKING:
    from islands.evolution.search_result import SearchResult
    from islands.facade.coupled.result import CoupledResult
    from islands.facade.results.identification import Result


#: Files of a result in its folder.
RESULT_FILES = "result.json, models/, figures/, summary.txt, method.txt"

#: Files of a result of several outputs.
COUPLED_FILES = "result.json, model.json, summary.txt, figures/, outputs/ (the result of each output)"


def check_folder(folder: Path, force: bool, result: str = "result.json") -> None:
    """Check that a result can be written to a folder without overwriting another result.

    Raises
    ------
    SettingsError
        The folder contains a result and ``force`` is false, the path or a part of it is a file, or the folder
        is not writable.
    """
    existing = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    if not existing.is_dir():
        raise SettingsError(f"--out {folder}: {existing} is a file, give a folder")
    if not os.access(existing, os.W_OK):
        raise SettingsError(f"--out {folder}: {existing} is not writable, give another folder")
    if (folder / result).exists() and not force:
        raise SettingsError(f"{folder} holds a result already: give another --out, or --force to replace it")


def keep_models(folder: Path) -> Callable[["SearchResult"], None]:
    """Return a callback that writes the models of a search to a folder before the steps after the search."""
    # The help of a command does not need it.
    from islands.report.documents.result_folder import write_interim_result  # noqa: PLC0415

    return partial(write_interim_result, folder=folder)


def print_failures(not_computed: Mapping[str, str]) -> None:
    """Print the steps that failed after the texts of a result were written, each with the reason."""
    for step, reason in not_computed.items():
        output.print(f"Not computed: {step}: {reason}.", markup=False)


def show_result(result: "Result | CoupledResult", folder: Path) -> None:
    """Print the summary and the files of a saved result."""
    output.print((folder / "summary.txt").read_text(encoding="utf-8"), markup=False)
    files = COUPLED_FILES if isinstance(result, islands.CoupledResult) else RESULT_FILES
    output.print(f"{folder}/: {files}", markup=False)
