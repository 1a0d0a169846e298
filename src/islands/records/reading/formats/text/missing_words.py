"""Texts that mean a missing value, as loggers, spreadsheets and control systems write them."""

import re
from collections.abc import Collection
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache

#: Cells without a value, in lower case.
EMPTY = frozenset({"", "nan", "na", "n/a", "null", "-", "--", "---", "#n/a", "none"})

#: Words of instruments, control systems and databases, in lower case and with blanks for underscores.
WORDS = EMPTY | frozenset(
    {
        # Multimeters and loggers: out of range, or no sensor.
        *("ol", "0l", "o.l", "o.l.", ".ol", "ovl", "ovld", "ovf", "ofl", "over", "overload", "overflow"),
        *("overrange", "over range", "over-range", "out of range", "ufl", "under", "underflow", "underrange"),
        *(
            "under range",
            "under-range",
            "burnout",
            "burn out",
            "burn-out",
            "b.out",
            "open tc",
            "open circuit",
        ),
        *("short circuit", "no sensor", "no probe", "not connected", "disconnected", "sensor error"),
        *("sensor fail", "sensor failure", "sensor fault", "no reading", "no signal"),
        # Historians and control systems.
        *("bad", "bad input", "bad data", "bad value", "bad quality", "bad total", "no data", "nodata"),
        *("no value", "novalue", "no sample", "no result", "no good data for calculation", "invalid"),
        *("not available", "unavailable", "unavail", "unknown", "uncertain", "undefined", "comm fail"),
        *("comm error", "comm loss", "no comm", "communication error", "communication failure"),
        *("i/o timeout", "timeout", "calc failed", "calc off", "calc crash", "pt created", "scan off"),
        *("scan timeout", "intf shut", "arc off-line", "arc offline", "not connect", "equip fail"),
        *("configure", "fail", "failed", "failure", "fault", "error", "err", "offline", "off-line"),
        *("out of serv", "out of service", "data error"),
        # Databases and statistics.
        *("<na>", "<null>", "(null)", "nil", "nat", "n.a.", "n.d.", "missing", "void", "blank", "empty"),
        # Spreadsheets whose word has no mark at its end.
        *("#nv", "#yok", "#getting_data", "#n/v"),
        # German, French, Spanish, Italian, Portuguese, Dutch, Swedish, Polish, Russian.
        *("ungültig", "kein wert", "keine daten", "fehler", "gestört", "überlauf", "unterlauf", "unbekannt"),
        *("nicht verfügbar", "fühlerbruch", "drahtbruch", "leitungsbruch", "k.a.", "n.v.", "übersteuert"),
        *("erreur", "invalide", "non valide", "non disponible", "indisponible", "pas de données", "défaut"),
        *("dépassement", "hors gamme", "sin datos", "no disponible", "inválido", "fallo", "desconocido"),
        *("errore", "non valido", "non disponibile", "nessun dato", "sem dados", "erro", "geen data"),
        *("ongeldig", "fout", "ogiltig", "saknas", "brak danych", "błąd", "нет данных", "ошибка", "обрыв"),
    }
)

#: Words that are a missing value in a column of numbers, and a state in a column of states.
OPEN_CIRCUIT = frozenset({"open", "offen"})

# Lower case: ``#div/0!``, ``#¡valor!``, ``#имя?``, ``#n/d``, ``err:502`` and a column too narrow, of
# spreadsheets; ``-1.#ind``, ``1,#qnan0``, ``-nan(ind)`` of printf; ``****``, ``+++++``, ``--.--`` of meters;
# ``-∞`` of oscilloscopes out of range.
_PATTERN = re.compile(
    r"#[¡¿]?[^\W\d_][\w/]*[!?]|#[^\W\d_]{1,2}/[^\W\d_]{1,2}|err:\d+|#{2,}"
    r"|[+-]?\d[.,]#(?:ind|qnan|snan|nan|r|j|o|io|jo)\d*|[+-]?nan(?:q|s|\([^()]*\))"
    r"|[-+*.?~]+|[-+]?∞"
)

#: Number of an error before its text: ``[-11059] No Good Data For Calculation``.
_CODE = re.compile(r"\[-?\d+\]\s*")


@dataclass(frozen=True, slots=True)
class MissingWords:
    """Words that the user has given in addition to `WORDS`.

    Attributes
    ----------
    texts : frozenset of str
        In lower case.
    numbers : frozenset of float
        Words that are numbers: ``-9999`` is also ``-9999.0``.
    """

    texts: frozenset[str] = frozenset()
    numbers: frozenset[float] = frozenset()


#: No word of the user.
NO_WORDS = MissingWords()


@lru_cache(64)
def parse_words(words: tuple[str, ...]) -> MissingWords:
    """Return the words of the option ``missing``."""
    numbers = set()
    for word in words:
        with suppress(ValueError):
            numbers.add(float(word.replace(",", ".")))
    return MissingWords(frozenset(word.lower() for word in words), frozenset(numbers))


def is_missing(text: str, given: Collection[str] = ()) -> bool:
    """Return whether a cell has no value.

    Parameters
    ----------
    text : str
    given : collection of str
        Words of the user, in lower case.
    """
    word = text.strip().lower()
    if word in EMPTY or word in given:
        return True
    # Nearly all cells are numbers.
    if word[-1].isdigit() and "#" not in word and word[0] != "e":
        return False
    return _is_known(word)


# The words of a file repeat.
@lru_cache(1024)
def _is_known(word: str) -> bool:
    if _PATTERN.fullmatch(word):
        return True
    plain = _CODE.sub("", word.replace("_", " "), count=1)
    return plain in WORDS or plain.lstrip("+-") in WORDS
