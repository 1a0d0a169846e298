"""Generated reference of the discrepancy analysis: effects, noise detectors, verdicts and simulators."""

import re
from collections.abc import Iterable, Iterator

import numpy as np
from tables import code, codes, escape, page, section, table

from islands.diagnosis.inference.noise_detectors import DETECTORS, NoiseDetector
from islands.effects.catalogue import CATALOGUE, EFFECTS, OF_EACH
from islands.effects.free_forms import FREE_FORMS
from islands.effects.interface.context import ForceCoordinate, Parameter, SimulationContext
from islands.effects.interface.effect import Effect, EffectTemplate
from islands.expressions.parsing import NAMED_FUNCTIONS
from islands.expressions.primitives import EQUATION_FUNCTIONS
from islands.simulators.specification.table import SIMULATORS

Entry = Effect | EffectTemplate | NoiseDetector


def symbolic_context() -> SimulationContext:
    """Return a context with symbols as units: [u], [y], [x] of the coordinate, [F] of a force."""
    u = np.sin(np.arange(400) / 20)
    coordinate = ForceCoordinate("[x]", 1.0, 1.0, "[F]", 1.0)
    return SimulationContext(
        u,
        0.01,
        {"T": u, "w": u},
        {"T": "K", "w": "[w]"},
        1.0,
        1.0,
        "[u]",
        "[y]",
        3.0,
        force_coordinate=coordinate,
    )


def effects() -> str:
    """Return the page of effects and noise detectors."""
    every: list[Entry] = [*CATALOGUE.values(), *OF_EACH.values(), *DETECTORS.values()]
    overview = ((f"[{code(each.name)}](#{each.name})", _family(each), escape(each.summary)) for each in every)
    return page(
        "Effects",
        "Effects that the discrepancy analysis searches for, and detectors of sampling and noise.",
        "u is the input, y the output, v the output before the sensor, x the coordinate that forces act on, "
        "x' its rate, h a hysteretic state, T the duration of the record or a temperature. [u], [y], [x] are "
        "their units, [F] is the unit of a force. Parameters without a unit are relative.\n",
        "Effects of one family resemble each other. Which effects a record cannot distinguish depends on the "
        "record: the analysis lists them as equivalents of each finding.\n",
        table(("Effect", "Family", "Meaning"), overview),
        section("Effects", "", *(_entry(each) for each in EFFECTS if not each.is_free)),
        section(
            "Free forms",
            "Effects without an assumed shape, which are compared with the other effects.",
            *map(_entry, FREE_FORMS),
        ),
        section(
            "Effects on one state, parameter or model",
            "The name of the state or parameter follows the name of the effect: `state-clip:upper`.",
            *map(_entry, OF_EACH.values()),
        ),
        section(
            "Sampling and noise",
            "Detectors examine samples and the residual of the best simulation, which they do not change.",
            *map(_entry, DETECTORS.values()),
        ),
    )


def _family(entry: Entry) -> str:
    return "" if isinstance(entry, EffectTemplate) else entry.family


def _entry(entry: Entry) -> str:
    properties = "\n".join(f"* {title}: {text}" for title, text in _properties(entry) if text)
    return section(f"`{entry.name}`", f"{escape(entry.summary)}.", properties, level=3)


def _properties(entry: Entry) -> Iterator[tuple[str, str]]:
    if not isinstance(entry, NoiseDetector):
        yield "In sentences", entry.title
    if isinstance(entry, Effect):
        yield "Acts on", str(entry.site)
        yield "Parameters", escape(_parameters(entry.parameters(symbolic_context())))
    yield "Similar to", _link_effects(escape(entry.similar_to))
    yield "Distinguished by", escape(entry.distinguished_by)
    if not isinstance(entry, NoiseDetector):
        yield "Occurs in", entry.occurs_in
    if not isinstance(entry, EffectTemplate):
        yield "Source", escape(entry.source)


def _link_effects(text: str) -> str:
    known = {*CATALOGUE, *OF_EACH, *DETECTORS}
    return re.sub(
        r"[a-z][a-z-]*", lambda name: f"[{name[0]}](#{name[0]})" if name[0] in known else name[0], text
    )


def _parameters(parameters: Iterable[Parameter]) -> str:
    return "; ".join(code(each.name) + (f" in {each.unit}" if each.unit else "") for each in parameters)


def simulators() -> str:
    """Return the page of the simulators that can be diagnosed."""
    rows = (
        (
            code(entry.name + entry.argument),
            escape(entry.summary),
            codes(entry.parameters),
            escape(entry.estimated),
        )
        for entry in SIMULATORS.values()
    )
    return page(
        "Simulators",
        "Values of `islands diagnose --simulation` and of the argument `simulation` of `islands.diagnose`.",
        table(("Simulator", "Meaning", "Parameters in `FILE.json`", "Estimated unless given"), rows),
        '`FILE.json` is an object with the parameters that are known: `{"m": 1.2, "k": 4000}`.\n',
        "`FILE.toml` contains equations: see "
        "[Write a simulation as equations](../how-to/write-a-simulation.md).\n",
        "`OPTIONS` are names of variables of an FMU: see "
        "[Diagnose an FMU](../how-to/simulate-with-an-fmu.md).\n",
        section(
            "Functions in equations",
            "In addition to the operators `+ - * / **` and the comparisons `< <= > >=`.",
            table(("Function", "Meaning"), _functions()),
        ),
    )


def _functions() -> Iterator[tuple[str, str]]:
    """Return the rows of the functions in equations, without the operators."""
    for name in NAMED_FUNCTIONS:
        yield code(name), escape(EQUATION_FUNCTIONS[name].summary)
    yield code("rate"), "`rate(u)`: slope of the input or of a channel between samples"
    yield code("delay"), "`delay(u, tau)`: input or channel tau seconds ago, interpolated linearly"
