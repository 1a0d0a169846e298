"""Admission: what a job must be before it is accepted. What is wrong is said now, not by a failed job."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from islands.errors import SettingsError
from islands.io.records.checks import check_choice
from islands.io.records.names import column_of
from islands_service.inspection import Asked
from islands_service.rows import overlap, rows_of
from islands_service.settings import ServiceSettings
from islands_service.specification import Identification, Part, checked
from islands_service.store import Store
from islands_service.store.datasets import StoredDataset


@dataclass(frozen=True, slots=True)
class Doubt:
    """A data set that has to be read once more, as the job would, to know whether that works."""

    dataset: StoredDataset
    asked: Asked


def admit(spec: Identification, owner: str, store: Store, settings: ServiceSettings) -> tuple[Doubt, ...]:
    """Refuse a job that could only fail; return what the previews of its data sets leave open.

    Raises
    ------
    SettingsError
        A setting is unknown, out of range, or asks for more than this service gives.
    NoSuchDataset
        A data set is not there, or belongs to somebody else.
    RecordError
        A column is not there, or cannot be used.
    """
    checked(spec, settings.max_islands, settings.max_evaluations)
    parts = [Part(dataset=spec.dataset, rows=spec.rows)]
    if isinstance(spec.validation, Part):
        parts.append(spec.validation)
        if len(set(spec.datasets)) == 1 and overlap(*(rows_of(part.rows) for part in parts)):
            raise SettingsError(
                "the validation shares samples with those that estimate: say with rows START:STOP which "
                "samples do either, or take another data set"
            )
    doubts = []
    for part in parts:
        dataset = store.datasets.get(owner, part.dataset)
        if not _plain(spec, part, dataset.preview, dataset.name):
            doubts.append(Doubt(dataset, Asked(spec.inputs, spec.output, spec.dt, part.rows)))
    return tuple(doubts)


def _plain(spec: Identification, part: Part, preview: Mapping[str, Any], name: str) -> bool:
    """Tell whether a preview alone says that a record can be read: all of it, with its own sampling time.

    A preview looks at each column by itself: what speaks against using them together leaves a doubt.
    """
    columns = {column["name"]: column for column in preview["columns"]}
    sources = [column_of(given, tuple(columns)) for given in spec.inputs]
    check_choice(tuple(columns), sources, spec.output, name)
    chosen = (*sources, spec.output)
    clean = not any(columns[name]["problem"] for name in chosen)
    alike = len({columns[name]["samples"] for name in chosen}) == 1 and not any(
        "." in name for name in chosen
    )
    sampled = preview["dt"] is not None and preview["time"] not in chosen and not preview["warnings"]
    return clean and alike and sampled and part.rows is None and spec.dt is None
