"""Sizes of an uploaded FMU are limited before anything of it is unpacked."""

import warnings
import zipfile

import pytest

from islands.errors import ModelError
from islands_service.intake import fmu_inspection
from islands_service.intake.fmu_inspection import _check_sizes


def write(path, *members):
    with warnings.catch_warnings(), zipfile.ZipFile(path, "w") as archive:
        warnings.simplefilter("ignore")  # about names that appear twice
        for name, size in members:
            archive.writestr(name, bytes(size))
    return str(path)


def test_a_name_that_appears_twice_is_counted_twice(tmp_path):
    path = write(tmp_path / "mass.fmu", ("resources/a", 600), ("resources/a", 600))
    _check_sizes(path, 1200)
    with pytest.raises(ModelError, match="unpacks to more than"):
        _check_sizes(path, 1199)


def test_a_description_has_a_further_limit(tmp_path, monkeypatch):
    monkeypatch.setattr(fmu_inspection, "_MAX_DESCRIPTION_BYTES", 500)
    path = write(tmp_path / "mass.fmu", ("modelDescription.xml", 501), ("modelDescription.xml", 1))
    with pytest.raises(ModelError, match=r"the modelDescription\.xml of .*mass\.fmu has more than"):
        _check_sizes(path, 10_000)
