"""Export of extended simulations: plain text, JSON, programs in Python, C and MATLAB."""

import json
from collections.abc import Callable, Mapping
from types import MappingProxyType

from islands.effects.catalogue import get_summary
from islands.export import export
from islands.export.closed_form import closed_form, find_closed_form
from islands.export.equations.c import c_equations
from islands.export.equations.collection import collect_equations
from islands.export.equations.matlab import matlab_equations
from islands.simulators.ode.system_document import SYMBOL_MEANINGS
from islands.simulators.specification.base import ValueSpec
from islands.simulators.specification.equations import OdeParameterSpec, OdeSpec
from islands.simulators.specification.table import LocalExtendedSpec


def as_text(spec: LocalExtendedSpec) -> str:
    """Describe the simulator, and every effect with its equation and its values."""
    lines = [f"{spec.output} from {', '.join(spec.inputs)}: "]
    if isinstance(spec.core, OdeSpec):
        lines[0] += spec.core.name
        lines += [f"    {line}" for line in _describe_equations(spec.core)]
    else:
        simulator = spec.core.model_dump(mode="json", exclude_defaults=True)
        lines[0] += f"{simulator.pop('kind', 'extended')} {json.dumps(simulator)}"
    if spec.times > 1 or spec.hold != "first-order":
        lines.append(f"solved with {spec.times} steps per sample; input between samples: {spec.hold}")
    if (added := spec.output_equation) is not None:
        lines.append(f"output = {added.equation}, where {SYMBOL_MEANINGS}")
        lines += [f"    {line}" for line in _describe_values(added.parameters)]
    for effect in spec.effects:
        values = ", ".join(_describe_values(effect.parameters))
        lines.append(f"{effect.name} ({effect.site}): {get_summary(effect.name)}")
        lines.append(f"    {values}")
    return "\n".join(lines) + "\n"


def _describe_equations(spec: OdeSpec) -> list[str]:
    """Return the equations, the output and the values of the parameters, one per line."""
    return [
        *spec.equations.splitlines(),
        f"output = {spec.output}",
        *_describe_values(spec.parameters),
    ]


def _describe_values(values: Mapping[str, ValueSpec | OdeParameterSpec]) -> list[str]:
    return [f"{name} = {each.value:.6g} {each.unit}".rstrip() for name, each in values.items()]


def as_json(spec: LocalExtendedSpec) -> str:
    """Return the text of ``extended.json``."""
    return json.dumps(spec.model_dump(mode="json", by_alias=True), indent=2, allow_nan=False) + "\n"


def as_program(spec: LocalExtendedSpec) -> str:
    """Return a Python program that simulates a record; it requires the package ``islands``."""
    quoted = as_json(spec).replace("\\", "\\\\").replace('"""', '\\"\\"\\"')
    inputs = ", ".join(map(repr, spec.inputs))
    return f'''"""Simulate a record with the result of a diagnosis: python FILE.py record.csv simulated.csv"""

import json
import sys

import islands

EXTENDED = json.loads("""
{quoted}""")

if __name__ == "__main__":
    record = islands.read_record(sys.argv[1], inputs=[{inputs}], output={spec.output!r})
    y = islands.simulate(EXTENDED, record).y
    with open(sys.argv[2], "w") as file:
        file.write("y_sim\\n" + "\\n".join(repr(float(value)) for value in y) + "\\n")
'''


def as_c(spec: LocalExtendedSpec) -> str:
    """Return C99 source; see `export_extended`."""
    model = find_closed_form(spec)
    return c_equations(collect_equations(spec)) if model is None else export(model, "c")


def as_matlab(spec: LocalExtendedSpec) -> str:
    """Return a MATLAB function; see `export_extended`."""
    model = find_closed_form(spec)
    return matlab_equations(collect_equations(spec)) if model is None else export(model, "matlab")


#: Export formats of an extended simulation by name.
EXTENDED_EXPORTS: Mapping[str, Callable[[LocalExtendedSpec], str]] = MappingProxyType(
    {"plain": as_text, "python": as_program, "c": as_c, "matlab": as_matlab, "json": as_json}
)


def export_extended(spec: LocalExtendedSpec, kind: str) -> str:
    """Return an extended simulation as text.

    Differential equations are exported as programs that integrate them. A model or a linear simulation whose
    effects have a closed form is exported as a model, in every text format of models. With other effects it
    is a program in C or MATLAB that applies them to the whole record, as is a column of the record.

    Raises
    ------
    SettingsError
        The format is unknown or is not text.
    ModelError
        The simulation cannot be written in this format. The message names what prevents it.
    """
    return EXTENDED_EXPORTS[kind](spec) if kind in EXTENDED_EXPORTS else export(closed_form(spec), kind)
