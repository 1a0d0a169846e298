"""Admission: what a job must be before it is accepted. What is wrong is said now, not by a failed job."""

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from math import prod
from typing import Any

from islands.errors import RecordError, SettingsError
from islands.io.models import model_from_json
from islands.io.records.column_names import find_column
from islands.io.records.row_range import overlap, parse_rows
from islands.io.records.validation import check_choice
from islands.io.simulator_spec.specification import PARAMETERS, ModelSpec, PhysicalSpec, innermost
from islands_service.domain.job_spec import (
    LIMITS,
    SHIFT,
    Discrepancy,
    Identification,
    Part,
    resolve_job_settings,
)
from islands_service.intake.file_inspection import InspectionRequest
from islands_service.settings import ServiceSettings
from islands_service.store import Store
from islands_service.store.datasets import StoredDataset

#: The most characters of a simulation, which stands in every list of jobs; and of all terms of a model with
#: their powers written out, since that is what reading them takes.
_SIMULATION, _WRITTEN_OUT = 50_000, 200_000


@dataclass(frozen=True, slots=True)
class PendingInspection:
    """A data set that has to be read once more, as the job would, to know whether that works."""

    dataset: StoredDataset
    request: InspectionRequest


def validate_job(
    spec: Identification | Discrepancy, owner: str, store: Store, settings: ServiceSettings
) -> tuple[PendingInspection, ...]:
    """Refuse a job that could only fail; return what the previews of its data sets leave open.

    Raises
    ------
    SettingsError
        A setting is unknown, out of range, or asks for more than this service gives.
    DatasetNotFoundError
        A data set is not there, or belongs to somebody else.
    RecordError
        A column is not there, or cannot be used.
    ModelError
        What is to be held against a record is no model.
    """
    doubts = []
    for part in _parts(spec, settings):
        dataset = store.datasets.get(owner, part.dataset)
        if not _plain(spec, part, dataset.preview, dataset.name):
            doubts.append(
                PendingInspection(dataset, InspectionRequest(spec.inputs, spec.output, spec.dt, part.rows))
            )
    return tuple(doubts)


def _parts(spec: Identification | Discrepancy, settings: ServiceSettings) -> list[Part]:
    return _of_discrepancy(spec) if isinstance(spec, Discrepancy) else _of_identification(spec, settings)


def _of_identification(spec: Identification, settings: ServiceSettings) -> list[Part]:
    """Check what an identification asks for; return what it reads."""
    resolve_job_settings(spec, settings.max_islands, settings.max_evaluations)
    parts = [Part(dataset=spec.dataset, rows=spec.rows)]
    if isinstance(spec.validation, Part):
        parts.append(spec.validation)
        if len(set(spec.datasets)) == 1 and overlap(*(parse_rows(part.rows) for part in parts)):
            raise SettingsError(
                "the validation shares samples with those that estimate: say with rows START:STOP which "
                "samples do either, or take another data set"
            )
    return parts


def _of_discrepancy(spec: Discrepancy) -> list[Part]:
    """Check what a discrepancy job asks for; return what it reads."""
    _check_simulation(spec)
    if spec.input in spec.channels:
        raise RecordError(f"channel {spec.input} is the input itself: leave it out")
    for name in spec.recorded_columns:
        if name in (spec.input, spec.output, *spec.channels):
            raise RecordError(
                f"column {name} is given as the simulation and as what it is held against: choose another "
                "one for either"
            )
    return [Part(dataset=spec.dataset, rows=spec.rows)]


def _check_simulation(spec: Discrepancy) -> None:
    """Refuse a model that is none, and a simulation that would take the machine.

    What else one can get wrong is said at the beginning of the job: to make one takes the kernels.
    """
    asked = spec.simulation
    if (size := len(json.dumps(asked.model_dump()))) > _SIMULATION:
        raise SettingsError(
            f"the simulation has {size} characters, and {_SIMULATION} is the most on this service"
        )
    core = innermost(asked)
    if isinstance(core, PhysicalSpec):
        _check_parameters(core, spec.tolerance if core is asked else {})
    if not isinstance(core, ModelSpec):
        return
    terms = core.model.get("terms")
    # Before it is read: a power of a power of a power takes all memory. What is no list is refused there.
    if isinstance(terms, list):
        if len(terms) > LIMITS["max_terms"]:
            raise SettingsError(
                f"{core.name} has {len(terms)} terms, and {LIMITS['max_terms']} is the most on this service"
            )
        if sum(map(_written_out, terms)) > _WRITTEN_OUT:
            raise SettingsError(f"{core.name} has terms that are too long, or of too high a degree")
    model = model_from_json(json.dumps(core.model), core.name)
    if model.maximum_lag > SHIFT:
        raise SettingsError(
            f"{core.name} reaches {model.maximum_lag} samples back, and {SHIFT} is the most on this service"
        )


def _check_parameters(core: PhysicalSpec, tolerance: Mapping[str, float]) -> None:
    """Refuse parameters that a system does not have; where it begins is known of a record alone."""
    known = PARAMETERS[core.kind]
    for name in (*core.parameters, *tolerance):
        if name not in known and not name.startswith("initial "):
            raise SettingsError(f"{core.kind} has no parameter {name!r}: it has {', '.join(known)}")


def _written_out(term: Any) -> int:
    """Return how many characters a term has at the most when it is written without powers."""
    text = term.get("regressor") if isinstance(term, dict) else None
    if not isinstance(text, str):
        return 0
    powers = re.findall(r"(?:\*\*|\^)\s*(\w*)", text)
    return len(text) * prod(max(1, int(each)) if re.fullmatch("[0-9]{1,3}", each) else 99 for each in powers)


def _plain(spec: Identification | Discrepancy, part: Part, preview: Mapping[str, Any], name: str) -> bool:
    """Tell whether a preview alone says that a record can be read: all of it, with its own sampling time.

    A preview looks at each column by itself: what speaks against using them together leaves a doubt.
    """
    columns = {column["name"]: column for column in preview["columns"]}
    sources = [find_column(given, tuple(columns)) for given in spec.inputs]
    check_choice(tuple(columns), sources, spec.output, name)
    chosen = (*sources, spec.output)
    clean = not any(columns[name]["problem"] for name in chosen)
    alike = len({columns[name]["samples"] for name in chosen}) == 1 and not any(
        "." in name for name in chosen
    )
    sampled = preview["dt"] is not None and preview["time"] not in chosen and not preview["warnings"]
    return clean and alike and sampled and part.rows is None and spec.dt is None
