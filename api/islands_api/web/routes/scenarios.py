"""Simulation of the models of a job on data sets, of inputs alone or with measured outputs."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from fastapi import APIRouter, Header, Response
from numpy.typing import NDArray

from islands.errors import SettingsError
from islands.records.coupled import AnyRecord
from islands.records.reading.row_range import parse_rows
from islands_api.simulation_schemas import MAX_SAMPLES, ScenarioPage, ScenarioRequest
from islands_api.web.auth import Reader
from islands_api.web.dependencies import AppStateDep
from islands_api.web.job_submission import get_job_of_kind, get_result
from islands_api.web.model_simulation import write_document
from islands_api.web.problems import RESPONSES
from islands_api.web.requests import JSONRoute
from islands_api.web.routes.jobs import Id
from islands_api.web.routes.models import Rank, get_model
from islands_service.domain.job import IDENTIFICATION
from islands_service.domain.job_spec import Part
from islands_service.intake.job_inputs import read_scenario
from islands_service.store.datasets import StoredDataset

if TYPE_CHECKING:
    from islands.facade.results.fitted_model import FittedModel

router = APIRouter(prefix="/v1/jobs", tags=["models"], responses=RESPONSES, route_class=JSONRoute)


@router.post("/{job}/models/{rank}/scenarios", response_model=ScenarioPage)
async def scenarios(
    job: Id,
    rank: Rank,
    request: ScenarioRequest,
    caller: Reader,
    state: AppStateDep,
    accept_encoding: Annotated[str, Header(max_length=1000, include_in_schema=False)] = "",
) -> Response:
    """Simulate a model on data sets of its inputs, such as planned experiments.

    A data set with another sampling time than that of the model is refused; read it again with `resample`.
    """
    entry = await get_job_of_kind(state, caller, job, IDENTIFICATION)
    stored = await get_model(state, caller, job, rank)
    document = await get_result(state, entry)

    def read_model() -> "FittedModel":
        # The classes of results import the search.
        from islands_service.domain.fitted_models import read_fitted  # noqa: PLC0415

        return read_fitted(entry.id, stored.file, stored.document, document)

    async with state.simulation_slots.hold(caller.owner):
        found = await state.run_blocking(read_model)
    columns = found.model.column_names, found.output_names
    items = []
    for part in request.datasets:
        dataset = await state.run_blocking(state.store.datasets.get, caller.owner, part.dataset)
        _check_length(dataset, part, MAX_SAMPLES * found.model.average)
        async with state.inspection_slots.hold(caller.owner):
            record = await state.run_blocking(
                read_scenario, dataset, columns, part.rows, request.dt, state.blobs
            )
        async with state.simulation_slots.hold(caller.owner):
            run = await state.run_blocking(_simulate, found, record, request.start, document)
        items.append({"dataset": part.dataset, **run})
    compressed = "gzip" in accept_encoding
    data = await state.run_blocking(write_document, {"items": items}, compressed)
    headers = {"Vary": "Accept-Encoding"} | ({"Content-Encoding": "gzip"} if compressed else {})
    return Response(data, media_type="application/json", headers=headers)


def _check_length(dataset: StoredDataset, part: Part, most: int) -> None:
    """Refuse more samples than a response may have."""
    whole = dataset.preview.get("samples")
    # Columns of different lengths have no number of samples; such a file is small enough to be inspected.
    if whole is None:
        return
    samples = len(range(*(parse_rows(part.rows) or slice(None)).indices(whole)))
    if samples > most:
        raise SettingsError(
            f"{dataset.name} has {samples} samples, and a simulation at most {most}: give rows, as 0:{most}"
        )


def _simulate(
    found: "FittedModel", record: AnyRecord, start: Mapping[str, float], document: Mapping[str, Any]
) -> dict[str, Any]:
    """Return the fields of `Scenario` of a record."""
    from islands.facade.results.model_simulation import (  # noqa: PLC0415 - imports the kernels
        list_extrapolations,
        match_columns,
        split_start,
    )

    model = found.model
    data = match_columns(model, record)
    y, states = split_start(model, start)
    run = found.simulate(data, y=y, states=states)
    ranges = document.get("data", {}).get("inputs", {}).get("estimation")
    outputs: NDArray[np.float64] = run.y.reshape(len(run.y), -1)
    is_measured = not start and bool(np.isfinite(data.y).any())
    return {
        "dt": data.dt,
        "time_s": data.records[0].time.tolist(),
        "outputs": dict(zip(found.output_names, outputs.T.tolist(), strict=True)),
        "units": dict(zip(found.output_names, found.output_units, strict=True)),
        "start": _describe_start(start, is_measured),
        "outcome": str(run.outcome),
        "warnings": list_extrapolations(model, data, ranges) if ranges else [],
    }


def _describe_start(start: Mapping[str, float], is_measured: bool) -> str:
    if is_measured:
        return "from the measured outputs"
    given = ", ".join(f"{name} = {level:g}" for name, level in start.items())
    return f"from {given}" if given else "from rest at the first inputs"
