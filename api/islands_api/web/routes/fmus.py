"""FMUs: upload, list, describe, delete. A diagnosis or a preview simulates one."""

from typing import Annotated, Any

import fastapi
from fastapi import APIRouter, File, UploadFile

from islands.simulators.fmu.model import MAX_DEFAULT_PARAMETERS, list_calibrated
from islands_api.dataset_schemas import FmuPage, FmuView
from islands_api.web.auth import Reader, Writer
from islands_api.web.dependencies import AppStateDep
from islands_api.web.problems import RESPONSES
from islands_api.web.requests import (
    Cursor,
    FormRoute,
    Limit,
    decode_cursor,
    describe_upload,
    encode_cursor,
)
from islands_api.web.responses import JSONDocument, dataset_document
from islands_api.web.uploads import parse_fmu_name, store_fmu
from islands_service.domain.uploaded_fmu import read_fmu
from islands_service.intake.job_inputs import check_allowed
from islands_service.store.datasets import StoredDataset


class FmuRoute(FormRoute):
    """Route that accepts a form with an FMU."""

    advice = "send the FMU as the part 'file' of a form, under a name FILE.fmu of at most 200 characters"


router = APIRouter(prefix="/v1/fmus", tags=["FMUs"], responses=RESPONSES, route_class=FmuRoute)

_UPLOAD_RESPONSES = describe_upload(FmuView, "FMU")

Id = Annotated[
    str,
    fastapi.Path(
        pattern=r"^[0-9A-Za-z_-]{1,48}$",
        description="An FMU's `id`.",
        examples=["9f86d081884c7d659a2feaa0c55ad015-fmu"],
    ),
]


@router.post(
    "",
    status_code=201,
    response_model=FmuView,
    responses=_UPLOAD_RESPONSES,
    form_limits={"max_files": 1, "max_fields": 1, "max_part_size": 1000},
)
async def upload(
    file: Annotated[
        UploadFile,
        File(
            description="FMU of FMI 2.0 or 3.0 with a library for the machine of the service",
            json_schema_extra={"format": "binary"},
        ),
    ],
    caller: Writer,
    state: AppStateDep,
) -> Any:
    """Upload an FMU, which is the simulation of a diagnosis then: `{"kind": "fmu", "file": ID}`.

    Its description is read, and none of its code runs. It counts towards the quota of the data sets, and is
    deleted like one. A service runs FMUs only if its operator allows them, since they are native code.
    """
    check_allowed(state.settings)
    name, compressed = parse_fmu_name(file.filename)
    stored, new = await store_fmu(state, caller, file.file, name, compressed)
    headers = {"Location": f"{state.settings.root_path}{router.prefix}/{stored.id}"}
    return JSONDocument(_describe(stored), 201 if new else 200, headers)


@router.get("", response_model=FmuPage)
async def fmus(caller: Reader, state: AppStateDep, cursor: Cursor = None, limit: Limit = 50) -> Any:
    """List the FMUs, newest first, without their variables."""
    page, after = await state.run_blocking(
        state.store.datasets.page, caller.owner, decode_cursor(cursor), limit, True
    )
    return JSONDocument({"items": [_summarise(each) for each in page], "next": encode_cursor(after)})


@router.get("/{fmu}", response_model=FmuView)
async def fmu(fmu: Id, caller: Reader, state: AppStateDep) -> Any:
    """Return an FMU: its inputs, outputs, parameters and values at the first sample."""
    stored = await state.run_blocking(state.store.datasets.get, caller.owner, fmu, is_fmu=True)
    return JSONDocument(_describe(stored))


@router.delete("/{fmu}", status_code=204)
async def delete(fmu: Id, caller: Writer, state: AppStateDep) -> None:
    """Delete an FMU that no unfinished job needs."""
    await state.run_blocking(state.store.datasets.delete, caller.owner, fmu, caller.requester, True)


def _summarise(stored: StoredDataset) -> dict[str, Any]:
    document = dataset_document(stored)
    return {name: document[name] for name in ("id", "name", "sha256", "bytes", "created")}


def _describe(stored: StoredDataset) -> dict[str, Any]:
    document = stored.preview["fmu"]
    parameters, initial = list_calibrated(read_fmu(document, stored.name))
    variables = {
        variable["name"]: {key: variable[key] for key in ("name", "unit", "start", "lower", "upper")}
        for kind in ("states", "parameters", "inputs", "outputs")
        for variable in document[kind]
    }

    def choose(names: Any) -> list[dict[str, Any]]:
        return [variables[name] for name in names]

    return {
        **_summarise(stored),
        "fmi": document["version"],
        "interface": document["interface"],
        "inputs": choose(variable["name"] for variable in document["inputs"]),
        "outputs": choose(variable["name"] for variable in document["outputs"]),
        "parameters": choose(parameters),
        "initial": choose(initial),
        "most_parameters": MAX_DEFAULT_PARAMETERS,
    }
