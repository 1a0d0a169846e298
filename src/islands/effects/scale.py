"""Effects on scale: gain errors of input and output, and wrong parameters."""

from islands.effects.interface.context import Parameter
from islands.effects.interface.effect import (
    Effect,
    EffectTemplate,
    Formula,
    MapEquation,
    Site,
)

INPUT_GAIN = Effect(
    name="input-gain",
    title="gain error of the input",
    summary="Gain error of the amplifier: (1 + k) u",
    family="scale",
    site=Site.INPUT,
    parameters=lambda _: (Parameter("k", "", 0.0, 0.01, -0.5, 0.5),),
    starting_points=lambda _context, _residual: ((0.02,),),
    form=lambda u, values, _: (1.0 + values[0]) * u,
    equation=lambda _: MapEquation("(1 + n0)*x"),
    formula=Formula("(1 + k)*x"),
    source="Doebelin, Measurement Systems, section 3",
    is_gain=True,
    similar_to="sensor-gain, wrong-parameter",
    distinguished_by="only tolerances of all parameters distinguish them",
    occurs_in="amplifier, valve or command scaling",
)


SENSOR_GAIN = Effect(
    name="sensor-gain",
    title="gain error of the sensor",
    summary="Gain error of the sensor: (1 + k) y",
    family="scale",
    site=Site.OUTPUT,
    parameters=lambda _: (Parameter("k", "", 0.0, 0.01, -0.5, 0.5),),
    starting_points=lambda _context, _residual: ((0.02,),),
    form=lambda y, values, _: (1.0 + values[0]) * y,
    equation=lambda _: MapEquation("(1 + n0)*x"),
    formula=Formula("(1 + k)*x"),
    source="Doebelin, Measurement Systems, section 3",
    is_gain=True,
    similar_to="input-gain, wrong-parameter",
    distinguished_by="only tolerances of all parameters distinguish them",
    occurs_in="calibration of the sensor or of its amplifier",
)


def wrong_parameter(parameter: Parameter) -> Effect:
    """Return the effect of one wrong parameter: its true value is (1 + r) times the nominal one."""
    label = f"{WRONG_PARAMETER.name}:{parameter.name}"

    return Effect(
        name=label,
        summary=WRONG_PARAMETER.summary,
        family="scale",
        site=Site.PARAMETER,
        parameters=lambda _: (Parameter(label, "", 0.0, 0.02, -0.8, 4.0),),
        starting_points=lambda _context, _residual: ((0.05,), (-0.05,)),
        form=None,
        formula=Formula("x*(1 + r)", symbols=("r",)),
        source="Ljung, System Identification, 2nd ed., section 7",
    )


WRONG_PARAMETER = EffectTemplate(
    "wrong-parameter",
    "A parameter of the simulation differs from its nominal value by more than its tolerance",
    title="wrong parameter",
    placed_title="wrong parameter {}",
    similar_to="input-gain, sensor-gain, other parameters",
    distinguished_by="only tolerances distinguish them; the name says which parameter",
    occurs_in="data sheets, estimates of mass and geometry, a part that was exchanged",
)
