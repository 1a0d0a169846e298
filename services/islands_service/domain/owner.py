"""Owners of jobs and data sets: weight in the queue, and quotas."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any

from islands.errors import SettingsError, suggest
from islands_service.settings import ServiceSettings

#: Weight of an owner for which none was set.
DEFAULT_WEIGHT = 100

#: Valid weights.
WEIGHTS = range(1, 10_001)

#: Largest quota: PostgreSQL stores 64 bits.
MAX_QUOTA = 2**62


@dataclass(frozen=True, slots=True)
class Quotas:
    """Limits of one owner.

    Attributes
    ----------
    max_active : int
        Queued and running jobs.
    max_running : int
        Running jobs. Further ones stay in the queue.
    max_islands : int or None
        Islands of the running jobs; None is no limit. Further jobs stay in the queue.
    max_run_seconds : int
        Seconds for which each job may run.
    max_uploads : int
        Uploads in progress.
    max_stored : int
        Total size of the data sets in bytes.
    max_streams : int
        Open event streams.
    max_drawings : int
        Requests whose figures are being drawn or wait for it.
    dataset_retention : int
        Seconds for which a data set that no job names is kept; 0 for ever.
    """

    max_active: int
    max_running: int
    max_islands: int | None
    max_run_seconds: int
    max_uploads: int
    max_stored: int
    max_streams: int
    max_drawings: int
    dataset_retention: int


#: Names of the quotas.
QUOTA_NAMES = tuple(field.name for field in fields(Quotas))


@dataclass(frozen=True, slots=True)
class Owner:
    """An owner with its weight, quotas and use of the service.

    Attributes
    ----------
    weight : int
        Share of the claims: an owner with twice the weight gets twice as many.
    quotas : mapping
        Quota by name; None is the default of the settings.
    queued, running : int
        Number of jobs.
    running_islands : int
        Islands of the running jobs.
    stored : int
        Total size of the data sets in bytes.
    """

    name: str
    weight: int
    quotas: Mapping[str, int | None]
    queued: int
    running: int
    running_islands: int
    stored: int


def default_quotas(settings: ServiceSettings) -> Quotas:
    """Return the quotas of an owner for which none were set."""
    return Quotas(
        settings.max_active,
        settings.max_running,
        settings.max_running_islands,
        settings.max_run_seconds,
        settings.max_uploads_per_owner,
        settings.max_stored,
        settings.max_streams,
        settings.max_drawings,
        settings.dataset_retention,
    )


def merge_quotas(defaults: Quotas, own: Mapping[str, int | None]) -> Quotas:
    """Replace the defaults by the quotas that are set."""
    return Quotas(**{**asdict(defaults), **{name: most for name, most in own.items() if most is not None}})


def check_owner_changes(changes: Mapping[str, Any]) -> None:
    """Refuse an unknown or invalid change of an owner.

    Parameters
    ----------
    changes : mapping
        New ``weight`` and quotas. None restores the default.

    Raises
    ------
    SettingsError
    """
    for name, value in changes.items():
        if name == "weight":
            if value is not None and value not in WEIGHTS:
                raise SettingsError(
                    f"weight is an integer from {WEIGHTS.start} to {WEIGHTS.stop - 1}, got {value}"
                )
        elif name not in QUOTA_NAMES:
            raise SettingsError(
                f"{name} is no quota: take one of {', '.join(QUOTA_NAMES)}{suggest(name, QUOTA_NAMES)}"
            )
        elif value is not None and not 0 <= value <= MAX_QUOTA:
            raise SettingsError(f"{name} is an integer of at least 0, got {value}")
