"""Faults and the ways to inject them: at the input, in the equation, at the output."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lab.diagnosis.injection import force_faults, signal_faults
from lab.diagnosis.injection.excitation import random_sign
from lab.diagnosis.injection.plant import Force, Map, Plant

#: Takes a random generator, a strength and a plant; returns the plant with a fault.
Inject = Callable[[np.random.Generator, float, Plant], Plant]


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault that can be injected.

    Attributes
    ----------
    name : str
        Name that the analysis should report; empty if the catalogue has no name for it.
    minimum, maximum : float
        Bounds of the strength, which is drawn from a log-uniform distribution. Its meaning depends on the
        form.
    forms : tuple of callable
        The standard forms, followed by variants that differ from the effects of the analysis.
    standard_forms : int
        Number of standard forms.
    """

    name: str
    minimum: float
    maximum: float
    forms: tuple[Inject, ...]
    standard_forms: int = 1


def alter_parameter(plant: Plant, **parameters: Any) -> Plant:
    """Return a plant with other values of some attributes, including those of its subclass."""
    return replace(plant, **parameters)


def before_plant(make: Callable[[np.random.Generator, float], Map]) -> Inject:
    """Inject a map of the input."""
    return lambda rng, strength, plant: replace(plant, input_maps=(*plant.input_maps, make(rng, strength)))


def after_plant(make: Callable[[np.random.Generator, float], Map]) -> Inject:
    """Inject a map of the output."""
    return lambda rng, strength, plant: replace(plant, output_maps=(*plant.output_maps, make(rng, strength)))


def add_force(make: Callable[[np.random.Generator, float], Force]) -> Inject:
    """Inject a force."""
    return lambda rng, strength, plant: replace(plant, forces=(*plant.forces, make(rng, strength)))


def scale_parameter(name: str) -> Inject:
    """Multiply or divide a parameter by ``exp(strength)``."""

    def inject(rng: np.random.Generator, strength: float, plant: Plant) -> Plant:
        factor = float(np.exp(random_sign(rng) * strength))
        return alter_parameter(plant, **{name: getattr(plant, name) * factor})

    return inject


def set_attribute(name: str, signed: bool = True, per: float = 1.0) -> Inject:
    """Set an attribute of the plant to ``strength / per``, with a random sign if ``signed``."""

    def inject(rng: np.random.Generator, strength: float, plant: Plant) -> Plant:
        return alter_parameter(plant, **{name: (random_sign(rng) if signed else 1.0) * strength / per})

    return inject


def gain_step(rng: np.random.Generator, strength: float, plant: Plant) -> Plant:
    """Change the gain at a random time."""
    k, at = random_sign(rng) * strength, float(rng.uniform(0.15, 0.6))
    return replace(plant, gain_profile=lambda time: 1.0 + k * (time > at * time[-1]))


def ageing(rng: np.random.Generator, strength: float, plant: Plant) -> Plant:
    """Change the gain linearly over the record."""
    k = random_sign(rng) * strength
    return replace(plant, gain_profile=lambda time: 1.0 + k * time / time[-1])


#: Forces that the catalogue has no name for.
NAMELESS_FORCES: Mapping[str, Fault] = {
    "position-damping": Fault("", 0.01, 1.0, (add_force(force_faults.position_damping),)),
    "tanh-spring": Fault("", 0.01, 0.5, (add_force(force_faults.tanh_spring),)),
    "product": Fault("", 0.01, 0.5, (add_force(force_faults.product),)),
    "fifth-power": Fault("", 0.01, 1.0, (add_force(force_faults.fifth_power),)),
    "cubic-damping": Fault("", 0.005, 0.5, (add_force(force_faults.cubic_damping),)),
    "position-friction": Fault("", 0.005, 0.5, (add_force(force_faults.position_friction),)),
}

#: Maps of input and output that the catalogue has no name for.
NAMELESS_MAPS: Mapping[str, Fault] = {
    "power-law": Fault("", 0.01, 0.5, (before_plant(signal_faults.power_law),)),
    "slow-modulation": Fault("", 0.005, 0.2, (after_plant(signal_faults.slow_modulation),)),
}
