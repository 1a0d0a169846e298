"""Columns of two states, such as ON and OFF, which are read as 1 and 0."""

from collections.abc import Collection, Sequence

from islands.records.reading.formats.text.missing_words import is_missing

#: Words for 1 and for 0 that belong together, in lower case.
PAIRS = (
    *(("on", "off"), ("true", "false"), ("yes", "no"), ("open", "closed"), ("open", "close")),
    *(("opened", "closed"), ("high", "low"), ("active", "inactive"), ("enabled", "disabled")),
    *(("running", "stopped"), ("t", "f"), ("y", "n"), ("h", "l"), (".t.", ".f.")),
    *(("ein", "aus"), ("an", "aus"), ("wahr", "falsch"), ("ja", "nein"), ("offen", "geschlossen")),
    *(("auf", "zu"), ("offen", "zu"), ("aktiv", "inaktiv")),
    *(("vrai", "faux"), ("oui", "non"), ("marche", "arrêt"), ("marche", "arret"), ("ouvert", "fermé")),
    *(("verdadero", "falso"), ("sí", "no"), ("si", "no"), ("encendido", "apagado"), ("abierto", "cerrado")),
    *(("vero", "falso"), ("sì", "no"), ("acceso", "spento"), ("aperto", "chiuso")),
    *(("verdadeiro", "falso"), ("sim", "não"), ("ligado", "desligado"), ("aberto", "fechado")),
    *(("waar", "onwaar"), ("aan", "uit"), ("ja", "nee"), ("sant", "falskt"), ("på", "av"), ("ja", "nej")),
    *(("prawda", "fałsz"), ("tak", "nie"), ("истина", "ложь"), ("вкл", "выкл"), ("да", "нет")),
)

_WORDS = frozenset(word for pair in PAIRS for word in pair)

#: Numbers that may occur among the words.
_NUMBERS = frozenset({"0", "1", "0.0", "1.0"})


def is_state(text: str) -> bool:
    """Return whether a cell is the word of a state."""
    return text.strip().lower() in _WORDS


def find_states(texts: Sequence[str], given: Collection[str] = ()) -> dict[str, str]:
    """Return the number of each word of a column of states, as a text; empty for another column.

    Parameters
    ----------
    texts : sequence of str
        The cells. Missing cells and the numbers 0 and 1 may occur among the words.
    given : collection of str
        Words of the user for a missing value, in lower case.
    """
    first = next((text for text in texts if not is_missing(text, given)), "")
    if not is_state(first) and first.strip() not in _NUMBERS:
        return {}  # nearly all columns
    found = {text.strip() for text in texts}
    words = {word for word in found if is_state(word) and word.lower() not in given}
    pair = next((pair for pair in PAIRS if words and {word.lower() for word in words} <= {*pair}), None)
    if pair is None or not all(is_missing(word, given) for word in found - words - _NUMBERS):
        return {}
    return {word: "1" if word.lower() == pair[0] else "0" for word in sorted(words)}
