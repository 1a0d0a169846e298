"""Access to the equations of a simulator, through the wrappers around them."""

from dataclasses import replace

from islands.discrepancy.interfaces.simulator import Simulator
from islands.discrepancy.simulators.intersample import ResampledSimulator
from islands.discrepancy.simulators.ode import OdeSimulator
from islands.systems.ode.ode_system import OdeSystem


def find_equations(simulator: Simulator) -> OdeSimulator | None:
    """Return the simulator of equations; None if the simulator has no equations that can be extended."""
    if isinstance(simulator, ResampledSimulator):
        return find_equations(simulator.simulator)
    return simulator if isinstance(simulator, OdeSimulator) else None


def with_equations(simulator: Simulator, system: OdeSystem) -> Simulator:
    """Return the simulator with other equations; the wrappers stay."""
    if isinstance(simulator, ResampledSimulator):
        return replace(simulator, simulator=with_equations(simulator.simulator, system))
    assert isinstance(simulator, OdeSimulator)
    return replace(simulator, system=system)
