"""Split of the data into an estimation part and a validation part."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product

import numpy as np

from islands.errors import ExtrapolationWarning, SettingsError, check_numbers, check_type
from islands.records.averaging import average_samples
from islands.records.channel_names import parse_channel_name
from islands.records.compatibility import Reference, match_record
from islands.records.dataset import Dataset, join
from islands.records.magnitudes import check_magnitudes
from islands.records.missing_outputs import skip_missing_outputs

#: Fraction of a record, at its end, that a diagnosis reserves for hold-out validation.
HOLDOUT_FRACTION = 0.25

#: Minimum number of samples of each of several recordings, and of each part of one that the hold-out part
#: divides: its initial state is estimated from them.
MIN_RECORDING_SAMPLES = 20


#: Excess over a range, as a fraction of it, that is no extrapolation.
_NEGLIGIBLE_EXCESS = 0.05


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

    @property
    def segments(self) -> tuple[int, ...]:
        """Lengths of the recordings of both parts in samples."""
        return self.estimation.segments + self.validation.segments

    def __post_init__(self) -> None:
        matched = match_record(self.estimation, self.validation, "the estimation data", "the validation data")
        object.__setattr__(self, "validation", matched)


# All models of a split are fitted to the same record, whose caches they share.
@lru_cache(maxsize=4)
def join_parts(split: Split) -> Dataset:
    """Return both parts of a split as one record, with the columns of the estimation data."""
    columns = ("input_names", "output_name", "input_units", "output_unit", "preprocessing")
    names = {name: getattr(split.estimation, name) for name in columns}
    return join((split.estimation, replace(split.validation, **names)))


def split(record: Dataset, fraction: float = 0.25) -> Split:
    """Split off the last ``fraction`` of every recording for validation.

    The warm-up of the validation part uses samples of that part, never of the estimation part.

    Raises
    ------
    SettingsError
        The fraction is not inside (0, 1) or leaves a part empty.
    """
    check_type(record, Dataset, "split", "make one by as_record(data, inputs=..., output=...)")
    check_numbers(fraction=fraction)
    if not 0.0 < fraction < 1.0:
        raise SettingsError(f"the validation fraction lies between 0 and 1, got {fraction}")
    estimation, validation = [], []
    for rows in record.rows_by_recording.values():
        boundary = rows.stop - round((rows.stop - rows.start) * fraction)
        estimation.append(slice(rows.start, boundary))
        validation.append(slice(boundary, rows.stop))
    parts = [
        tuple(record[each] for each in rows if each.stop > each.start) for rows in (estimation, validation)
    ]
    if not all(parts):
        raise SettingsError(f"a fraction of {fraction} of {record.samples} samples leaves a part empty")
    return Split(*map(join, parts))


def split_data(record: Dataset, validation: Dataset | float) -> Split:
    """Return the split of two records, or of one record and a validation fraction.

    Samples without an output are skipped: the parts before and after them become segments.

    Raises
    ------
    RecordError
        The validation data has other columns, units or another sampling time, every output is missing, or a
        magnitude is too large or too small to calculate with.
    SettingsError
        The fraction leaves a part empty, or the validation data has samples of the record.
    """
    if not isinstance(validation, Dataset):
        parts = split(record, validation)
        parts = Split(*map(skip_missing_outputs, (parts.estimation, parts.validation)))
        check_magnitudes(parts.estimation, parts.validation)
        return parts
    parts = Split(skip_missing_outputs(record), skip_missing_outputs(validation))
    check_magnitudes(parts.estimation, parts.validation)
    if share_samples(parts.estimation, parts.validation):
        raise SettingsError(
            "the validation data has samples that are used for estimation: give another recording, other "
            "rows, or a fraction of the record"
        )
    return parts


def measure_input_ranges(record: Dataset) -> list[tuple[float, float]]:
    """Return the least and the largest value of every input."""
    return [(float(signal.min()), float(signal.max())) for signal in record.u.T]


def describe_extrapolation(parts: Split) -> list[str]:
    """State every input of the validation data that leaves the range of the estimation data."""
    record = parts.estimation
    estimated, validated = map(measure_input_ranges, (parts.estimation, parts.validation))
    return compare_input_ranges(record.input_names, record.input_units, estimated, validated)


def warn_of_extrapolation(parts: Split) -> None:
    """Warn the caller of a search of every input whose validation data leave the range of the estimation."""
    for statement in describe_extrapolation(parts):
        # The search is the caller of this function.
        warnings.warn(f"validation extrapolates: {statement}", ExtrapolationWarning, stacklevel=3)


def compare_input_ranges(
    names: Sequence[str],
    units: Sequence[str],
    estimated: Sequence[Sequence[float]],
    others: Sequence[Sequence[float]],
    title: str = "the validation data",
) -> list[str]:
    """State every input whose range in other data leaves that in the estimation data.

    An excess of at most 5 % of the range does not count.

    Parameters
    ----------
    names, units : sequence of str
        Of the inputs.
    estimated, others : sequence of (float, float)
        Least and largest value of every input in the estimation data and in the other data.
    title : str
        Name of the other data.
    """
    found = []
    for name, unit, (low, high), (lowest, highest) in zip(names, units, estimated, others, strict=True):
        allowed = _NEGLIGIBLE_EXCESS * (high - low)
        if lowest < low - allowed or highest > high + allowed:
            found.append(
                f"{parse_channel_name(name).base} is {lowest:.4g} to {highest:.4g} {unit}".rstrip()
                + f" in {title} and {low:.4g} to {high:.4g} {unit}".rstrip()
                + " in the estimation data"
            )
    return found


def hold_out(record: Dataset, validation: Dataset) -> Dataset:
    """Return the joined recordings of two records, of which a diagnosis holds out the second one as a whole.

    Raises
    ------
    RecordError
        The records differ in their columns, units or sampling time.
    SettingsError
        The validation data has samples of the record.
    """
    parts = Split(record, validation)
    if share_samples(record, validation):
        raise SettingsError(
            "the validation data has samples of the record: give another recording, or other rows"
        )
    return replace(join((parts.estimation, parts.validation)), held_out=validation.samples)


def average_split(split: Split, count: int) -> Split:
    """Return the split with means of ``count`` samples; the split itself for a count of 1."""
    if count == 1:
        return split
    return Split(average_samples(split.estimation, count), average_samples(split.validation, count))


def match_split(reference: Reference, split: Split) -> Split:
    """Return the split with its inputs in the order of a model, advanced if the model reads them early."""
    return Split(match_record(reference, split.estimation), match_record(reference, split.validation))


def share_samples(one: Dataset, other: Dataset) -> bool:
    """Return whether two records with the same sampling time have samples in common.

    They do if a recording of one has the samples of a recording of the other, or if the two overlap in time
    and either are the same column of one file or agree, with an output that is not constant, throughout the
    overlap.
    """
    pairs = product(*([each[rows] for rows in each.rows_by_recording.values()] for each in (one, other)))
    return any(_recordings_share_samples(*pair) for pair in pairs)


def _recordings_share_samples(one: Dataset, other: Dataset) -> bool:
    if one.samples == other.samples and _agree(one, other):
        return True
    offset = round((other.start - one.start) / one.dt)
    first, last = max(0, offset), min(one.samples, offset + other.samples)
    if first >= last:
        return False
    if one.sha256 and (one.sha256, one.output_name) == (other.sha256, other.output_name):
        return True
    overlap = one[first:last]
    return bool(np.ptp(overlap.y) > 0.0) and _agree(overlap, other[first - offset : last - offset])


def _agree(one: Dataset, other: Dataset) -> bool:
    return np.array_equal(one.y, other.y) and np.array_equal(one.u, other.u)


def estimation_part(record: Dataset) -> Dataset:
    """Return the part of a record that is used for estimation, without the hold-out part at its end.

    The hold-out part is that of the record, or its last quarter, which may consist of whole recordings. The
    quarter begins with a recording if less than `MIN_RECORDING_SAMPLES` would be divided from one.
    """
    if record.held_out:
        return record[: -record.held_out]
    fitted = int((1.0 - HOLDOUT_FRACTION) * record.samples)
    for boundary, _ in record.bounds[1:]:
        if abs(fitted - boundary) < MIN_RECORDING_SAMPLES:
            fitted = boundary
            break
    return record[:fitted]
