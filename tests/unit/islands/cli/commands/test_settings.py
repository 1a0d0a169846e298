"""``islands settings``: what ``--set`` can change."""

from islands.facade.fit_settings import FitSettings
from islands.settings_schema import list_settings
from support.command_line import fail, succeed


def test_every_setting_of_a_command_is_listed_with_default_and_values() -> None:
    lines = succeed("settings", "fit").splitlines()
    assert "  max_terms: an integer of at least 1, by default 10" in lines
    assert "  gaps: one of split, interpolate" in lines
    for name, info, _ in list_settings(FitSettings):
        assert any(line.startswith(f"  {name}: ") for line in lines), info


def test_a_command_without_settings_is_named() -> None:
    assert "there is no command 'fti' with settings" in fail("settings", "fti")
