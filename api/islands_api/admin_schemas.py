"""Wire models of keys and owners, for operators."""

from datetime import datetime
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from islands_api.schemas import ResponseModel
from islands_service.domain.owner import DEFAULT_WEIGHT, MAX_QUOTA, WEIGHTS
from islands_service.store.keys import SCOPES

#: Name of an owner that can be part of a path.
OwnerName = Annotated[
    str,
    Field(min_length=1, max_length=64, pattern=r"^[^\x00-\x1f\x7f/]+$", description="Name of an owner."),
]

Quota = Annotated[int | None, Field(ge=0, le=MAX_QUOTA)]


class KeyRequest(BaseModel):
    """Request for a key."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={"examples": [{"name": "lab-3", "scopes": ["read", "write"], "owner": "lab"}]},
    )

    scopes: Annotated[
        list[str],
        Field(
            min_length=1,
            max_length=16,
            description="What the key allows.",
            json_schema_extra={"items": {"type": "string", "enum": list(SCOPES)}},
        ),
    ]
    name: Annotated[
        str, Field(max_length=200, pattern=r"^[^\x00-\x1f\x7f]*$", description="Name of the key; one line.")
    ] = ""
    owner: OwnerName | None = Field(default=None, description="A new owner by default.")
    days: Annotated[
        float | None, Field(gt=0.0, le=36_500.0, description="Days until the key expires; never by default.")
    ] = None


class KeyView(ResponseModel):
    """Key without its secret."""

    id: str
    owner: str
    name: str
    scopes: tuple[str, ...]
    created: datetime
    expires: datetime | None = None
    revoked: datetime | None = None
    valid: bool = Field(description="Whether the key is neither revoked nor expired.")


class CreatedKey(KeyView):
    """New key. This is the only response with its secret."""

    secret: str = Field(description="Send it as `Authorization: Bearer ...`.")


class KeyPage(ResponseModel):
    """All keys, oldest first."""

    items: tuple[KeyView, ...]


class OwnerChanges(BaseModel):
    """Changes of an owner. What is absent is not changed; null restores the default of the settings."""

    model_config = ConfigDict(
        extra="forbid", json_schema_extra={"examples": [{"weight": 200, "max_running": 4}]}
    )

    weight: Annotated[
        int | None,
        Field(
            ge=WEIGHTS.start,
            le=WEIGHTS.stop - 1,
            description=f"Share of the claims; {DEFAULT_WEIGHT} by default.",
        ),
    ] = None
    max_active: Annotated[Quota, Field(description="Queued and running jobs.")] = None
    max_running: Annotated[Quota, Field(description="Running jobs; further ones stay in the queue.")] = None
    max_islands: Annotated[
        Quota, Field(description="Islands of the running jobs; further jobs stay in the queue.")
    ] = None
    max_run_seconds: Annotated[
        Quota, Field(description="Seconds for which each job may run; also for the present jobs.")
    ] = None
    max_uploads: Annotated[Quota, Field(description="Uploads in progress, of each API process.")] = None
    max_stored: Annotated[Quota, Field(description="Bytes of data sets.")] = None
    max_streams: Annotated[Quota, Field(description="Open event streams, of each API process.")] = None
    max_drawings: Annotated[
        Quota, Field(description="Requests whose figures are being drawn, of each API process.")
    ] = None
    dataset_retention: Annotated[
        Quota, Field(description="Seconds for which a data set that no job names is kept; 0 for ever.")
    ] = None


class OwnerView(ResponseModel):
    """Owner with its weight, quotas and use of the service. A quota of null is the default."""

    name: str
    weight: int
    max_active: int | None = None
    max_running: int | None = None
    max_islands: int | None = None
    max_run_seconds: int | None = None
    max_uploads: int | None = None
    max_stored: int | None = None
    max_streams: int | None = None
    max_drawings: int | None = None
    dataset_retention: int | None = None
    queued: int = Field(description="Number of queued jobs.")
    running: int = Field(description="Number of running jobs.")
    running_islands: int = Field(description="Islands of the running jobs.")
    stored: int = Field(description="Bytes of data sets.")


class OwnerPage(ResponseModel):
    """All owners by name."""

    items: tuple[OwnerView, ...]
