"""Limits of the inspection of an upload, in proportion to its size, so that a small file costs little.

A compressed file of 2 MB can unpack to gigabytes, in any format that compresses. Its inspection would hold
memory, disk and a core for as long as that of a large record.
"""

from dataclasses import dataclass

from islands_service.settings import ServiceSettings

#: Largest ratio of unpacked to received bytes. Text of measured values has 3 to 30, constant columns more.
EXPANSION = 100

#: Bytes that every file may unpack to: the unit of the slots of inspections.
SLOT_BYTES = 64_000_000

#: Least address space of a reader in bytes: its libraries, and 18 for each byte of a text of `SLOT_BYTES`.
_LEAST_MEMORY = 1_500_000_000


@dataclass(frozen=True, slots=True)
class InspectionLimits:
    """Limits of the inspection of one file.

    Attributes
    ----------
    unpacked : int
        Bytes that the file may unpack to.
    memory : int
        Bytes of address space of the process that reads it, which bounds what a reader unpacks.
    slots : int
        Part of what all inspections may take at once, in units of `SLOT_BYTES`.
    """

    unpacked: int
    memory: int
    slots: int


def find_limits(received: int, settings: ServiceSettings) -> InspectionLimits:
    """Return the limits of a file by the number of its bytes as they were received."""
    most = settings.max_unpacked
    unpacked = min(max(SLOT_BYTES, EXPANSION * received), most)
    memory = min(_LEAST_MEMORY + settings.inspection_memory * unpacked // most, settings.inspection_memory)
    return InspectionLimits(unpacked, memory, count_slots(unpacked))


def count_slots(size: int) -> int:
    """Return the number of slots of a file that unpacks to some bytes."""
    return -(-size // SLOT_BYTES)
