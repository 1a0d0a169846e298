"""A measured property of a record."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from islands.sentences import write_one


@dataclass(frozen=True, slots=True)
class Fact:
    """A property of a signal or of a record, as measured.

    Attributes
    ----------
    name : str
        Property, such as ``dead-time``.
    signal : str
        Column that it describes. Empty for a property of the whole record.
    finding : str
        What was found: the statement of the template ``record`` that writes the fact.
    value : float, bool or None
        Measured value; None if the record does not determine it.
    unit : str
        Unit of the value and of the interval.
    interval : tuple of float or None
        95 % interval of the value, if there is one.
    confidence : float or None
        Probability that the value is right, between 0 and 1; None if there is no estimate of it. The sentence
        of a dead time says what counts as right.
    details : mapping
        Further quantities and decisions that the sentence states.
    """

    name: str
    signal: str
    finding: str
    value: float | bool | None = None
    unit: str = ""
    interval: tuple[float, float] | None = None
    confidence: float | None = None
    details: Mapping[str, Any] = field(default_factory=dict)

    @property
    def sentence(self) -> str:
        """The fact in one sentence."""
        return write_one("record", self.finding, fact=self, **{"name": self.signal, **self.details})

    def as_document(self) -> dict[str, Any]:
        """Return the fact as a JSON document."""
        names = ("name", "signal", "value", "unit", "interval", "confidence", "sentence")
        document = {name: getattr(self, name) for name in names}
        return document | {"interval": None if self.interval is None else list(self.interval)}
