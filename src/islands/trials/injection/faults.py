"""What can be hidden, and the ways in: before a system, in its equation, behind it."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from islands.trials.injection.excitation import sign
from islands.trials.injection.plant import Force, Map, Truth

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
        The first ones are usual, the others are unlike what the analysis would extend a simulation by.
    usual : int
        How many are usual.
    """

    name: str
    least: float
    most: float
    forms: tuple[Hide, ...]
    usual: int = 1


def altered(truth: Truth, **parts: Any) -> Truth:
    """Return a truth with other parts, of its own kind as well."""
    return replace(truth, **parts)


def before(make: Callable[[np.random.Generator, float], Map]) -> Hide:
    """Hide a map on the input."""
    return lambda rng, strength, truth: replace(truth, before=(*truth.before, make(rng, strength)))


def behind(make: Callable[[np.random.Generator, float], Map]) -> Hide:
    """Hide a map on the output."""
    return lambda rng, strength, truth: replace(truth, behind=(*truth.behind, make(rng, strength)))


def beside(make: Callable[[np.random.Generator, float], Force]) -> Hide:
    """Hide a force."""
    return lambda rng, strength, truth: replace(truth, beside=(*truth.beside, make(rng, strength)))


def wrong(which: str) -> Hide:
    """Hide another value of a parameter."""

    def hide(rng: np.random.Generator, strength: float, truth: Truth) -> Truth:
        factor = float(np.exp(sign(rng) * strength))
        return altered(truth, **{which: getattr(truth, which) * factor})

    return hide


def own(which: str, signed: bool = True, per: float = 1.0) -> Hide:
    """Hide something that a truth's own equation knows, ``strength / per`` of it."""

    def hide(rng: np.random.Generator, strength: float, truth: Truth) -> Truth:
        return altered(truth, **{which: (sign(rng) if signed else 1.0) * strength / per})

    return hide


def gain_step(rng: np.random.Generator, strength: float, truth: Truth) -> Truth:
    """Let the gain change at an instant."""
    k, at = sign(rng) * strength, float(rng.uniform(0.15, 0.6))
    return replace(truth, gain=lambda time: 1.0 + k * (time > at * time[-1]))


def ageing(rng: np.random.Generator, strength: float, truth: Truth) -> Truth:
    """Let the gain drift."""
    k = sign(rng) * strength
    return replace(truth, gain=lambda time: 1.0 + k * time / time[-1])
