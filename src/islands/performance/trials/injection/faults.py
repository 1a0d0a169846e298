"""What can be hidden, and the ways in: before a system, in its equation, behind it."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from islands.performance.trials.injection.excitation import random_sign
from islands.performance.trials.injection.plant import Force, Map, Plant

#: Takes chance, the strength, and a truth; gives that truth with something hidden in it.
Inject = Callable[[np.random.Generator, float, Plant], Plant]


@dataclass(frozen=True, slots=True)
class Fault:
    """An effect, as it may be hidden.

    Attributes
    ----------
    name : str
        What the analysis should call it; "" for what it has no name for.
    minimum, maximum : float
        Strengths, drawn evenly in their logarithm; what they mean is the form's.
    forms : tuple of callable
        The first ones are usual, the others are unlike what the analysis would extend a simulation by.
    usual : int
        How many are usual.
    """

    name: str
    minimum: float
    maximum: float
    forms: tuple[Inject, ...]
    usual: int = 1


def alter_parameter(truth: Plant, **parts: Any) -> Plant:
    """Return a truth with other parts, of its own kind as well."""
    return replace(truth, **parts)


def before_plant(make: Callable[[np.random.Generator, float], Map]) -> Inject:
    """Hide a map on the input."""
    return lambda rng, strength, truth: replace(truth, before=(*truth.before, make(rng, strength)))


def after_plant(make: Callable[[np.random.Generator, float], Map]) -> Inject:
    """Hide a map on the output."""
    return lambda rng, strength, truth: replace(truth, behind=(*truth.behind, make(rng, strength)))


def add_force(make: Callable[[np.random.Generator, float], Force]) -> Inject:
    """Hide a force."""
    return lambda rng, strength, truth: replace(truth, beside=(*truth.beside, make(rng, strength)))


def wrong(which: str) -> Inject:
    """Hide another value of a parameter."""

    def hide(rng: np.random.Generator, strength: float, truth: Plant) -> Plant:
        factor = float(np.exp(random_sign(rng) * strength))
        return alter_parameter(truth, **{which: getattr(truth, which) * factor})

    return hide


def set_attribute(which: str, signed: bool = True, per: float = 1.0) -> Inject:
    """Hide something that a truth's own equation knows, ``strength / per`` of it."""

    def hide(rng: np.random.Generator, strength: float, truth: Plant) -> Plant:
        return alter_parameter(truth, **{which: (random_sign(rng) if signed else 1.0) * strength / per})

    return hide


def gain_step(rng: np.random.Generator, strength: float, truth: Plant) -> Plant:
    """Let the gain change at an instant."""
    k, at = random_sign(rng) * strength, float(rng.uniform(0.15, 0.6))
    return replace(truth, gain=lambda time: 1.0 + k * (time > at * time[-1]))


def ageing(rng: np.random.Generator, strength: float, truth: Plant) -> Plant:
    """Let the gain drift."""
    k = random_sign(rng) * strength
    return replace(truth, gain=lambda time: 1.0 + k * time / time[-1])
