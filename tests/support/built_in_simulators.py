"""Built-in simulators with given values, without a record that they are compared with."""

from collections.abc import Mapping

from islands.simulators.ode.simulator import OdeSimulator, make_ode_simulator
from islands.simulators.specification.equations import read_built_in
from support.simulated_records import recorded, wave


def make_oscillator(m: float, c: float, k: float, position: float = 0.0, rate: float = 0.0) -> OdeSimulator:
    """Make ``second-order`` in N and m."""
    return _make("second-order", ("N", "m"), {"m": m, "c": c, "k": k}, {"x": position, "v": rate})


def make_piezo(**values: float) -> OdeSimulator:
    """Make ``bouc-wen-piezo``; parameters that are not given have the values of the paper."""
    return _make("bouc-wen-piezo", ("V", "um"), values, {})


def make_tanks(k1: float, k2: float, k3: float, levels: tuple[float, float]) -> OdeSimulator:
    """Make ``cascaded-tanks`` with an input and a level in V."""
    states = dict(zip(("upper", "lower"), levels, strict=True))
    return _make("cascaded-tanks", ("V", "V"), {"k1": k1, "k2": k2, "k3": k3}, states)


def _make(
    name: str, units: tuple[str, str], values: Mapping[str, float], states: Mapping[str, float]
) -> OdeSimulator:
    system = read_built_in(name).with_values(values)
    return make_ode_simulator(system, recorded(wave(), wave(), units=units), states)
