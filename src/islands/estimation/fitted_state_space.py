"""State space with units and estimated parameters, the individual of a search for latent models."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from islands.estimation.constraints.state_space import NO_CONDITIONS, StateSpaceConditions
from islands.estimation.latent_data import LatentData, measure_held_out
from islands.estimation.state_space_fit import StateSpaceFit
from islands.models.latent import ZERO_BLOCKS, StateSpaceLayout, reads_at_once
from islands.models.unit_functions import find_codes, parse_unit
from islands.simulation.outcome import OK, EvaluationOutcome, Status
from islands.simulation.segment_lanes import SegmentLanes

#: Entries of matrices by name, as of `StateSpaceLayout.split`.
Blocks = dict[str, NDArray[Any]]


class NewUnit(NamedTuple):
    """A unit that a draft lacks: its entries of the blocks E, F, W and s, and which of them are free."""

    function: str
    values: Blocks
    free: Blocks


@dataclass(frozen=True, slots=True)
class FittedStateSpace:
    """State space with units, with parameters for signals of the standard deviation 1.

    Attributes
    ----------
    order, inputs : int
        Numbers of states and inputs.
    units : tuple of str
        Function of each unit, as `parse_unit` reads it.
    theta : tuple of float
        All parameters in the order of `StateSpaceLayout`.
    free : tuple of bool
        Which of them are estimated; the others are zero.
    states : tuple of tuple of float
        States at the first row of each block.
    fitness : float
        Mean squared error of the held-out rows, in the squared unit of the output.
    mean_square : float
        Mean squared error of the rows of the estimation, of the scaled output.
    delays : tuple of int
        Dead time of each input in samples; none if empty.
    """

    #: Systems of every size in a hall of fame. There are many sizes.
    kept: ClassVar[int] = 1

    order: int
    inputs: int
    units: tuple[str, ...]
    theta: tuple[float, ...]
    free: tuple[bool, ...]
    states: tuple[tuple[float, ...], ...]
    fitness: float
    mean_square: float
    delays: tuple[int, ...] = ()

    @property
    def layout(self) -> StateSpaceLayout:
        """Sizes and names of all parameters."""
        return StateSpaceLayout(self.order, self.inputs, len(self.units))

    @property
    def outcome(self) -> EvaluationOutcome:
        """Outcome of the estimation, which has succeeded."""
        return OK

    @property
    def size(self) -> int:
        """Number of free parameters, dead times, and further operations of units of several functions."""
        late = sum(map(bool, self.delays))
        return sum(self.free) + late + sum(parse_unit(each).operations - 1 for each in self.units)

    @property
    def key(self) -> tuple[str, ...]:
        """Structure as text; equal keys mean equal structures."""
        free = "".join("01"[each] for each in self.free)
        return f"order {self.order}", *self.units, free, *map(str, self.delays)

    @property
    def niche(self) -> tuple[str, ...]:
        """Order and units: systems of one niche differ in their zeros and in the order of their units."""
        return f"order {self.order}", *sorted(self.units)

    @property
    def reads_at_once(self) -> bool:
        """Whether the output reads an input of the same sample."""
        named = zip(self.layout.names, self.theta, strict=True)
        return reads_at_once((name for name, value in named if value != 0.0), self.delays)

    def draft(self) -> "Draft":
        """Return a draft with this structure and these parameters."""
        theta, free, states = np.array(self.theta), np.array(self.free), np.array(self.states)
        return Draft(self.layout, self.units, theta, free, states, delays=self.delays)


@dataclass(frozen=True, slots=True, eq=False)
class Draft:
    """State space with units before its parameters are estimated.

    Attributes
    ----------
    layout : StateSpaceLayout
    units : tuple of str
    theta : ndarray, shape (parameters,)
        Starting values; parameters that are not free are zero.
    free : ndarray of bool, shape (parameters,)
    states : ndarray, shape (blocks, states)
        Starting values of the states at the first row of each block.
    steps : int
        Steps of the estimation of all parameters.
    effect_steps : int
        Steps of the estimation of all parameters outside of the arguments of the units, before the others.
    delays : tuple of int
        Dead time of each input in samples; none if empty.
    """

    layout: StateSpaceLayout
    units: tuple[str, ...]
    theta: NDArray[np.float64]
    free: NDArray[np.bool_]
    states: NDArray[np.float64]
    steps: int = 0
    effect_steps: int = 0
    delays: tuple[int, ...] = ()

    def take(self, states: Sequence[int], units: Sequence[int]) -> "Draft":
        """Return a draft with some of the states and units only, by their places."""
        order, kept, used = self.layout.order, list(states), list(units)
        inputs = range(order, order + self.layout.inputs)

        def select(values: NDArray[Any]) -> NDArray[Any]:
            blocks = self.layout.split(values)
            taken = {"A": blocks["A"][np.ix_(kept, kept)], "E": blocks["E"][np.ix_(kept, used)]}
            taken |= {name: blocks[name][kept] for name in ("B", "C", "o")}
            taken |= {name: blocks[name][used] for name in ("F", "s")}
            taken["W"] = blocks["W"][np.ix_(used, [*kept, *inputs])]
            return np.concatenate([taken.get(name, block).ravel() for name, block in blocks.items()])

        return Draft(
            StateSpaceLayout(len(kept), self.layout.inputs, len(used)),
            tuple(self.units[unit] for unit in used),
            select(self.theta),
            select(self.free),
            self.states[:, kept],
            delays=self.delays,
        )

    def append(self, units: Sequence[NewUnit]) -> "Draft":
        """Return the draft with further units."""
        blocks, free = self.layout.split(self.theta), self.layout.split(self.free)
        for unit in units:
            blocks, free = _append(blocks, unit.values), _append(free, unit.free)
        layout = replace(self.layout, units=len(self.units) + len(units))
        functions = (*self.units, *(unit.function for unit in units))
        theta, used = layout.join(blocks), layout.join(free)
        return replace(self, layout=layout, units=functions, theta=theta, free=used)

    def restrict(self, structure: str) -> "Draft":
        """Return the draft with the zeros of a structure, an entry of ``ZERO_BLOCKS``."""
        free = self.free.copy()
        blocks = self.layout.split(free)
        blocks["W of the states"] = blocks["W"][:, : self.layout.order]
        for name in ZERO_BLOCKS[structure]:
            blocks[name][...] = False
        return replace(self, free=free)

    def begin(
        self, segments: SegmentLanes, conditions: StateSpaceConditions = NO_CONDITIONS
    ) -> StateSpaceFit:
        """Return the fit of the free parameters to segments, without any step."""
        theta, codes = np.where(self.free, self.theta, 0.0), find_codes(self.units)
        return StateSpaceFit(theta, number(self.free), codes, segments, self.states, conditions)

    def estimate(self, data: LatentData) -> "FittedStateSpace | EvaluationOutcome":
        """Estimate the parameters and measure the error of the held-out rows."""
        data = data.delay(self.delays)
        fit = self.begin(data.used, data.conditions)
        try:
            if self.effect_steps:
                effects = self.free.copy()
                blocks = self.layout.split(effects)
                blocks["W"][...] = blocks["s"][...] = False
                fit.release(number(effects))
                fit.advance(self.effect_steps)
                fit.release(number(self.free))
            fit.advance(self.steps)
            error = measure_held_out(fit, data)
        except np.linalg.LinAlgError:
            return EvaluationOutcome(Status.SINGULAR, "the parameters depend on each other")
        if not fit.meets_conditions:
            return EvaluationOutcome(Status.INFEASIBLE, "the state space cannot meet the constraints")
        if not np.isfinite([error, fit.mean_square]).all():
            return EvaluationOutcome(Status.DIVERGED, "a free run of the state space diverges")
        return self.describe(fit, error)

    def describe(self, fit: StateSpaceFit, error: float) -> FittedStateSpace:
        """Return the system of a fit of this structure, with its error on the held-out rows."""
        return FittedStateSpace(
            self.layout.order,
            self.layout.inputs,
            self.units,
            tuple(fit.theta.tolist()),
            tuple(self.free.tolist()),
            tuple(map(tuple, fit.states.tolist())),
            error,
            fit.mean_square,
            self.delays,
        )


def _append(blocks: Blocks, entries: Blocks) -> Blocks:
    """Return the blocks with the entries of a further unit."""
    return {
        **blocks,
        "E": np.column_stack([blocks["E"], entries["E"]]),
        "F": np.append(blocks["F"], entries["F"]),
        "W": np.vstack([blocks["W"], entries["W"]]),
        "s": np.append(blocks["s"], entries["s"]),
    }


def number(free: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the columns of the free parameters, -1 for the others."""
    return np.where(free, np.cumsum(free) - 1, -1)
