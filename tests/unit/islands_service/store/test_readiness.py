"""Readiness: a brief check takes no time on a large file, and a complete one finds all damage."""

import threading
from collections.abc import Iterator
from pathlib import Path
from time import perf_counter

import pytest
from sqlalchemy import Connection

from islands_service.store import Store
from islands_service.store.database import DatabaseDamagedError
from support.processes import eventually

#: Size in bytes of the file of `large`.
SIZE = 40_000_000


@pytest.fixture
def large(tmp_path: Path) -> Iterator[tuple[Store, Path]]:
    """A store whose file has a table of `SIZE`, and the path of the file."""

    def write(connection: Connection) -> None:
        connection.exec_driver_sql("CREATE TABLE filler (content BLOB)")
        connection.exec_driver_sql(
            "WITH RECURSIVE numbers(n) AS (SELECT 1 UNION ALL SELECT n + 1 FROM numbers LIMIT ?) "
            "INSERT INTO filler SELECT zeroblob(1900) FROM numbers",
            (SIZE // 2000,),
        )

    with Store(f"sqlite:///{tmp_path / 'islands.db'}") as store:
        store.database.write(write)
        with store.database.engine.connect() as connection:
            connection.exec_driver_sql("PRAGMA wal_checkpoint(TRUNCATE)")
        yield store, tmp_path / "islands.db"


def is_ready(store: Store) -> bool:
    try:
        store.readiness.check()
    except DatabaseDamagedError:
        return False
    return True


def damage_last_page(path: Path) -> None:
    with path.open("r+b") as file:
        file.seek(path.stat().st_size - 4096)
        file.write(b"\xaa" * 4096)


@pytest.mark.ci
def test_a_check_of_a_large_database_is_brief(large: tuple[Store, Path]) -> None:
    store, _ = large
    began = perf_counter()
    store.readiness.check_file()
    complete = perf_counter() - began
    brief = []
    for _ in range(5):
        began = perf_counter()
        store.readiness.check()
        brief.append(perf_counter() - began)
    assert min(brief) < 0.25 * complete, (brief, complete)


@pytest.mark.ci
def test_damage_found_by_a_complete_check_is_remembered(
    large: tuple[Store, Path],
) -> None:
    store, path = large
    kept = path.read_bytes()
    damage_last_page(path)
    store.readiness.check()
    with pytest.raises(DatabaseDamagedError, match="pages of the database are damaged"):
        store.readiness.check_file()
    with pytest.raises(DatabaseDamagedError, match="pages of the database are damaged"):
        store.readiness.check()
    path.write_bytes(kept)
    store.readiness.check_file()
    store.readiness.check()


@pytest.mark.ci
def test_the_background_finds_damage_until_it_is_stopped(large: tuple[Store, Path]) -> None:
    store, path = large
    kept = path.read_bytes()
    damage_last_page(path)
    store.readiness.watch(0.0)
    eventually(lambda: not is_ready(store))
    path.write_bytes(kept)
    eventually(lambda: is_ready(store))
    store.readiness.stop()
    eventually(lambda: not any(each.name == "islands-readiness" for each in threading.enumerate()))
    damage_last_page(path)
    assert is_ready(store)
