"""Compatibility of a record with a model or with another record: columns, units and sampling time."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

from islands.errors import RecordError, name_option
from islands.records.channel_names import (
    AT_ONCE,
    ChannelName,
    conversion_factor,
    is_unit,
    normalise_unit,
    parse_channel_name,
)
from islands.records.dataset import Dataset, same_dt
from islands.records.input_lead import advance_inputs
from islands.records.preprocessing_steps import Preprocessing


class Reference(Protocol):
    """Model or record that defines columns and sampling time."""

    @property
    def input_names(self) -> tuple[str, ...]:
        """Names of the inputs, in their order."""

    @property
    def output_name(self) -> str:
        """Name of the output."""

    @property
    def dt(self) -> float | None:
        """Sampling time in seconds. None if any is allowed."""


@dataclass(frozen=True, slots=True)
class ColumnReference:
    """Columns and preprocessing of a simulation that is neither a model of one output nor a record."""

    input_names: tuple[str, ...]
    output_name: str
    dt: float | None = None
    average: int = 1
    preprocessing: Preprocessing | None = None


@dataclass(frozen=True, slots=True)
class _Channel:
    name: str
    parts: ChannelName
    unit: str

    @classmethod
    def make(cls, name: str, unit: str = "") -> "_Channel":
        parts = parse_channel_name(name)
        return cls(name, parts, unit or parts.unit)


def match_record(
    reference: Reference,
    record: Dataset,
    reference_title: str = "the model",
    title: str = "the record",
    advance: bool = True,
) -> Dataset:
    """Return a record with its inputs in the order of a model or of another record.

    Inputs are matched by name. If no name occurs in both, they are matched by the name without its unit
    (``u`` of ``u_V``). If no such name occurs in both either, they are matched by position: ``u_est_V`` and
    ``u_val_V`` may be one signal in two recordings. Values are never converted. An input that the reference
    reads one sample early (``u_V+1``) is advanced if the record has it as measured (``u_V``).

    Parameters
    ----------
    reference : Model or Dataset
        Units of a model are those in its names.
    record : Dataset
    reference_title, title : str
        Names of both in error messages.
    advance : bool
        Whether inputs may be advanced. False for a caller that continues with its own record.

    Returns
    -------
    Dataset
        The record itself if its inputs have the right order and none is advanced.

    Raises
    ------
    RecordError
        The numbers of inputs differ; some but not all input names occur in both; an input has the name of the
        other's output; an input of the record is read one sample early and should not be, or may not be
        advanced; known units differ; or the sampling times differ by more than `SAME_DT`.
    """
    check_dt(reference.dt, record.dt, reference_title, title)
    titles = (reference_title, title)
    expected, given = _inputs(reference), _inputs(record)
    if len(expected) != len(given):
        raise RecordError(
            f"{reference_title} has {len(expected)} inputs ({_list(expected)}), {title} {len(given)} "
            f"({_list(given)}): give {title} the same inputs"
        )
    if reference.output_name in record.input_names or record.output_name in reference.input_names:
        raise RecordError(
            f"{reference_title} has the inputs {_list(expected)} and the output {reference.output_name}, "
            f"{title} {_list(given)} and {record.output_name}: choose the same inputs and output, or rename "
            "the columns"
        )
    order = _find_order(expected, given, titles)
    for one, place in zip(expected, order, strict=True):
        _check_pair(one, given[place], titles, advance)
    _check_units(_output(reference), _output(record), titles)
    late = [
        place
        for one, place in zip(expected, order, strict=True)
        if one.parts.at_once and not given[place].parts.at_once
    ]
    record = advance_inputs(record, late)
    if order == list(range(len(order))):
        return record
    return replace(
        record,
        u=record.u[:, order],
        input_names=tuple(record.input_names[place] for place in order),
        input_units=tuple(record.input_units[place] for place in order),
        preprocessing=record.preprocessing and record.preprocessing.select_inputs(order),
    )


def check_dt(expected: float | None, dt: float, reference_title: str, title: str) -> None:
    """Check that a sampling time in seconds is the expected one; None allows any.

    Raises
    ------
    RecordError
        The sampling times differ by more than `SAME_DT`.
    """
    if expected is not None and not same_dt(expected, dt):
        raise RecordError(
            f"{reference_title} has a sampling time of {expected:.10g} s, {title} of {dt:.10g} s: "
            f"resample {title}, as by {name_option('resample', expected)}"
        )


def _inputs(source: Reference) -> list[_Channel]:
    units = source.input_units if isinstance(source, Dataset) else ("",) * len(source.input_names)
    return [_Channel.make(name, unit) for name, unit in zip(source.input_names, units, strict=True)]


def _output(source: Reference) -> _Channel:
    return _Channel.make(source.output_name, source.output_unit if isinstance(source, Dataset) else "")


def _find_order(
    expected: Sequence[_Channel], given: Sequence[_Channel], titles: tuple[str, str]
) -> list[int]:
    """Return the place in ``given`` of every expected input."""
    for part in ("name", "base", "stem"):
        ours, theirs = ([_part(channel, part) for channel in channels] for channels in (expected, given))
        if ours == theirs:
            break
        if set(ours) == set(theirs) and len(set(ours)) == len(ours):
            return [theirs.index(key) for key in ours]
        if part != "name" and set(ours) & set(theirs):
            raise RecordError(
                f"{titles[0]} has the inputs {_list(expected)}, {titles[1]} {_list(given)}: some names occur "
                "in both, so the others cannot be matched by position; rename the columns so that all names "
                "agree"
            )
    return list(range(len(expected)))


def _part(channel: _Channel, part: str) -> str:
    return channel.name if part == "name" else str(getattr(channel.parts, part))


def _check_pair(one: _Channel, other: _Channel, titles: tuple[str, str], advance: bool) -> None:
    """Check that two matched inputs are read at the same instant and have the same unit."""
    if other.parts.at_once > one.parts.at_once or (other.parts.at_once != one.parts.at_once and not advance):
        right = other.parts.base + AT_ONCE * one.parts.at_once
        raise RecordError(
            f"{titles[0]} has the input {one.name}, {titles[1]} {other.name}, and {AT_ONCE} is a column that "
            f"is read one sample early: read the input {right}"
        )
    _check_units(one, other, titles)


def _check_units(one: _Channel, other: _Channel, titles: tuple[str, str]) -> None:
    """Check that the units of two matched channels are equal, as far as they are known.

    A name's last part need not be a unit (``u_est``). Units of equal names differ only if they were stated.
    """
    expected, unit = normalise_unit(one.unit), normalise_unit(other.unit)
    stated = one.name == other.name or (is_unit(expected) and is_unit(unit))
    if not (expected and unit and stated) or expected == unit:
        return
    factor = conversion_factor(unit, expected)
    advice = f"convert {other.name}" if factor is None else f"multiply {other.name} by {factor:g}"
    raise RecordError(
        f"{titles[0]} has {one.name} in {one.unit}, {titles[1]} {other.name} in {other.unit}: {advice} and "
        f"give it the unit {one.unit}"
    )


def _list(channels: Sequence[_Channel]) -> str:
    return ", ".join(channel.name for channel in channels)
