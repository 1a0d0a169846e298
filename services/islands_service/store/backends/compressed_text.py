"""Column type of long texts, such as models and progress, which zlib stores in a quarter of the space."""

import zlib
from base64 import b64decode, b64encode
from typing import Any

from sqlalchemy import Text
from sqlalchemy.types import TypeDecorator

#: Beginning of a compressed text. No JSON document begins like this.
_MARK = "zlib:"

#: Characters of a text that is not worth the time.
_SHORT = 500


class CompressedText(TypeDecorator[str]):
    """JSON document as text, compressed if that makes it shorter. The database cannot search in it."""

    impl = Text
    cache_ok = True

    def process_bind_param(self, value: str | None, _dialect: Any) -> str | None:
        """Return the text as it is stored."""
        if value is None or len(value) < _SHORT:
            return value
        packed = _MARK + b64encode(zlib.compress(value.encode())).decode()
        return min(value, packed, key=len)

    def process_result_value(self, value: str | None, _dialect: Any) -> str | None:
        """Return the text as it was given."""
        if value is None or not value.startswith(_MARK):
            return value
        return zlib.decompress(b64decode(value[len(_MARK) :])).decode()
