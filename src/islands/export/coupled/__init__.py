"""Export of coupled models. Each format is an entry of `COUPLED_EXPORTS`."""

from collections.abc import Callable, Mapping
from types import MappingProxyType

from islands.errors import SettingsError, suggest
from islands.export.coupled.coupled_document import coupled_json
from islands.export.coupled.coupled_equations import coupled_latex, coupled_mathml, coupled_text
from islands.export.coupled.coupled_programs import coupled_c, coupled_matlab, coupled_python
from islands.export.languages.matlab_system import matlab_system_source
from islands.export.languages.modelica import modelica_source
from islands.export.languages.s_function import s_function_source
from islands.simulation.coupled_model import CoupledModel

#: Export formats of a coupled model by name.
COUPLED_EXPORTS: Mapping[str, Callable[[CoupledModel], str]] = MappingProxyType(
    {
        "plain": coupled_text,
        "latex": coupled_latex,
        "mathml": coupled_mathml,
        "python": coupled_python,
        "c": coupled_c,
        "matlab": coupled_matlab,
        "matlab-system": matlab_system_source,
        "s-function": s_function_source,
        "modelica": modelica_source,
        "json": coupled_json,
    }
)


def export_coupled(model: CoupledModel, kind: str) -> str:
    """Return a coupled model as text in one of the formats of ``COUPLED_EXPORTS``.

    Raises
    ------
    SettingsError
        There is no such format for coupled models.
    """
    if kind not in COUPLED_EXPORTS:
        raise SettingsError(
            f"a model of several outputs has no format {kind!r}: take {', '.join(COUPLED_EXPORTS)}, or "
            "export the equation of one output, which has the other outputs as inputs"
            f"{suggest(kind, COUPLED_EXPORTS)}"
        )
    return COUPLED_EXPORTS[kind](model)
