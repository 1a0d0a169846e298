"""What an inspection finds in a file: its columns, its sampling, the chosen record and its facts."""

from dataclasses import asdict, dataclass, field
from typing import Any

from islands.records.dataset import Dataset
from islands.records.inspection.column_roles import ColumnChoice
from islands.records.inspection.fact import Fact
from islands.records.inspection.record_facts import RecordFacts
from islands.records.inspection.record_note import RecordNote

#: Schema of the document.
SCHEMA = "islands.inspection/1"


@dataclass(frozen=True, slots=True)
class InspectedColumn:
    """A column of a file.

    Attributes
    ----------
    name, unit : str
    role : str
        ``time``, ``input``, ``output`` or empty.
    minimum, maximum : float or None
        Range of the values that are not missing; None if there is none.
    missing : int
        Number of missing values.
    problem : str
        Why the column cannot be used as it is; empty if it can.
    """

    name: str
    unit: str
    role: str
    minimum: float | None
    maximum: float | None
    missing: int
    problem: str


@dataclass(frozen=True, slots=True)
class InspectedSampling:
    """Sampling of a file.

    Attributes
    ----------
    time : str or None
        Name of the time column.
    samples : int
    dt : float or None
        Sampling time in seconds; None if it is unknown.
    jitter : float or None
        Root mean square deviation of the steps, relative to ``dt``; None without a time column.
    gaps, repeated, backward : tuple of str
        Rows before which samples are missing, that repeat a time stamp, and whose time stamp is earlier than
        the one before: ``line 14``. The first `islands.records.inspection.record_note.MOST_ROWS` of each.
    counts : dict
        Number of all rows of each kind, and of missing samples.
    problem : str
        Why the sampling is not uniform, with a remedy; empty if it is.
    """

    time: str | None
    samples: int
    dt: float | None
    jitter: float | None
    gaps: tuple[str, ...]
    repeated: tuple[str, ...]
    backward: tuple[str, ...]
    counts: dict[str, int]
    problem: str


@dataclass(frozen=True, slots=True)
class RecordInspection:
    """What an inspection found in a file.

    Attributes
    ----------
    file : str
        Path of the file as given.
    columns : tuple of InspectedColumn
        In the file's order.
    sampling : InspectedSampling
    choice : ColumnChoice
        Inputs and output that the facts describe.
    facts : RecordFacts
        Empty if inputs, output or sampling time are unknown.
    notes : tuple of RecordNote
        Problems of the record, with remedies, and remarks on what was inferred.
    command : str
        Next command; empty if inputs and output are unknown.
    remedy : dict
        Options of reading in addition to the given ones with which the record can be used; empty if it can
        be used without, or if none of those that were tried helps.
    record : Dataset or None
        The record that the facts describe, cut where samples are missing.
    """

    file: str
    columns: tuple[InspectedColumn, ...]
    sampling: InspectedSampling
    choice: ColumnChoice
    facts: RecordFacts
    notes: tuple[RecordNote, ...]
    command: str
    remedy: dict[str, Any] = field(default_factory=dict)
    record: Dataset | None = field(default=None, repr=False, compare=False)

    def __repr__(self) -> str:
        chosen = (
            f"{', '.join(self.choice.inputs)} to {self.choice.output}" if self.choice.output else "no record"
        )
        return f"<RecordInspection of {self.file}: {chosen}, {len(self.facts.facts)} facts>"

    @property
    def warnings(self) -> tuple[str, ...]:
        """Texts of the notes."""
        return tuple(note.text for note in self.notes)

    def find(self, name: str, signal: str | None = None) -> Fact:
        """Return the fact of a name, such as ``dead-time``, about a signal if several have it.

        Raises
        ------
        KeyError
            There is no such fact.
        """
        return self.facts.find(name, signal)

    def as_document(self) -> dict[str, Any]:
        """Return everything but the samples as a JSON document."""
        return {
            "schema": SCHEMA,
            "file": self.file,
            "columns": [asdict(column) for column in self.columns],
            "sampling": asdict(self.sampling),
            "choice": self.choice.as_document(),
            "facts": [fact.as_document() for fact in self.facts.facts],
            "warnings": list(self.warnings),
            "notes": [note.as_document() for note in self.notes],
            "remedy": self.remedy,
            "command": self.command,
        }
