"""JSON text that is read piece by piece."""

import json
import re
from collections.abc import Iterator
from typing import Any, TextIO

#: Characters that are read at once. If a value is longer, the number is doubled.
_PIECE = 1 << 20

_NEXT = re.compile(r"\s*(\S)")


class JsonReader:
    """Reader of an object or a list whose members do not have to be in memory at the same time.

    Every method raises `json.JSONDecodeError` if the text is no JSON.

    Parameters
    ----------
    stream : file
        The text.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream, self._text, self._place = stream, "", 0
        self._decoder = json.JSONDecoder()

    def skip(self, character: str) -> bool:
        """Skip a character if it is the next one after white space; return whether it was."""
        while (found := _NEXT.match(self._text, self._place)) is None and self._read_more():
            pass
        if found is None:
            return False
        self._place = found.end() if found[1] == character else found.start(1)
        return found[1] == character

    def read_value(self) -> Any:
        """Return the next value."""
        self.skip("")
        while True:
            try:
                value, place = self._decoder.raw_decode(self._text, self._place)
            except json.JSONDecodeError:
                if not self._read_more():
                    raise
            else:
                # The end of a number is known from the character after it.
                if place < len(self._text) or not self._read_more():
                    self._place = place
                    return value

    def read_list(self) -> Iterator[Any]:
        """Yield the members of a list."""
        self._expect("[")
        for _ in self._members("]"):
            yield self.read_value()

    def read_keys(self) -> Iterator[str]:
        """Yield the keys of an object. The caller reads the value after each."""
        self._expect("{")
        for _ in self._members("}"):
            key = self.read_value()
            self._expect(":")
            yield key

    def read_end(self) -> None:
        """Read the end of the text."""
        if _NEXT.match(self._text[self._place :] + self._stream.read()):
            raise json.JSONDecodeError("Extra data", self._text, self._place)

    def _members(self, end: str) -> Iterator[None]:
        """Yield before each member, and skip commas and the closing bracket."""
        if self.skip(end):
            return
        yield
        while self.skip(","):
            yield
        self._expect(end)

    def _expect(self, character: str) -> None:
        if not self.skip(character):
            raise json.JSONDecodeError(f"Expecting '{character}'", self._text, self._place)

    def _read_more(self) -> bool:
        """Append the next piece to the rest of the text; return whether there was one."""
        rest = self._text[self._place :]
        more = self._stream.read(max(_PIECE, len(rest)))
        self._text, self._place = rest + more, 0
        return bool(more)
