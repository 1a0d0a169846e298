"""Checkpoints: exact round trips, atomic writes, and errors for damaged files."""

import json
import os
from dataclasses import replace
from math import inf
from pathlib import Path

import pytest

from islands.errors import ModelError
from islands.evolution.archipelago import Archipelago, Island, empty_archipelago
from islands.evolution.hall_of_fame import HallOfFame, merge, with_entries
from islands.evolution.individual import Individual, make_regressor
from islands.expressions.parsing import parse
from islands.expressions.primitives import PRIMITIVES
from islands.expressions.tree import Apply, Constant
from islands.expressions.user_primitive import primitive
from islands.models.narx import canonical_order
from islands.persistence import checkpoints
from islands.persistence.checkpoints import (
    read_checkpoint,
    write_checkpoint,
    write_hall,
)
from islands.simulation.outcome import OK, EvaluationOutcome, Status

#: Floats that only an exact round trip preserves.
FLOATS = (0.1 + 0.2, 5e-324, -1.7976931348623157e308, 1 / 3, -0.0, 1e22)

GENES = (
    "y(k-1)",
    "q5(q5(q1(u(k-1))))",
    "phi1(q1(u2(k-1)), q5(q4(u2(k-1))))*y(k-3)",
    "mul(mul(u1(k-1), y(k-1)), mul(u1(k-1), q2(mul(y(k-1), y(k-1)))))",
    "q3(tanh(q2(y(k-1)) - 0.30000000000000004*u1(k-1)))/exp(-1e-300)",
    "2.5",
)


def individual(*texts, fitness=0.5, outcome=OK):
    genes = tuple(parse(text) for text in texts)
    regressors = tuple(canonical_order(make_regressor(gene) for gene in genes))
    theta = tuple(FLOATS[: len(regressors)]) if outcome else ()
    return Individual(genes, regressors, theta, fitness, outcome)


def archipelago():
    good = individual(*GENES, fitness=1 / 3)
    failed = individual(
        "u1(k-1)", fitness=inf, outcome=EvaluationOutcome(Status.INFEASIBLE, 'no "y" at rest \u2013 add it')
    )
    # Equal genes with different texts.
    unevaluated = Individual((parse("phi1(u1(k-1), u1(k-1))"), Constant(0.0), Constant(-0.0)))
    abandoned = individual(
        "y(k-3)", fitness=inf, outcome=EvaluationOutcome(Status.ABANDONED, "beyond the bar")
    )
    population = (good, failed, unevaluated, individual("y(k-2)", fitness=5e-324), abandoned)
    hall = with_entries(HallOfFame(), population)
    assert len(hall.entries) == 2
    here = Island(0, 2**40, 7, population, population[:1], hall, 0.1 + 0.2)
    second = replace(here, index=1, population=population[::-1], elite=(), abandon_threshold=inf)
    return Archipelago((here, second))


#: Islands without individuals.
EMPTY = empty_archipelago(2, 5)


ABOUT = {
    "job": {"record": "record.csv", "seed": 3},
    "history": [[0, 200, {"1": 0.1 + 0.2}, [0.1 + 0.2, None]]],
}


@pytest.fixture
def path(tmp_path):
    return tmp_path / "checkpoint.json"


@pytest.fixture
def document(path):
    write_checkpoint(archipelago(), path, ABOUT)
    return json.loads(path.read_text())


def test_an_archipelago_is_read_back_exactly(path):
    write_checkpoint(archipelago(), path, ABOUT)
    read, about = read_checkpoint(path)
    assert read == archipelago()
    assert about == ABOUT
    # Float equality ignores the sign of zero, and regressor equality compares texts only.
    assert repr(read) == repr(archipelago())


@pytest.mark.parametrize("size", [1, 7, 1 << 20])
@pytest.mark.parametrize("indent", [None, 1])
def test_a_checkpoint_is_read_in_pieces_of_any_size(document, path, monkeypatch, size, indent):
    monkeypatch.setattr(checkpoints, "_PIECE", size)
    path.write_text(json.dumps({"number": 10**30, **document}, indent=indent))
    assert read_checkpoint(path) == (archipelago(), ABOUT)
    for damage in ("]", ",", "{}", '"'):
        path.write_text(json.dumps(document) + damage)
        with pytest.raises(ModelError, match="cannot read the checkpoint"):
            read_checkpoint(path)


def test_user_defined_primitives_are_read_back_from_their_table(path):
    def _twice(a: float) -> float:
        return 2.0 * a

    table = {**PRIMITIVES, "twice": primitive("twice", _twice)}
    gene = Apply(table["twice"], (parse("u(k-1)"),))
    own = Individual((gene,), (make_regressor(gene),), (1.0,), 0.25)
    kept = Archipelago((Island(0, 0, 0, (own,), (own,), HallOfFame((own,))),))
    write_checkpoint(kept, path, {})
    assert read_checkpoint(path, table)[0] == kept
    with pytest.raises(ModelError, match=r"checkpoint\.json: unknown function 'twice': .*primitives="):
        read_checkpoint(path)


@pytest.mark.parametrize("name", ["index", "seed", "generation", "population", "elite", "hall", "bar"])
def test_an_island_with_a_missing_part_is_refused(document, path, name):
    """An island without ``bar`` has the first schema, in which no evaluations were abandoned."""
    del document["islands"][1][name]
    path.write_text(json.dumps(document))
    with pytest.raises(ModelError, match=f"checkpoint.json is damaged: KeyError\\('{name}'\\)"):
        read_checkpoint(path)


def test_a_crash_before_replacing_keeps_the_old_checkpoint(path, monkeypatch):
    write_checkpoint(EMPTY, path, {"epoch": "old"})

    def crash(self, target):
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(Path, "replace", crash)
        with pytest.raises(KeyboardInterrupt):
            write_checkpoint(archipelago(), path, {"epoch": "new"})
    assert read_checkpoint(path) == (EMPTY, {"epoch": "old"})
    write_checkpoint(archipelago(), path, {"epoch": "new"})
    assert read_checkpoint(path) == (archipelago(), {"epoch": "new"})
    assert [entry.name for entry in path.parent.iterdir()] == ["checkpoint.json"]


# Atomic replacement.


def test_a_crash_while_writing_keeps_the_old_checkpoint(path, monkeypatch):
    write_checkpoint(EMPTY, path, {"epoch": "old"})

    def full(_number):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space left"):
        write_checkpoint(archipelago(), path, {"epoch": "new"})
    assert read_checkpoint(path) == (EMPTY, {"epoch": "old"})


def test_a_checkpoint_is_synced_before_it_replaces_the_old_one(path, monkeypatch):
    order = []
    synchronise, put = os.fsync, Path.replace
    monkeypatch.setattr(os, "fsync", lambda number: (order.append("synchronised"), synchronise(number))[1])
    monkeypatch.setattr(Path, "replace", lambda self, to: (order.append("replaced"), put(self, to))[1])
    write_checkpoint(archipelago(), path, {})
    assert order == ["synchronised", "replaced"]


# Hall of fame files.


def halls():
    """One hall of fame, built in two orders and from differently written expressions."""
    found = [
        individual(*GENES, fitness=1 / 3),
        individual("y(k-2)", "u1(k-1)*y(k-1)", fitness=0.25),
        individual("y(k-3)", fitness=5e-324),
        individual("y(k-4)", fitness=1e300),
    ]
    otherwise = individual("mul(y(k-1), u1(k-1))", "q1(y(k-1))", fitness=0.25)
    one = with_entries(HallOfFame(), found)
    parts = [with_entries(HallOfFame(), each) for each in ([found[2], otherwise], [found[0], *found[2:]])]
    return one, merge(parts)


def test_equal_halls_are_the_same_bytes_from_any_search(tmp_path):
    one, other = halls()
    assert [entry.size for entry in one.entries] == [1, 1, 2, 6]
    write_hall(one, tmp_path / "one.json")
    write_hall(other, tmp_path / "other.json")
    assert (tmp_path / "one.json").read_bytes() == (tmp_path / "other.json").read_bytes()
    assert {path.name for path in tmp_path.iterdir()} == {"one.json", "other.json"}


def test_a_hall_is_replaced_atomically(tmp_path, monkeypatch):
    path = tmp_path / "hall.json"
    write_hall(HallOfFame(), path)
    before = path.read_bytes()

    def crash(self, target):
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "replace", crash)
    with pytest.raises(KeyboardInterrupt):
        write_hall(halls()[0], path)
    assert path.read_bytes() == before


# Invalid checkpoints are refused with a message that names the file.


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(ModelError, match=r"cannot read the checkpoint .*nothing\.json: .*No such file"):
        read_checkpoint(tmp_path / "nothing.json")
    with pytest.raises(ModelError, match="cannot read the checkpoint"):
        read_checkpoint(tmp_path)


def test_a_file_truncated_at_any_position_is_refused(document, path):
    whole = path.read_bytes()
    for end in (0, 1, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:end])
        with pytest.raises(ModelError, match=r"cannot read the checkpoint .*checkpoint\.json"):
            read_checkpoint(path)


@pytest.mark.parametrize(
    "content", [b"\xff\xfe\x00", b"y = a*b", b"[" * 100_000, b'{"about": ' + b"[" * 100_000, b"[]", b"3"]
)
def test_a_foreign_file_is_refused(path, content):
    path.write_bytes(content)
    with pytest.raises(ModelError, match="cannot read the checkpoint"):
        read_checkpoint(path)


@pytest.mark.parametrize(
    "foreign",
    [
        {},
        {"schema": "islands.model/1"},
        {"islands": 3},
        {"schema": "islands.hall/1"},
        {"schema": "islands.checkpoint/2"},
    ],
)
def test_another_schema_is_refused(path, foreign):
    path.write_text(json.dumps(foreign))
    with pytest.raises(
        ModelError, match=r"checkpoint\.json is not a checkpoint of schema islands\.checkpoint/3"
    ):
        read_checkpoint(path)


@pytest.mark.parametrize(
    "changed", [{"islands": []}, {"islands": [0, 8]}, {"islands": [7, 6]}, {"islands": [-1, 7]}]
)
def test_islands_at_different_generations_are_refused(document, path, changed):
    """A checkpoint without islands has no generation and is refused too."""
    pairs = list(zip(document["islands"], changed["islands"], strict=False))
    for island, generation in pairs:
        island["generation"] = generation
    document["islands"] = [island for island, _ in pairs]
    path.write_text(json.dumps(document))
    with pytest.raises(ModelError, match=r"checkpoint\.json: its islands are at different generations"):
        read_checkpoint(path)


@pytest.mark.parametrize(
    ("place", "value"),
    [
        (("islands",), 5),
        (("islands", 0), []),
        (("islands", 0, "index"), None),
        (("islands", 0, "generation"), "seven"),
        (("islands", 0, "bar"), "high"),
        (("islands", 0, "bar"), []),
        (("islands", 0, "population"), 3),
        (("islands", 0, "population", 0, "genes", 0), "y(k-"),
        (("islands", 0, "population", 0, "genes", 0), "os.remove(k-1)"),
        (("islands", 0, "population", 0, "genes", 0), 7),
        (("islands", 0, "population", 0, "regressors", 0), None),
        (("islands", 0, "population", 0, "theta", 0), "much"),
        (("islands", 0, "population", 0, "theta"), None),
        (("islands", 0, "population", 0, "fitness"), "best"),
        (("islands", 0, "population", 0, "outcome"), ["FINE", ""]),
        (("islands", 0, "population", 0, "outcome"), "OK"),
        (("about",), 3),
    ],
)
def test_a_damaged_part_is_refused(document, path, place, value):
    part = document
    for step in place[:-1]:
        part = part[step]
    part[place[-1]] = value
    path.write_text(json.dumps(document))
    with pytest.raises(ModelError, match=r"the checkpoint .*checkpoint\.json( is damaged)?: "):
        read_checkpoint(path)
