"""Two tanks, a pump fills the upper one and that the lower: a truth, and what can be hidden in it."""

from dataclasses import dataclass
from math import inf, sqrt

import numpy as np

from islands.performance.trials.injection import signal_faults
from islands.performance.trials.injection.excitation import (
    Excitation,
    Signal,
    make_excitation,
    multisine,
    random_noise,
    random_sign,
)
from islands.performance.trials.injection.faults import (
    Fault,
    Inject,
    after_plant,
    ageing,
    alter_parameter,
    before_plant,
    gain_step,
)
from islands.performance.trials.injection.plant import Plant
from islands.performance.trials.injection.rig import Rig, fault_table

#: Samples a second of the truth, and the frequency in Hz up to which the pump's voltage moves.
RATE, BAND = 2.5, 0.004

#: Largest voltage of the pump, and the usual highest level as its sensor has it: what strengths refer to.
PEAK, OUTPUT = 5.0, 8.0

#: The linear part of an outflow in 1/s that is as large as the other one at half the usual level.
_LAW = 0.025

#: Inflow in V/s of the pump at its largest voltage.
_PUMPED = 0.2


@dataclass(frozen=True, slots=True)
class Tanks(Plant):
    """``x1' = k4 u - k1 sqrt(x1)``, ``x2' = k1 sqrt(x1) - k3 sqrt(x2)``, ``y = x2``; levels in V.

    Attributes
    ----------
    k1, k3, k4 : float
    start : tuple of float
        Levels at the first sample: there nobody measures the upper one.
    below : tuple of float
        How far below its highest level each tank overflows, relative to that; 0 is never.
    spilled : float
        Part of what the upper one loses over its edge that falls into the lower one.
    leaks : tuple of float
        Linear parts of the outflows, 1/s.
    exponent : float
        Of both outflows' law.
    inflows : tuple of float
        What flows into each tank besides, V/s.
    """

    k1: float = 0.05
    k3: float = 0.05
    k4: float = 0.04
    start: tuple[float, float] = (5.0, 5.0)
    below: tuple[float, float] = (0.0, 0.0)
    spilled: float = 0.0
    leaks: tuple[float, float] = (0.0, 0.0)
    exponent: float = 0.5
    inflows: tuple[float, float] = (0.0, 0.0)

    def equation(self, drive: Excitation, x: Signal) -> Signal:
        """See `Plant`."""
        pumped = self.k4 * (x if self.gain is None else x * self.gain(drive.time))
        between = ((pumped[1:] + pumped[:-1]) / 2).tolist()
        upper, lower = self._levels(between, (inf, inf))
        if any(self.below):
            edges = [
                max(levels) * (1.0 - low) for levels, low in zip((upper, lower), self.below, strict=True)
            ]
            upper, lower = self._levels(between, (edges[0], edges[1]))
        return np.array(lower)

    def _levels(self, pumped: list[float], edges: tuple[float, float]) -> tuple[list[float], list[float]]:
        """Integrate both levels by Heun's method; what overflows leaves at the end of a step."""
        h = 1.0 / RATE
        (edge, edge_below), (upper, lower) = edges, self.start
        (leak, leak_below), (beside, beside_below) = self.leaks, self.inflows
        power = self.exponent

        def slopes(upper: float, lower: float, inflow: float) -> tuple[float, float]:
            upper, lower = max(upper, 0.0), max(lower, 0.0)
            # A square root is what the power of one half costs four times.
            fallen = self.k1 * (sqrt(upper) if power == 0.5 else upper**power) + leak * upper
            gone = self.k3 * (sqrt(lower) if power == 0.5 else lower**power) + leak_below * lower
            return inflow + beside - fallen, fallen + beside_below - gone

        levels, levels_below = [upper], [lower]
        for inflow in pumped:
            one, other = slopes(upper, lower, inflow)
            then, otherwise = slopes(upper + h * one, lower + h * other, inflow)
            upper, lower = upper + h * (one + then) / 2, lower + h * (other + otherwise) / 2
            if upper > edge:
                upper, lower = edge, lower + self.spilled * (upper - edge)
            lower = min(lower, edge_below)
            levels.append(upper)
            levels_below.append(lower)
        return levels, levels_below


def _upper_edge(rng: np.random.Generator, strength: float, truth: Plant) -> Plant:
    """Let the upper tank overflow, and a part of that fall into the lower one."""
    return alter_parameter(truth, below=(strength, 0.0), spilled=float(rng.uniform(0.1, 0.9)))


def _lower_edge(_rng: np.random.Generator, strength: float, truth: Plant) -> Plant:
    """Let the lower tank overflow."""
    return alter_parameter(truth, below=(0.0, strength))


def _leak(upper: float, lower: float) -> Inject:
    """Let outflows have a linear part."""
    return lambda _rng, strength, truth: alter_parameter(
        truth, leaks=(upper * strength * _LAW, lower * strength * _LAW)
    )


def _inflow(upper: float, lower: float) -> Inject:
    """Let something flow in beside the pump."""

    def hide(rng: np.random.Generator, strength: float, truth: Plant) -> Plant:
        c = random_sign(rng) * strength * _PUMPED
        return alter_parameter(truth, inflows=(upper * c, lower * c))

    return hide


def _steeper(rng: np.random.Generator, strength: float, truth: Plant) -> Plant:
    """Let the outflows' law have another exponent."""
    return alter_parameter(truth, exponent=0.5 * (1.0 + random_sign(rng) * strength))


def _drive(rng: np.random.Generator, seconds: float) -> Excitation:
    """Draw a random multisine, or noise through a low-pass, about a level."""
    count = int(seconds * RATE)
    spread = (
        random_noise(rng, count, RATE, BAND, BAND) if rng.integers(2) else multisine(rng, count, RATE, BAND)
    )
    u = 0.56 * PEAK + 0.44 * PEAK * spread / np.max(np.abs(spread))
    return make_excitation(rng, u, RATE, BAND, PEAK, OUTPUT)


TANKS = Rig(
    plant=Tanks(),
    relative_error={"k1": 0.02, "k3": 0.02, "k4": 0.02},
    excitation=_drive,
    seconds=4096.0,
    decimation=10,
    noise=0.003,
    input=("u_V", "V"),
    output=("y_V", "V"),
    neighbour=("w_V", "V"),
    known=fault_table(
        Fault("state-clip", 0.02, 0.6, (_upper_edge, _lower_edge), usual=2),
        Fault("outflow-law", 0.002, 0.5, (_leak(0.0, 1.0), _leak(1.0, 0.0), _steeper), usual=2),
        Fault("input-offset", 0.001, 0.2, (_inflow(1.0, 0.0), _inflow(0.0, 1.0)), usual=2),
        Fault("delay", 1.0, 40.0, (before_plant(signal_faults.later), before_plant(signal_faults.two_lags))),
        Fault(
            "sensor-lag", 1.0, 40.0, (after_plant(signal_faults.sensor), after_plant(signal_faults.averaging))
        ),
        Fault("offset", 0.005, 0.1, (after_plant(signal_faults.zero),)),
        Fault("linear-drift", 0.005, 0.2, (after_plant(signal_faults.drift),)),
        Fault("jump", 0.005, 0.2, (after_plant(signal_faults.jump),)),
        Fault("thermal-drift", 0.005, 0.2, (after_plant(signal_faults.thermal),)),
        Fault("output-saturation", 0.03, 0.5, (after_plant(signal_faults.cut_output),)),
        Fault("input-saturation", 0.03, 0.5, (before_plant(signal_faults.cut_input),)),
        Fault("gain-step", 0.01, 0.2, (gain_step,)),
        Fault("ageing", 0.01, 0.2, (ageing,)),
        Fault("periodic-disturbance", 0.002, 0.05, (after_plant(signal_faults.hum(0.006, 0.1)),)),
        Fault("cross-coupling", 0.005, 0.2, (after_plant(signal_faults.coupling),)),
    ),
    unknown={
        "slew-rate": Fault("", 0.002, 0.01, (before_plant(signal_faults.slew),)),
        "ripple": Fault("", 0.003, 0.03, (after_plant(signal_faults.ripple(1.0, 3.0)),)),
    },
)
