"""Rigid axis with friction: the input is a force, the output a position."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from islands.data.dataset import Dataset
from islands.discrepancy.effects import friction
from islands.discrepancy.effects.baseline import input_offset
from islands.discrepancy.effects.time_variation import gain_over_time
from islands.discrepancy.interfaces.context import ForceCoordinate, Parameter, Signal, SimulationContext
from islands.discrepancy.interfaces.effect import Effect, ForceLaw, Site
from islands.discrepancy.interfaces.force import pack_force_laws
from islands.discrepancy.interfaces.segments import map_segments
from islands.discrepancy.interfaces.simulator import Forces
from islands.discrepancy.simulators.coordinates import output_coordinate
from islands.errors import RecordError
from islands.systems.mechanics import integrate_motion

#: Name of the state in effects.
FORCE = "force"

#: Duration of a shooting interval in seconds.
SHOT_SECONDS = 0.5

#: Smallest number of samples in a shooting interval.
MIN_SHOT_SAMPLES = 20

#: Window of the Savitzky-Golay filter that smooths the measured position, in samples.
SMOOTHING_WINDOW = 9

#: Nominal rate vs of dry friction, relative to the typical rate.
_RELATIVE_VS = 0.01


@dataclass(frozen=True, slots=True, eq=False)
class RigidAxisSimulator:
    """``m x'' + c x' + F tanh(x' / vs) = u + forces`` by multiple shooting; the coordinate is the output.

    An axis has no restoring force, so that a free run drifts. The simulation restarts every half second, or
    every 20 samples if these last longer, from a position and a rate that are fitted to the measured output
    (multiple shooting after Bock, with the states eliminated). This includes the hold-out part.

    Attributes
    ----------
    mass, damping, dry, smoothing_rate : float
        Nominal parameters m, c, F and vs.
    measured, rate : ndarray, shape (samples,)
        Measured output, and its smoothed rate.
    shot : int
        Samples per shooting interval.
    units : tuple of str
        Units of input and output.
    """

    mass: float
    damping: float
    dry: float
    smoothing_rate: float
    measured: Signal
    rate: Signal
    shot: int
    units: tuple[str, str]
    name: str = "rigid-axis"
    sites: frozenset[Site] = frozenset(Site)
    supported_effects: frozenset[str] = frozenset(("gain-step", "ageing"))
    built_in_effects: frozenset[str] = frozenset(("viscous", "coulomb-friction", "offset", "linear-drift"))
    state_effects: tuple[Effect, ...] = field(default=(input_offset(FORCE),))
    is_continuous_time: bool = True

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Mass, damping, dry friction, and the rate within which dry friction changes its sign."""
        force, length = self.units
        vs = self.smoothing_rate
        typical_rate = float(np.std(self.rate)) or 1.0
        typical_force = (
            abs(self.dry)
            + abs(self.damping) * typical_rate
            + abs(self.mass) * typical_rate / (SHOT_SECONDS / 5)
        )
        return (
            Parameter(
                "m", f"{force} s^2/{length}", self.mass, 0.01 * self.mass, 0.05 * self.mass, 20 * self.mass
            ),
            Parameter(
                "c",
                f"{force} s/{length}",
                self.damping,
                0.01 * typical_force / typical_rate,
                0.0,
                20 * typical_force / typical_rate,
            ),
            Parameter("F", force, self.dry, 0.01 * typical_force, 0.0, 20 * typical_force),
            # Calibrated as well: the response to a wrong value looks like backlash.
            Parameter("vs", f"{length}/s", vs, 0.3 * vs, 0.01 * vs, 20 * vs),
        )

    def make_force_coordinate(self, context: SimulationContext, output: Signal) -> ForceCoordinate:
        """Return the output as the coordinate."""
        return replace(output_coordinate(context, output), friction_smoothing=_RELATIVE_VS)

    def for_samples(self, first: int, last: int) -> "RigidAxisSimulator":
        """Return the simulator of one recording; a shooting interval begins with it."""
        return replace(self, measured=self.measured[first:last], rate=self.rate[first:last])

    def simulate(
        self,
        values: Signal,
        x: Signal,
        context: SimulationContext,
        effect_parameters: Mapping[str, float],
        forces: Forces,
    ) -> Signal:
        """Simulate the output; see `Simulator.simulate`."""
        mass, damping, dry, vs = map(float, values)
        gain, offset = (
            gain_over_time(effect_parameters, context),
            effect_parameters.get(f"input-offset:{FORCE}", 0.0),
        )
        dry_friction = friction.COULOMB_FRICTION.form
        assert isinstance(dry_friction, ForceLaw)
        elements = pack_force_laws([*forces, (dry_friction, np.array([dry, vs]))], context, balance=True)
        oversampling = x.size // self.measured.size
        starts = np.zeros(x.size, dtype=bool)
        starts[:: self.shot * oversampling] = True

        def run_shots(position: Signal, rate: Signal) -> Signal:
            y = np.empty(x.size)
            integrate_motion(
                *(x * gain + offset, context.get_intersample_values(x) * gain + offset),
                *(context.dt, mass, damping, 0.0, elements),
                *(starts, np.repeat(position, oversampling), np.repeat(rate, oversampling), y),
            )
            return y[::oversampling]

        return np.repeat(self._fit_initial_states(run_shots, context.force_coordinate), oversampling)

    def _fit_initial_states(
        self, run_shots: Callable[[Signal, Signal], Signal], coordinate: ForceCoordinate
    ) -> Signal:
        """Fit the initial state of every shooting interval by Gauss-Newton, and return the output.

        All intervals are fitted at once, since the state of one interval does not affect the others.
        """
        position, rate = self.measured, self.rate
        y = run_shots(position, rate)
        delta = (1e-4 * coordinate.peak, 1e-4 * coordinate.rate)
        responses = (
            (run_shots(position + delta[0], rate) - y) / delta[0],
            (run_shots(position, rate + delta[1]) - y) / delta[1],
        )
        interval = np.arange(y.size) // self.shot
        for _ in range(2):
            steps = self._solve_steps(self.measured - y, responses, interval)
            trial = run_shots(position + steps[0], rate + steps[1])
            squares = [np.bincount(interval, weights=(self.measured - each) ** 2) for each in (y, trial)]
            # During sticking the response is nonlinear, and a full step may increase the error.
            closer = (squares[1] < squares[0])[interval]
            position = np.where(closer, position + steps[0], position)
            rate = np.where(closer, rate + steps[1], rate)
            y = np.where(closer, trial, y)
        return y

    @staticmethod
    def _solve_steps(
        error: Signal, responses: tuple[Signal, Signal], interval: NDArray[np.int64]
    ) -> tuple[Signal, Signal]:
        """Solve the normal equations of every interval; return the steps of position and rate per sample."""

        def inner(one: Signal, other: Signal) -> Signal:
            return np.asarray(np.bincount(interval, weights=one * other), dtype=np.float64)

        first, second = responses
        a, b, d = inner(first, first), inner(first, second), inner(second, second)
        p, q = inner(first, error), inner(second, error)
        determinant = a * d - b * b
        # An interval of one sample determines its position only.
        regular = determinant > 1e-12 * a * d
        determinant = np.where(regular, determinant, 1.0)
        position = np.where(regular, (d * p - b * q) / determinant, p / np.maximum(a, 1e-300))
        rate = np.where(regular, (a * q - b * p) / determinant, 0.0)
        return position[interval], rate[interval]


def make_rigid_axis(
    given: Mapping[str, float], record: Dataset, estimation_samples: int
) -> RigidAxisSimulator:
    """Make a simulator; estimate the parameters that are not given from the estimation part of a record.

    The estimate uses the inverse dynamics: least squares of the force on smoothed acceleration, rate and
    direction (Olsen and Petersen 2001).

    Raises
    ------
    RecordError
        The record is shorter than four shooting intervals of the smallest size, or a recording than one.
    """
    if record.samples < 4 * MIN_SHOT_SAMPLES:
        raise RecordError(f"an axis needs {4 * MIN_SHOT_SAMPLES} samples, the record has {record.samples}")
    if (shortest := min(record.segments)) < MIN_SHOT_SAMPLES:
        raise RecordError(f"an axis needs {MIN_SHOT_SAMPLES} samples of each recording, one has {shortest}")
    y, dt = record.y, record.dt

    def smooth(signal: Signal, order: int = 0) -> Signal:
        return map_segments(
            lambda part: scipy.signal.savgol_filter(part, SMOOTHING_WINDOW, 3, deriv=order, delta=dt),
            signal,
            record.segments,
        )

    rate, acceleration = smooth(y, 1), smooth(y, 2)
    typical_rate = float(np.std(rate)) or 1.0
    columns = np.column_stack([acceleration, rate, np.tanh(rate / (0.02 * typical_rate))])[
        :estimation_samples
    ]
    names = ("m", "c", "F")
    free = [place for place, name in enumerate(names) if name not in given]
    known = np.array([given.get(name, 0.0) for name in names])
    force = smooth(record.u[:, 0])[:estimation_samples]
    known[free] = scipy.optimize.lsq_linear(
        columns[:, free], force - columns @ known, bounds=(1e-12, np.inf)
    ).x
    mass, damping, dry = map(float, known)
    vs = given.get("vs", _RELATIVE_VS * typical_rate)
    shot = max(MIN_SHOT_SAMPLES, round(SHOT_SECONDS / dt))
    units = (record.input_units[0] or "1", record.output_unit or "1")
    return RigidAxisSimulator(mass, damping, dry, vs, np.asarray(y), rate, shot, units)
