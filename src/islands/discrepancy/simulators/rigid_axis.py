"""A rigid axis with friction: its force is given, its position is measured; with places for effects."""

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
from islands.discrepancy.interfaces.simulator import Forces
from islands.discrepancy.simulators.coordinates import output_coordinate
from islands.errors import RecordError
from islands.systems.mechanics import integrate_motion

#: What its state is called.
FORCE = "force"

#: Seconds of a shot, samples of one at least, and samples over which the measured position is smoothed.
SHOT, LEAST, SMOOTHED = 0.5, 20, 9

#: Part of the usual rate within which dry friction turns, nominally.
_SHARP = 0.01


@dataclass(frozen=True, slots=True, eq=False)
class RigidAxisSimulator:
    """``m x'' + c x' + F tanh(x' / vs) = u + forces``, by multiple shooting; the coordinate is the output.

    Nothing pulls an axis back, so that a free run drifts away: it starts anew every half second, from a
    position and a rate that are fitted to what is measured (Bock's multiple shooting, its states eliminated).

    Attributes
    ----------
    mass, damping, dry, turns : float
        Nominal parameters.
    measured, rate : ndarray, shape (samples,)
        The output, and its smoothed rate.
    shot : int
        Samples between two starts.
    units : tuple of str
        Of input and output.
    """

    mass: float
    damping: float
    dry: float
    turns: float
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
        """Mass, damping, dry friction, and the rate at which that turns."""
        force, length = self.units
        usual = float(np.std(self.rate)) or 1.0
        moved = abs(self.dry) + abs(self.damping) * usual + abs(self.mass) * usual / (SHOT / 5)
        return (
            Parameter(
                "m", f"{force} s^2/{length}", self.mass, 0.01 * self.mass, 0.05 * self.mass, 20 * self.mass
            ),
            Parameter(
                "c", f"{force} s/{length}", self.damping, 0.01 * moved / usual, 0.0, 20 * moved / usual
            ),
            Parameter("F", force, self.dry, 0.01 * moved, 0.0, 20 * moved),
            # How sharply friction turns is its own business: a wrong width looks like play.
            Parameter("vs", f"{length}/s", self.turns, 0.3 * self.turns, 0.01 * self.turns, 20 * self.turns),
        )

    def make_force_coordinate(self, context: SimulationContext, output: Signal) -> ForceCoordinate:
        """See `islands.discrepancy.interfaces.simulator.Simulator`."""
        return replace(output_coordinate(context, output), friction_smoothing=_SHARP)

    def simulate(
        self, values: Signal, x: Signal, context: SimulationContext, own: Mapping[str, float], forces: Forces
    ) -> Signal:
        """See `islands.discrepancy.interfaces.simulator.Simulator`."""
        mass, damping, dry, turns = map(float, values)
        gain, offset = gain_over_time(own, context), own.get(f"input-offset:{FORCE}", 0.0)
        dry_friction = friction.COULOMB_FRICTION.form
        assert isinstance(dry_friction, ForceLaw)
        elements = pack_force_laws([*forces, (dry_friction, np.array([dry, turns]))], context, balance=True)
        times = x.size // self.measured.size
        starts = np.zeros(x.size, dtype=bool)
        starts[:: self.shot * times] = True

        def shots(position: Signal, rate: Signal) -> Signal:
            y = np.empty(x.size)
            integrate_motion(
                *(x * gain + offset, context.get_intersample_values(x) * gain + offset),
                *(context.dt, mass, damping, 0.0, elements),
                *(starts, np.repeat(position, times), np.repeat(rate, times), y),
            )
            return y[::times]

        return np.repeat(self._freed(shots, context.force_coordinate), times)

    def _freed(self, shots: Callable[[Signal, Signal], Signal], frame: ForceCoordinate) -> Signal:
        """Return the shots with their states as free as can be: by Newton and Gauss, from what is measured.

        All shots are fitted side by side: a state moves its own alone.
        """
        position, rate = self.measured, self.rate
        y = shots(position, rate)
        moved = (1e-4 * frame.peak, 1e-4 * frame.rate)
        responses = (
            (shots(position + moved[0], rate) - y) / moved[0],
            (shots(position, rate + moved[1]) - y) / moved[1],
        )
        which = np.arange(y.size) // self.shot
        for _ in range(2):
            steps = self._steps(self.measured - y, responses, which)
            there = shots(position + steps[0], rate + steps[1])
            squares = [np.bincount(which, weights=(self.measured - each) ** 2) for each in (y, there)]
            # A shot that sticks may leap over its best state.
            closer = (squares[1] < squares[0])[which]
            position = np.where(closer, position + steps[0], position)
            rate = np.where(closer, rate + steps[1], rate)
            y = np.where(closer, there, y)
        return y

    @staticmethod
    def _steps(
        missed: Signal, responses: tuple[Signal, Signal], which: NDArray[np.int64]
    ) -> tuple[Signal, Signal]:
        """Solve every shot's two equations; return the steps of its state at each of its samples."""

        def inner(one: Signal, other: Signal) -> Signal:
            return np.asarray(np.bincount(which, weights=one * other), dtype=np.float64)

        first, second = responses
        a, b, d = inner(first, first), inner(first, second), inner(second, second)
        p, q = inner(first, missed), inner(second, missed)
        determinant = a * d - b * b
        # A shot of one sample tells its position alone.
        sure = determinant > 1e-12 * a * d
        determinant = np.where(sure, determinant, 1.0)
        position = np.where(sure, (d * p - b * q) / determinant, p / np.maximum(a, 1e-300))
        rate = np.where(sure, (a * q - b * p) / determinant, 0.0)
        return position[which], rate[which]


def make_rigid_axis(
    given: Mapping[str, float], record: Dataset, estimation_samples: int
) -> RigidAxisSimulator:
    """Make a simulator; estimate the parameters that are not given from the estimation part of a record.

    The estimate is that of the inverse dynamics: least squares of the force on smoothed acceleration, rate
    and direction (Olsen and Petersen 2001).
    """
    if record.samples < 4 * LEAST:
        raise RecordError(f"an axis needs {4 * LEAST} samples, the record has {record.samples}")
    y, dt = record.y, record.dt
    rate, acceleration = (
        scipy.signal.savgol_filter(y, SMOOTHED, 3, deriv=order, delta=dt) for order in (1, 2)
    )
    usual = float(np.std(rate)) or 1.0
    columns = np.column_stack([acceleration, rate, np.tanh(rate / (0.02 * usual))])[:estimation_samples]
    names = ("m", "c", "F")
    free = [place for place, name in enumerate(names) if name not in given]
    known = np.array([given.get(name, 0.0) for name in names])
    force = scipy.signal.savgol_filter(record.u[:, 0], SMOOTHED, 3)[:estimation_samples]
    known[free] = scipy.optimize.lsq_linear(
        columns[:, free], force - columns @ known, bounds=(1e-12, np.inf)
    ).x
    mass, damping, dry = map(float, known)
    turns = given.get("vs", _SHARP * usual)
    shot = max(LEAST, round(SHOT / dt))
    units = (record.input_units[0] or "1", record.output_unit or "1")
    return RigidAxisSimulator(mass, damping, dry, turns, np.asarray(y), rate, shot, units)
