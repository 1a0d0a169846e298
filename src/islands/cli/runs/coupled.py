"""Several outputs on the command line: a coupled model is identified and fitted."""

import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import islands
from islands.cli.console import output, print_message
from islands.cli.engines import start_engine
from islands.cli.progress_display import Display, compile_kernels, progress
from islands.cli.recordings import advance_as_named
from islands.cli.runs.identify import TEST, RunOptions, compute_errors
from islands.cli.search_progress import search_progress
from islands.cli.stop_requests import REPEAT, StopRequests, stop_requests
from islands.data.averaging import AUTO
from islands.data.coupled_record import CoupledRecord, check_outputs, couple
from islands.data.dataset import Dataset
from islands.data.preprocessing import preprocess
from islands.data.preprocessing_steps import PreprocessingSteps
from islands.data.signal_map import match_rate
from islands.evolution.presets import resolve_settings
from islands.facade.coupled.identification import StoppedCouplingError
from islands.facade.coupled.result import list_folders
from islands.progress import Steps


def join_columns(inputs: Sequence[str], outputs: Sequence[str]) -> tuple[list[str], str]:
    """Return the inputs and the output of one record with all columns, for `couple_data`.

    Raises
    ------
    RecordError
        With several outputs, one is given twice or is also an input.
    """
    if len(outputs) > 1:
        check_outputs(inputs, outputs)
    return [*inputs, *outputs[1:]], outputs[0]


def couple_data(
    data: Dataset, held_out: Dataset | float, outputs: int, steps: PreprocessingSteps, names: Sequence[str]
) -> tuple[CoupledRecord, CoupledRecord | float]:
    """Return the coupled records of data that were read with `join_columns` and `measured_names`.

    They are preprocessed, and then the inputs are advanced whose names say so.
    """

    def advance(record: Dataset) -> Dataset:
        return advance_as_named(record, names[: record.inputs])

    prepared = couple(data, outputs).map(lambda each: preprocess(each, **asdict(steps)))
    if isinstance(held_out, float):
        return prepared.map(advance), held_out
    pairs = zip(couple(held_out, outputs).records, prepared.records, strict=True)
    held = CoupledRecord(tuple(preprocess(each, like=like) for each, like in pairs))
    return prepared.map(advance), held.map(advance)


def coupled_options(given: dict[str, Any]) -> dict[str, Any]:
    """Return options of a single output as those of several: by default, other settings hold for these."""
    return {
        name: value
        for name, value in given.items()
        if value is not None and (name, value) != ("feedthrough", AUTO)
    }


def identify_several(
    run_options: RunOptions,
    folder: Path,
    data: tuple[CoupledRecord, CoupledRecord | float],
    preset: str,
    seed: int,
    changes: Mapping[str, Any],
    test: CoupledRecord | None,
) -> None:
    """Identify several outputs by evolution, write the result and its errors on the test data, print both."""
    settings = resolve_settings(preset, changes)
    compile_kernels()
    with ExitStack() as handlers:
        with (
            progress("identify") as show,
            start_engine(
                run_options.engine_for(settings.islands), run_options.address, print_message
            ) as engine,
        ):
            # As in `islands.cli.runs.identify`.
            stop = handlers.enter_context(stop_requests())
            identify_all = partial(
                islands.identify_coupled,
                data[0],
                validation=data[1],
                preset=preset,
                seed=seed,
                progress=show,
                on_epoch=search_progress(show),
                stop=stop,
                engine=engine,
                **coupled_options(dict(changes)),
            )
            result, left_out = keep_coupled(identify_all, folder, show, stop)
        (folder / TEST).unlink(missing_ok=True)  # of an earlier run
        if test is not None:
            _evaluate_test(result, test, folder)
        stop.end(folder, left_out, REPEAT)


def _evaluate_test(result: "islands.CoupledResult", test: CoupledRecord, folder: Path) -> None:
    """Simulate all outputs of the test data together; print and write the metrics of each."""
    test = test.map(partial(match_rate, result.model))
    simulated = result.simulate(test)
    output.print(f"test data, not used before: free run {simulated.outcome}", markup=False)
    outputs = []
    for record, y in zip(test.records, simulated.y.T, strict=True):
        numbers, text = compute_errors(record, y if simulated.outcome else None)
        outputs.append({"name": record.output_name, **numbers})
        if text:
            output.print(f"  {record.output_name}{text.replace(',', ':', 1)}", markup=False)
    document = {"outcome": str(simulated.outcome), "outputs": outputs}
    (folder / TEST).write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")


def keep_coupled(
    search: Callable[[], "islands.CoupledResult"], folder: Path, show: Display, stop: StopRequests
) -> tuple["islands.CoupledResult", tuple[str, ...]]:
    """Search several outputs, write the result and print it; return it and the steps that were left out.

    A stopped search keeps its results so far, and ends the command.
    """
    drawing = Steps(stop=stop)
    try:
        result = search()
    except StoppedCouplingError as stopped:
        if not stopped.found:
            raise
        left_out = [f"models of {name}" for name in stopped.outputs[len(stopped.found) :]]
        for name, found in zip(list_folders(stopped.outputs), stopped.found, strict=False):
            found.save(folder / "outputs" / name, drawing)
        stop.end(folder / "outputs", (*left_out, "the common model", *drawing.left_out), REPEAT)
        raise
    show("figures", 1.0)
    result.save(folder, drawing)
    output.print(str(result), markup=False)
    files = "result.json, model.json, summary.txt, figures/, outputs/ (the result of each output)"
    output.print(f"{folder}/: {files}", markup=False)
    return result, (*result.left_out, *drawing.left_out)
