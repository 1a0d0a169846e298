"""A bounded cache of inner products: evolution sees the same regressors again and again.

An inner product is one number keyed by a pair of regressors, and its bits do not depend on what was computed
with it or before it; so the cache changes how long a result takes, never the result.
"""

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from islands.data.dataset import Dataset
from islands.model.expression import Lagged
from islands.model.regressor import Regressor
from islands.program.columns import Term, inner_products

#: Bytes that one pair takes in the table, key and number together.
_PAIR_BYTES = 200

#: The target's key: no regressor has this text.
_TARGET = "y(k)"


class InnerProducts:
    """Inner products of regressors and of the target y(k) over the rows of a record.

    Parameters
    ----------
    record : Dataset
    warm_up : int
        Samples before the first row of every segment: one for all models of a run.
    limit : int
        Bytes that the table may take; a full table is emptied.
    """

    def __init__(self, record: Dataset, warm_up: int, limit: int = 256_000_000) -> None:
        self._record, self._warm_up = record, warm_up
        self._most = limit // _PAIR_BYTES
        self._known: dict[tuple[str, str], float] = {}

    @property
    def bytes(self) -> int:
        """What the table takes now."""
        return len(self._known) * _PAIR_BYTES

    def prepare(self, structures: Iterable[Sequence[Regressor]]) -> None:
        """Compute what the Gram matrices of these structures still miss, in one pass over the record."""
        if len(self._known) > self._most:
            self._known.clear()
        terms: dict[str, Term] = {}
        missing: dict[tuple[str, str], None] = {}
        for structure in structures:
            named: list[tuple[str, Term]] = [(item.text, item) for item in structure]
            named.append((_TARGET, Lagged(0, 0)))
            for position, (one, term) in enumerate(named):
                for other, second in named[position:]:
                    pair = _pair(one, other)
                    if pair not in self._known and pair not in missing:
                        missing[pair] = None
                        terms[one], terms[other] = term, second
        if not missing:
            return
        places = {text: position for position, text in enumerate(terms)}
        pairs = np.array([(places[one], places[other]) for one, other in missing], np.int64)
        numbers = inner_products(list(terms.values()), pairs, self._record, self._warm_up)
        self._known.update(zip(missing, numbers.tolist(), strict=True))

    def gram(self, structure: Sequence[Regressor]) -> NDArray[np.float64]:
        """Return the Gram matrix of a structure and, last, the target, shape (terms + 1, terms + 1)."""
        texts = [*(item.text for item in structure), _TARGET]
        wanted = [_pair(one, other) for position, one in enumerate(texts) for other in texts[position:]]
        if any(pair not in self._known for pair in wanted):
            self.prepare([structure])
        gram = np.empty((len(texts), len(texts)))
        numbers = iter(wanted)
        for i in range(len(texts)):
            for j in range(i, len(texts)):
                gram[i, j] = gram[j, i] = self._known[next(numbers)]
        return gram


def _pair(one: str, other: str) -> tuple[str, str]:
    return (one, other) if one <= other else (other, one)
