"""The command ``islands identify`` with several islands: settings, and equal results on all engines."""

from pathlib import Path

import pytest

from support.command_line import BUDGET, COLUMNS, fail, found, stored, succeed, write_hysteresis
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


@pytest.mark.ci
def test_result_contains_the_settings_of_the_islands(folder: Path) -> None:
    result = stored(folder / "serial")
    settings = result["settings"]
    assert (settings["islands"], settings["topology"], settings["migrate_every"]) == (
        *(3, "bidirectional-ring"),
        "2,4:1",
    )
    assert settings["characters"] == ["plain", "explorer"]
    assert "engine" not in settings
    assert result["search"]["evaluations"] == 3 * 7 * 30
    assert result["search"]["ended_by"] == "generations"
    assert (folder / "serial/figures/islands.svg").exists()


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


@pytest.mark.ci
def test_invalid_island_options_are_rejected_in_one_line(folder: Path) -> None:
    base = ("identify", folder / "record.csv", *COLUMNS, "--out", folder / "never")
    for options, message in (
        (("--islands", 0), "islands is an integer from 1 to 10000, got '0'"),
        (("--islands", 1_000_000), "islands is an integer from 1 to 10000"),
        (("--set", "topology=spiral"), "unknown topology 'spiral': take one of isolated, ring"),
        (("--islands", 3, "--set", "topology=0>7"), "does not join two of the islands 0 to 2"),
        (("--set", "migrate_every=often"), "cannot read migrate_every 'often'"),
        (("--engine", "steam"), "engine is one of serial, ray, got 'steam'"),
        (("--set", "characters=grumpy"), "unknown character 'grumpy'"),
        (("--set", "ray_address=127.0.0.1:9"), "no Ray cluster answers at 127.0.0.1:9"),
    ):
        assert message in fail(*base, *options)
    assert not (folder / "never/result.json").exists()
