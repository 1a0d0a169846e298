"""Split of the data into an estimation part and a validation part."""

from dataclasses import dataclass

from islands.data.dataset import SAME_DT, Dataset
from islands.errors import RecordError, SettingsError


@dataclass(frozen=True, slots=True)
class Split:
    """Estimation data and validation data.

    Parameters are estimated on the estimation data. Models are selected on the validation data. Column names
    may differ (``u_est_V``, ``u_val_V``), because inputs are matched by position.

    Attributes
    ----------
    estimation, validation : Dataset
        Records of the same system.

    Raises
    ------
    RecordError
        The records differ in the number of inputs or in sampling time.
    """

    estimation: Dataset
    validation: Dataset

    def __post_init__(self) -> None:
        estimation, validation = self.estimation, self.validation
        if estimation.inputs != validation.inputs:
            raise RecordError(
                f"the estimation data has {estimation.inputs} inputs, the validation data "
                f"{validation.inputs}: give both the same inputs in the same order"
            )
        if abs(estimation.dt - validation.dt) > SAME_DT * estimation.dt:
            raise RecordError(
                f"the estimation data was sampled at {estimation.dt} s, the validation data at "
                f"{validation.dt} s: resample one of them"
            )


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
        The validation data has a different number of inputs or sampling time.
    SettingsError
        The fraction leaves a part empty.
    """
    return Split(record, validation) if isinstance(validation, Dataset) else split(record, validation)
