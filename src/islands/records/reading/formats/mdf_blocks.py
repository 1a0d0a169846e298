"""Lists of the blocks of MDF files, which are checked before asammdf follows them: it reads circles for ever.

A block states the address of the next one of its list, and of the first ones of other lists.
Source: ASAM MDF, versions 3.3 and 4.1.
"""

import mmap
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from islands.errors import RecordError

#: Place of the header, and its marks in versions 3 and 4.
_HEADER, _OLD, _NEW = 64, b"HD", b"##HD"


@dataclass(frozen=True, slots=True)
class _List:
    """A kind of list.

    Attributes
    ----------
    others : tuple of (str, int)
        Kinds of the lists that begin in a block of this one, and the places of the addresses of their first
        blocks.
    marks : tuple of bytes
        Marks of the blocks that continue the list; empty if asammdf reads on whatever a block begins with.
    """

    others: tuple[tuple[str, int], ...] = ()
    marks: tuple[bytes, ...] = ()


@dataclass(frozen=True, slots=True)
class _Layout:
    """Lists of a version: format of an address, place of the address of the next block, kinds of lists."""

    address: str
    next: int
    lists: Mapping[str, _List]


#: Data groups, channel groups and channels.
_VERSION_3 = _Layout(
    *("<I", 4),
    MappingProxyType(
        {
            "header": _List((("data group", 4),)),
            "data group": _List((("channel group", 8),)),
            "channel group": _List((("channel", 8),)),
            "channel": _List(),
        }
    ),
)

#: Also histories, attachments and events, and lists of parts of the data.
_VERSION_4 = _Layout(
    *("<Q", 24),
    MappingProxyType(
        {
            "header": _List((("data group", 24), ("history", 32), ("attachment", 48), ("event", 56))),
            "data group": _List((("channel group", 32), ("data", 40))),
            "channel group": _List((("channel", 32),)),
            "channel": _List((("channel", 32), ("array", 32), ("data", 64)), (b"##CN",)),
            "array": _List((("channel", 24),), (b"##CA",)),
            "data": _List((), (b"##HL", b"##DL", b"##LD")),
            "history": _List(),
            "attachment": _List(),
            "event": _List(),
        }
    ),
)


def check_lists(path: Path) -> None:
    """Refuse a file with a list of blocks that is a circle.

    Raises
    ------
    RecordError
        A list contains a block twice.
    """
    with path.open("rb") as stream:
        if path.stat().st_size <= _HEADER:
            return  # asammdf refuses it
        with mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as content:
            mark = content[_HEADER : _HEADER + len(_NEW)]
            if mark == _NEW or mark.startswith(_OLD):
                _check_blocks(content, _VERSION_4 if mark == _NEW else _VERSION_3, path.name)


def _check_blocks(content: mmap.mmap, layout: _Layout, file: str) -> None:
    size = struct.calcsize(layout.address)
    # Every block takes space: only lists that share their blocks are longer than the file.
    left = len(content) // size

    def read_address(place: int) -> int:
        is_inside = place + size <= len(content)
        return int(struct.unpack_from(layout.address, content, place)[0]) if is_inside else 0

    firsts = [(kind, read_address(_HEADER + place)) for kind, place in layout.lists["header"].others]
    started: set[tuple[str, int]] = set()
    while firsts:
        kind, address = first = firsts.pop()
        if first in started:
            continue
        started.add(first)
        seen: set[int] = set()
        marks = layout.lists[kind].marks
        while address and (not marks or content[address : address + len(marks[0])] in marks):
            if address in seen or left == 0:
                raise RecordError(f"{file} is damaged (a list of its blocks is a circle): write it again")
            seen.add(address)
            left -= 1
            firsts += [(other, read_address(address + place)) for other, place in layout.lists[kind].others]
            address = read_address(address + layout.next)
