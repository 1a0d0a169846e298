"""Extended simulations as text: in words, as JSON, and as a program that runs them."""

import json
from collections.abc import Callable, Mapping
from types import MappingProxyType

from islands.discrepancy.effects import summary_of
from islands.errors import lookup
from islands.io.simulator_spec.specification import LocalExtendedSpec


def in_words(asked: LocalExtendedSpec) -> str:
    """Say what is simulated, and every effect with its form and its values."""
    simulator = asked.core.model_dump(mode="json", exclude_defaults=True)
    kind = simulator.pop("kind", "extended")
    lines = [f"{asked.output} from {', '.join(asked.inputs)}: {kind} {json.dumps(simulator)}"]
    if asked.times > 1 or asked.hold != "first-order":
        lines.append(f"solved in {asked.times} steps a sample; the input between samples: {asked.hold}")
    for effect in asked.effects:
        values = ", ".join(
            f"{name} = {each.value:.6g} {each.unit}" for name, each in effect.parameters.items()
        )
        lines.append(f"{effect.name} ({effect.site}): {summary_of(effect.name)}")
        lines.append(f"    {values}")
    return "\n".join(lines) + "\n"


def as_json(asked: LocalExtendedSpec) -> str:
    """Write the file that it was read from."""
    return json.dumps(asked.model_dump(mode="json", by_alias=True), indent=2, allow_nan=False) + "\n"


def as_program(asked: LocalExtendedSpec) -> str:
    """Write a Python program that simulates a record; it needs the package ``islands``."""
    quoted = as_json(asked).replace("\\", "\\\\").replace('"""', '\\"\\"\\"')
    inputs = ", ".join(map(repr, asked.inputs))
    return f'''"""Simulates a record with what a diagnosis found: python FILE.py record.csv simulated.csv"""

import json
import sys

import islands

EXTENDED = json.loads("""
{quoted}""")

if __name__ == "__main__":
    record = islands.read_record(sys.argv[1], inputs=[{inputs}], output={asked.output!r})
    y = islands.simulate(EXTENDED, record).y
    with open(sys.argv[2], "w") as file:
        file.write("y_sim\\n" + "\\n".join(repr(float(value)) for value in y) + "\\n")
'''


EXTENDED_EXPORTS: Mapping[str, Callable[[LocalExtendedSpec], str]] = MappingProxyType(
    {"plain": in_words, "python": as_program, "json": as_json}
)


def export_extended(asked: LocalExtendedSpec, kind: str) -> str:
    """Return an extended simulation as text of a kind in ``EXTENDED_EXPORTS``.

    Raises
    ------
    SettingsError
        There is no such kind.
    """
    return lookup(EXTENDED_EXPORTS, kind, "format of an extended simulation")(asked)
