"""Output folder of a command: the check before the work and the message after it."""

import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from islands.cli.console import output
from islands.cli.stop_requests import REPEAT, StopRequests
from islands.errors import SettingsError
from islands.progress import Steps

if TYPE_CHECKING:
    from islands.cli.progress_display import Display
    from islands.evolution.search_result import SearchResult
    from islands.facade.results.identification import Result


#: Files of a result in its folder.
RESULT_FILES = "result.json, models/, figures/, summary.txt, method.txt"

#: Files of a result of several outputs.
SEPARATE_FILES = "result.json, models/, figures/, summary.txt, outputs/ (the result of each output)"


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


def keep_models(folder: Path, outputs: Sequence[str], show: "Display") -> Callable[["SearchResult"], None]:
    """Return a callback that writes the models so far to a folder, and shows them below a progress bar.

    Of several outputs, the models of each are written to its folder.
    """
    # The help of a command does not need it.
    from islands.report.documents.result_folder import list_folders, write_interim_result  # noqa: PLC0415
    from islands.report.text.layout import front_table  # noqa: PLC0415

    folders = [""] if len(outputs) == 1 else list_folders(outputs)

    def write(found: "SearchResult") -> None:
        document = write_interim_result(found, folder / folders[outputs.index(found.record.output_name)])
        show(lines=front_table(document))

    return write


def run_search(
    search: Callable[[], "Result"],
    folder: Path,
    stop: StopRequests,
    figures: Sequence[str],
    explain_continuation: Callable[[], str] = lambda: REPEAT,
) -> "Result":
    """Run a search; one of several outputs that is stopped before the last of them ends the command.

    The results of its first outputs are kept.
    """
    # The search loads the kernels, which the help of a command does not need.
    from islands.facade.coupled.identification import StoppedCouplingError  # noqa: PLC0415
    from islands.report.documents.result_folder import list_folders  # noqa: PLC0415

    try:
        return search()
    except StoppedCouplingError as stopped:
        if not stopped.found:
            raise
        drawing = Steps(stop=stop)
        left_out = [f"models of {name}" for name in stopped.outputs[len(stopped.found) :]]
        for name, found in zip(list_folders(stopped.outputs), stopped.found, strict=False):
            found.save(folder / name, drawing, figures)
        stop.end(
            folder / "outputs", (*left_out, "the common model", *drawing.left_out), explain_continuation()
        )
        raise


def print_failures(not_computed: Mapping[str, str]) -> None:
    """Print the steps that failed after the texts of a result were written, each with the reason."""
    for step, reason in not_computed.items():
        output.print(f"Not computed: {step}: {reason}.", markup=False)


def show_result(result: "Result", folder: Path) -> None:
    """Print the summary and the files of a saved result."""
    output.print((folder / "summary.txt").read_text(encoding="utf-8"), markup=False)
    files = SEPARATE_FILES if result.outputs else RESULT_FILES
    output.print(f"{folder}/: {files}", markup=False)
