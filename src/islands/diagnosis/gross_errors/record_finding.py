"""Finding about a record: a gross error, or a property that the reader of a diagnosis has to know."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from islands.records.dataset import Dataset
from islands.records.segments import find_runs
from islands.records.signal_ranges import compare_ranges, measure_ranges
from islands.simulators.extended import SavedExtension
from islands.simulators.interface import Simulator

#: Family of gross errors in the list of causes.
FAMILY = "gross"


@dataclass(frozen=True, slots=True)
class RecordFinding:
    """A finding about a record.

    Findings are made before the search for effects. They concern the record and the way in which it was read,
    not the physics of the simulation.

    Attributes
    ----------
    name : str
        Name such as ``output-unit`` or ``duplicated-channel``.
    description : str
        What is wrong, as one or more sentences.
    advice : str
        What to do, as a sentence.
    parameters : mapping
        Values by name, each with its unit; the unit of a fraction or a factor is empty.
    errors : tuple of float or None
        RMS errors of the calibrated simulation over the estimation part, as given and with the correction,
        relative to the standard deviation of the output; None if the finding explains no misfit.
    """

    name: str
    description: str
    advice: str
    parameters: Mapping[str, tuple[float, str]] = field(default_factory=dict)
    errors: tuple[float, float] | None = None

    @property
    def text(self) -> str:
        """Description and advice, for reports."""
        return f"{self.description} {self.advice}"

    def as_document(self) -> dict[str, Any]:
        """Return the finding as JSON values."""
        return {
            "name": self.name,
            "description": self.description,
            "advice": self.advice,
            "parameters": {
                name: {"value": value, "unit": unit} for name, (value, unit) in self.parameters.items()
            },
            "errors": None if self.errors is None else {"before": self.errors[0], "after": self.errors[1]},
        }


def describe_extrapolation(record: Dataset, simulator: Simulator) -> tuple[RecordFinding, ...]:
    """Return a finding if a record leaves the ranges in which an extended simulation was tested."""
    if not isinstance(simulator, SavedExtension):
        return ()
    statements = compare_ranges(simulator.tested, measure_ranges(record, record.y)[:-1])
    if not statements:
        return ()
    return (
        RecordFinding(
            "extrapolation",
            f"{'; '.join(statements)}.",
            "An error there may be that of the extension.",
        ),
    )


def describe_gaps(record: Dataset) -> tuple[RecordFinding, ...]:
    """Return a finding if outputs are missing; otherwise nothing."""
    is_missing = np.isnan(record.y)
    if not is_missing.any():
        return ()
    gaps = find_runs(is_missing, record.segments)
    count, longest = int(is_missing.sum()), max(last - first for first, last in gaps)
    share = count / record.samples
    return (
        RecordFinding(
            "missing-output",
            f"{count} of {record.samples} outputs are missing ({100 * share:.2g} %), in {len(gaps)} gaps of "
            f"at most {longest * record.dt:.4g} s. They do not count.",
            "No step is necessary (option gaps: interpolate would add values that were not measured).",
            {"share": (share, ""), "longest": (longest * record.dt, "s")},
        ),
    )
