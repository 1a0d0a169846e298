"""Names of query parameters and form fields: unknown ones are refused, because the framework ignores them."""

from collections.abc import Collection, Iterable
from dataclasses import fields

from islands.errors import SettingsError, suggest
from islands.records.reading.options import ReadingOptions

#: Options of reading a record, which the form field ``reading`` contains.
_READING = frozenset(option.name for option in fields(ReadingOptions))

#: Characters of a name in a message.
_SHOWN = 40


def check_names(given: Iterable[str], known: Collection[str], kind: str, path: str) -> None:
    """Refuse an unknown name.

    Parameters
    ----------
    given, known : collection of str
        Names of a request and of its route.
    kind : str
        ``query parameter`` or ``form field``.
    path : str
        Path of the route.

    Raises
    ------
    SettingsError
        A name is unknown. The message lists the known ones.
    """
    for name in given:
        if name not in known:
            listed = f"its {kind}s are {', '.join(known)}" if known else f"it has no {kind}s"
            advice = suggest(name, known)
            if path == "/v1/datasets" and name in _READING:
                advice = (
                    f"; {name} is an option of reading: send it in the form field reading, a JSON object, as "
                    'reading={"header": false}'
                )
            raise SettingsError(f"{path} has no {kind} {name[:_SHOWN]!r}; {listed}{advice}")
