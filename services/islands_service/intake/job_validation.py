"""Validation of a job before it is accepted, so that invalid jobs are rejected instead of failing later."""

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations
from math import prod
from typing import Any

from islands.errors import RecordError, SettingsError, lookup, suggest
from islands.estimation.constraints.state_space import find_conditions
from islands.estimation.estimator_table import REFITS
from islands.evolution.settings import LATENT
from islands.persistence.models import MODEL_CLASSES, NARX, model_from_json
from islands.records.compatibility import check_dt
from islands.records.coupled import check_outputs
from islands.records.reading.column_names import find_column
from islands.records.reading.row_range import overlap, parse_rows
from islands.records.reading.validation import check_choice
from islands.simulators.specification.table import SIMULATORS, ModelSpec, PhysicalSpec, innermost
from islands_service.domain.job_spec import Discrepancy, Identification, Part, SimulatedRecord
from islands_service.domain.search_limits import (
    DEFAULT_SHARE,
    LIMITS,
    MAX_SHIFT,
    estimate_memory,
    machine_memory,
    resolve_job_settings,
)
from islands_service.intake.file_inspection import InspectionRequest
from islands_service.intake.job_inputs import check_allowed, check_fmu
from islands_service.settings import ServiceSettings
from islands_service.store import Store
from islands_service.store.datasets import StoredDataset

#: Largest number of characters of a simulation, which is part of every list of jobs.
_MAX_SIMULATION = 50_000

#: Largest number of characters of the terms of a model with written-out powers, which bounds the cost of
#: parsing.
_MAX_WRITTEN_OUT = 200_000


@dataclass(frozen=True, slots=True)
class PendingInspection:
    """A data set whose preview is not sufficient, and the columns to read before the job is accepted."""

    dataset: StoredDataset
    request: InspectionRequest


@dataclass(frozen=True, slots=True)
class ValidJob:
    """Number of islands of a job, and the inspections that its data sets still need."""

    islands: int
    inspections: tuple[PendingInspection, ...]


def validate_job(
    spec: Identification | Discrepancy, owner: str, store: Store, settings: ServiceSettings
) -> ValidJob:
    """Reject a job that can only fail.

    Raises
    ------
    SettingsError
        A setting is unknown, out of range, or exceeds a limit of this service.
    DatasetNotFoundError, FmuNotFoundError
        The owner has no such data set, or FMU.
    RecordError
        A column is missing or unusable, or the data sets have different sampling times.
    ModelError
        The simulation contains an invalid model.
    """
    pending = []
    islands = _check_spec(spec, settings)
    if isinstance(spec, Discrepancy) and spec.fmu is not None:
        check_allowed(settings)
        check_fmu(spec.fmu, store.datasets.get(owner, spec.fmu.file, is_fmu=True))
    parts = list(spec.parts)
    datasets = [store.datasets.get(owner, part.dataset) for part in parts]
    _check_disjoint(parts, datasets)
    if spec.dt is None:
        _check_sampling(datasets)
    for part, dataset in zip(parts, datasets, strict=True):
        if not _is_readable(spec, part, dataset.preview, dataset.name):
            reading = dataset.preview.get("reading", {})
            is_diagnosis = isinstance(spec, Discrepancy)
            request = InspectionRequest(*spec.columns, spec.dt, part.rows, reading, is_diagnosis)
            pending.append(PendingInspection(dataset, request))
    return ValidJob(islands, tuple(pending))


def _check_spec(spec: Identification | Discrepancy, settings: ServiceSettings) -> int:
    """Check a job without its data; return the number of its islands, 1 without a search."""
    if isinstance(spec, Discrepancy):
        check_discrepancy(spec)
        return 1
    if len(spec.outputs) > 1:
        check_outputs(spec.inputs, spec.outputs)
    if spec.model != NARX:
        lookup(MODEL_CLASSES, spec.model, "class of models")
        if len(spec.outputs) > 1:
            raise SettingsError(
                f"a fit of models {spec.model} has one output: name one, or take the model {NARX} with the "
                f"preset {LATENT}"
            )
        is_latent = spec.model == LATENT
        if others := spec.changes.keys() - {"refit", *(["constraints"] if is_latent else [])}:
            listed = ", ".join(sorted(others))
            raise SettingsError(f"{listed}: settings are those of a search for models {NARX}, leave them out")
        lookup(REFITS, spec.changes.get("refit", "none"), "refit")
        find_conditions(spec.changes.get("constraints", "none"), len(spec.columns[0]))
        return 1
    resolved = resolve_job_settings(spec, settings.max_islands, settings.max_evaluations)
    limit = settings.max_job_memory or int(DEFAULT_SHARE * machine_memory())
    memory = estimate_memory(resolved)
    memory.check_limit(limit)
    # All kinds of the preset auto have the same number.
    return memory.islands


def _check_disjoint(parts: list[Part], datasets: list[StoredDataset]) -> None:
    """Reject recordings and validation data that share samples, also if a file was uploaded twice."""
    used = [(dataset.blob, parse_rows(part.rows)) for part, dataset in zip(parts, datasets, strict=True)]
    for (blob, rows), (other, other_rows) in combinations(used, 2):
        if blob == other and overlap(rows, other_rows):
            raise SettingsError(
                "recordings or validation data share samples: give rows START:STOP for each, or take another "
                "data set for one of them"
            )


def _check_sampling(datasets: list[StoredDataset]) -> None:
    """Reject data sets with different sampling times, as far as their previews contain them."""
    first, *others = datasets
    for other in others:
        if other.preview["dt"] is not None:
            check_dt(
                first.preview["dt"], other.preview["dt"], "the first data set", f"the data set {other.name}"
            )


def check_discrepancy(spec: SimulatedRecord) -> None:
    """Check the simulation and the columns of a discrepancy job without its data.

    Raises
    ------
    SettingsError, RecordError, ModelError
        See `validate_job`.
    """
    _check_simulation(spec)
    if spec.input in spec.channels:
        raise RecordError(f"channel {spec.input} is the input itself: leave it out")
    for name in spec.recorded_columns:
        if name in (spec.input, spec.output, *spec.channels):
            raise RecordError(
                f"column {name} is given as the simulation and also as an input, a channel or the "
                "output: choose another column for one of them"
            )


def _check_simulation(spec: SimulatedRecord) -> None:
    """Reject an invalid model, and a simulation that would exhaust the memory or the time of this process.

    Further errors are reported when the job starts, because making a simulator needs the kernels.
    """
    simulation = spec.simulation
    if (size := len(json.dumps(simulation.model_dump()))) > _MAX_SIMULATION:
        raise SettingsError(
            f"the simulation has {size} characters, and {_MAX_SIMULATION} is the most on this service"
        )
    core = innermost(simulation)
    if isinstance(core, PhysicalSpec):
        _check_parameters(core, spec.tolerance if core is simulation else {})
    if not isinstance(core, ModelSpec):
        return
    terms = core.model.get("terms")
    # Check before parsing: nested powers would exhaust memory. The parser rejects a value that is not a
    # list.
    if isinstance(terms, list):
        if len(terms) > LIMITS["max_terms"]:
            raise SettingsError(
                f"{core.name} has {len(terms)} terms, and {LIMITS['max_terms']} is the most on this service"
            )
        if sum(map(_written_out_length, terms)) > _MAX_WRITTEN_OUT:
            raise SettingsError(f"{core.name} has terms that are too long, or of too high a degree")
    model = model_from_json(json.dumps(core.model), core.name)
    if model.maximum_lag > MAX_SHIFT:
        raise SettingsError(
            f"{core.name} reaches {model.maximum_lag} samples back, and {MAX_SHIFT} is the most on this "
            "service"
        )


def _check_parameters(core: PhysicalSpec, tolerance: Mapping[str, float]) -> None:
    """Reject unknown parameters. Initial values are not checked, since their number depends on the record."""
    known = SIMULATORS[core.kind].parameters
    for name in (*core.parameters, *tolerance):
        if name not in known and not name.startswith("initial "):
            raise SettingsError(
                f"{core.kind} has no parameter {name!r}: it has {', '.join(known)}{suggest(name, known)}"
            )


def _written_out_length(term: Any) -> int:
    """Return an upper bound of the number of characters of a term that is written without powers."""
    text = term.get("regressor") if isinstance(term, dict) else None
    if not isinstance(text, str):
        return 0
    powers = re.findall(r"(?:\*\*|\^)\s*(\w*)", text)
    return len(text) * prod(max(1, int(each)) if re.fullmatch("[0-9]{1,3}", each) else 99 for each in powers)


def _is_readable(
    spec: Identification | Discrepancy, part: Part, preview: Mapping[str, Any], name: str
) -> bool:
    """Return whether the preview proves that the whole record can be read with its own sampling time.

    A preview describes each column separately. If the combination may fail, the answer is False.
    """
    columns = {column["name"]: column for column in preview["columns"]}
    inputs, output = spec.columns
    sources = [find_column(given, tuple(columns)) for given in inputs]
    check_choice(tuple(columns), sources, output, name)
    chosen = (*sources, output)
    clean = not any(columns[name]["problem"] for name in chosen)
    alike = len({columns[name]["samples"] for name in chosen}) == 1 and not any(
        "." in name for name in chosen
    )
    sampled = preview["dt"] is not None and preview["time"] not in chosen and not preview["warnings"]
    return clean and alike and sampled and part.rows is None and spec.dt is None
