"""MDF files of test benches and loggers (.mf4, .mdf), read by asammdf (extra `mdf`)."""

import textwrap
import weakref
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from islands.distribution import describe_missing_extra
from islands.errors import RecordError
from islands.records.masked_values import fill_masked
from islands.records.reading.column_names import append_unit
from islands.records.reading.formats.columnar import ColumnarFile
from islands.records.reading.formats.groups import choose_group
from islands.records.reading.formats.mat.workspace import DAMAGED
from islands.records.reading.formats.mdf_blocks import check_lists
from islands.records.reading.options import DEFAULT_READING, ReadingOptions
from islands.records.reading.size_limits import check_column_count, check_samples, check_stored
from islands.records.reading.validation import MIN_SAMPLES

#: Name of the column with the times of a group.
_TIME = "t_s"

#: Characters of an error of the library in a message.
_SHOWN = 120


def read_mdf(path: Path, options: ReadingOptions = DEFAULT_READING) -> ColumnarFile:
    """Open an MDF file: the channels of one channel group, with the times of the group as the column t_s.

    Raises
    ------
    RecordError
        The file is not an MDF file or is damaged, has no such group, or asammdf is not installed.
    """
    options.check_array_file(path.name, sheets=True)
    with ExitStack() as stack, _translated_errors(path.name):
        # Opening reads the description of all channels, so that the file is opened once for all of them.
        file = stack.enter_context(_open(path))
        numbers = _name_groups(file)
        tables = {
            name: len(file.groups[number].channels) > 1
            and file.groups[number].channel_group.cycles_nr >= MIN_SAMPLES
            for name, number in numbers.items()
        }
        group, others = choose_group(tables, options.sheet, path.name)
        number = numbers[group]
        master = file.masters_db.get(number)
        loads = {} if master is None else {_TIME: partial(_read_times, file, path, number)}
        check_column_count(file.groups[number].channels, path.name)
        for place, channel in enumerate(file.groups[number].channels):
            name = _name_channel(channel)
            if place != master and name not in loads:
                loads[name] = partial(_read_channel, file, path, number, place, name)
        table = ColumnarFile(
            path.name, tuple(loads), lambda name: loads[name](), (), {}, others, options.missing
        )
        weakref.finalize(table, stack.pop_all().close)
    return table


def _open(path: Path) -> Any:
    from asammdf import MDF  # noqa: PLC0415
    from asammdf.blocks.mdf_v3 import MDF3  # noqa: PLC0415
    from asammdf.blocks.mdf_v4 import MDF4  # noqa: PLC0415
    from asammdf.mdf import logger  # noqa: PLC0415

    # The destructor of a reader that has not opened its file raises, and Python prints the traceback.
    MDF3.__del__ = MDF4.__del__ = _close  # type: ignore[method-assign]
    # It also logs damages, before it raises or reads on.
    logger.setLevel("CRITICAL")
    check_lists(path)
    return MDF(path)


def _close(reader: Any) -> None:
    with suppress(Exception):
        reader.close()


@contextmanager
def _translated_errors(file: str) -> Iterator[None]:
    try:
        from asammdf.blocks.utils import MdfException  # noqa: PLC0415
    except ImportError as error:
        raise RecordError(f"{describe_missing_extra(file, 'mdf')}; or export the record as CSV") from error
    try:
        yield
    except (*DAMAGED, MdfException) as error:
        # The library quotes whole blocks of the file.
        reason = textwrap.shorten(str(error), _SHOWN, placeholder="...")
        raise RecordError(f"{file} is damaged or not an MDF file ({reason}): write it again") from error


def _name_groups(file: Any) -> dict[str, int]:
    """Return the numbers of the channel groups by name; a group without a name has its number."""
    numbers: dict[str, int] = {}
    for number, group in enumerate(file.groups):
        name = getattr(group.channel_group, "acq_name", "") or str(number)
        numbers[name if name not in numbers else f"{name} ({number})"] = number
    return numbers


def _name_channel(channel: Any) -> str:
    conversion = getattr(channel, "conversion", None)
    unit = getattr(channel, "unit", "") or getattr(conversion, "unit", "")
    return append_unit(str(channel.name), str(unit or ""))


def _read_times(file: Any, path: Path, number: int) -> NDArray[Any]:
    with _translated_errors(path.name):
        _check_size(file, path, number, _TIME)
        _check_places(file, path, number)
        return np.asarray(file.get_master(number))


def _read_channel(file: Any, path: Path, number: int, place: int, name: str) -> NDArray[Any]:
    with _translated_errors(path.name):
        _check_size(file, path, number, name)
        _check_places(file, path, number, place)
        # The library leaves invalid samples out by default, so that the channels have other lengths.
        signal = file.get(group=number, index=place, ignore_invalidation_bits=True)
        invalid = signal.invalidation_bits
        if invalid is None:
            return np.asarray(signal.samples)
        return np.asarray(fill_masked(np.ma.array(signal.samples, mask=invalid)))


def _check_size(file: Any, path: Path, number: int, name: str) -> None:
    group = file.groups[number].channel_group
    check_samples(group.cycles_nr, name, path.name)
    check_stored(group.cycles_nr * group.samples_byte_nr, path.stat().st_size, True, name, path.name)


def _check_places(file: Any, path: Path, number: int, *places: int) -> None:
    """Refuse channels outside of the records of their group: the library reads beyond its memory for them.

    It reads the times of the group with each channel.
    """
    group = file.groups[number]
    master = file.masters_db.get(number)
    for place in (*places, *([] if master is None else [master])):
        channel = group.channels[place]
        bits = channel.bit_count + getattr(channel, "bit_offset", 0)
        if getattr(channel, "byte_offset", 0) + -(-bits // 8) > group.channel_group.samples_byte_nr:
            raise RecordError(
                f"{path.name}: channel {channel.name} is outside of the records of its group: the file is "
                "damaged, write it again"
            )
