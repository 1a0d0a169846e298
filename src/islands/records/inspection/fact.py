"""A measured property of a record."""

from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class Fact:
    """A property of a signal or of a record, as measured.

    Attributes
    ----------
    name : str
        Property, such as ``dead-time``.
    signal : str
        Column that it describes. Empty for a property of the whole record.
    value : float, bool or None
        Measured value; None if the record does not determine it.
    unit : str
        Unit of the value and of the interval.
    interval : tuple of float or None
        95 % interval of the value, if there is one.
    confidence : float or None
        Probability that the value is right, between 0 and 1; None if there is no estimate of it. The sentence
        of a dead time says what counts as right.
    sentence : str
        The fact in one sentence.
    """

    name: str
    signal: str
    value: float | bool | None
    unit: str
    interval: tuple[float, float] | None
    confidence: float | None
    sentence: str

    def as_document(self) -> dict[str, Any]:
        """Return the fact as a JSON document with the names of the attributes as keys."""
        return asdict(self) | {"interval": None if self.interval is None else list(self.interval)}
