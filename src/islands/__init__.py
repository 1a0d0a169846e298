"""Identify models from measured data, and diagnose what simulations of the data get wrong.

>>> import islands
>>> record = islands.read_record("piezo.csv", inputs=["u_V"], output="y_um")  # doctest: +SKIP
>>> result = islands.fit(record)  # doctest: +SKIP
>>> result.best.equation  # doctest: +SKIP
"""

from importlib import import_module
from typing import Any

from islands.distribution import read_version

#: Public names by defining module. A module is imported on first use, because the compiler of the kernels
#: takes half a second to import. `__init__.pyi` is generated from this table.
_PUBLIC = {
    "records.dataset": ("Dataset", "join"),
    "records.preprocessing": ("preprocess",),
    "records.split": ("split",),
    "effects.catalogue": ("EFFECTS",),
    "errors": ("ExtrapolationWarning", "IslandsError", "ModelError", "RecordError", "SettingsError"),
    "estimation.estimator_table": ("ESTIMATORS",),
    "evolution.presets": ("PRESETS",),
    "evolution.settings": ("Settings",),
    "expressions.parsing": ("parse",),
    "expressions.primitives": ("PRIMITIVES",),
    "expressions.user_primitive": ("primitive",),
    "facade.diagnose": ("diagnose", "function_simulator", "plan_experiment"),
    "facade.engine_choice": ("Ray",),
    "facade.explain_residual": ("explain_residual",),
    "facade.fit": ("fit",),
    "facade.inspect_record": ("inspect_record",),
    "facade.load": ("load",),
    "facade.identify": ("identify",),
    "facade.record_monitor": ("create_monitor", "monitor_record"),
    "facade.results.complete_diagnosis": ("DiagnosisResult",),
    "facade.results.fitted_model": ("FittedModel",),
    "facade.results.model_analysis": ("linearise",),
    "facade.results.model_simulation": ("simulate",),
    "facade.results.identification": ("Result",),
    "report.documents.monitor_state": ("read_monitor", "write_monitor"),
    "records.reading.data_frames": ("as_record",),
    "persistence.models": ("read_model", "write_model"),
    "records.reading": ("read_record",),
    "records.writer": ("write_record",),
    "models.narx": ("Model", "make_model"),
    "simulators.interface": ("Simulator",),
}
_MODULES = {name: module for module, names in _PUBLIC.items() for name in names}

__all__ = sorted(_MODULES, key=lambda name: (not name.isupper(), name))  # noqa: PLE0605


def __getattr__(name: str) -> Any:
    if name == "__version__":
        return read_version()
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = globals()[name] = getattr(import_module(f"islands.{_MODULES[name]}"), name)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


def _make_stub() -> str:
    """Return the text of ``__init__.pyi``, which declares the public names for editors and type checkers."""
    lines = [f"from islands.{module} import {name} as {name}" for name, module in _MODULES.items()]
    return "\n".join(["# Made by islands._make_stub().", *sorted(lines), "", "__version__: str", ""])
