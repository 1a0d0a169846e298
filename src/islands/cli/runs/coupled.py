"""Several outputs on the command line: their records, and the result of a search that was stopped."""

from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import islands
from islands.cli.recordings import advance_as_named
from islands.cli.stop_requests import REPEAT, StopRequests
from islands.progress import Steps
from islands.records.averaging import AUTO
from islands.records.coupled import CoupledRecord, couple
from islands.records.dataset import Dataset
from islands.records.preprocessing import preprocess
from islands.records.preprocessing_steps import PreprocessingSteps


def couple_data(
    data: Dataset,
    others: Sequence[Dataset | float | None],
    outputs: int,
    steps: PreprocessingSteps,
    names: Sequence[str],
) -> list[Any]:
    """Return the coupled records of data that were read with `join_columns` and `measured_names`.

    They are preprocessed, and then the inputs are advanced whose names say so.

    Parameters
    ----------
    data : Dataset
        Its offsets are those of all records.
    others : sequence
        Further records; a fraction or None stays as it is.
    """

    def advance(record: Dataset) -> Dataset:
        return advance_as_named(record, names[: record.inputs])

    prepared = couple(data, outputs).map(lambda each: preprocess(each, **asdict(steps)))
    found: list[Any] = [prepared.map(advance)]
    for other in others:
        if isinstance(other, Dataset):
            pairs = zip(couple(other, outputs).records, prepared.records, strict=True)
            done = CoupledRecord(tuple(preprocess(each, like=like) for each, like in pairs))
            found.append(done.map(advance))
        else:
            found.append(other)
    return found


def coupled_options(given: dict[str, Any]) -> dict[str, Any]:
    """Return options of a single output as those of several: by default, other settings hold for these."""
    return {
        name: value
        for name, value in given.items()
        if value is not None and (name, value) != ("feedthrough", AUTO)
    }


def search_outputs(
    search: Callable[[], "islands.CoupledResult"],
    folder: Path,
    stop: StopRequests,
    figures: Sequence[str],
    explain_continuation: Callable[[], str] = lambda: REPEAT,
) -> "islands.CoupledResult":
    """Search several outputs; a search that is stopped before its last output ends the command.

    The results of its first outputs are kept.
    """
    # The search loads the kernels, which the help of a command does not need.
    from islands.facade.coupled.identification import StoppedCouplingError  # noqa: PLC0415
    from islands.facade.coupled.result import list_folders  # noqa: PLC0415

    drawing = Steps(stop=stop)
    try:
        return search()
    except StoppedCouplingError as stopped:
        if not stopped.found:
            raise
        left_out = [f"models of {name}" for name in stopped.outputs[len(stopped.found) :]]
        for name, found in zip(list_folders(stopped.outputs), stopped.found, strict=False):
            found.save(folder / "outputs" / name, drawing, figures)
        stop.end(
            folder / "outputs", (*left_out, "the common model", *drawing.left_out), explain_continuation()
        )
        raise
