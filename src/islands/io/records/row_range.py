"""Rows of a record as text: ``START:STOP``."""

from islands.errors import SettingsError


def parse_rows(text: str | None) -> slice | None:
    """Read ``START:STOP``.

    Raises
    ------
    SettingsError
        It is none.
    """
    if text is None:
        return None
    try:
        start, stop = (int(part) if part else None for part in text.split(":"))
    except ValueError:
        raise SettingsError(f"cannot read the rows {text!r}: write START:STOP, for example 0:5000") from None
    return slice(start, stop)


def overlap(one: slice | None, other: slice | None) -> bool:
    """Tell whether two selections share samples; an open end reaches as far as there are any."""
    if one is None or other is None:
        return True
    ends = [part.stop for part in (one, other) if part.stop is not None]
    return not ends or max(one.start or 0, other.start or 0) < min(ends)
