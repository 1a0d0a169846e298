"""Corrections of swapped channels: the input, the output or a further channel are exchanged."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from islands.data.dataset import Dataset
from islands.discrepancy.gross_errors.correction import Correction


def correct_swapped_channels(record: Dataset) -> Iterator[Correction]:
    """Yield the record with input and output exchanged, and with a channel as the input or the output."""
    first, *others = record.input_names
    if not np.isnan(record.y).any():
        yield _exchange_output(record, 0)
    for place, name in enumerate(others, start=1):
        order = list(range(record.inputs))
        order[0], order[place] = place, 0
        yield Correction(
            "swapped-channels",
            replace(
                record,
                u=record.u[:, order],
                input_names=tuple(record.input_names[each] for each in order),
                input_units=tuple(record.input_units[each] for each in order),
            ),
            f"The input and a channel seem to be exchanged: the simulation is driven by {name}, not {first}.",
            f"Give --input {name}, and {first} as a --channel.",
        )
        if not np.isnan(record.y).any():
            yield _exchange_output(record, place)


def _exchange_output(record: Dataset, place: int) -> Correction:
    """Return the record with one of its inputs exchanged for the output."""
    u, name = record.u.copy(), record.input_names[place]
    u[:, place] = record.y
    names, units = list(record.input_names), list(record.input_units)
    names[place], units[place] = record.output_name, record.output_unit
    others = "".join(f" --channel {each}" for each in names[1:])
    role = "input" if place == 0 else "channel"
    return Correction(
        "swapped-channels",
        replace(
            record,
            u=u,
            y=record.u[:, place],
            input_names=tuple(names),
            input_units=tuple(units),
            output_name=name,
            output_unit=record.input_units[place],
        ),
        f"The output and the {role} {name} seem to be exchanged: the simulated signal is {name}, not "
        f"{record.output_name}.",
        f"Give --input {names[0]} --output {name}{others}.",
        has_other_output=True,
    )
