"""Equations of a coupled model as plain text, LaTeX and MathML."""

import re

from islands.io.export.coupled.coupled_signals import equation_signals
from islands.model.equations import latex_equation, mathml_equation, named_equation
from islands.simulation.coupled_model import CoupledModel


def coupled_equation(model: CoupledModel) -> str:
    """Write one line per output, with the column names of the record."""
    return "\n".join(named_equation(single) for single in model.models)


def coupled_latex(model: CoupledModel) -> str:
    """Write the equations as a LaTeX environment ``aligned`` without dollar signs."""
    rows = [
        _name_leaves(
            r"([yu])_\{(?:(\d+),)?k(?=[-}])", "{0}_{{{1}k", "{},", latex_equation(single), model, place
        )
        for place, single in enumerate(model.models)
    ]
    lines = " \\\\\n".join(row.replace(" = ", " &= ", 1) for row in rows)
    return f"\\begin{{aligned}}\n{lines}\n\\end{{aligned}}"


def coupled_mathml(model: CoupledModel) -> str:
    """Write one ``math`` element per output, which browsers render without a library."""
    leaf = r"<mi>([yu])</mi><mrow>(?:<mn>(\d+)</mn><mo>,</mo>)?<mi>k</mi>"
    return "\n".join(
        _name_leaves(
            leaf,
            "<mi>{0}</mi><mrow>{1}<mi>k</mi>",
            "<mn>{}</mn><mo>,</mo>",
            mathml_equation(single),
            model,
            place,
        )
        for place, single in enumerate(model.models)
    )


def _name_leaves(pattern: str, leaf: str, index: str, text: str, model: CoupledModel, place: int) -> str:
    """Replace the signals of one equation by those of the coupled model."""
    names = equation_signals(model, place)

    def name(found: re.Match[str]) -> str:
        signal = names[f"{found[1]}{found[2] or ''}"]
        return leaf.format(signal[0], index.format(signal[1:]) if signal[1:] else "")

    return re.sub(pattern, name, text)
