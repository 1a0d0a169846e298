"""A cause, its records, and the answers that are right for it."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lab.diagnosis.injection.excitation import Signal


@dataclass(frozen=True, slots=True, eq=False)
class Response:
    """A simulated record.

    Attributes
    ----------
    u : ndarray, shape (samples, inputs)
        The recorded inputs; the first one drives the simulation.
    y : ndarray, shape (samples,)
        Output without noise.
    noise : ndarray, shape (samples,), or None
        Noise of the sensor; None for white noise of a size that the
        misfit determines.
    """

    u: Signal
    y: Signal
    noise: Signal | None = None


#: Draws a record, given a generator of the plant's random values and one of those of the record.
DrawResponse = Callable[[np.random.Generator, np.random.Generator], Response]


@dataclass(frozen=True, slots=True, eq=False)
class UnusualCause:
    """A plant with a cause that the simulation of it lacks, or a clean record.

    Attributes
    ----------
    name : str
    summary : str
        What the plant does, in one line without a period.
    simulation : str
        Simulation that is diagnosed, as on the command line.
    draw : callable
    names : frozenset of str
        Effects that are the cause. Names that the analysis may get later belong to them.
    terms : str
        Regular expression that the text of a discovered term matches if it is the cause; empty for none.
    family : frozenset of str
        Effects and families of the catalogue that describe the cause in part or by its behaviour.
    family_terms : str
        Regular expression of terms of the same kind; empty for none.
    carries : bool
        Whether a right extension holds on another record. A disturbance that is not measured has
        another phase there.
    is_clean : bool
        Whether there is no cause, so that a claim is false.
    """

    name: str
    summary: str
    simulation: str
    draw: DrawResponse
    names: frozenset[str] = frozenset()
    terms: str = ""
    family: frozenset[str] = frozenset()
    family_terms: str = ""
    carries: bool = True
    is_clean: bool = False
