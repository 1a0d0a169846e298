"""Sets of the package nonlinear_benchmarks, where it is installed: it downloads them and splits them.

It is no dependency. Its functions return estimation data and tests as objects with the arrays ``u`` and
``y``, ``sampling_time`` and ``state_initialization_window_length``: one, or a tuple of them.
"""

import sys
from contextlib import redirect_stdout
from importlib import import_module
from importlib.util import find_spec
from inspect import isfunction, signature
from pathlib import Path
from typing import Any

import numpy as np

from islands.errors import SettingsError, lookup
from islands.records.dataset import Dataset, join
from lab.published_sets.definition import Benchmark, BenchmarkData, BenchmarkTest

#: Name of the package; its sets are named ``nonlinear_benchmarks:EMPS``.
PACKAGE = "nonlinear_benchmarks"


def is_installed() -> bool:
    """Return whether the package is installed."""
    return find_spec(PACKAGE) is not None


def list_package_sets() -> list[str]:
    """Return the names of the sets with an official split; none if the package is not installed."""
    return [f"{PACKAGE}:{name}" for name in _find_functions()] if is_installed() else []


def make_package_benchmark(name: str) -> Benchmark:
    """Return the benchmark of a function of the package.

    Raises
    ------
    SettingsError
        The package is not installed, or has no such function.
    """
    if not is_installed():
        raise SettingsError(f"install {PACKAGE} for its sets: pip install nonlinear-benchmarks")
    function = lookup(_find_functions(), name, f"set of {PACKAGE}")

    def read(_folder: Path) -> BenchmarkData:
        try:
            with redirect_stdout(sys.stderr):  # the package prints the progress of a download
                estimation, tests = function(always_return_tuples_of_datasets=True)
        except Exception as error:  # what the package raises without a network depends on its version
            raise SettingsError(
                f"{PACKAGE} cannot load {name}, which it downloads at first: {error}"
            ) from error
        return _convert(_list(estimation), _list(tests))

    return Benchmark(
        description=f"{name} of the package {PACKAGE}.",
        published={},
        unit="",
        scale=1.0,
        rule="split and initial samples of the package; error in the unit of the output",
        address="https://www.nonlinearbenchmark.org",
        licence="see the address",
        read=read,
    )


def _find_functions() -> dict[str, Any]:
    """Return the functions that split their data, by name."""
    try:
        package = import_module(f"{PACKAGE}.benchmarks")
    except ImportError as error:
        raise SettingsError(
            f"{PACKAGE} is installed, but a package that it imports is missing: {error}"
        ) from error
    return {
        name: each
        for name, each in vars(package).items()
        if isfunction(each) and "always_return_tuples_of_datasets" in signature(each).parameters
    }


def _list(found: Any) -> list[Any]:
    return list(found) if isinstance(found, (tuple, list)) else [found]


def _convert(estimation: list[Any], tests: list[Any]) -> BenchmarkData:
    named = {
        str(getattr(each, "name", "") or f"test {place}"): each for place, each in enumerate(tests, start=1)
    }
    if len(named) < len(tests):  # names of the package are not always unique
        named = {f"test {place}": each for place, each in enumerate(tests, start=1)}
    return BenchmarkData(
        join(tuple(map(_make_record, estimation))), {name: _make_test(each) for name, each in named.items()}
    )


def _make_test(found: Any) -> BenchmarkTest:
    known = found.state_initialization_window_length
    if known is None:
        raise SettingsError(f"this version of {PACKAGE} states no initial samples of {found.name}: update it")
    return BenchmarkTest(_make_record(found), int(known), int(known))


def _make_record(found: Any) -> Dataset:
    y = np.asarray(found.y, float)
    if y.ndim > 1 and y.shape[1] > 1:
        raise SettingsError(f"{found.name} has several outputs, which are not read from {PACKAGE}")
    return Dataset(np.asarray(found.u, float), y.ravel(), float(found.sampling_time))
