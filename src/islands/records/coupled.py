"""Record of several outputs of one system, which share the inputs and the time grid."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from islands.errors import RecordError
from islands.records.channel_names import parse_channel_name
from islands.records.compatibility import ColumnReference, match_record
from islands.records.dataset import Dataset
from islands.records.missing_outputs import skip_missing_outputs
from islands.records.split import Split, split, split_data


@dataclass(frozen=True, slots=True, eq=False)
class CoupledRecord:
    """One record per output, all with the same inputs, segments and sampling time.

    Read each of them with ``read_record`` from the same file.

    Attributes
    ----------
    records : tuple of Dataset
        The inputs and one output each; at least two.

    Raises
    ------
    RecordError
        There are fewer than two outputs, an output occurs twice or is also an input, or the records have
        other inputs, segments or sampling times.
    """

    records: tuple[Dataset, ...]

    def __post_init__(self) -> None:
        check_outputs(self.records[0].input_names if self.records else (), self.output_names)
        first = self.records[0]
        for record in self.records:
            if (record.input_names, record.dt, record.segments) != (
                first.input_names,
                first.dt,
                first.segments,
            ) or not np.array_equal(record.u, first.u):
                raise RecordError(
                    f"the records of {first.output_name} and {record.output_name} differ in their inputs, "
                    "segments or sampling time: read all outputs with the same options"
                )

    @property
    def output_names(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return tuple(record.output_name for record in self.records)

    @property
    def input_names(self) -> tuple[str, ...]:
        """Names of the inputs, without the outputs."""
        return self.records[0].input_names

    @property
    def dt(self) -> float:
        """Sampling time in seconds."""
        return self.records[0].dt

    @property
    def samples(self) -> int:
        """Number of samples."""
        return self.records[0].samples

    @property
    def segments(self) -> tuple[int, ...]:
        """Number of samples of each segment."""
        return self.records[0].segments

    @property
    def bounds(self) -> tuple[tuple[int, int], ...]:
        """First sample of each segment, and the one after its last."""
        return self.records[0].bounds

    @property
    def u(self) -> NDArray[np.float64]:
        """The inputs, shape (samples, inputs)."""
        return self.records[0].u

    @property
    def y(self) -> NDArray[np.float64]:
        """The outputs, shape (samples, outputs). NaN marks a missing value."""
        return np.column_stack([record.y for record in self.records])

    def __len__(self) -> int:
        return self.samples

    def __repr__(self) -> str:
        inputs, outputs = ", ".join(self.input_names), ", ".join(self.output_names)
        return f"<CoupledRecord of {self.samples} samples of {self.dt:g} s: {inputs} to {outputs}>"

    def map(self, function: Callable[[Dataset], Dataset]) -> "CoupledRecord":
        """Return the record with a function applied to the record of every output."""
        return CoupledRecord(tuple(map(function, self.records)))

    def separate(self, place: int) -> Dataset:
        """Return the record of one output, with the other outputs as further inputs.

        Raises
        ------
        RecordError
            A value of another output is missing.
        """
        record = self.records[place]
        others = [other for other in self.records if other is not record]
        done = record.preprocessing
        return replace(
            record,
            u=np.column_stack([record.u, *(other.y for other in others)]),
            input_names=(*record.input_names, *(other.output_name for other in others)),
            input_units=(*record.input_units, *(other.output_unit for other in others)),
            preprocessing=done
            and done.with_inputs(
                other.preprocessing.output_offset if other.preprocessing else 0.0 for other in others
            ),
        )

    def skip_missing(self) -> "CoupledRecord":
        """Return the record without the samples of which an output is missing.

        The parts before and after them are segments, so that no regressor reads a missing value.

        Raises
        ------
        RecordError
            No sample has all outputs.
        """
        missing = np.isnan(self.y).any(axis=1)
        if not missing.any():
            return self
        if missing.all():
            raise RecordError("no sample has a value of every output: choose other outputs")
        return self.map(
            lambda record: skip_missing_outputs(replace(record, y=np.where(missing, np.nan, record.y)))
        )


#: Record of one or several outputs.
AnyRecord: TypeAlias = Dataset | CoupledRecord


def unite(records: Sequence[Dataset]) -> AnyRecord:
    """Return the record of several outputs, one record for each, or the only record."""
    return records[0] if len(records) == 1 else CoupledRecord(tuple(records))


@dataclass(frozen=True, slots=True)
class CoupledSplit:
    """Estimation data and validation data of several outputs.

    Attributes
    ----------
    estimation, validation : CoupledRecord
        Without samples of which an output is missing.
    record : CoupledRecord
        The record as passed by the user.
    """

    estimation: CoupledRecord
    validation: CoupledRecord
    record: CoupledRecord

    @property
    def segments(self) -> tuple[int, ...]:
        """Lengths of the recordings of both parts in samples."""
        return self.estimation.segments + self.validation.segments

    @property
    def first(self) -> Split:
        """Data of the first output, with the inputs that all outputs share."""
        return Split(self.estimation.records[0], self.validation.records[0])

    def map(self, function: Callable[[Dataset], Dataset]) -> "CoupledSplit":
        """Return the split with a function applied to the record of every output."""
        return CoupledSplit(*(each.map(function) for each in (self.estimation, self.validation, self.record)))


class OutputNames(Protocol):
    """Columns and sampling time of a model of several outputs."""

    @property
    def input_names(self) -> tuple[str, ...]:
        """Names of the inputs, without the outputs."""

    @property
    def output_names(self) -> tuple[str, ...]:
        """Names of the outputs."""

    @property
    def dt(self) -> float | None:
        """Sampling time in seconds. None if any is allowed."""


def match_coupled(
    model: OutputNames, record: CoupledRecord, inputs: Sequence[str] | None = None
) -> CoupledRecord:
    """Return a record with its columns in the order of a model.

    Outputs are matched by name, or by position if no name occurs in both; inputs as in `match_record`.

    Parameters
    ----------
    model : OutputNames
    record : CoupledRecord
    inputs : sequence of str, optional
        Names of the inputs in place of those of the model.

    Raises
    ------
    RecordError
        The columns, units or sampling time of the record are not those of the model.
    """
    by_name = {each.output_name: each for each in record.records}
    records = record.records
    if set(by_name) == set(model.output_names):
        records = tuple(by_name[name] for name in model.output_names)
    elif len(records) != len(model.output_names) or set(by_name) & set(model.output_names):
        raise RecordError(
            f"the model has the outputs {', '.join(model.output_names)}, the record "
            f"{', '.join(record.output_names)}: name the same outputs"
        )
    return CoupledRecord(
        tuple(
            match_record(ColumnReference(tuple(inputs or model.input_names), name, model.dt), each)
            for name, each in zip(model.output_names, records, strict=True)
        )
    )


def check_outputs(inputs: Sequence[str], outputs: Sequence[str]) -> None:
    """Check that there are several outputs, each named once, and none of them is an input.

    Raises
    ------
    RecordError
        The message names the column.
    """
    if len(outputs) < 2:
        raise RecordError(f"a coupled record has at least two outputs, got {', '.join(outputs) or 'none'}")
    bases = {parse_channel_name(name).base for name in inputs}
    for name in outputs:
        if outputs.count(name) > 1:
            raise RecordError(f"the output {name} is given twice: name each output once")
        if name in bases:
            raise RecordError(f"{name} is an input and an output: remove one of them")


def join_columns(inputs: Sequence[str], outputs: Sequence[str]) -> tuple[tuple[str, ...], str | None]:
    """Return the inputs and the output of one record with all columns, for `couple`; None without output.

    Raises
    ------
    RecordError
        With several outputs, one is given twice or is also an input.
    """
    if len(outputs) > 1:
        check_outputs(inputs, outputs)
    return (*inputs, *outputs[1:]), next(iter(outputs), None)


def couple(record: Dataset, outputs: int) -> AnyRecord:
    """Return the record of several outputs of a record whose last inputs are the outputs after the first.

    Reading all outputs at once cuts the record at the gaps of every one.

    Parameters
    ----------
    record : Dataset
    outputs : int
        Number of outputs. The record itself is returned for less than two.
    """
    if outputs < 2:
        return record
    first = record.inputs - outputs + 1
    single = record.first_inputs(first)
    others = [
        replace(single, y=column, measured=None, output_name=name, output_unit=unit)
        for column, name, unit in zip(
            record.u.T[first:], record.input_names[first:], record.input_units[first:], strict=True
        )
    ]
    return unite([single, *others])


def split_record(record: AnyRecord, fraction: float) -> tuple[AnyRecord, AnyRecord]:
    """Return a record without its end, and the end, as `islands.split` does; missing outputs stay."""
    parts = [split(each, fraction) for each in record.records]
    return unite([part.estimation for part in parts]), unite([part.validation for part in parts])


def split_first(record: AnyRecord, validation: AnyRecord | float) -> Split:
    """Return the split of a record of one output, or that of the first of several; see `split_data`."""
    if isinstance(record, CoupledRecord):
        return split_coupled(record, validation).first
    if isinstance(validation, CoupledRecord):
        raise RecordError(
            f"the record has the output {record.output_name}, the validation data "
            f"{', '.join(validation.output_names)}: give both the same outputs"
        )
    return split_data(record, validation)


def split_coupled(record: CoupledRecord, validation: AnyRecord | float) -> CoupledSplit:
    """Return estimation data and validation data, split at the same samples for every output.

    Samples of which an output is missing are skipped.

    Parameters
    ----------
    record : CoupledRecord
    validation : CoupledRecord or float
        Another record with the same columns, or the fraction at the end of every recording.

    Raises
    ------
    RecordError
        The validation data has other columns, units or another sampling time.
    SettingsError
        The fraction leaves a part empty, or the validation data has samples of the record.
    """
    complete = record.skip_missing()
    if isinstance(validation, Dataset | CoupledRecord):
        if validation.output_names != record.output_names:
            raise RecordError(
                f"the record has the outputs {', '.join(record.output_names)}, the validation data "
                f"{', '.join(validation.output_names)}: give both the same outputs in one order"
            )
        assert isinstance(validation, CoupledRecord)
        held_out: list[Dataset | float] = list(validation.skip_missing().records)
    else:
        held_out = [validation] * len(complete.records)
    parts = [split_data(*pair) for pair in zip(complete.records, held_out, strict=True)]
    return CoupledSplit(
        CoupledRecord(tuple(part.estimation for part in parts)),
        CoupledRecord(tuple(part.validation for part in parts)),
        record,
    )
