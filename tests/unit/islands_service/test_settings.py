"""Settings: environment variables, ranges, and the environment of child processes."""

import importlib
import os

import pytest

from islands.errors import SettingsError
from islands_service.settings import ServiceSettings, service_settings


@pytest.fixture(autouse=True)
def clean(monkeypatch):
    for name in list(os.environ):
        if name.startswith("ISLANDS_"):
            monkeypatch.delenv(name)


def test_arguments_precede_the_environment_and_that_precedes_defaults(monkeypatch, tmp_path):
    assert service_settings(data_dir=tmp_path).port == 8000
    monkeypatch.setenv("ISLANDS_PORT", "9000")
    assert service_settings(data_dir=tmp_path).port == 9000
    assert service_settings(data_dir=tmp_path, port=9001).port == 9001
    assert service_settings(data_dir=tmp_path, port=None).port == 9000


@pytest.mark.parametrize(("cores", "coordinators"), [(1, 1), (2, 2), (64, 4)])
def test_one_coordinator_for_each_core_is_the_default_up_to_four(monkeypatch, cores, coordinators):
    module = importlib.import_module("islands_service.settings")
    monkeypatch.setattr(module, "count_cpus", lambda: cores)
    assert service_settings().coordinators == coordinators
    assert service_settings(coordinators=0).coordinators == 0


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("port", "70000"),
        ("port", "-1"),
        ("port", "http"),
        ("lease", "0"),
        ("lease", "nan"),
        ("checkpoint_every", "-1"),
        ("max_upload", "0"),
        ("max_islands", "0"),
        ("max_running_islands", "0"),
        ("max_run_seconds", "0"),
        ("max_active", "many"),
        ("inspection_seconds", "0"),
        ("rate", "-1"),
        ("burst", "0"),
        ("retention", "-1"),
        ("audit_retention", "-1"),
        ("coordinators", "65"),
        ("log_format", "xml"),
        ("require_keys", "perhaps"),
    ],
)
def test_value_out_of_range_is_refused_with_the_name_of_its_setting(monkeypatch, name, value):
    monkeypatch.setenv(f"ISLANDS_{name.upper()}", value)
    with pytest.raises(SettingsError, match=rf"setting {name} \(ISLANDS_{name.upper()}\): .+"):
        service_settings()


def test_database_is_read_from_a_file_which_child_processes_read_again(monkeypatch, tmp_path):
    path = tmp_path / "database"
    path.write_text("postgresql+psycopg://me:secret@host/islands\n")
    monkeypatch.setenv("ISLANDS_DATABASE_FILE", str(path))
    given = service_settings(data_dir=tmp_path)
    assert given.url == "postgresql+psycopg://me:secret@host/islands"
    environment = given.environment()
    assert "secret" not in repr(environment)
    monkeypatch.setattr(os, "environ", environment)
    assert service_settings() == given


def test_database_and_its_file_are_not_both_given(monkeypatch, tmp_path):
    (tmp_path / "database").write_text("sqlite://")
    monkeypatch.setenv("ISLANDS_DATABASE_FILE", str(tmp_path / "database"))
    with pytest.raises(SettingsError, match="give either ISLANDS_DATABASE or ISLANDS_DATABASE_FILE"):
        service_settings(database="sqlite:///other.db")
    monkeypatch.setenv("ISLANDS_DATABASE_FILE", str(tmp_path / "missing"))
    with pytest.raises(SettingsError, match=r"cannot read the file of ISLANDS_DATABASE_FILE.*missing"):
        service_settings()


@pytest.mark.parametrize("host", ["127.0.0.1", "::1", "localhost"])
def test_loopback_address_needs_no_key_unless_keys_are_required(host):
    assert not ServiceSettings(host=host).keys_needed
    assert ServiceSettings(host=host).allow_fmus
    shared = ServiceSettings(host=host, require_keys=True)
    assert (shared.keys_needed, shared.allow_fmus) == (True, False)


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.168.0.7", "islands.example.org", ""])
def test_other_addresses_need_keys(host):
    assert ServiceSettings(host=host).keys_needed
    assert not ServiceSettings(host=host).allow_fmus
