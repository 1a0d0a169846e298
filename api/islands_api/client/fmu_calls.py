"""Calls that upload, list, describe and delete FMUs, and the simulation of an uploaded one."""

from pathlib import Path
from typing import Any
from urllib.parse import quote

from islands.simulators.specification.code import FmuSpec
from islands_api.client.calls import RequestSpec
from islands_api.client.response_parsing import read_as
from islands_api.fmu_schemas import FmuPage, FmuSummary, FmuView

#: FMU or its id.
FmuRef = FmuSummary | str


def upload_fmu(path: str | Path) -> RequestSpec[FmuView]:
    """Upload an FMU; its ``id`` is the ``file`` of the simulation ``{"kind": "fmu", "file": ID}``."""
    return RequestSpec("POST", "/v1/fmus", read_as(FmuView), file=Path(path))


def fmus(cursor: str | None = None, limit: int = 50) -> RequestSpec[FmuPage]:
    """Return a page of the uploaded FMUs, newest first."""
    params = {"limit": limit, **({} if cursor is None else {"cursor": cursor})}
    return RequestSpec("GET", "/v1/fmus", read_as(FmuPage), params=params)


def describe_fmu(which: FmuRef) -> RequestSpec[FmuView]:
    """Return an uploaded FMU with its inputs, outputs, parameters and values at the first sample."""
    return RequestSpec("GET", f"/v1/fmus/{_quote_id(which)}", read_as(FmuView))


def delete_fmu(which: FmuRef) -> RequestSpec[None]:
    """Delete an uploaded FMU that no unfinished job needs."""
    return RequestSpec("DELETE", f"/v1/fmus/{_quote_id(which)}", lambda _: None, repeatable=False)


def name_uploaded(spec: FmuSpec, uploaded: FmuRef) -> dict[str, Any]:
    """Return the simulation of an FMU in a file as that of the uploaded file."""
    return {**spec.model_dump(mode="json", exclude_unset=True), "file": _get_id(uploaded)}


def _get_id(which: FmuRef) -> str:
    return which if isinstance(which, str) else which.id


def _quote_id(which: FmuRef) -> str:
    return quote(_get_id(which), safe="")
