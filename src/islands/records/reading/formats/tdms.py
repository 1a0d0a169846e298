"""TDMS files of LabVIEW (.tdms), read by npTDMS (extra `tdms`)."""

import weakref
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from islands.distribution import describe_missing_extra
from islands.errors import RecordError
from islands.records.reading.column_names import append_unit
from islands.records.reading.formats.columnar import ColumnarFile
from islands.records.reading.formats.groups import choose_group
from islands.records.reading.formats.mat.workspace import DAMAGED
from islands.records.reading.options import DEFAULT_READING, ReadingOptions
from islands.records.reading.size_limits import check_column_count, check_samples, check_stored
from islands.records.reading.validation import MIN_SAMPLES

#: Array with the sampling time of the waveforms of a group.
_STEP = "dt"


def read_tdms(path: Path, options: ReadingOptions = DEFAULT_READING) -> ColumnarFile:
    """Open a TDMS file: the channels of one group. Waveforms state their sampling time.

    Raises
    ------
    RecordError
        The file is not a TDMS file or is damaged, has no such group, or npTDMS is not installed.
    """
    options.check_array_file(path.name, sheets=True)
    with ExitStack() as stack, _translated_errors(path.name):
        # Opening reads the description of all channels, so that the file is opened once for all of them.
        file = _open(path)
        stack.callback(file.close)
        groups = {group.name: group.channels() for group in file.groups()}
        for channels in groups.values():
            check_column_count(channels, path.name)
        tables = {
            name: sum(len(channel) >= MIN_SAMPLES and channel.dtype.kind in "fiubM" for channel in channels)
            > 1
            for name, channels in groups.items()
        }
        group, others = choose_group(tables, options.sheet, path.name)
        names = {_name_channel(channel): channel.name for channel in groups[group]}
        clocks = {_name_channel(channel): "" for channel in groups[group] if channel.dtype.kind == "M"}
        steps = {channel.properties.get("wf_increment") for channel in groups[group]} - {None, 0.0}
        loads = {name: partial(_read, file, path, group, channel) for name, channel in names.items()}
        scalars = []
        if len(steps) == 1 and _STEP not in loads:
            loads[_STEP] = partial(np.array, [float(steps.pop())])
            scalars.append(_STEP)
        table = ColumnarFile(
            path.name, tuple(loads), lambda name: loads[name](), scalars, clocks, others, options.missing
        )
        weakref.finalize(table, stack.pop_all().close)
    return table


def _open(path: Path) -> Any:
    try:
        from nptdms import TdmsFile  # noqa: PLC0415
    except ImportError as error:
        raise RecordError(
            f"{describe_missing_extra(path.name, 'tdms')}; or export the record as CSV"
        ) from error
    return TdmsFile.open(path)


@contextmanager
def _translated_errors(file: str) -> Iterator[None]:
    try:
        yield
    except DAMAGED as error:
        raise RecordError(f"{file} is damaged or not a TDMS file ({error}): write it again") from error


def _name_channel(channel: Any) -> str:
    return append_unit(str(channel.name), str(channel.properties.get("unit_string", "")))


def _read(file: Any, path: Path, group: str, name: str) -> NDArray[Any]:
    with _translated_errors(path.name):
        channel = file[group][name]
        check_samples(len(channel), name, path.name)
        # Scaled channels are stored with fewer bytes than they have when they are read, but with one or more.
        check_stored(len(channel), path.stat().st_size, False, name, path.name)
        values = np.asarray(channel[:])
    if values.dtype.kind == "M":
        elapsed: NDArray[Any] = (values - values[:1]) / np.timedelta64(1, "s")
        return elapsed
    return values
