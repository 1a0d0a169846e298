"""Least squares of the simulated and whitened error of linear models.

For given poles, dead times and noise, the output is linear in the numerators, the initial states and the
operating point, which are eliminated (variable projection, Golub and Pereyra 1973). Gauss-Newton steps move
the poles and the noise together: a Box-Jenkins model, whose estimate is also consistent in closed loop (Ljung
1999, sections 4.2 and 13.4). All sums are triangular factors of blocks of samples.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from islands.estimation.linear.noise import limit_zeros
from islands.estimation.linear.numerators import Residues, find_residues, find_rest, map_numerators
from islands.estimation.linear.sections import (
    INTEGRATORS,
    Section,
    Signal,
    Signals,
    find_point_poles,
    find_poles,
    is_stable,
    pair_poles,
)
from islands.kernels.parallel_sections import factor_sections, solve_rows

#: A column that keeps at most this part of its norm depends on the columns before it.
_DEPENDENT = 1e-10

#: Reduction of the deviance for which no step is taken: it is no reason to prefer a model.
_NEGLIGIBLE = 1e-3

#: Halvings of a step.
_MAX_HALVINGS = 8

#: Part of a standard error by which the noise is moved for the derivatives of the restricted likelihood.
_NOISE_STEP = 0.1

#: Part by which poles and dead times are moved for the derivatives of numerators.
_MOVED = 1e-5


class Mode(NamedTuple):
    """A real pole or a complex pair.

    Attributes
    ----------
    pole : complex
        Of a pair, that with the positive imaginary part.
    drives : ndarray of bool, shape (outputs, inputs)
        Whether it is in the response of an output to an input.
    """

    pole: complex
    drives: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Structure:
    """What the numerators and the noise belong to.

    Attributes
    ----------
    sections : tuple of ndarray
        Denominators without an integrator.
    integrators : int
        Number of poles at exactly 1: 0, 1 or 2.
    delays : ndarray of int64, shape (outputs, inputs)
        Whole samples before the response to an input begins: it reads lag ``delay + 1`` first.
    leads : ndarray of bool, shape (outputs, inputs)
        Whether it reads lag ``delay`` as well: the dead time is not a whole number of samples.
    noise : tuple of ndarray, each of shape (2, states)
        Noise of every output: ``v(k) = d1 v(k-1) + ... + e(k) + c1 e(k-1) + ...``, d in the first row.
    before : ndarray, shape (recordings, inputs), optional
        Values of the inputs before every recording. If they are not known, outputs that read them are not
        counted.
    drives : ndarray of bool, shape (outputs, inputs, sections)
        Whether a section, last that of the integrators, is in the response of an output to an input.
    excess : ndarray of int64, shape (outputs, inputs)
        Poles of the response in continuous time less its zeros. If it is 1, all numerators are free.
    fractions : ndarray, shape (outputs, inputs)
        Part of a sample by which a response that leads begins earlier; a parameter with fewer zeros.
    rests : bool
        Whether every recording begins at rest with the inputs before it.
    """

    sections: tuple[Section, ...]
    integrators: int
    delays: NDArray[np.int64]
    leads: NDArray[np.bool_]
    noise: tuple[Signal, ...]
    before: Signal | None
    drives: NDArray[np.bool_]
    excess: NDArray[np.int64]
    fractions: Signal
    rests: bool = False

    @property
    def skipped(self) -> int:
        """Samples of every recording that are not counted; the initial states apply after them."""
        return int(self.delays.max(initial=0)) if self.before is None else 0

    def find_intervals(self, signals: Signals) -> list[tuple[int, int]]:
        """Return the first sample that is counted of every recording, and the sample after its last one."""
        return [(begin + self.skipped, end) for begin, end in signals.bounds]

    def count_coefficients(self, output: int) -> int:
        """Return the number of the coefficients of an output."""
        return len(self.leads[output]) * self.order + int(np.count_nonzero(self.leads[output])) + 1

    @cached_property
    def filters(self) -> tuple[Signal, NDArray[np.int64]]:
        """Coefficients of all sections, shape (sections, 2), and how many each one has."""
        padded = np.zeros((len(self.parts), 2))
        for row, section in zip(padded, self.parts, strict=True):
            row[: section.size] = section
        return padded, np.array([section.size for section in self.parts], np.int64)

    @cached_property
    def parts(self) -> tuple[Section, ...]:
        """All sections, that of the integrators last."""
        return self.sections + INTEGRATORS[self.integrators]

    @cached_property
    def order(self) -> int:
        """Number of poles."""
        return sum(section.size for section in self.parts)

    @property
    def free(self) -> int:
        """Number of poles that are estimated."""
        return self.order - self.integrators

    @property
    def modes(self) -> list[Mode]:
        """All modes but the integrators."""
        return [
            Mode(pole, self.drives[:, :, place])
            for place, section in enumerate(self.sections)
            for pole in find_poles([section]).tolist()
            if pole.imag >= 0.0
        ]

    @property
    def key(self) -> tuple[object, ...]:
        """What equal structures have in common."""
        orders = np.repeat(self.drives, [part.size for part in self.parts], axis=2).sum(axis=2)
        excess = np.clip(self.excess, 1, np.maximum(orders, 1))
        fractions = np.where(self.leads & (excess > 1), self.fractions, 0.5)
        arrays = (*self.sections, self.delays, self.leads, *self.noise, self.drives, excess, fractions)
        before = None if self.before is None else self.before.tobytes()
        return self.integrators, self.rests, before, *(each.tobytes() for each in arrays)

    def take(self, modes: Sequence[Mode], **changes: Any) -> "Structure":
        """Return the structure with other modes; real poles share a section with those of the same inputs."""
        sections, drives = [], []
        groups = {mode.drives.tobytes(): mode.drives for mode in modes}
        for key, driven in groups.items():
            poles = [mode.pole for mode in modes if mode.drives.tobytes() == key]
            own = pair_poles([*poles, *(pole.conjugate() for pole in poles if pole.imag > 0.0)])
            sections += own
            drives += [driven] * len(own)
        drives += [self.drives[:, :, place] for place in range(len(self.sections), len(self.parts))]
        every = np.stack(drives, axis=2) if drives else np.ones((*self.delays.shape, 0), bool)
        return replace(self, **{"sections": tuple(sections), "drives": every, **changes})

    def is_free(self, output: int) -> bool:
        """Return whether all coefficients and initial states of an output are parameters."""
        return bool((self.excess[output] == 1).all() and self.drives[output].all() and not self.rests)

    def find_tied(self, output: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return the places of initial states that follow from the inputs before, and of the others."""
        first, order = self.noise[output].shape[1], self.order
        places = np.arange(first + order)
        is_tied = (places >= first) & (places < first + self.free) & self.rests
        return places[is_tied], places[~is_tied]

    @property
    def whole(self) -> NDArray[np.int64]:
        """Whole samples of the dead times, shape (outputs, inputs)."""
        return np.maximum(self.delays - (self.leads & (self.order > 0)), 0)

    @property
    def holds(self) -> bool:
        """Whether the inputs before the recording hold the output of an integrator."""
        return self.rests and self.integrators > 0 and self.before is not None and len(self.before) == 1

    def find_early(self, output: int) -> NDArray[np.int64]:
        """Return the inputs for which the fraction of the dead time is a parameter."""
        return np.flatnonzero(self.leads[output] & (self.excess[output] > 1))


def make_structure(
    sections: tuple[Section, ...],
    integrators: int,
    delays: NDArray[np.int64],
    leads: NDArray[np.bool_],
    noise: tuple[Signal, ...],
    before: Signal | None,
) -> Structure:
    """Return the structure with free numerators of all sections, and free initial states."""
    drives = np.ones((*delays.shape, len(sections) + min(integrators, 1)), bool)
    excess, fractions = np.ones_like(delays), np.full(delays.shape, 0.5)
    return Structure(sections, integrators, delays, leads, noise, before, drives, excess, fractions)


@dataclass(frozen=True, eq=False)
class Fit:
    """A structure with the best numerators.

    Attributes
    ----------
    signals : Signals
    structure : Structure
    parameters : tuple of ndarray
        Linear parameters of every output: of every input the coefficients of the sections and, if it leads,
        of the direct term, or those of the numerator in continuous time; last the constant.
    mappings : tuple of ndarray
        What tied states and coefficients of every output are for them.
    coefficients : tuple of ndarray
        The coefficients that follow.
    states : tuple of ndarray
        States of the noise and of the sections of every output at the first sample that is counted, shape
        (recordings, states).
    squares : ndarray, shape (outputs,)
        Sum of squares of the whitened error.
    counts : ndarray, shape (outputs,)
        Samples of the whitened error.
    """

    signals: Signals
    structure: Structure
    parameters: tuple[Signal, ...]
    mappings: tuple[Signal, ...]
    coefficients: tuple[Signal, ...]
    states: tuple[Signal, ...]
    squares: Signal
    counts: Signal

    @cached_property
    def residual(self) -> Signal:
        """Error of the free run, shape (outputs, samples); zero where it is not counted."""
        residual, nothing = np.zeros(self.signals.y.shape), np.empty((0, 0))
        for output, (coefficients, states) in enumerate(zip(self.coefficients, self.states, strict=True)):
            rest = coefficients, states, False, residual[output], nothing, np.empty((0, 0, 0))
            _run(self.signals, self.structure, output, *rest)
        return residual

    @property
    def starts(self) -> tuple[Signal, ...]:
        """States of the sections of every output at the first counted sample, shape (recordings, order)."""
        return tuple([states[:, states.shape[1] - self.structure.order :] for states in self.states])

    @cached_property
    def deviance(self) -> float:
        """Minus twice the logarithm of the likelihood of all samples, up to a constant.

        Models that count different numbers of samples are compared by the mean square. An input before a
        recording and a sample that is not counted cost 2, as a parameter does in the criterion of Akaike: the
        information on them does not grow with the number of samples.
        """
        return self.measure_deviance(self.squares)

    def measure_deviance(self, squares: Signal) -> float:
        """Return the deviance for given sums of squares."""
        mean_squares = np.maximum(squares, np.finfo(float).tiny) / self.counts
        return float(self.signals.samples * np.log(mean_squares).sum() + 2.0 * self._bounded)

    @cached_property
    def _bounded(self) -> int:
        """Number of values on which the information does not grow with the number of samples."""
        before, first = self.structure.before, self.signals.first
        levels = 0 if before is None else int(np.count_nonzero(before != first))
        return len(self.states) * len(first) * self.structure.skipped + levels

    @cached_property
    def count(self) -> int:
        """Number of parameters, with the initial states and dead times."""
        structure = self.structure
        sizes = [each.size for each in (*self.parameters, *structure.noise)]
        sizes += [structure.find_early(output).size for output in range(len(structure.noise))]
        free = structure.integrators if structure.rests else structure.order
        sizes += [len(self.starts) * self.signals.ends.size * free]
        return structure.free + sum(sizes) + int(np.count_nonzero(structure.whole))

    @property
    def criterion(self) -> float:
        """Information criterion of Schwarz."""
        return self.deviance + float(np.log(self.signals.samples)) * self.count

    @property
    def expected_deviance(self) -> float:
        """Information criterion of Akaike: the deviance that is expected on another record."""
        return self.deviance + 2.0 * self.count


def project(signals: Signals, structure: Structure) -> Fit | None:
    """Return the fit with the best numerators.

    None if it is not finite or not stable, its noise not invertible, or a pole has no continuous time that
    numerators need.
    """
    if not all(map(is_stable, structure.sections)) or not all(
        is_invertible(each, signals.samples) for each in structure.noise
    ):
        return None
    recordings, parameters, mappings, coefficients, states = signals.ends.size, [], [], [], []
    squares = np.empty(len(structure.noise))
    for output, noise in enumerate(structure.noise):
        mapping = map_parameters(structure, output, signals.samples)
        if mapping is None:
            return None
        zero = np.zeros(structure.count_coefficients(output))
        starts = np.zeros((recordings, noise.shape[1] + structure.order))
        tied, untied = structure.find_tied(output)
        equations, own, norms = _map_columns(
            *_factor(signals, structure, output, zero, starts), _append(mapping, np.eye(1)), tied, untied
        )
        found = solve(equations[:, :-1], equations[:, -1], norms[:-1])
        values = mapping @ found.values
        starts[:, tied] = values[: -zero.size].reshape(recordings, tied.size)
        starts[:, untied] = [_solve_states(rows, found.values) for rows in own]
        squares[output] = found.squares
        parameters.append(found.values)
        mappings.append(mapping)
        coefficients.append(values[-zero.size :])
        states.append(starts)
    if not np.isfinite(squares).all():
        return None
    counts = np.full(squares.size, float(signals.samples - structure.skipped * recordings))
    linear = tuple(parameters), tuple(mappings), tuple(coefficients), tuple(states)
    return Fit(signals, structure, *linear, squares, counts)


def map_parameters(
    structure: Structure, output: int, samples: int, moved: Structure | None = None
) -> Signal | None:
    """Return what tied states and coefficients of an output are for its linear parameters.

    Parameters
    ----------
    structure : Structure
        Numerators in continuous time have the unit of its poles.
    output, samples : int
    moved : Structure, optional
        One near it, whose mapping of the same parameters is returned; by default the structure itself.

    Returns
    -------
    ndarray, shape (recordings * tied + coefficients, parameters), optional
        None if numerators need the continuous time of a pole that has none.
    """
    if structure.is_free(output):
        return np.eye(structure.count_coefficients(output))
    mapping = _map_points(structure, output, samples, [structure, *([moved] if moved else [])])
    return None if mapping is None else mapping[-1]


def _map_points(
    structure: Structure, output: int, samples: int, points: Sequence[Structure]
) -> Signal | None:
    """Return the mappings of structures that differ in poles and fractions, as the first axis."""
    poles, known = find_point_poles([point.parts for point in points]), dict[bytes, Residues | None]()
    blocks = []
    for place in range(structure.delays.shape[1]):
        early = np.array([point.fractions[output, place] for point in points])
        blocks.append(_map_input(structure, output, place, poles, early, known))
    kept = [block for block in blocks if block is not None]
    if len(kept) < len(blocks):
        return None
    levels = np.zeros((0, len(kept)))
    if structure.rests and structure.before is not None:
        levels = structure.before
    rests = [_list_rests(each) if structure.rests else [] for each in points]
    tied = len(levels) * structure.free
    rows, columns = (sum(block.shape[axis] for block in kept) + 1 for axis in (1, 2))
    mapping = np.zeros((len(points), tied + rows, columns))
    row = column = 0
    for block, level in zip(kept, levels.T, strict=True):
        taken = slice(column, column + block.shape[2])
        mapping[:, tied + row : tied + row + block.shape[1], taken] = block
        for point, own in enumerate(rests):
            for at, rest in own:
                states = rest @ block[point, at : at + len(rest)]
                for recording, value in enumerate(level):
                    first = recording * structure.free + at
                    mapping[point, first : first + len(rest), taken] = value * states
        if structure.holds:
            # The constant of an integrator is its growth over the record.
            mapping[:, -1, taken] = -samples * level[0] * block[:, structure.free]
        row, column = row + block.shape[1], column + block.shape[2]
    if structure.holds:
        return mapping[:, :, :-1]
    mapping[:, -1, -1] = 1.0
    return mapping


def _append(one: Signal, other: Signal) -> Signal:
    """Return a matrix of two blocks on the diagonal."""
    joined = np.zeros((len(one) + len(other), one.shape[1] + other.shape[1]))
    joined[: len(one), : one.shape[1]], joined[len(one) :, one.shape[1] :] = one, other
    return joined


def _list_rests(structure: Structure) -> list[tuple[int, Signal]]:
    """Return the first row of every section, and its states at rest."""
    ends = np.cumsum([section.size for section in structure.sections])
    return [
        (int(end) - section.size, find_rest(section))
        for end, section in zip(ends, structure.sections, strict=True)
    ]


def _map_input(
    structure: Structure,
    output: int,
    place: int,
    poles: NDArray[np.complex128],
    early: Signal,
    known: dict[bytes, Residues | None],
) -> Signal | None:
    """Return what the coefficients of an input are for its parameters, for several poles and fractions.

    Residues are those of equal numbers of zeros and driven modes, so that inputs share them.
    """
    leads, excess = bool(structure.leads[output, place]), int(structure.excess[output, place])
    drives = structure.drives[output, place]
    sizes = [part.size for part in structure.parts]
    rows = np.repeat(drives, sizes)
    if excess > 1 and rows.any():
        zeros, key = (
            max(int(rows.sum()) - excess, 0),
            drives.tobytes() + bytes([min(excess, int(rows.sum()))]),
        )
        if key not in known:
            known[key] = find_residues(poles[:, rows], zeros)
        residues = known[key]
        driven = [size for size, is_driven in zip(sizes, drives, strict=True) if is_driven]
        own = None if residues is None else map_numerators(residues, driven, early if leads else None)
        if own is None:
            return None
    else:
        own = np.repeat(np.eye(int(rows.sum()) + leads)[None], len(poles), axis=0)
    if rows.all():
        return own
    block = np.zeros((len(poles), structure.order + leads, own.shape[2]))
    block[:, np.append(rows, np.ones(int(leads), bool))] = own
    return block


def differentiate_mapping(
    structure: Structure, output: int, samples: int, parameters: Signal
) -> Signal | None:
    """Return the derivatives of tied states and coefficients by the fractions of dead times and by the poles.

    Returns
    -------
    ndarray, shape (recordings * tied + coefficients, fractions + poles), optional
    """
    points, steps = list[Structure](), list[float]()
    for place in structure.find_early(output):
        change = np.zeros_like(structure.fractions)
        change[output, place] = _MOVED
        points += [replace(structure, fractions=structure.fractions + sign * change) for sign in (1.0, -1.0)]
        steps.append(_MOVED)
    least = [min(1.0 + float(each.sum()), abs(float(each[-1]))) for each in structure.sections for _ in each]
    for place, step in enumerate(least):
        change = _MOVED * step * np.eye(1, structure.free, place)[0]
        sides = [move(structure.sections, sign * change) for sign in (1.0, -1.0)]
        points += [replace(structure, sections=sections) for sections in sides]
        steps.append(_MOVED * step)
    if not points:
        return np.zeros((structure.count_coefficients(output), 0))
    mapping = _map_points(structure, output, samples, points)
    if mapping is None:
        return None
    every = mapping @ parameters
    slopes: Signal = (every[::2] - every[1::2]) / (2.0 * np.array(steps)[:, None])
    return slopes.T


def _map_columns(
    factor: Signal, own: Signal, mapping: Signal, tied: NDArray[np.int64], untied: NDArray[np.int64]
) -> tuple[Signal, Signal, Signal]:
    """Return equations in the parameters, rows of the states that are not tied, and norms of the columns."""
    recordings, order = own.shape[:2]
    kept = mapping[recordings * tied.size :]
    starts = mapping[: recordings * tied.size].reshape(recordings, tied.size, mapping.shape[1])
    equations = factor @ kept
    columns = own[:, :, order:] @ kept + own[:, :, tied] @ starts
    norms = np.sqrt(np.square(equations).sum(axis=0) + np.square(columns).sum(axis=(0, 1)))
    own = np.concatenate([own[:, :, untied], columns], axis=2)
    if tied.size:
        # Rows of zeros, as a factor has no more rows than the matrix.
        missing = np.zeros((recordings, max(own.shape[2] - order, 0), own.shape[2]))
        own = np.asarray(np.linalg.qr(np.concatenate([own, missing], axis=1), mode="r"))
        equations = np.vstack([equations, *own[:, untied.size :, untied.size :]])
    return equations, own[:, : untied.size], norms


def _factor(
    signals: Signals,
    structure: Structure,
    output: int,
    coefficients: Signal,
    states: Signal,
    derivatives: bool = False,
) -> tuple[Signal, Signal]:
    """Return the factor of an output, and of every recording the rows of its initial states.

    Columns of the factor are those of the coefficients, of the noise and the poles if they are requested, and
    the residual. Rows of the initial states begin with their own columns.
    """
    noise = structure.noise[output]
    size = coefficients.size + (noise.size + structure.free if derivatives else 0) + 1
    factor, own = np.empty((size, size)), np.empty((*states.shape, states.shape[1] + size))
    _run(signals, structure, output, coefficients, states, derivatives, np.empty(0), factor, own)
    return factor, own


def _run(signals: Signals, structure: Structure, output: int, *rest: Any) -> None:
    """Call the kernel for an output."""
    factor_sections(
        signals.u,
        signals.y[output],
        signals.ends,
        signals.first if structure.before is None else structure.before,
        structure.skipped,
        *structure.filters,
        len(structure.parts) - len(structure.sections),
        structure.delays[output],
        structure.leads[output],
        structure.noise[output],
        *rest,
    )


def _solve_states(rows: Signal, coefficients: Signal) -> Signal:
    """Return the initial states of a recording."""
    order = len(rows)
    moment = rows[:, -1] - rows[:, order : order + coefficients.size] @ coefficients
    return solve(rows[:, :order], moment).values


class Solution(NamedTuple):
    """Solution of linear equations, and the sum of squares that it leaves."""

    values: Signal
    squares: float


def solve(rows: Signal, moment: Signal, units: Signal | None = None) -> Solution:
    """Return the least-squares solution; columns that depend on those before them have the value 0.

    Parameters
    ----------
    rows : ndarray, shape (equations, unknowns)
    moment : ndarray, shape (equations,)
    units : ndarray, shape (unknowns,), optional
        Norms of the columns in the equations that the rows come from; by default those of the rows.
    """
    count, unknowns = rows.shape
    equations, values = np.empty((count, unknowns + 1)), np.empty(unknowns)
    equations[:, :-1], equations[:, -1] = rows, moment
    norms = np.sqrt(np.square(rows).sum(axis=0)) if units is None else units
    return Solution(values, solve_rows(equations, norms, _DEPENDENT, values))


class OutputFactor(NamedTuple):
    """Triangular factor of one output: its own parameters first, then the poles, then the error.

    Its own parameters are the linear ones, those of the noise, and fractions of dead times.

    The coordinates of a section of two coefficients are ``a1 + a2`` and ``-a2``.
    """

    factor: Signal
    own: int


def linearise(signals: Signals, fit: Fit) -> list[OutputFactor] | None:
    """Return the factors of every output at a fit; None if a pole has no continuous time."""
    found = []
    for output, (parameters, coefficients, states) in enumerate(
        zip(fit.parameters, fit.coefficients, fit.states, strict=True)
    ):
        structure = fit.structure
        rows = _factor(signals, structure, output, coefficients, states, derivatives=True)
        noise, (tied, untied) = structure.noise[output].size, structure.find_tied(output)
        early = structure.find_early(output).size
        if structure.is_free(output):
            found.append(OutputFactor(rows[0], parameters.size + noise))
            continue
        matrix = fit.mappings[output]
        slopes = differentiate_mapping(structure, output, signals.samples, parameters)
        if slopes is None:
            return None
        # The rows are tied states, coefficients, noise, poles and the error.
        rest = np.eye(noise + structure.free + 1)
        rest = np.insert(rest, [noise] * early, 0.0, axis=1)
        mapping = _append(matrix, rest)
        mapping[: len(matrix), matrix.shape[1] + noise : -1] = slopes
        equations = _map_columns(*rows, mapping, tied, untied)[0]
        factor = np.asarray(np.linalg.qr(equations, mode="r"))
        found.append(OutputFactor(factor, parameters.size + noise + early))
    return found


class _Step(NamedTuple):
    """Changes of poles, noise and fractions of dead times, and the deviance that they lead to if linear."""

    poles: Signal
    noise: list[Signal]
    fractions: Signal
    deviance: float


def _find_step(signals: Signals, fit: Fit) -> _Step | None:
    """Return the Gauss-Newton step; None if it is not finite."""
    factors, structure = linearise(signals, fit), fit.structure
    if factors is None:
        return None
    free, fractions = structure.free, np.zeros_like(structure.fractions)
    deviations = np.sqrt(np.maximum(fit.squares / fit.counts, np.finfo(float).tiny))
    shared = np.vstack(
        [each.factor[each.own :, each.own :] / s for each, s in zip(factors, deviations, strict=True)]
    )
    poles = solve(shared[:, :free], shared[:, free]).values
    noise, squares = [], []
    for output, (each, before) in enumerate(zip(factors, structure.noise, strict=True)):
        moment = each.factor[:, -1] - each.factor[:, each.own : -1] @ poles
        own = solve(each.factor[: each.own, : each.own], moment[: each.own])
        count = fit.parameters[output].size
        noise.append(own.values[count : count + before.size].reshape(before.shape))
        fractions[output, structure.find_early(output)] = own.values[count + before.size :]
        squares.append(own.squares + float(moment[each.own :] @ moment[each.own :]))
    deviance = fit.measure_deviance(np.array(squares))
    return _Step(poles, noise, fractions, deviance) if np.isfinite(deviance) else None


def _take_step(signals: Signals, fit: Fit, step: _Step) -> Fit | None:
    """Return the fit after the longest step that reduces the deviance; None if there is none."""
    structure = fit.structure
    for halving in range(_MAX_HALVINGS):
        scale = 0.5**halving
        sections = move(structure.sections, scale * step.poles)
        noise = tuple([old + scale * new for old, new in zip(structure.noise, step.noise, strict=True)])
        # A dead time passes smoothly from one sample to the next.
        fractions = structure.fractions + scale * step.fractions
        whole = np.floor(fractions).astype(np.int64)
        delays = structure.delays - whole
        if (delays < np.minimum(structure.delays, 1)).any():
            continue
        moved = replace(structure, sections=sections, noise=noise, delays=delays, fractions=fractions - whole)
        found = project(signals, _join_neighbours(moved))
        if found is not None and found.deviance < fit.deviance:
            return found
    return None


def move(sections: Sequence[Section], moved: Signal) -> tuple[Section, ...]:
    """Return sections after a step in the coordinates of `differentiate`."""
    found, at = [], 0
    for section in sections:
        change = moved[at : at + section.size]
        found.append(
            section + (np.array([change[0] + change[1], -change[1]]) if section.size == 2 else change)
        )
        at += section.size
    return tuple(found)


def _join_neighbours(structure: Structure) -> Structure:
    """Return sections of neighbouring real poles, so that a double pole stays in one of them."""
    real = np.count_nonzero(find_poles(structure.sections).imag == 0.0)
    return structure.take(structure.modes) if real > 2 else structure


def is_invertible(noise: Signal, samples: int) -> bool:
    """Return whether the zeros of the noise are inside of the unit circle, as far as a record can show."""
    return not noise.size or bool(np.abs(np.roots([1.0, *noise[1]])).max() <= limit_zeros(samples))


def minimise(signals: Signals, fit: Fit, steps: int, least: float = 1e-3, goal: float = float("inf")) -> Fit:
    """Return the fit after steps that each reduce the deviance by at least a given amount.

    They end where a deviance is out of reach, for which a step would need twice its expected reduction.
    """
    for _ in range(steps):
        step = _find_step(signals, fit)
        if step is None:
            break
        expected = fit.deviance - step.deviance
        if expected < min(least, _NEGLIGIBLE) or fit.deviance - 2.0 * expected > goal:
            break
        found = _take_step(signals, fit, step)
        if found is None:
            break
        gain, fit = fit.deviance - found.deviance, found
        if gain < least:
            break
    return fit


def restrict(signals: Signals, fit: Fit) -> Fit:
    """Return a fit with noise of the largest restricted likelihood, by a step.

    The parameters of the system absorb a part of the noise at the frequencies that determine them, so that
    its spectrum is too small there. The restricted likelihood has the determinant of their information
    (Patterson & Thompson 1971); its derivatives by the noise lead from the largest likelihood to its own.
    """
    factors, noise = linearise(signals, fit), list(fit.structure.noise)
    for output, each in enumerate(factors or []):
        if noise[output].size:
            noise[output] = _restrict_output(signals, fit, output, each)
    return project(signals, replace(fit.structure, noise=tuple(noise))) or fit


def _restrict_output(signals: Signals, fit: Fit, output: int, each: OutputFactor) -> Signal:
    """Return the noise of one output after the step."""
    noise = fit.structure.noise[output]
    cost, triangle = _split_noise(each, fit, output)
    back = np.asarray(np.linalg.pinv(triangle, rcond=1e-6), np.float64)

    def shift(step: Signal) -> Fit | None:
        moved = list(fit.structure.noise)
        moved[output] = noise + (back @ step).reshape(noise.shape)
        return project(signals, replace(fit.structure, noise=tuple(moved)))

    slopes = np.zeros(noise.size)
    for place in range(noise.size):
        found = shift(_NOISE_STEP * np.eye(noise.size)[place])
        factors = linearise(signals, found) if found else None
        if found and factors:
            slopes[place] = (_split_noise(factors[output], found, output)[0] - cost) / _NOISE_STEP
    steps = (shift(-(0.5**halving) * slopes) for halving in range(_MAX_HALVINGS))
    found = next(filter(None, steps), fit)
    return found.structure.noise[output]


def _split_noise(each: OutputFactor, fit: Fit, output: int) -> tuple[float, Signal]:
    """Return the logarithm of the determinant of all parameters but the noise, and the factor of the noise.

    The squares of changes of the noise by the factor are those that the deviance grows by, times 2.
    """
    count, size = fit.parameters[output].size, fit.structure.noise[output].size
    places = np.arange(each.factor.shape[1] - 1)
    is_noise = (places >= count) & (places < count + size)
    columns = each.factor[:, np.append(places[~is_noise], places[is_noise])]
    triangle = np.asarray(np.linalg.qr(columns, mode="r"))
    diagonal = np.abs(np.diag(triangle))[: places.size - size]
    unit = np.sqrt(2.0 * fit.counts[output] / max(fit.squares[output], np.finfo(float).tiny))
    determined = diagonal > _DEPENDENT * np.abs(columns).max(initial=0.0)
    return 2.0 * float(np.log(diagonal[determined]).sum()), unit * triangle[-size:, -size:]


def predict(signals: Signals, fit: Fit) -> float:
    """Return the information criterion after a step, if the response were linear in it."""
    step = _find_step(signals, fit)
    return fit.criterion if step is None else fit.criterion - max(fit.deviance - step.deviance, 0.0)
