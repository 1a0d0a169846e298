"""What can be hidden: an entry for every effect, each in one form or several."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from islands.trials.hide.truth import Truth

#: Takes chance, the strength, and a truth; gives that truth with something hidden in it.
Hide = Callable[[np.random.Generator, float, Truth], Truth]


@dataclass(frozen=True, slots=True)
class Hidden:
    """An effect, as it may be hidden.

    Attributes
    ----------
    name : str
        What the analysis should call it; "" for what it has no name for.
    least, most : float
        Strengths, drawn evenly in their logarithm; what they mean is the form's.
    forms : tuple of callable
        The first is the usual one, the others are unlike what the analysis would extend a simulation by.
    """

    name: str
    least: float
    most: float
    forms: tuple[Hide, ...]
