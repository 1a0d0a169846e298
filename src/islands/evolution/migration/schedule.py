"""Schedules: integers that change over the generations of a run, written as ``10`` or ``5,100:20``."""

import re
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

from islands.errors import SettingsError


@dataclass(frozen=True, slots=True)
class Schedule:
    """Piecewise constant integer over the generations.

    Attributes
    ----------
    pieces : tuple of (generation, value)
        Each value applies from its generation on; the first piece begins at 0.
    """

    pieces: tuple[tuple[int, int], ...]

    def at(self, generation: int) -> int:
        """Return the value at a generation."""
        return next(value for begin, value in reversed(self.pieces) if begin <= generation)

    def next_stop(self, generation: int) -> int:
        """Return the first stop after a generation; the values are intervals between stops.

        Every generation at which a piece begins is a stop, and intervals are counted from there. Stops do not
        depend on where a run was interrupted.
        """
        begin, every = next(piece for piece in reversed(self.pieces) if piece[0] <= generation)
        stop = begin + ((generation - begin) // every + 1) * every
        return min([stop, *(other for other, _ in self.pieces if other > generation)])

    def stops_at(self, generation: int) -> bool:
        """Return whether a generation is a stop; generation 0 is not."""
        return generation > 0 and self.next_stop(generation - 1) == generation


@lru_cache(typed=True)
def parse_schedule(text: int | str, least: int, what: str) -> Schedule:
    """Parse a schedule.

    Parameters
    ----------
    text : int or str
        ``10`` is constant. ``5,100:20`` is 5, and 20 from generation 100 on.
    least : int
        Smallest valid value.
    what : str
        Name of the schedule in error messages.

    Raises
    ------
    SettingsError
        The text cannot be parsed, its generations do not ascend, or a value is too small.
    """
    first, *others = str(text).split(",")
    pieces = [("0", first), *(part.partition(":")[::2] for part in others)]
    if not all(re.fullmatch(r"\s*\d{1,9}\s*", number) for piece in pieces for number in piece):
        raise SettingsError(
            f"cannot read {what} {text!r}: write a whole number, or 5,100:20 for 5, and 20 from generation "
            "100 on"
        )
    numbers = tuple((int(begin), int(value)) for begin, value in pieces)
    begins = [begin for begin, _ in numbers]
    if any(later <= earlier for earlier, later in pairwise(begins)):
        raise SettingsError(f"{what} {text!r}: its generations ascend, from 1 on")
    if any(value < least for _, value in numbers):
        raise SettingsError(f"{what} is at least {least}, got {text!r}")
    return Schedule(numbers)
