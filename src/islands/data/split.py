"""Split of the data into an estimation part and a validation part."""

from dataclasses import dataclass

from islands.data.compatibility import match_record
from islands.data.dataset import Dataset
from islands.errors import SettingsError


@dataclass(frozen=True, slots=True)
class Split:
    """Estimation data and validation data.

    Parameters are estimated on the estimation data. Models are selected on the validation data. Inputs are
    matched by name; if no name occurs in both, by position (``u_est_V``, ``u_val_V``). See `match_record`.

    Attributes
    ----------
    estimation, validation : Dataset
        Records of the same system. The inputs of the validation data are brought into the order of the
        estimation data.

    Raises
    ------
    RecordError
        The records differ in their columns, units or sampling time.
    """

    estimation: Dataset
    validation: Dataset

    def __post_init__(self) -> None:
        matched = match_record(self.estimation, self.validation, "the estimation data", "the validation data")
        object.__setattr__(self, "validation", matched)


def split(record: Dataset, fraction: float = 0.25) -> Split:
    """Split off the last ``fraction`` of the record for validation.

    The warm-up of the validation part uses samples of that part, never of the estimation part.

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


def split_data(record: Dataset, validation: Dataset | float) -> Split:
    """Return the split of two records, or of one record and a validation fraction.

    Raises
    ------
    RecordError
        The validation data has other columns, units or another sampling time.
    SettingsError
        The fraction leaves a part empty.
    """
    return Split(record, validation) if isinstance(validation, Dataset) else split(record, validation)
