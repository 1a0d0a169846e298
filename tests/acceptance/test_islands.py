"""The command ``islands identify`` with several islands: settings, and equal results on all engines."""

from pathlib import Path

import pytest

from support.command_line import BUDGET, COLUMNS, found, stored, succeed, write_hysteresis
from support.undrawn import undrawn_figures

#: Options of three islands with a migration schedule.
ISLANDS = (
    *("--generations", 6, "--islands", 3, "--set", "topology=bidirectional-ring"),
    *(
        *("--set", "migrate_every=2,4:1", "--set", "migrants=2", "--set", "emigrants=front"),
        *("--set", "replaced=random"),
    ),
    *("--set", "characters=plain,explorer"),
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Record of 1000 samples, and the result of three islands with the serial engine."""
    base = tmp_path_factory.mktemp("islands")
    write_hysteresis(base / "record.csv")
    lines = (base / "record.csv").read_text().splitlines(keepends=True)
    (base / "record.csv").write_text("".join(lines[:1001]))
    identify(base, "serial", *ISLANDS, "--engine", "serial")
    return base


def identify(base: Path, out: str, *options: object) -> str:
    """Identify the record with empty figures."""
    with undrawn_figures():
        return succeed(
            *("identify", base / "record.csv", *COLUMNS, *BUDGET, *options),
            *("--figures", "islands", "--out", base / out),
        )


@pytest.mark.nightly
def test_run_on_a_local_ray_resumes_with_another_engine(folder: Path) -> None:
    out = folder / "moved"
    printed = identify(folder, "moved", *ISLANDS, "--set", "max_evaluations=250", "--engine", "ray")
    assert "MAPE val. %" in printed
    # Three islands of thirty: generation 2 is the first end of an epoch after 250 individuals.
    assert stored(out)["search"]["ended_by"] == "evaluations"
    assert stored(out)["search"]["generations"] == 2
    document = (out / "checkpoint.json").read_text()
    (out / "checkpoint.json").write_text(document.replace('"max_evaluations": 250', '"max_evaluations": 0'))
    with undrawn_figures():
        succeed("identify", "--resume", out, "--engine", "serial")
    assert found(out) == found(folder / "serial")
