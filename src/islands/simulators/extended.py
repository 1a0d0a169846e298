"""Simulator with effects: input maps, simulation with forces, output maps."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from islands.effects.catalogue import catalogue_order
from islands.effects.interface.context import Parameter, Signal, SimulationContext
from islands.effects.interface.effect import Effect, ForceLaw, Site, apply_map
from islands.errors import RecordError
from islands.records.dataset import Dataset
from islands.records.masked_values import fill_masked
from islands.records.segments import fill_gaps, is_resting
from islands.records.signal_ranges import RangeLike
from islands.simulators.interface import (
    Forces,
    SimulationRun,
    Simulator,
    SimulatorWrapper,
    peak_amplitude,
    split_recordings,
)

#: Cached outputs before the output maps: finite differences need the same one several times.
_CACHE_SIZE = 4

_NONE: Mapping[str, float] = MappingProxyType({})

#: A simulation diverges if its output exceeds its nominal peak by this factor; squares would overflow later.
_DIVERGENCE_FACTOR = 1e6


class MappedInput(NamedTuple):
    """Input of a simulation, as in `SimulationRun`.

    Attributes
    ----------
    x : ndarray, shape (samples,)
    characteristic : callable or None
        Map that acts on the values between samples as well.
    """

    x: Signal
    characteristic: Callable[[Signal, Signal], Signal] | None


def count_sampled_maps(effects: Sequence[Effect]) -> int:
    """Return how many maps of the input act on its samples in continuous time.

    They are the maps up to the last one that does not act between samples.
    """
    places = [place for place, effect in enumerate(effects, start=1) if not effect.acts_between_samples]
    return max(places, default=0)


def map_input(
    maps: Sequence[tuple[Effect, Signal]], context: SimulationContext, is_continuous_time: bool
) -> MappedInput:
    """Apply maps of the input, each with its values, in their order.

    In continuous time, the last ones form the characteristic if they act between samples.
    """
    last = count_sampled_maps([effect for effect, _ in maps]) if is_continuous_time else len(maps)

    def apply(
        part: Sequence[tuple[Effect, Signal]], signal: Signal, intervals: Signal | None = None
    ) -> Signal:
        given = replace(context, intervals=intervals)
        for effect, values in part:
            signal = apply_map(effect, signal, values, given)
        return signal

    return MappedInput(apply(maps[:last], context.u), partial(apply, maps[last:]) if maps[last:] else None)


@dataclass(frozen=True, slots=True, eq=False)
class ExtendedSimulator:
    """Simulator with effects. One vector has the values of the simulator, then those of each effect.

    Several recordings are simulated one by one, each from its own initial states. The values of the simulator
    or of an effect are followed by the initial states of the second and all further recordings.

    Attributes
    ----------
    simulator : Simulator
    effects : tuple of Effect
        In the order of the catalogue, in which maps act.
    context : SimulationContext
    parameters : tuple of Parameter
        Parameters of the simulator, then those of each effect.
    bounds : tuple of ndarray, each of shape (parameters,)
        Lower and upper bounds of the values.
    recordings : ndarray of int, shape (parameters,)
        Index of the recording that an initial state belongs to; zero for all other parameters.
    parts : tuple of ExtendedSimulator
        Simulator of each recording; empty for a single one.
    """

    simulator: Simulator
    effects: tuple[Effect, ...]
    context: SimulationContext
    parameters: tuple[Parameter, ...] = field(init=False)
    bounds: tuple[Signal, Signal] = field(init=False)
    recordings: NDArray[np.int64] = field(init=False)
    parts: "tuple[ExtendedSimulator, ...]" = field(init=False)
    _places: tuple[NDArray[np.int64], ...] = field(init=False)
    _slices: tuple[slice, ...] = field(init=False)
    _by_site: Mapping[Site, tuple[tuple[Effect, slice], ...]] = field(init=False)
    _before_output: NDArray[np.bool_] = field(init=False)
    _cache: dict[bytes, Signal] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        split = split_recordings(self.simulator, self.context)
        parameters: list[Parameter] = []
        recordings: list[int] = []
        before_output: list[bool] = []
        slices: list[slice] = []
        places: list[list[int]] = [[] for _ in split]
        for effect in (None, *self.effects):
            own = self.simulator.parameters if effect is None else effect.parameters(self.context)
            first = len(parameters)
            parameters += own
            recordings += [0] * len(own)
            for part in places:
                part.extend(range(first, first + len(own)))
            for recording, (simulator, _) in enumerate(split[1:], start=1):
                # The nominal initial state may depend on the recording.
                theirs = simulator.parameters if effect is None else own
                for index, parameter in enumerate(theirs):
                    if parameter.initial:
                        places[recording][index - len(own)] = len(parameters)
                        name = f"{parameter.name} (recording {recording + 1})"
                        parameters.append(replace(parameter, name=name))
                        recordings.append(recording)
            slices.append(slice(first, len(parameters)))
            is_before = effect is None or effect.site != Site.OUTPUT
            before_output += [is_before] * (len(parameters) - first)
        parts = [
            ExtendedSimulator(simulator, self.effects, context)
            for simulator, context in (split if len(split) > 1 else ())
        ]
        for name, value in (
            ("parameters", tuple(parameters)),
            (
                "bounds",
                tuple(
                    np.reshape([(parameter.lower, parameter.upper) for parameter in parameters], (-1, 2)).T
                ),
            ),
            ("recordings", np.array(recordings, dtype=np.int64)),
            ("parts", tuple(parts)),
            ("_places", tuple(np.array(part, dtype=np.int64) for part in places)),
            ("_slices", tuple(slices)),
            ("_by_site", _group_by_site(self.effects, slices[1:])),
            ("_before_output", np.array(before_output, dtype=bool)),
        ):
            object.__setattr__(self, name, value)

    @property
    def nominal(self) -> Signal:
        """Nominal values of the simulator and of the effects, at which effects vanish."""
        return np.array([parameter.nominal for parameter in self.parameters])

    def project(self, points: Signal) -> Signal:
        """Return the nearest points within the bounds and the limits of the effects, (points, parameters)."""
        projected = np.clip(points, *self.bounds)
        for effect, part in zip(self.effects, self._slices[1:], strict=True):
            if effect.project is not None:
                projected[:, part] = [effect.project(values) for values in projected[:, part]]
        return projected

    @property
    def scales(self) -> Signal:
        """Typical changes of the values."""
        return np.array([parameter.scale for parameter in self.parameters])

    @property
    def is_copy(self) -> NDArray[np.bool_]:
        """Whether a parameter is an initial state of a recording after the first one, shape (parameters,)."""
        return np.array(self.recordings > 0)

    @property
    def is_batch(self) -> bool:
        """Whether several simulations of one call cost less than one by one."""
        return self.simulator.is_batch

    @property
    def fits_states(self) -> bool:
        """Whether states are fitted to the record in each simulation."""
        return self.simulator.fits_states

    @property
    def simulator_slice(self) -> slice:
        """Slice of the values that belongs to the simulator."""
        return self._slices[0]

    def get_slice(self, effect: Effect) -> slice:
        """Return the slice of the values that belongs to an effect."""
        return self._slices[1 + self.effects.index(effect)]

    def expand(self, effect: Effect, point: Sequence[float]) -> Signal:
        """Return the values of an effect, given one for each of its parameters.

        Its initial states are the same in all recordings.
        """
        part = self.get_slice(effect)
        values = np.empty(part.stop - part.start)
        for places in self._places:
            own = places[(places >= part.start) & (places < part.stop)] - part.start
            values[own] = point
        return values

    def with_effects(self, effects: Sequence[Effect]) -> "ExtendedSimulator":
        """Return the same simulator with other effects, of which those that it has keep their order."""
        return replace(self, effects=catalogue_order(effects, self.effects))

    def simulate(
        self, values: Signal, effect_parameters: Mapping[str, float] = _NONE, forces: Forces = ()
    ) -> Signal:
        """Simulate the whole record.

        Parameters
        ----------
        values : ndarray, shape (parameters,)
        effect_parameters, forces
            Further arguments of `Simulator.simulate`, in addition to those of the effects.

        Returns
        -------
        ndarray, shape (samples,)
            NaN in every sample if the simulation diverges.
        """
        if self.parts:
            joined = np.concatenate(
                [
                    part.simulate(values[places], effect_parameters, forces)
                    for part, places in zip(self.parts, self._places, strict=True)
                ]
            )
            return np.full_like(joined, np.nan) if np.isnan(joined).any() else joined
        if effect_parameters or forces:
            run = self._make_run(values, effect_parameters, forces, {})
            with np.errstate(over="ignore", invalid="ignore"):
                y = self.simulator.simulate_batch([run], self.context)[0]
            return self._apply_output_maps([y], values[None]).reshape(-1)
        return self.simulate_batch(values[None])[0]

    def simulate_batch(self, points: Signal, near: NDArray[np.int64] | None = None) -> Signal:
        """Simulate the whole record for several vectors of values, at once if the simulator can.

        Parameters
        ----------
        points : ndarray, shape (points, parameters)
        near : ndarray of int64, shape (points,), optional
            Index of the point that each one is a small change of, or its own; see `SimulationRun`.

        Returns
        -------
        ndarray, shape (points, samples)
            As of `simulate`.
        """
        if self.parts:
            joined = np.concatenate(
                [
                    part.simulate_batch(points[:, places], near)
                    for part, places in zip(self.parts, self._places, strict=True)
                ],
                axis=1,
            )
            joined[np.isnan(joined).any(axis=1)] = np.nan
            return joined
        keys = [values[self._before_output].tobytes() for values in points]
        bases = self._link_to_bases(keys, near)
        known = {key: self._cache[key] for key in keys if key in self._cache}
        needed = {base for key, base in bases.items() if key not in known}
        missing = {
            key: values for key, values in zip(keys, points, strict=True) if key not in known or key in needed
        }
        if missing:
            known |= self._simulate_points(missing, bases)
            # Copies, since a row would keep the outputs of all points in memory.
            self._cache.update({key: known[key].copy() for key in list(missing)[-_CACHE_SIZE:]})
            while len(self._cache) > _CACHE_SIZE:
                del self._cache[next(iter(self._cache))]
        return self._apply_output_maps([known[key] for key in keys], points)

    def _link_to_bases(self, keys: list[bytes], near: NDArray[np.int64] | None) -> dict[bytes, bytes]:
        """Return the key of the base of each point that is a change of another one.

        The keys of these points are extended by that of their base, in place: the states of a simulation that
        fits them depend on it.
        """
        bases: dict[bytes, bytes] = {}
        if near is not None and self.fits_states:
            for index, base in enumerate(near):
                if keys[index] != keys[base]:
                    bases[keys[index] + keys[base]] = keys[base]
                    keys[index] += keys[base]
        return bases

    def _simulate_points(
        self, points: Mapping[bytes, Signal], bases: Mapping[bytes, bytes]
    ) -> dict[bytes, Signal]:
        """Simulate points by their keys in one call, without output maps."""
        inputs: dict[bytes, MappedInput] = {}
        places = {key: place for place, key in enumerate(points)}
        runs = [
            self._make_run(values, _NONE, (), inputs, places[bases[key]] if key in bases else None)
            for key, values in points.items()
        ]
        with np.errstate(over="ignore", invalid="ignore"):
            found = np.ascontiguousarray(fill_masked(self.simulator.simulate_batch(runs, self.context)))
        return dict(zip(points, found, strict=True))

    def _apply_output_maps(self, outputs: Sequence[Signal], points: Signal) -> Signal:
        """Return the outputs of several points after the output maps; NaN if they diverge."""
        mapped = np.stack(outputs)
        with np.errstate(over="ignore", invalid="ignore"):
            for effect, part in self._by_site[Site.OUTPUT]:
                for row, values in enumerate(points):
                    mapped[row] = apply_map(effect, mapped[row], values[part], self.context)
            mapped[~(np.abs(mapped).max(axis=1) < _DIVERGENCE_FACTOR * self.context.output_peak)] = np.nan
        return mapped

    def _make_run(
        self,
        values: Signal,
        effect_parameters: Mapping[str, float],
        further: Forces,
        inputs: dict[bytes, MappedInput],
        near: int | None = None,
    ) -> SimulationRun:
        """Return the run, without output maps. Runs with equal input maps share their input in ``inputs``."""
        maps = [(effect, values[part]) for effect, part in self._by_site[Site.INPUT]]
        key = b"".join(own.tobytes() for _, own in maps)
        if key not in inputs:
            inputs[key] = map_input(maps, self.context, self.simulator.is_continuous_time)
        x, characteristic = inputs[key]
        parameters = dict(effect_parameters)
        for _, part in self._by_site[Site.CORE]:
            names = [parameter.name for parameter in self.parameters[part]]
            parameters |= zip(names, values[part].tolist(), strict=True)
        simulator_values = values[self.simulator_slice].copy()
        for effect, part in self._by_site[Site.PARAMETER]:
            simulator_values[self._get_parameter_index(effect)] *= 1.0 + values[part][0]
        forces = list(further)
        for effect, part in self._by_site[Site.FORCE]:
            assert isinstance(effect.form, ForceLaw)
            forces.append((effect.form, values[part]))
        return SimulationRun(
            simulator_values, x, parameters, forces, near=near, characteristic=characteristic
        )

    def _get_parameter_index(self, effect: Effect) -> int:
        _, _, name = effect.name.partition(":")
        return [parameter.name for parameter in self.simulator.parameters].index(name)


def _group_by_site(
    effects: Sequence[Effect], slices: Sequence[slice]
) -> Mapping[Site, tuple[tuple[Effect, slice], ...]]:
    """Return the effects at each site with the slices of their values, in the order in which they act."""
    placed = list(zip(effects, slices, strict=True))
    return {site: tuple((effect, part) for effect, part in placed if effect.site == site) for site in Site}


@dataclass(frozen=True, slots=True, eq=False)
class SavedExtension(SimulatorWrapper):
    """Simulator with effects and their calibrated values.

    Attributes
    ----------
    simulator : Simulator
        Simulator without the effects, with the intersample behaviour that the record required.
    added : tuple of Effect
    values : ndarray, shape (parameters,)
        Nominal values of the parameters of the effects.
    scales : SimulationContext
        Scales of the record in which the effects were found; some strengths are relative to its peaks or its
        duration.
    tested : tuple of RangeLike
        Ranges of the inputs and of the output in which the extension was tested; empty if they are not known.
    """

    added: tuple[Effect, ...]
    values: Signal
    scales: SimulationContext
    tested: tuple[RangeLike, ...] = ()

    @property
    def name(self) -> str:
        """Names of the simulator and of the effects."""
        return " + ".join([self.simulator.name, *(effect.name for effect in self.added)])

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters of the simulator, then those of each effect, prefixed with the name of the effect."""
        found, at = list(self.simulator.parameters), 0
        for effect in self.added:
            for parameter in effect.parameters(self.scales):
                name = f"{effect.name} {parameter.name}"
                found.append(replace(parameter, name=name, nominal=float(self.values[at])))
                at += 1
        return tuple(found)

    @property
    def is_continuous_time(self) -> bool:
        """False: the intersample behaviour is already selected."""
        return False

    @property
    def built_in_effects(self) -> frozenset[str]:
        """Built-in effects of the simulator, and the added effects."""
        return self.simulator.built_in_effects | {effect.name for effect in self.added}

    def simulate(
        self,
        values: Signal,
        x: Signal,
        context: SimulationContext,
        effect_parameters: Mapping[str, float],
        forces: Forces,
    ) -> Signal:
        """Simulate the output; see `Simulator.simulate`."""
        scales = self.scales
        inner = replace(
            context,
            u=np.ascontiguousarray(x),
            input_peak=scales.input_peak,
            output_peak=scales.output_peak,
            fit_end_time=scales.fit_end_time,
            reference_duration=scales.duration,
            step_width=scales.step_width,
            force_coordinate=scales.force_coordinate,
        )
        return ExtendedSimulator(self.simulator, self.added, inner).simulate(
            values, effect_parameters, forces
        )


def make_context(record: Dataset, simulator: Simulator, fitted: int) -> SimulationContext:
    """Make the context of a simulation: its input, and the scales of the record.

    Parameters
    ----------
    fitted : int
        Number of samples used for estimation.

    Raises
    ------
    RecordError
        The simulation diverges on the input.
    """
    names, units = record.input_names, record.input_units
    context = SimulationContext(
        u=np.ascontiguousarray(record.u[:, 0]),
        dt=record.dt,
        channels={
            name: np.ascontiguousarray(record.u[:, index]) for index, name in enumerate(names) if index
        },
        units=dict(zip(names[1:], units[1:], strict=True)),
        input_peak=peak_amplitude(record.u[:, 0]),
        output_peak=1.0,
        input_unit=units[0] or "1",
        output_unit=record.output_unit or "1",
        fit_end_time=fitted * record.dt,
        segments=record.segments,
        measured=fill_gaps(record.y),
    )
    simulation = ExtendedSimulator(simulator, (), context)
    nominal = simulation.simulate(simulation.nominal)
    if not np.isfinite(nominal).all():
        raise RecordError(
            f"the simulation {simulator.name} diverges on this input: check its parameters, its units and "
            "the sampling time"
        )
    peak = peak_amplitude(nominal)
    if is_resting(nominal[:fitted]):  # it may rest at zero, while the measured output creeps
        peak = max(float(np.max(np.abs(nominal))), peak_amplitude(record.y[~np.isnan(record.y)]))
    scaled = replace(context, output_peak=peak)
    return replace(scaled, force_coordinate=simulator.make_force_coordinate(scaled, nominal))
