"""Which part of the data estimates and which validates."""

from dataclasses import dataclass

from islands.data.dataset import SAME_DT, Dataset
from islands.errors import RecordError, SettingsError


@dataclass(frozen=True, slots=True)
class Split:
    """Data that estimates parameters and data that selects among the models estimated.

    The columns' names may differ (``u_est_V``, ``u_val_V``): inputs correspond by their order.

    Attributes
    ----------
    estimation, validation : Dataset
        Records of one system.

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


def split_data(record: Dataset, validation: Dataset | float) -> Split:
    """Return estimation and validation data: two records, or two parts of one record.

    Raises
    ------
    RecordError
        The validation data has another number of inputs or sampling time.
    SettingsError
        The fraction leaves a part empty.
    """
    return Split(record, validation) if isinstance(validation, Dataset) else split(record, validation)
