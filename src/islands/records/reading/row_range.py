"""Selections of rows as text: ``START:STOP``."""

from islands.errors import SettingsError


def parse_rows(text: str | None) -> slice | None:
    """Parse ``START:STOP``; None selects all rows.

    Raises
    ------
    SettingsError
        The text does not have this form.
    """
    if text is None:
        return None
    try:
        start, stop = (int(part) if part else None for part in text.split(":"))
    except ValueError:
        raise SettingsError(f"cannot read the rows {text!r}: write START:STOP, for example 0:5000") from None
    return slice(start, stop)


def overlap(one: slice | None, other: slice | None) -> bool:
    """Return whether two selections share samples. An open end extends to the end of the record."""
    if one is None or other is None:
        return True
    ends = [part.stop for part in (one, other) if part.stop is not None]
    return not ends or max(one.start or 0, other.start or 0) < min(ends)
