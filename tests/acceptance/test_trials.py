"""``islands trials`` through its front door."""

import json
from pathlib import Path

import pytest
from front_door import fail, succeed

pytestmark = [pytest.mark.xdist_group("ray"), pytest.mark.slow]


def test_trials_are_counted_and_the_same_each_time(tmp_path: Path) -> None:
    asked = ("trials", "--effects", "offset", "--effects", "cubic-stiffness", "--count", 1, "--clean", 2)
    more = ("--open-set", 0, "--pairs", 1, "--seconds", 20, "--seed", 7)
    said = [succeed(*asked, *more, "--json", tmp_path / name) for name in ("first.json", "again.json")]
    assert "pairs exact" in said[0]
    assert (tmp_path / "first.json").read_text() == (tmp_path / "again.json").read_text()
    document = json.loads((tmp_path / "first.json").read_text())
    assert len(document["outcomes"]) == 5
    assert {share["name"]: share["of"] for share in document["shares"]}["pairs exact"] == 1


def test_what_nobody_can_hide_is_refused() -> None:
    assert "nobody knows how to hide gravity" in fail("trials", "--effects", "gravity")
    assert "take white or ar" in fail("trials", "--noise", "pink")
