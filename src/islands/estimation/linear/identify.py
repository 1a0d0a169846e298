"""Search for the order, the dead times and the noise of a linear model."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import cycle, product
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from islands.errors import RecordError
from islands.estimation.linear.model import LinearCandidate, LinearModel, Scales, make_model
from islands.estimation.linear.noise import WHITE, fit_noises
from islands.estimation.linear.reduction import (
    Reduced,
    Response,
    reduce_inputs,
    reduce_model,
    sample_fit,
    sample_high_order,
)
from islands.estimation.linear.regression import (
    Fit,
    Mode,
    Structure,
    make_structure,
    minimise,
    predict,
    project,
)
from islands.estimation.linear.sections import INTEGRATORS, Signal, Signals, find_poles
from islands.estimation.linear.starts import HighOrder, fit_high_order, grid_pairs, grid_real
from islands.progress import Steps

#: Largest number of poles, unless another one is given.
LARGEST_ORDER = 12

#: Samples of the part of a record on which starts and dead times are searched.
_PART = 6000

#: Dead times that are tried first, and changes that are tried then.
_COARSE, _CHANGES = (0, 1, 2, 3, 5, 8, 12, 17, 23, 30, 40, 55, 75, 100), (-1, 1, -2, 2, -4, 4)

#: Starts whose dead times are tried, starts that are minimised, and orders without a gain that end a search.
_PLACED, _MINIMISED, _PATIENCE = 8, 3, 2

#: Dead times that differ by less lead to the same minimum.
_NEAR = 4

#: Orders up to which every start is tried; those of the ARX model follow.
_SMALL = 2

#: Steps to the levels of inputs before a recording. The error of given numerators is linear in them.
_LEVEL_STEPS = 3

#: Transfer functions that are minimised, and the largest order of those that are tried first.
_REDUCED, _GROUP = 8, 8

#: Steps after each of which the better half of the starts is left, and starts that are left at the end.
_HALVINGS, _KEPT = (1, 2, 4, 8), 2

#: Time constants in samples of a further pole in series.
_SERIES = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0)

#: Changes of a structure that are minimised, those of the least criterion first.
_NEIGHBOURS = 8


def identify_linear(
    u: NDArray[np.float64],
    y: NDArray[np.float64],
    dt: float = 1.0,
    segments: Sequence[int] = (),
    *,
    max_order: int = LARGEST_ORDER,
    max_dead_time: int = 60,
    feedthrough: bool = False,
    steps: Steps | None = None,
) -> LinearModel:
    """Identify a linear model of the least information criterion.

    Parameters
    ----------
    u : ndarray, shape (samples, inputs)
    y : ndarray, shape (samples,) or (samples, outputs)
    dt : float
        Sampling time in seconds.
    segments : sequence of int
        Lengths of the recordings in samples; one recording if empty.
    max_order : int
        Largest number of poles, 0 to 40.
    max_dead_time : int
        Largest dead time in samples; not more than a sixth of the shortest recording.
    feedthrough : bool
        Whether an output may read an input of the same sample. In closed loop it must not.
    steps : Steps, optional
        Receives the orders that are fitted, and may stop.

    Returns
    -------
    LinearModel

    Raises
    ------
    RecordError
        The arrays do not fit together, have missing values, or are too short.
    StoppedError
        A stop is requested.
    """
    orders = identify_orders(
        u,
        y,
        dt,
        segments,
        max_order=max_order,
        max_dead_time=max_dead_time,
        feedthrough=feedthrough,
        steps=steps,
    )
    return next(orders)


def identify_orders(
    u: NDArray[np.float64],
    y: NDArray[np.float64],
    dt: float = 1.0,
    segments: Sequence[int] = (),
    *,
    max_order: int = LARGEST_ORDER,
    max_dead_time: int = 60,
    feedthrough: bool = False,
    steps: Steps | None = None,
) -> Iterator[LinearModel]:
    """Yield the model of the least information criterion, then the best ones of other orders.

    They are the smaller orders and the next larger ones that were compared. Of a long record, models of
    smaller orders are those of the part on which structures are searched. Parameters and errors are those of
    `identify_linear`.
    """
    u, y = (np.asarray(each, dtype=np.float64).reshape(len(each), -1) for each in (u, y))
    lengths = tuple(segments) or (len(y),)
    if len(u) != len(y) or sum(lengths) != len(y):
        raise RecordError(
            f"u, y and segments must have equal lengths, got {len(u)}, {len(y)} and {sum(lengths)} samples"
        )
    if not (np.isfinite(u).all() and np.isfinite(y).all()):
        raise RecordError("a linear identification needs all samples: fill or cut out missing values")
    if len(y) < 10:
        raise RecordError(f"a linear identification needs at least 10 samples, got {len(y)}")
    signals, scales = scale_signals(u, y, dt, lengths)
    longest = min(max_dead_time, min(lengths) // 6)
    # On small matrices, several threads take a hundred times as long, and sums have other bits.
    with threadpool_limits(1, user_api="blas"):
        fits, smaller, rivals = _search(signals, longest, max_order, feedthrough, steps or Steps())
        best = min(fits, key=attrgetter("criterion"))
        model = make_model(signals, best, scales, list(map(_describe, fits)), rivals)
    yield model
    for fit in (*smaller, *fits):
        if fit is not best and fit.structure.order <= best.structure.order + _PATIENCE:
            with threadpool_limits(1, user_api="blas"):
                model = make_model(fit.signals, fit, scales)
            yield model


def _describe(fit: Fit) -> LinearCandidate:
    structure, error = fit.structure, float(np.sqrt(np.mean(fit.residual**2)))
    return LinearCandidate(structure.order, structure.integrators, fit.criterion, error)


def scale_signals(
    u: NDArray[np.float64], y: NDArray[np.float64], dt: float, segments: Sequence[int] = ()
) -> tuple[Signals, Scales]:
    """Return signals of mean 0 and standard deviation 1, and their units.

    Parameters
    ----------
    u, y : ndarray, shapes (samples, inputs) and (samples,) or (samples, outputs)
    dt : float
    segments : sequence of int
        Lengths of the recordings in samples.
    """
    u, y = u.reshape(len(u), -1), y.reshape(len(y), -1)
    means, units = zip(*((each.mean(axis=0), each.std(axis=0)) for each in (u, y)), strict=True)
    (u0, y0), (u_unit, y_unit) = means, [np.where(each > 0.0, each, 1.0) for each in units]
    ends = np.cumsum(segments or (len(u),), dtype=np.int64)
    u, y = np.ascontiguousarray(((u - u0) / u_unit).T), np.ascontiguousarray(((y - y0) / y_unit).T)
    return Signals(u, y, ends), Scales(u0, u_unit, y0, y_unit, dt)


def _search(
    signals: Signals, longest: int, max_order: int, feedthrough: bool, steps: Steps
) -> tuple[list[Fit], list[Fit], list[Fit]]:
    """Return the best fit of every order that all samples compare, smaller ones, and rivals of the best one.

    Of a long record, orders below the best one of a part are not compared on all samples.
    """
    search = Search(_take_part(signals), longest, max_order, feedthrough, steps)
    found = search.run()
    best, rivals = search.improve(min(found, key=attrgetter("criterion")))
    found = [each for each in found if each.structure.order != best.structure.order] + [best]
    if signals.samples <= _PART:
        return found, [], rivals
    # More samples show more: orders that a part rejects are compared again.
    larger = [each for each in found if each.structure.order >= best.structure.order]
    smaller = [each for each in found if each.structure.order < best.structure.order]
    return _extend_to(signals, larger, steps), smaller, _extend_to(signals, rivals, steps)


def _extend_to(signals: Signals, fits: Sequence[Fit], steps: Steps) -> list[Fit]:
    """Return the fits of a part after steps on all samples."""
    found = []
    for fit in fits:
        steps(f"linear model of order {fit.structure.order} of all samples")
        # The inputs before the part are not those before the recordings.
        structure = fit.structure
        begins = [structure] if structure.before is None else []
        begins += [replace(structure, before=signals.first, rests=rests) for rests in (False, True)]
        starts = [each for each in (project(signals, begin) for begin in begins) if each]
        if starts:
            found.append(minimise(signals, min(starts, key=attrgetter("criterion")), 20, 1e-2))
    return found


def _take_part(signals: Signals) -> Signals:
    """Return the signals, of a long record consecutive samples where the inputs vary most."""
    return signals if signals.samples <= _PART else signals.keep(*find_part(signals.u))


def find_part(u: Signal) -> tuple[int, int]:
    """Return the first sample of the part on which structures are searched, and the one after its last.

    Parameters
    ----------
    u : ndarray, shape (inputs, samples)
        With equal units.
    """
    begins = range(0, max(1, u.shape[1] - _PART + 1), _PART)
    spreads = [float(np.log(u[:, begin : begin + _PART].var(axis=1) + 1e-12).sum()) for begin in begins]
    begin = begins[int(np.argmax(spreads))]
    return begin, min(begin + _PART, u.shape[1])


def _take_distant(fits: Sequence[Fit]) -> list[Fit]:
    """Return the first fit of each minimum: of an oscillation, half a period more inverts the gain."""
    kept: list[Fit] = []
    for fit in fits:
        if all(np.abs(fit.structure.delays - each.structure.delays).max() > _NEAR for each in kept):
            kept.append(fit)
    return kept


class Search:
    """Search for fits of increasing order."""

    def __init__(
        self, signals: Signals, longest: int, max_order: int, feedthrough: bool, steps: Steps
    ) -> None:
        self.signals = signals
        self.longest = longest
        self.max_order = max_order
        self.feedthrough = feedthrough
        self.steps = steps
        self.high: HighOrder | None = None
        self.fits: dict[int, Fit] = {}

    def run(self) -> list[Fit]:
        """Return the best fit of every order that was reached."""
        shape = len(self.signals.y), len(self.signals.u)
        self.high = fit_high_order(self.signals, self.longest, self.feedthrough)
        static = make_structure(
            (), 0, np.zeros(shape, np.int64), np.ones(shape, bool), (WHITE,) * shape[0], self.signals.first
        )
        self._keep(self._fit([static]))
        for order in range(1, min(_SMALL, self.max_order) + 1):
            self.steps(f"linear model of order {order}")
            self._keep(self._fit(list(self._starts(order))))
        if self.high is not None:
            response = sample_high_order(self.signals, self.high)
            small = list(reduce_model(response, range(2, min(_GROUP, self.max_order) + 1)))
            small += self._reduce_inputs(response, np.zeros(shape[1], np.int64))
            self.steps.check("linear models of several orders")
            least = min(map(self._expect, small), default=np.inf)
            # Many modes are a sum, whose zeros are all free.
            bound = float(np.log(self.signals.samples)), least
            large = list(reduce_model(response, range(_GROUP + 1, self.max_order + 1), 0, 1, bound))
            self._keep_reduced(small)
            if min(map(self._expect, large), default=np.inf) < least:
                self._keep_reduced(large)
        self._grow()
        best = self.best.structure
        orders = range(1, min(best.order + 1, self.max_order) + 1)
        if best.order > 1:
            response = sample_fit(self.best)
            driven = best.drives[:, :, len(best.sections) :].any(axis=(0, 2))
            integrating = np.where(driven, best.integrators, 0)
            reduced = [*reduce_model(response, orders, best.integrators)]
            reduced += self._reduce_inputs(response, integrating)
            self._keep_reduced(reduced)
        return [self.fits[order] for order in sorted(self.fits)]

    def _reduce_inputs(self, response: Response, integrators: NDArray[np.int64]) -> Iterator[Reduced]:
        """Yield transfer functions of several inputs that have poles of their own."""
        inputs = len(self.signals.u)
        if inputs > 1:
            orders = range(1, min(_GROUP, self.max_order) // inputs + 1)
            yield from reduce_inputs(response, orders, integrators, float(np.log(self.signals.samples)))

    def _expect(self, reduced: Reduced) -> float:
        """Return the criterion that is expected of a transfer function, up to a constant."""
        return reduced.loss + float(np.log(self.signals.samples)) * reduced.size

    def _keep_reduced(self, reduced: Iterable[Reduced]) -> None:
        """Keep the most promising fits that begin with transfer functions."""
        promising = sorted(reduced, key=self._expect)[:_REDUCED]
        starts = [start for each in promising for start in self._list_starts(each)]
        fits = [each for each in (project(self.signals, start) for start in starts) if each]
        if fits and not any(noise.size for noise in self.best.structure.noise):
            # Without the noise, poles of a closed loop would move away from the consistent ones.
            noise = self._list_noises(min(fits, key=attrgetter("criterion")))[0]
            coloured = [project(self.signals, replace(start, noise=noise)) for start in starts]
            fits += [each for each in coloured if each]
        for steps in _HALVINGS:
            self.steps.check("linear models of several orders")
            fits = [minimise(self.signals, each, steps, 1e-2) for each in fits]
            fits = sorted(fits, key=attrgetter("criterion"))[: max(len(fits) // 2, _KEPT)]
        for fit in fits[:_KEPT]:
            self.steps(f"linear model of order {fit.structure.order}")
            self._keep(self._colour(self._move_delays(fit)))

    def _list_starts(self, reduced: Reduced) -> Iterator[Structure]:
        """Yield structures from rest or not, with whole dead times or a fraction of a sample."""
        best, shape = self.best.structure, self.best.structure.delays.shape
        every = np.ones(shape, bool)
        # A direct path is no response of the modes.
        direct = ~every if self.high is None else self.high.leads
        modes = [
            Mode(complex(np.exp(pole)), reduced.drives[:, :, place])
            for place, pole in enumerate(reduced.poles)
            if pole.imag >= 0.0
        ]
        integrators = int(reduced.integrators.max(initial=0))
        integrating = np.repeat(reduced.integrators[:, :, None] > 0, min(integrators, 1), axis=2)
        bare = replace(best, sections=(), integrators=integrators, drives=integrating)
        excess = np.where(direct, 1, reduced.excess)
        delays = np.where(direct, 0, np.minimum(reduced.delays, self.longest - 1))
        for leads in (direct, every):
            start = bare.take(modes, excess=excess, delays=delays + (leads & ~direct), leads=leads)
            yield replace(start, rests=True, before=self.signals.first)
            yield replace(start, rests=False)

    @property
    def best(self) -> Fit:
        """Fit of the least criterion."""
        return min(self.fits.values(), key=attrgetter("criterion"))

    def _keep(self, fit: Fit | None) -> None:
        """Keep a fit that is the best of its order."""
        if fit is not None:
            order = fit.structure.order
            self.fits[order] = min(self.fits.get(order, fit), fit, key=attrgetter("criterion"))

    def _grow(self) -> None:
        """Add orders after the best one as long as one of a few reduces the criterion."""
        order = self.best.structure.order
        while order < min(self.max_order, self.best.structure.order + _PATIENCE):
            order += 1
            self.steps(f"linear model of order {order}")
            self._keep(self._fit(list(self._starts(order))))

    def _starts(self, order: int) -> Iterator[Structure]:
        """Yield structures of an order: smaller ones with further poles."""
        samples = self.signals.samples
        smaller, smallest = self.fits.get(order - 1), self.fits.get(order - 2)
        if smaller is not None:
            for pole in grid_real(samples):
                yield self._extend(smaller.structure, pole)
        if smallest is not None:
            for pair in grid_pairs(samples):
                yield self._extend(smallest.structure, pair)

    def _extend(self, structure: Structure, poles: Iterable[complex]) -> Structure:
        """Return a structure with further poles."""
        delays, leads = structure.delays, structure.leads
        if structure.order == 0:
            # The response begins at the lag that the gain reads.
            leads = (delays == 0) & self.feedthrough
            delays = np.maximum(delays - 1, 0)
        every = np.ones(delays.shape, bool)
        modes = [Mode(complex(pole), every) for pole in poles if np.imag(pole) >= 0.0]
        # Of a transient, a small model without its first samples would be a free decay.
        before = self.signals.first if structure.order < _SMALL else structure.before
        noise = (WHITE,) * len(structure.noise)
        return structure.take(
            [*structure.modes, *modes], delays=delays, leads=leads, noise=noise, before=before
        )

    def _fit(self, structures: Sequence[Structure]) -> Fit | None:
        """Return the best fit that the most promising structures lead to."""
        tried = [each for each in (project(self.signals, structure) for structure in structures) if each]
        tried = sorted(tried, key=attrgetter("deviance"))
        if tried and tried[0].structure.order <= 2:
            placed = [fit for each in tried[:_PLACED] for fit in self._place(each)]
            tried = _take_distant(sorted(placed, key=attrgetter("deviance")))
        refined = [self._move_delays(minimise(self.signals, each, 8, 1.0)) for each in tried[:_MINIMISED]]
        return self._colour(min(refined, key=attrgetter("deviance"))) if refined else None

    def improve(self, fit: Fit) -> tuple[Fit, list[Fit]]:
        """Return the fit after changes of its structure that reduce the criterion, and those that do not."""
        improved, rivals = True, list[Fit]()
        while improved:
            self.steps(f"changes of the linear model of order {fit.structure.order}")
            improved, rivals = False, []
            others = {each.key: each for each in self._list_neighbours(fit)}
            others.pop(fit.structure.key, None)
            tried = [project(self.signals, each) for each in others.values() if self._is_causal(each)]
            for start in sorted(filter(None, tried), key=partial(predict, self.signals))[:_NEIGHBOURS]:
                found = minimise(self.signals, start, 15, 0.1)
                # An order that is too large hides a wrong dead time, and wrong inputs before the recordings.
                if found.structure.order < fit.structure.order:
                    found = self._choose_before(self._move_delays(found))
                rivals.append(found)
                if found.criterion < fit.criterion - 1e-6:
                    fit, improved = self._colour(found), True
                    break
        return fit, rivals

    def _list_neighbours(self, fit: Fit) -> Iterator[Structure]:
        """Yield structures with one change."""
        structure = fit.structure
        white = (WHITE,) * len(structure.noise)
        for before in self._list_before(fit):
            yield replace(structure, before=before, rests=structure.rests and before is not None)
        if any(noise.size for noise in structure.noise):
            yield replace(structure, noise=white)
        if structure.order == 0:
            return
        yield replace(structure, rests=not structure.rests, before=self.signals.first)
        if structure.before is not None:
            yield replace(structure, rests=not structure.rests)
        yield from self._list_smaller(structure)
        yield from self._list_integrators(structure)
        yield from self._list_larger(structure)
        yield from self._list_numerators(structure)
        yield from self._list_delays(structure)

    def _list_smaller(self, structure: Structure) -> Iterator[Structure]:
        """Yield structures without a mode, whose lag may become a dead time."""
        modes, early = structure.modes, structure.fractions * structure.leads
        for place, mode in enumerate(modes):
            left = [*modes[:place], *modes[place + 1 :]]
            smaller = structure.take(left)
            # A mode may describe the response to other inputs before the recordings.
            if structure.before is not None and structure.delays.any():
                yield replace(smaller, before=None, rests=False)
            size = 2 if mode.pole.imag > 0.0 else 1
            lag = (
                0.0 if mode.pole == 0.0 else min(-size * (1.0 / np.log(mode.pole)).real, float(self.longest))
            )
            late = structure.delays + lag * mode.drives
            leads = structure.leads | mode.drives
            fractions = np.where(leads, np.ceil(late - early) - late + early, structure.fractions)
            for excess in (structure.excess, np.maximum(structure.excess - size * mode.drives, 1)):
                yield replace(smaller, excess=excess)
                if left:
                    yield replace(smaller, excess=excess, delays=np.rint(late).astype(np.int64))
                    delays = np.ceil(late - early).astype(np.int64)
                    yield replace(smaller, excess=excess, delays=delays, leads=leads, fractions=fractions)
        yield from self._list_shared(structure)

    def _list_shared(self, structure: Structure) -> Iterator[Structure]:
        """Yield structures where a mode of some inputs and the nearest one of others are the same, or not."""
        modes = structure.modes
        for place, mode in enumerate(modes):
            left = [*modes[:place], *modes[place + 1 :]]
            others = [
                each
                for each in left
                if (each.pole.imag > 0.0) == (mode.pole.imag > 0.0) and not (each.drives & mode.drives).any()
            ]
            if others:
                near = min(others, key=lambda other: abs(other.pole - mode.pole))
                joined = Mode(0.5 * (mode.pole + near.pole), mode.drives | near.drives)
                yield structure.take([*(each for each in left if each is not near), joined])
            inputs = np.flatnonzero(mode.drives.any(axis=0))
            size = 2 if mode.pole.imag > 0.0 else 1
            if inputs.size > 1 and structure.order + size * (inputs.size - 1) <= self.max_order:
                masks = mode.drives & np.eye(mode.drives.shape[1], dtype=bool)[inputs][:, None]
                yield structure.take([*left, *(Mode(mode.pole, mask) for mask in masks)])

    def _list_integrators(self, structure: Structure) -> Iterator[Structure]:
        """Yield structures with an integrator in place of the slowest mode, and the other way round."""
        modes = structure.modes
        if structure.integrators:
            bare = replace(structure, integrators=0, drives=structure.drives[:, :, :-1])
            # With a pole that is nearly 1, the output has a level.
            slow = Mode(complex(np.exp(-2.0 / self.signals.samples)), structure.drives[:, :, -1])
            yield bare.take([*modes, *[slow] * structure.integrators])
            yield replace(bare, excess=np.maximum(structure.excess - structure.integrators, 1))
        place = min(range(len(modes)), key=lambda each: abs(modes[each].pole - 1.0), default=0)
        count = structure.integrators + (2 if modes and modes[place].pole.imag > 0.0 else 1)
        if modes and count < len(INTEGRATORS):
            bare = structure.take([*modes[:place], *modes[place + 1 :]])
            driven = structure.drives.any(axis=2) if structure.integrators else modes[place].drives
            drives = np.dstack([bare.drives[:, :, : len(bare.sections)], driven])
            integrating = replace(bare, integrators=count, drives=drives)
            yield from (integrating, replace(integrating, noise=(WHITE,) * len(structure.noise)))

    def _list_larger(self, structure: Structure) -> Iterator[Structure]:
        """Yield structures with a further real pole in series, in place of a part of the dead time or not."""
        every = np.ones(structure.delays.shape, bool)
        for time in _SERIES if structure.order < self.max_order else ():
            mode = Mode(complex(np.exp(-1.0 / time)), every)
            larger = structure.take([*structure.modes, mode], excess=structure.excess + 1)
            yield larger
            least = np.minimum(structure.delays, structure.leads)
            yield replace(larger, delays=np.maximum(structure.delays - round(time), least))

    def _list_numerators(self, structure: Structure) -> Iterator[Structure]:
        """Yield structures with more or fewer zeros, and modes in the response to more or fewer inputs."""
        excess = structure.excess
        orders = np.repeat(structure.drives, [part.size for part in structure.parts], axis=2).sum(axis=2)
        for zeros in range(structure.order):
            yield replace(structure, excess=np.maximum(orders - zeros, 1))
        for place in np.ndindex(excess.shape):
            for change in (-1, 1):
                if excess.size > 1 and 1 <= excess[place] + change <= orders[place]:
                    moved = excess.copy()
                    moved[place] += change
                    yield replace(structure, excess=moved)
            for section in range(len(structure.parts) if excess.size > 1 else 0):
                drives = structure.drives.copy()
                drives[(*place, section)] = not drives[(*place, section)]
                if drives[:, :, section].any():
                    size = structure.parts[section].size * (1 if drives[(*place, section)] else -1)
                    moved = excess.copy()
                    moved[place] = max(1, int(moved[place]) + size)
                    yield from (replace(structure, drives=drives, excess=each) for each in (excess, moved))

    def _list_delays(self, structure: Structure) -> Iterator[Structure]:
        """Yield structures with other dead times."""
        for place in np.ndindex(structure.delays.shape):
            for change in (-1, 1, -int(structure.delays[place])):
                delays = structure.delays.copy()
                delays[place] += change
                yield replace(structure, delays=delays)
            for change in (-1, 0) if structure.leads[place] else (0, 1):
                leads, delays = structure.leads.copy(), structure.delays.copy()
                leads[place] = not leads[place]
                delays[place] += change
                yield replace(structure, leads=leads, delays=delays)

    def _is_causal(self, structure: Structure) -> bool:
        """Return whether no output reads a later input, nor one of the same sample without a direct path."""
        least = 0 if self.feedthrough else structure.leads
        return bool((structure.delays >= least).all() and (structure.delays <= self.longest).all())

    def _place(self, fit: Fit) -> list[Fit]:
        """Return fits with a few dead times of every input, one after the other from the best one so far."""
        every = [fit]
        for output, place in np.ndindex(fit.structure.delays.shape):
            self.steps.check("dead times of a linear model")
            best = min(every, key=attrgetter("deviance"))
            found = [self._with_delay(best, output, place, delay) for delay in _COARSE]
            every += [each for each in found if each is not None]
        return every

    def _with_delay(self, fit: Fit, output: int, place: int, delay: int) -> Fit | None:
        least = int(fit.structure.leads[output, place] and fit.structure.order > 0 and not self.feedthrough)
        if not least <= delay <= self.longest:
            return None
        delays = fit.structure.delays.copy()
        delays[output, place] = delay
        return project(self.signals, replace(fit.structure, delays=delays))

    def _move_delays(self, fit: Fit) -> Fit:
        """Return the fit with dead times that were moved as long as the error falls."""
        moves = list(product(*map(range, fit.structure.delays.shape), _CHANGES))
        failed = 0
        for output, place, change in cycle(moves):
            if failed == len(moves):
                break
            if not failed:
                self.steps.check("dead times of a linear model")
            failed += 1
            delay = int(fit.structure.delays[output, place]) + change
            moved = self._with_delay(fit, output, place, delay)
            if moved is None:
                continue
            cost = moved.criterion - moved.deviance
            moved = minimise(self.signals, moved, 4, 2.0, fit.criterion - cost)
            if moved.criterion < fit.criterion - 1e-3:
                fit, failed = moved, 0
        return fit

    def _colour(self, fit: Fit) -> Fit:
        """Return the minimum with the noise and the inputs before the recordings of the least criterion."""
        best = minimise(self.signals, fit, 20, 1e-2)
        for noise in self._list_noises(best):
            start = project(self.signals, replace(best.structure, noise=noise))
            found = start and minimise(self.signals, start, 8, 0.1)
            if found is not None and found.criterion < best.criterion:
                # A moved dead time that reduces the error may cost a parameter.
                ends = [minimise(self.signals, each, 20, 1e-2) for each in (found, self._move_delays(found))]
                best = min(ends, key=attrgetter("criterion"))
        return self._choose_before(best)

    def _choose_before(self, fit: Fit) -> Fit:
        """Return the fit with the inputs before the recordings of the least criterion."""
        for before in self._list_before(fit):
            rests = fit.structure.rests and before is not None
            start = project(self.signals, replace(fit.structure, before=before, rests=rests))
            if start is not None:
                fit = min(fit, minimise(self.signals, start, 8, 0.1), key=attrgetter("criterion"))
        return fit

    def _list_before(self, fit: Fit) -> list[Signal | None]:
        """Return values of the inputs before the recordings: unknown, the first ones, and constant ones."""
        if not fit.structure.delays.any():
            return []
        now = fit.structure.before
        levels = np.array(self.signals.first if now is None else now)
        places = np.argwhere(fit.structure.delays.any(axis=0) & np.ones(levels.shape, bool))
        for place in [*places] * _LEVEL_STEPS:
            change, squares = np.zeros_like(levels), []
            change[tuple(place)] = 1.0
            for side in (-1.0, 0.0, 1.0):
                found = project(self.signals, replace(fit.structure, before=levels + side * change))
                squares.append(np.inf if found is None else float((found.squares / fit.squares).sum()))
            below, here, above = squares
            curvature = above - 2.0 * here + below
            if np.isfinite(curvature) and curvature > 0.0:
                levels[tuple(place)] += 0.5 * (below - above) / curvature
        known = [self.signals.first, levels]
        if now is None:
            return [*known]
        return [None, *(each for each in known if not np.array_equal(each, now))]

    def _list_noises(self, fit: Fit) -> list[tuple[Signal, ...]]:
        """Return noise of every output from its residual: added to it, and driving the states."""
        intervals = fit.structure.find_intervals(self.signals)
        lengths = [end - begin for begin, end in intervals]
        kept = np.concatenate([np.arange(begin, end) for begin, end in intervals])
        poles = find_poles(fit.structure.parts)
        return list(zip(*(fit_noises(each[kept], lengths, poles) for each in fit.residual), strict=True))
