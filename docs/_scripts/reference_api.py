"""Generated reference of the Python interfaces: the public names of ``islands`` and of ``islands_api``."""

from types import ModuleType

from tables import page, section

import islands
import islands_api
from islands_api.client.base import BaseClient, Endpoint

#: Documented names that are reached by their submodule.
FURTHER = (
    "records.coupled.CoupledRecord",
    "records.split.Split",
    "models.coupled_narx.CoupledModel",
    "models.operating_point.static_characteristic",
    "models.sympy_expression.to_sympy",
    "simulation.input_response.step_response",
    "effects.Effect",
    "effects.Parameter",
    "effects.Site",
    "evolution.migration.TOPOLOGIES",
    "facade.results.saved_simulation.SavedDiagnosis",
    "facade.results.saved_simulation.SavedSimulation",
    "diagnosis.planning.experiment_plan.ExperimentPlan",
    "report.documents.monitor_state.SavedMonitor",
)


def python() -> str:
    """Return the page of the package ``islands``."""
    return page(
        "Python API",
        "The public names of the package `islands`, further names of its submodules, and its estimator of "
        "scikit-learn.",
        *_groups(islands),
        section(
            "By submodule",
            "What these functions take and return, and what is needed less often.",
            *(f"::: islands.{name}" for name in FURTHER),
        ),
        section(
            "Scikit-learn",
            "`islands.sklearn` needs the extra `sklearn`. "
            "[Use the library](../how-to/use-the-library.md#use-scikit-learn) has an example.",
            "::: islands.sklearn.IslandsRegressor",
        ),
    )


def client() -> str:
    """Return the page of the package ``islands_api``."""
    return page(
        "Python client",
        "The public names of the package `islands_api`: clients of a running service.",
        *_groups(islands_api),
        section(
            "Calls",
            "Methods of `Client` and of `AsyncClient`. A method has the parameters of the function below, "
            "sends its request and returns the answer, whose type is the argument of `RequestSpec`.",
            *_calls(),
        ),
    )


def _calls() -> list[str]:
    """Return a reference to the function of each call, in the order of the client."""
    functions = [
        getattr(BaseClient, name).__wrapped__
        for name, member in vars(BaseClient).items()
        if isinstance(member, Endpoint)
    ]
    return [f"::: {each.__module__}.{each.__name__}" for each in functions]


def _groups(package: ModuleType) -> list[str]:
    groups: dict[str, list[str]] = {"Functions": [], "Classes": [], "Errors": [], "Tables": []}
    for name in package.__all__:
        groups[_kind(getattr(package, name))].append(f"::: {package.__name__}.{name}")
    return [section(title, *found) for title, found in groups.items() if found]


def _kind(entry: object) -> str:
    if isinstance(entry, type):
        return "Errors" if issubclass(entry, Exception) else "Classes"
    return "Functions" if callable(entry) else "Tables"
