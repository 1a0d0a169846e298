"""Simulations that can be diagnosed: their list, and the check of equations that a user writes."""

from functools import cache
from typing import Any

from fastapi import APIRouter
from pydantic import ValidationError

from islands.document_problems import find_problem
from islands.errors import SettingsError
from islands.simulators.specification.base import SimulatorEntry
from islands.simulators.specification.equations import OdeSpec, read_built_in, read_built_in_text
from islands.simulators.specification.table import SIMULATORS, PhysicalSpec
from islands_api.simulation_schemas import EquationsRequest, EquationsView, SimulationList
from islands_api.web.auth import Reader
from islands_api.web.dependencies import AppStateDep
from islands_api.web.problems import RESPONSES
from islands_api.web.requests import JSONRoute
from islands_api.web.responses import JSONDocument

router = APIRouter(
    prefix="/v1/simulations", tags=["discrepancies"], responses=RESPONSES, route_class=JSONRoute
)

#: Name of equations that have none.
_NAME = "equations"


@router.get("", response_model=SimulationList)
async def simulations(_caller: Reader, state: AppStateDep) -> Any:
    """List the simulations that a diagnosis accepts, with the parameters of the physical systems."""
    return await state.run_blocking(_list_simulations)


@router.post("/equations", response_model=EquationsView)
async def equations(asked: EquationsRequest, _caller: Reader, state: AppStateDep) -> Any:
    """Check differential equations, and return them in the form of the `simulation` of a diagnosis.

    The text is the content of the file that `ode:FILE.toml` names on the command line. The `detail` of a
    problem has the line. Nothing is stored, and nothing is simulated.
    """
    return JSONDocument(await state.run_blocking(_read_equations, asked.text))


@cache
def _list_simulations() -> dict[str, Any]:
    return {"items": [_describe(entry) for entry in SIMULATORS.values() if entry.is_remote]}


def _describe(entry: SimulatorEntry) -> dict[str, Any]:
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
