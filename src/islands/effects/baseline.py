"""Effects on the baseline: offsets, drifts and jumps."""

from islands.effects.channels import TEMPERATURE_NOTE, channel, channel_range, channel_unit, has_channel
from islands.effects.interface.context import Parameter
from islands.effects.interface.effect import (
    Effect,
    EffectTemplate,
    Formula,
    FormulaQuantity,
    MapEquation,
    Site,
)
from islands.effects.time_variation import (
    STEP_NOTE,
    candidate_instants,
    instant_bounds,
    smooth_step,
    write_step,
)

OFFSET = Effect(
    name="offset",
    title="offset of the output",
    summary="Zero offset of the output: y + c",
    family="baseline",
    site=Site.OUTPUT,
    parameters=lambda context: (Parameter("c", context.output_unit, 0.0, 0.01 * context.output_peak),),
    starting_points=lambda context, _: ((0.01 * context.output_peak,),),
    form=lambda y, values, _: y + values[0],
    equation=lambda _: MapEquation("x + n0"),
    formula=Formula("x + c"),
    source="Doebelin, Measurement Systems, section 3",
    similar_to="jump, even-nonlinearity, input-offset",
    distinguished_by="the mean of the residual",
    occurs_in="zero of a sensor or of its amplifier",
)


def input_offset(state: str, unit: str = "", size: float = 0.0) -> Effect:
    """Return the offset in the balance of one state as an effect.

    Its value has a unit and a typical size, by default those of the input.
    """
    label = f"{INPUT_OFFSET.name}:{state}"

    return Effect(
        name=label,
        summary=INPUT_OFFSET.summary,
        family="baseline",
        site=Site.CORE,
        parameters=lambda context: (
            Parameter(label, unit or context.input_unit, 0.0, 0.01 * (size or context.input_peak)),
        ),
        starting_points=lambda context, _: ((0.02 * (size or context.input_peak),),),
        form=None,
        formula=Formula(symbols=(f"offset_{state}",)),
        source="Schoukens and Noel, Three benchmarks addressing open challenges, 2017",
    )


INPUT_OFFSET = EffectTemplate(
    "input-offset",
    "Constant flow or force in addition to the input: + c in the balance of one state",
    title="offset of the input",
    placed_title="offset of the input at {}",
    similar_to="offset, outflow-law",
    distinguished_by="an offset filtered by the equation; in tanks it shifts with the level",
    occurs_in="gravity, preload, leakage, zero of a valve or amplifier",
)


LINEAR_DRIFT = Effect(
    name="linear-drift",
    title="linear drift of the output",
    summary="Linear drift of the output: y + c t / T over the record's duration T",
    family="baseline",
    site=Site.OUTPUT,
    parameters=lambda context: (Parameter("c", context.output_unit, 0.0, 0.01 * context.output_peak),),
    starting_points=lambda context, _: ((0.01 * context.output_peak,),),
    form=lambda y, values, context: y + values[0] * context.time / context.duration,
    equation=lambda context: MapEquation(f"x + n0*t/{context.duration}"),
    formula=Formula(
        "x + c*t/T",
        quantities=lambda values, context: (
            FormulaQuantity("c", float(values[0]), context.output_unit, "c"),
            FormulaQuantity("T", context.duration, "s"),
        ),
    ),
    source="Doebelin, Measurement Systems, section 3",
    depends_on_time=True,
    similar_to="jump, thermal-drift, exponential-creep",
    distinguished_by="the residual over time",
    occurs_in="zero of a sensor that warms up, integrated signals",
)


JUMP = Effect(
    name="jump",
    title="jump of the output",
    summary="Jump of the output's zero: y + c after an instant",
    family="baseline",
    site=Site.OUTPUT,
    parameters=lambda context: (
        Parameter("c", context.output_unit, 0.0, 0.01 * context.output_peak),
        Parameter("instant", "s", 0.0, 0.3 * context.fit_end_time / 45, *instant_bounds(context)),
    ),
    starting_points=lambda context, _: tuple(
        (0.02 * context.output_peak, instant) for instant in candidate_instants(context)
    ),
    form=lambda y, values, context: y + values[0] * smooth_step(context, values[1]),
    equation=lambda context: MapEquation(f"x + n0*{write_step(context, 'n1')}"),
    formula=Formula("x + c*step(t - t0)", symbols=("c", "t0"), note=STEP_NOTE),
    source="Basseville and Nikiforov, Detection of Abrupt Changes",
    extra_degrees_of_freedom=1,
    depends_on_time=True,
    similar_to="linear-drift, offset",
    distinguished_by="the residual over time, before and after one instant",
    occurs_in="a sensor that was touched or set to zero, lost counts of an encoder",
)


THERMAL_DRIFT = Effect(
    name="thermal-drift",
    title="thermal drift of the output",
    summary="The output follows a temperature: y + k (T - T(0)), where T is a given channel",
    family="baseline",
    site=Site.OUTPUT,
    parameters=lambda context: (
        Parameter(
            "k",
            f"{context.output_unit}/{channel_unit(context, True)}",
            0.0,
            0.01 * context.output_peak / channel_range(context, True),
        ),
    ),
    starting_points=lambda context, _: ((0.02 * context.output_peak / channel_range(context, True),),),
    form=lambda y, values, context: y + values[0] * channel(context, True),
    equation=lambda _: MapEquation("x + n0*z0", (("temperature",),)),
    formula=Formula("x + k*(T - T_0)", names=("T", "T_0"), note=TEMPERATURE_NOTE),
    source="Doebelin, Measurement Systems, section 2",
    is_applicable=lambda context: has_channel(context, True),
    similar_to="cross-coupling; linear-drift if the temperature only rises",
    distinguished_by="a residual that follows a channel in K, degC or degF",
    occurs_in="thermal expansion, temperature coefficient of a sensor",
)
