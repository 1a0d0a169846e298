"""Friction: viscous, dry, one-sided, and quadratic drag."""

from math import tanh
from typing import Any

from islands.effects.interface.context import Parameter, Points, Signal, SimulationContext
from islands.effects.interface.effect import Effect, ForceLaw, Formula, Site


def _coulomb_friction_force(_x: float, rate: float, _z: float, numbers: Any) -> float:
    # Smoothed around zero rate: calibration requires a derivative, and a step has none.
    return numbers[0] * tanh(rate / numbers[1])


def _coulomb_friction_constants(context: SimulationContext) -> tuple[float, ...]:
    return (context.force_coordinate.friction_smoothing * context.force_coordinate.rate,)


def _coulomb_friction_parameters(context: SimulationContext) -> tuple[Parameter, ...]:
    coordinate = context.force_coordinate
    return (Parameter("F", coordinate.force_unit, 0.0, 0.005 * coordinate.force, coordinate.lower_bound),)


COULOMB_FRICTION = Effect(
    name="coulomb-friction",
    title="dry friction",
    summary="Dry friction: - F sign(x')",
    family="memory",
    site=Site.FORCE,
    parameters=_coulomb_friction_parameters,
    starting_points=lambda context, _: ((0.01 * context.force_coordinate.force,),),
    form=ForceLaw(
        _coulomb_friction_force,
        constants=_coulomb_friction_constants,
        is_dissipative=True,
        equation="n0*tanh(v/n1)",
    ),
    formula=Formula("F*sign(v)", note="The simulation smooths sign({v}) around zero"),
    source="Armstrong-Helouvry, Dupont and Canudas de Wit, 1994",
    similar_to="backlash, second-hysteresis",
    distinguished_by="a step of the residual where the rate x' changes its sign",
    occurs_in="guides, bearings, seals, brushes and their preload",
)


def _viscous_force(_x: float, rate: float, _z: float, c: Any) -> float:
    return c[0] * rate


def _viscous_parameters(context: SimulationContext) -> tuple[Parameter, ...]:
    coordinate = context.force_coordinate
    return (
        Parameter(
            "c",
            f"{coordinate.force_unit} s/{coordinate.unit}",
            0.0,
            0.01 * coordinate.force / coordinate.rate,
            coordinate.lower_bound,
        ),
    )


def _viscous_starting_points(context: SimulationContext, _residual: Signal) -> Points:
    return ((0.02 * context.force_coordinate.force / context.force_coordinate.rate,),)


VISCOUS = Effect(
    name="viscous",
    title="viscous friction",
    summary="Viscous friction: - c x'",
    family="timing",
    site=Site.FORCE,
    parameters=_viscous_parameters,
    starting_points=_viscous_starting_points,
    form=ForceLaw(_viscous_force, is_dissipative=True, equation="n0*v"),
    formula=Formula("c*v"),
    source="Armstrong-Helouvry, Dupont and Canudas de Wit, 1994",
    similar_to="delay, sensor-lag",
    distinguished_by="the hysteretic part of the output is not delayed",
    occurs_in="lubricated guides and bearings, dampers, eddy currents, back-EMF of a motor",
)


def _viscous_asymmetry_force(_x: float, rate: float, _z: float, c: Any) -> float:
    return c[0] * abs(rate)


def _viscous_asymmetry_parameters(context: SimulationContext) -> tuple[Parameter, ...]:
    coordinate = context.force_coordinate
    return (
        Parameter(
            "c",
            f"{coordinate.force_unit} s/{coordinate.unit}",
            0.0,
            0.01 * coordinate.force / coordinate.rate,
        ),
    )


VISCOUS_ASYMMETRY = Effect(
    name="viscous-asymmetry",
    title="asymmetric viscous friction",
    summary="Friction that differs between the directions: - c |x'|",
    family="memory",
    site=Site.FORCE,
    parameters=_viscous_asymmetry_parameters,
    starting_points=_viscous_starting_points,
    form=ForceLaw(_viscous_asymmetry_force, is_dissipative=True, equation="n0*abs(v)"),
    formula=Formula("c*abs(v)"),
    source="Armstrong-Helouvry, Dupont and Canudas de Wit, 1994",
    similar_to="offset, loop-asymmetry",
    distinguished_by="the slope over the rate differs with the sign of the rate",
    occurs_in="one-way valves, dampers with different rebound, gears loaded on one flank",
)


def _quadratic_drag_force(_x: float, rate: float, _z: float, c: Any) -> float:
    return c[0] * abs(rate) * rate


def _quadratic_drag_parameters(context: SimulationContext) -> tuple[Parameter, ...]:
    coordinate = context.force_coordinate
    unit = f"{coordinate.force_unit} s^2/{coordinate.unit}^2"
    return (Parameter("c", unit, 0.0, 0.01 * coordinate.force / coordinate.rate**2, coordinate.lower_bound),)


QUADRATIC_DRAG = Effect(
    name="quadratic-drag",
    title="quadratic drag",
    summary="Quadratic drag, as in turbulent flow: - c |x'| x'",
    family="shape",
    site=Site.FORCE,
    parameters=_quadratic_drag_parameters,
    starting_points=lambda context, _: (
        (0.02 * context.force_coordinate.force / context.force_coordinate.rate**2,),
    ),
    form=ForceLaw(_quadratic_drag_force, is_dissipative=True, equation="n0*abs(v)*v"),
    formula=Formula("c*abs(v)*v"),
    source="Worden and Tomlinson, Nonlinearity in Structural Dynamics, section 2",
    similar_to="viscous; on a single sine also second-hysteresis",
    distinguished_by="drag grows with the square of the frequency, hysteresis does not",
    occurs_in="fans, pumps, orifices and bodies in a fluid",
)
