"""The forms in which effects are hidden, written down from what they are, and not from how they are found."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from islands.trials.hide import maps
from islands.trials.hide.excitation import OUTPUT, PEAK, SPEED, Drive, Signal
from islands.trials.hide.hidden import Hidden, Hide
from islands.trials.hide.truth import Addition, Map, Truth

_Make = Callable[[np.random.Generator, float], Map]
_MakeAddition = Callable[[np.random.Generator, float], Addition]


def _before(make: _Make) -> Hide:
    return lambda rng, strength, truth: replace(truth, before=(*truth.before, make(rng, strength)))


def _behind(make: _Make) -> Hide:
    return lambda rng, strength, truth: replace(truth, behind=(*truth.behind, make(rng, strength)))


def _beside(make: _MakeAddition) -> Hide:
    return lambda rng, strength, truth: replace(truth, beside=(*truth.beside, make(rng, strength)))


def _wrong(which: str) -> Hide:
    def hide(rng: np.random.Generator, strength: float, truth: Truth) -> Truth:
        factor = float(np.exp(maps.sign(rng) * strength))
        return replace(truth, **{which: getattr(truth, which) * factor})

    return hide


def _decay(_rng: np.random.Generator, strength: float, truth: Truth) -> Truth:
    return replace(truth, decay=strength)


def _hurry(rng: np.random.Generator, strength: float, truth: Truth) -> Truth:
    return replace(truth, hurry=maps.sign(rng) * strength / SPEED)


def _lean(rng: np.random.Generator, strength: float, truth: Truth) -> Truth:
    return replace(truth, lean=maps.sign(rng) * strength)


def _parallel(rng: np.random.Generator, strength: float) -> Addition:
    sign = maps.sign(rng)

    def add(_drive: Drive, x: Signal, _rate: Signal) -> Signal:
        states, z = [0.0], 0.0
        for du in np.diff(x).tolist():
            z += du - 0.06 * abs(du) * z - 0.01 * du * abs(z)
            states.append(z)
        return sign * strength * OUTPUT / PEAK * np.array(states)

    return add


def _viscous(_rng: np.random.Generator, strength: float) -> Addition:
    return lambda _drive, _x, rate: -strength * OUTPUT * rate / SPEED


def _coulomb(_rng: np.random.Generator, strength: float) -> Addition:
    return lambda _drive, _x, rate: -strength * OUTPUT * np.sign(rate)


def _stribeck(_rng: np.random.Generator, strength: float) -> Addition:
    """Let dry friction turn within a few volts a second."""
    return lambda _drive, _x, rate: -strength * OUTPUT * np.tanh(rate / 2.0)


def _one_sided(rng: np.random.Generator, strength: float) -> Addition:
    c = maps.sign(rng) * strength * OUTPUT / SPEED
    return lambda _drive, _x, rate: -c * np.abs(rate)


def _drag(_rng: np.random.Generator, strength: float) -> Addition:
    return lambda _drive, _x, rate: -strength * OUTPUT * rate * np.abs(rate) / SPEED**2


def _square(rng: np.random.Generator, strength: float) -> Addition:
    c = maps.sign(rng) * strength * OUTPUT
    return lambda _drive, x, _rate: c * (x / PEAK) ** 2


def _cube(rng: np.random.Generator, strength: float) -> Addition:
    c = maps.sign(rng) * strength * OUTPUT
    return lambda _drive, x, _rate: c * (x / PEAK) ** 3


def _gain_step(rng: np.random.Generator, strength: float, truth: Truth) -> Truth:
    k, at = maps.sign(rng) * strength, float(rng.uniform(0.15, 0.6))
    return replace(truth, gain=lambda time: 1.0 + k * (time > at * time[-1]))


def _ageing(rng: np.random.Generator, strength: float, truth: Truth) -> Truth:
    k = maps.sign(rng) * strength
    return replace(truth, gain=lambda time: 1.0 + k * time / time[-1])


_KNOWN = (
    Hidden("delay", 0.002, 0.06, (_before(maps.later), _before(maps.two_lags))),
    Hidden("sensor-lag", 0.002, 0.08, (_behind(maps.sensor), _behind(maps.averaging))),
    Hidden("resonance", 1 / 25, 1 / 4, (_behind(maps.mode),)),
    Hidden("viscous", 0.001, 0.06, (_beside(_viscous),)),
    Hidden("clock-skew", 5e-5, 2e-3, (_before(maps.clock),)),
    Hidden("sensor-gain", 0.005, 0.1, (_behind(maps.sensor_gain),)),
    Hidden("input-gain", 0.005, 0.1, (_before(maps.sensor_gain),)),
    Hidden("wrong-parameter", 0.02, 0.3, tuple(map(_wrong, ("A", "beta", "gamma", "dp")))),
    Hidden("offset", 0.001, 0.05, (_behind(maps.zero),)),
    Hidden("linear-drift", 0.002, 0.1, (_behind(maps.drift),)),
    Hidden("jump", 0.002, 0.1, (_behind(maps.jump),)),
    Hidden("thermal-drift", 0.002, 0.1, (_behind(maps.thermal), _behind(maps.slow_thermal))),
    Hidden("exponential-creep", 0.005, 0.15, (_behind(maps.creep),)),
    Hidden("logarithmic-creep", 0.002, 0.03, (_behind(maps.log_creep),)),
    Hidden("relaxation", 0.02, 1.0, (_decay,)),
    Hidden("rate-dependent-loop", 0.02, 0.4, (_hurry,)),
    Hidden("loop-asymmetry", 1e-4, 4e-3, (_lean,)),
    Hidden("second-hysteresis", 0.02, 0.15, (_beside(_parallel),)),
    Hidden("backlash", 0.1, 5.0, (_before(maps.play),)),
    Hidden("stiction", 0.3, 5.0, (_before(maps.stick),)),
    Hidden("coulomb-friction", 0.002, 0.05, (_beside(_coulomb), _beside(_stribeck))),
    Hidden("viscous-asymmetry", 0.001, 0.06, (_beside(_one_sided),)),
    Hidden("quadratic-drag", 0.001, 0.06, (_beside(_drag),)),
    Hidden("even-nonlinearity", 0.002, 0.1, (_beside(_square),)),
    Hidden("cubic-stiffness", 0.004, 0.2, (_beside(_cube),)),
    Hidden("input-saturation", 0.04, 0.4, (_before(maps.cut_input),)),
    Hidden("output-saturation", 0.03, 0.35, (_behind(maps.cut_output),)),
    Hidden("dead-zone", 0.1, 5.0, (_before(maps.dead),)),
    Hidden("absolute-value-sensor", 0.004, 0.1, (_behind(maps.kink),)),
    Hidden("gain-step", 0.005, 0.15, (_gain_step,)),
    Hidden("ageing", 0.005, 0.15, (_ageing,)),
    Hidden("periodic-disturbance", 5e-4, 0.03, (_behind(maps.hum),)),
    Hidden("cross-coupling", 0.002, 0.1, (_behind(maps.coupling),)),
)

#: Effects of the catalogue, by name.
KNOWN: Mapping[str, Hidden] = MappingProxyType({hidden.name: hidden for hidden in _KNOWN})

#: Causes that the catalogue has no name for, by what they are.
UNKNOWN: Mapping[str, Hidden] = MappingProxyType(
    {
        "slew-rate": Hidden("", 40.0, 90.0, (_before(maps.slew),)),
        "ripple": Hidden("", 0.003, 0.03, (_behind(maps.ripple),)),
    }
)
