"""Export of extended simulations: plain text, JSON, Python program."""

import json
from collections.abc import Callable, Mapping
from types import MappingProxyType

from islands.discrepancy.effects import get_summary
from islands.io.simulator_spec.ode_spec import OdeSpec
from islands.io.simulator_spec.specification import LocalExtendedSpec


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
    for effect in spec.effects:
        values = ", ".join(
            f"{name} = {each.value:.6g} {each.unit}" for name, each in effect.parameters.items()
        )
        lines.append(f"{effect.name} ({effect.site}): {get_summary(effect.name)}")
        lines.append(f"    {values}")
    return "\n".join(lines) + "\n"


def _describe_equations(spec: OdeSpec) -> list[str]:
    """Return the equations, the output and the values of the parameters, one per line."""
    return [
        *spec.equations.splitlines(),
        f"output = {spec.output}",
        *(f"{name} = {each.value:.6g} {each.unit}".rstrip() for name, each in spec.parameters.items()),
    ]


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


#: Export formats of an extended simulation by name.
EXTENDED_EXPORTS: Mapping[str, Callable[[LocalExtendedSpec], str]] = MappingProxyType(
    {"plain": as_text, "python": as_program, "json": as_json}
)
