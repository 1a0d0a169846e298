"""Sets of a package that is no dependency: a module with its interface takes its place."""

import sys
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

from islands.benchmarks import public_package
from islands.benchmarks.catalogue import find_benchmark
from islands.benchmarks.definition import read_data
from islands.errors import SettingsError


def part(samples, known=None, name="", y=None):
    y = np.arange(float(samples)) if y is None else y
    return SimpleNamespace(
        u=-np.arange(float(samples)),
        y=y,
        sampling_time=0.5,
        state_initialization_window_length=known,
        name=name,
    )


@pytest.fixture
def package(monkeypatch):
    """A package with sets of one test, of two tests, of several outputs, and one that does not load."""
    module = ModuleType(f"{public_package.PACKAGE}.benchmarks")

    def One(always_return_tuples_of_datasets=False):  # noqa: N802 - named as in the package
        assert always_return_tuples_of_datasets
        return (part(30),), (part(20, 4, "test one"),)

    def Two(always_return_tuples_of_datasets=False):  # noqa: N802
        return (part(30), part(40)), (part(20, 4, "same"), part(25, 5, "same"))

    def Wide(always_return_tuples_of_datasets=False):  # noqa: N802
        return (part(30, y=np.zeros((30, 2))),), (part(20, 4),)

    def Old(always_return_tuples_of_datasets=False):  # noqa: N802
        return part(30), part(20)

    def Offline(always_return_tuples_of_datasets=False):  # noqa: N802
        raise RuntimeError("name resolution failed")

    def helper(apply):
        return apply

    for each in (One, Two, Wide, Old, Offline, helper):
        setattr(module, each.__name__, each)
    parent = ModuleType(public_package.PACKAGE)
    monkeypatch.setitem(sys.modules, public_package.PACKAGE, parent)
    monkeypatch.setitem(sys.modules, module.__name__, module)
    monkeypatch.setattr(public_package, "is_installed", lambda: True)


def read(name):
    return read_data(name, find_benchmark(name), None)


def test_the_sets_are_the_functions_that_split_their_data(package):
    names = [f"{public_package.PACKAGE}:{each}" for each in ("One", "Two", "Wide", "Old", "Offline")]
    assert public_package.list_package_sets() == names


def test_a_set_has_the_split_and_the_initial_samples_of_the_package(package):
    data = read("nonlinear_benchmarks:One")
    assert (data.estimation.samples, data.estimation.dt) == (30, 0.5)
    test = data.tests["test one"]
    assert (test.record.samples, test.known, test.unscored) == (20, 4, 4)


def test_tests_of_equal_names_are_numbered(package):
    data = read("nonlinear_benchmarks:Two")
    assert data.estimation.segments == (30, 40)
    assert [test.known for test in data.tests.values()] == [4, 5]


def test_a_set_that_cannot_be_loaded_says_why(package):
    with pytest.raises(
        SettingsError, match=r"cannot load Offline, which it downloads.*name resolution failed"
    ):
        read("nonlinear_benchmarks:Offline")
    with pytest.raises(SettingsError, match="several outputs"):
        read("nonlinear_benchmarks:Wide")
    with pytest.raises(SettingsError, match="no initial samples"):
        read("nonlinear_benchmarks:Old")


def test_a_package_with_a_missing_import_is_an_error(monkeypatch):
    monkeypatch.setattr(public_package, "is_installed", lambda: True)
    monkeypatch.setitem(sys.modules, f"{public_package.PACKAGE}.benchmarks", None)
    with pytest.raises(SettingsError, match="a package that it imports is missing"):
        public_package.list_package_sets()


def test_unknown_sets_and_a_missing_package_are_errors(package, monkeypatch):
    with pytest.raises(SettingsError, match="take one of One"):
        find_benchmark("nonlinear_benchmarks:Three")
    monkeypatch.setattr(public_package, "is_installed", lambda: False)
    assert public_package.list_package_sets() == []
    with pytest.raises(SettingsError, match="pip install nonlinear-benchmarks"):
        find_benchmark("nonlinear_benchmarks:One")
