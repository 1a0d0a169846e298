"""Which part of the data estimates and which validates."""

from dataclasses import dataclass

from islands.data.dataset import Dataset
from islands.errors import SettingsError


@dataclass(frozen=True, slots=True)
class Split:
    """Data that estimates parameters and data that selects among the models estimated."""

    estimation: Dataset
    validation: Dataset


def split(record: Dataset, fraction: float = 0.25) -> Split:
    """Keep the last ``fraction`` of the record for validation.

    The validation part warms up on samples of its own, so nothing of the estimation part is used there.

    Raises
    ------
    SettingsError
        The fraction is not inside (0, 1) or leaves a part empty.
    """
    if not 0.0 < fraction < 1.0:
        raise SettingsError(f"the validation fraction lies between 0 and 1, got {fraction}")
    boundary = record.samples - round(record.samples * fraction)
    if boundary in (0, record.samples):
        raise SettingsError(f"a fraction of {fraction} of {record.samples} samples leaves a part empty")
    return Split(record[:boundary], record[boundary:])
