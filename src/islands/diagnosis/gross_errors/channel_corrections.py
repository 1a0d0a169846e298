"""Corrections of swapped channels: the input, the output or a further channel are exchanged."""

from collections.abc import Iterator, Set
from dataclasses import replace
from itertools import combinations

import numpy as np

from islands.diagnosis.gross_errors.correction import Correction
from islands.records.dataset import Dataset


def correct_swapped_channels(record: Dataset, read: Set[str]) -> Iterator[Correction]:
    """Yield the record with input and output exchanged, and with a channel as the input or the output.

    A simulation finds a channel that it reads by the name of the column. The names of such channels stay, and
    their values are exchanged.

    Parameters
    ----------
    read : set of str
        Names of the channels that the simulation reads. They are also exchanged for other channels.
    """
    has_all_outputs = not np.isnan(record.y).any()
    corrections = [_exchange_output(record, 0)] if has_all_outputs else []
    for place in range(1, record.inputs):
        corrections.append(_exchange_inputs(record, 0, place))
        if has_all_outputs:
            corrections.append(_exchange_output(record, place))
    corrections += [
        _exchange_inputs(record, *places)
        for places in combinations(range(1, record.inputs), 2)
        if any(record.input_names[place] in read for place in places)
    ]
    for correction in corrections:
        yield _keep_names(correction, record) if _moved_names(correction, record) & read else correction


def _exchange_inputs(record: Dataset, first: int, second: int) -> Correction:
    """Return the record with two of its inputs exchanged."""
    order = list(range(record.inputs))
    order[first], order[second] = second, first
    drive, name = record.input_names[first], record.input_names[second]
    return Correction(
        "swapped-channels",
        replace(
            record,
            u=record.u[:, order],
            input_names=tuple(record.input_names[each] for each in order),
            input_units=tuple(record.input_units[each] for each in order),
        ),
        f"The input and a channel seem to be exchanged: the simulation is driven by {name}, not {drive}.",
        f"Give {name} as the input, and {drive} as a channel.",
    )


def _exchange_output(record: Dataset, place: int) -> Correction:
    """Return the record with one of its inputs exchanged for the output."""
    u, name = record.u.copy(), record.input_names[place]
    u[:, place] = record.y
    names, units = list(record.input_names), list(record.input_units)
    names[place], units[place] = record.output_name, record.output_unit
    channels = f", and {', '.join(names[1:])} as channels" if names[1:] else ""
    role = "input" if place == 0 else "channel"
    return Correction(
        "swapped-channels",
        replace(
            record,
            u=u,
            y=record.u[:, place],
            measured=None,
            input_names=tuple(names),
            input_units=tuple(units),
            output_name=name,
            output_unit=record.input_units[place],
        ),
        f"The output and the {role} {name} seem to be exchanged: the simulated signal is {name}, not "
        f"{record.output_name}.",
        f"Give {names[0]} as the input and {name} as the output{channels}.",
        has_other_output=True,
    )


def _moved_names(correction: Correction, record: Dataset) -> Set[str]:
    """Return the names of the columns that a correction exchanges."""
    before = (*record.input_names, record.output_name)
    after = (*correction.record.input_names, correction.record.output_name)
    return {name for name, other in zip(before, after, strict=True) if name != other}


def _keep_names(correction: Correction, record: Dataset) -> Correction:
    """Return the correction that exchanges the values of two columns under their names."""
    before = (*record.input_names, record.output_name)
    moved = _moved_names(correction, record)
    first, second = (name for name in before if name in moved)
    return replace(
        correction,
        record=replace(
            correction.record,
            input_names=record.input_names,
            input_units=record.input_units,
            output_name=record.output_name,
            output_unit=record.output_unit,
        ),
        description=f"The columns {first} and {second} seem to be exchanged: each has the values that the "
        "other should have.",
        advice=f"Exchange the names of the columns {first} and {second} in the file.",
    )
