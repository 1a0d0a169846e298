"""Simulations that can be diagnosed: their list, the check of written equations, and calibrated previews."""

from contextlib import ExitStack
from functools import cache
from typing import Any

from fastapi import APIRouter
from pydantic import ValidationError

from islands.document_problems import find_problem
from islands.errors import SettingsError
from islands.simulators.specification.base import SimulatorEntry
from islands.simulators.specification.equations import OdeSpec, read_built_in, read_built_in_text
from islands.simulators.specification.table import SIMULATORS, PhysicalSpec
from islands_api.simulation_schemas import (
    EquationsRequest,
    EquationsView,
    PreviewRequest,
    SimulationList,
    SimulationPreview,
)
from islands_api.web.auth import Reader
from islands_api.web.dependencies import AppStateDep
from islands_api.web.problems import RESPONSES
from islands_api.web.requests import JSONRoute
from islands_api.web.responses import JSONDocument
from islands_api.web.uploads import open_stored
from islands_service.intake.job_inputs import check_allowed, check_fmu, explain_refusal, link_blob
from islands_service.intake.job_validation import check_discrepancy
from islands_service.intake.reader_process import SIMULATION_SERVER
from islands_service.intake.simulation_preview import SimulationPreviewRequest, preview_simulation

router = APIRouter(
    prefix="/v1/simulations", tags=["discrepancies"], responses=RESPONSES, route_class=JSONRoute
)

#: Longest time of a preview in seconds.
_PREVIEW_SECONDS = 30.0

#: Name of equations that have none.
_NAME = "equations"


@router.get("", response_model=SimulationList)
async def simulations(_caller: Reader, state: AppStateDep) -> Any:
    """List the simulations that a diagnosis accepts, with the parameters of the physical systems.

    A simulation with a `refusal` is one that this service does not accept.
    """
    listed = await state.run_blocking(_list_simulations)
    # The server of the previews starts while the user chooses.
    await state.run_blocking(SIMULATION_SERVER.ensure_running)
    return {"items": [*listed, _describe(SIMULATORS["fmu"], explain_refusal(state.settings))]}


@router.post("/equations", response_model=EquationsView)
async def equations(asked: EquationsRequest, _caller: Reader, state: AppStateDep) -> Any:
    """Check differential equations, and return them in the form of the `simulation` of a diagnosis.

    The text is the content of the file that `ode:FILE.toml` names on the command line. The `detail` of a
    problem has the line. Nothing is stored, and nothing is simulated.
    """
    return JSONDocument(await state.run_blocking(_read_equations, asked.text))


@router.post("/preview", response_model=SimulationPreview)
async def preview(asked: PreviewRequest, caller: Reader, state: AppStateDep) -> Any:
    """Calibrate a simulation on a part of a record, as a diagnosis does first; nothing is stored.

    The part has at most 5000 samples: those in a row over which the output varies most. Parameters are fitted
    to its first three quarters. The answer takes 0.1 to 2 s, and at most 30 s. A diagnosis uses all rows, and
    searches for what the simulation lacks.
    """
    check_discrepancy(asked)
    settings, owner, datasets = state.settings, caller.owner, state.store.datasets
    stored = await state.run_blocking(datasets.get, owner, asked.dataset)
    job = asked.model_dump(mode="json", exclude_unset=True, by_alias=True, exclude={"points"})
    reading = stored.preview.get("reading", {})
    with ExitStack() as files:
        fmu, described = None, None
        if asked.fmu is not None:
            check_allowed(settings)
            found = await state.run_blocking(datasets.get, owner, asked.fmu.file, is_fmu=True)
            check_fmu(asked.fmu, found)
            held = await state.run_blocking(files.enter_context, state.blobs.hold(found.blob))
            fmu, described = files.enter_context(link_blob(held, found.name)), found.preview["fmu"]
            described = {**described, "path": found.name}
        request = SimulationPreviewRequest(job, reading, asked.points, described)
        async with open_stored(state, owner, stored) as path:
            return JSONDocument(
                await preview_simulation(path, request, settings.inspection_memory, _PREVIEW_SECONDS, fmu)
            )


@cache
def _list_simulations() -> tuple[dict[str, Any], ...]:
    return tuple(_describe(entry) for entry in SIMULATORS.values() if entry.is_remote)


def _describe(entry: SimulatorEntry, refusal: str = "") -> dict[str, Any]:
    is_physical = entry.spec is PhysicalSpec
    system = read_built_in(entry.name) if is_physical else None
    return {
        "kind": entry.name,
        "summary": entry.summary,
        "estimated": entry.estimated,
        "parameters": [
            {
                "name": each.name,
                "unit": each.unit,
                "default": None if entry.estimator else each.value,
                "range": entry.parameters[each.name],
            }
            for each in (system.parameters if system else ())
        ],
        "equations": read_built_in_text(entry.name) if is_physical else "",
        "refusal": refusal,
    }


def _read_equations(text: str) -> dict[str, Any]:
    """Return the specification of a text.

    Raises
    ------
    SettingsError
        The text is not TOML, or its equations are invalid.
    """
    try:
        spec = OdeSpec.from_toml(text, "the text", _NAME)
    except ValidationError as error:
        raise SettingsError(": ".join(filter(None, find_problem(error, OdeSpec)))) from error
    return dict(spec.model_dump(mode="json", exclude_unset=True))
