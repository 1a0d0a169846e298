"""``islands identify`` with islands, through its front door, on every engine."""

import json
from pathlib import Path

import pytest

from islands_service.engines import ENGINES
from support.command_line import BUDGET, COLUMNS, fail, found, stored, succeed, write_hysteresis

ISLANDS = (
    *("--generations", 12, "--islands", 3, "--topology", "bidirectional-ring"),
    *("--migrate-every", "3,6:2", "--migrants", 2, "--emigrants", "front", "--replaced", "random"),
    *("--character", "plain", "--character", "explorer"),
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A record, and what every engine makes of it with three islands."""
    base = tmp_path_factory.mktemp("house")
    write_hysteresis(base / "record.csv")
    for engine in ENGINES:
        succeed(
            *("identify", base / "record.csv", *COLUMNS, *BUDGET, *ISLANDS),
            *("--engine", engine, "--out", base / engine),
        )
    return base


def test_every_engine_finds_the_same_bytes(folder: Path) -> None:
    results = [found(folder / engine) for engine in ENGINES]
    assert all(each == results[0] for each in results)
    assert len(results[0]) > 2
    searches = [stored(folder / engine)["search"] for engine in ENGINES]
    for name in ("evaluations", "duplicates", "outcomes", "generations", "ended_by"):
        assert all(each[name] == searches[0][name] for each in searches), name


def test_a_result_says_how_its_islands_lived(folder: Path) -> None:
    result = stored(folder / "ray")
    settings = result["settings"]
    assert (settings["islands"], settings["topology"], settings["migrate_every"]) == (
        *(3, "bidirectional-ring"),
        "3,6:2",
    )
    assert settings["characters"] == ["plain", "explorer"]
    assert "engine" not in settings
    assert result["search"]["evaluations"] == 3 * 13 * 30
    assert result["search"]["ended_by"] == "generations"
    assert (folder / "ray/figures/islands.svg").exists()


def test_isolated_islands_find_at_least_what_the_first_finds_alone(folder: Path) -> None:
    best = []
    for count in (1, 3):
        out = folder / f"isolated-{count}"
        succeed(
            *("identify", folder / "record.csv", *COLUMNS, *BUDGET, "--generations", 12, "--out", out),
            *("--islands", count, "--topology", "isolated", "--engine", "serial"),
        )
        assert stored(out)["search"]["evaluations"] == count * 13 * 30
        sizes: dict[int, float] = {}
        for each in json.loads((out / "hall.json").read_text())["hall"]:
            sizes.setdefault(len(each["regressors"]), each["fitness"])
        best.append(sizes)
    alone, together = best
    assert all(together[size] <= fitness for size, fitness in alone.items())
    assert any(together[size] < fitness for size, fitness in alone.items())


def test_a_run_goes_on_with_another_engine(folder: Path) -> None:
    out = folder / "moved"
    base = ("identify", folder / "record.csv", *COLUMNS, *BUDGET, *ISLANDS)
    said = succeed(*base, "--max-evaluations", 600, "--engine", "ray", "--out", out)
    assert "MAPE val. %" in said
    # Three islands of thirty: generation 6 is the first stop with 600 individuals behind it.
    assert stored(out)["search"]["ended_by"] == "evaluations"
    assert stored(out)["search"]["generations"] == 6
    document = (out / "checkpoint.json").read_text()
    (out / "checkpoint.json").write_text(document.replace('"max_evaluations": 600', '"max_evaluations": 0'))
    succeed("identify", "--resume", out, "--engine", "serial")
    assert found(out) == found(folder / "ray")


def test_what_makes_no_sense_is_refused_in_a_line(folder: Path) -> None:
    base = ("identify", folder / "record.csv", *COLUMNS, "--out", folder / "never")
    for options, message in (
        (("--islands", 0), "islands is at least 1, got 0"),
        (("--islands", 1_000_000), "at most 10000 islands"),
        (("--topology", "spiral"), "unknown topology 'spiral': take one of isolated, ring"),
        (("--islands", 3, "--topology", "0>7"), "does not join two of the islands 0 to 2"),
        (("--migrate-every", "often"), "cannot read migrate_every 'often'"),
        (("--engine", "steam"), "unknown engine 'steam': take one of serial, ray"),
        (("--character", "grumpy"), "unknown character 'grumpy'"),
        (("--ray-address", "127.0.0.1:9"), "no Ray cluster answers at 127.0.0.1:9"),
    ):
        assert message in fail(*base, *options)
    assert not (folder / "never/result.json").exists()
