"""How the doors carry out what waits: in a thread, as if it were here, and never left behind."""

import asyncio
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextvars import ContextVar
from dataclasses import fields
from typing import Any

import pytest

from islands_api.doors import Doors

who: ContextVar[str] = ContextVar("who", default="nobody")


@pytest.fixture
def doors() -> Iterator[Doors]:
    with ThreadPoolExecutor(2) as threads:
        parts: dict[str, Any] = dict.fromkeys(field.name for field in fields(Doors))
        yield Doors(**{**parts, "threads": threads})


def test_an_operation_runs_in_a_thread_and_what_it_returns_or_raises_comes_back(doors: Doors) -> None:
    async def ask() -> None:
        assert await doors.do(threading.get_ident) != threading.get_ident()
        assert await doors.do(int, "ff", base=16) == 255
        with pytest.raises(ZeroDivisionError):
            await doors.do(lambda: 1 / 0)

    asyncio.run(ask())


def test_an_operation_knows_whose_request_it_serves(doors: Doors) -> None:
    """Every line of the log has its request's id."""

    async def ask(name: str) -> str:
        who.set(name)
        await asyncio.sleep(0)
        return await doors.do(who.get)

    async def all_ask() -> list[str]:
        return await asyncio.gather(*(ask(name) for name in "abc"))

    assert asyncio.run(all_ask()) == ["a", "b", "c"]


def test_where_a_client_goes_away_its_operation_is_waited_for(doors: Doors) -> None:
    """What it works with, a file that is received perhaps, is closed only then."""
    begun, go_on, ended = threading.Event(), threading.Event(), threading.Event()

    def operation() -> None:
        begun.set()
        go_on.wait(10.0)
        ended.set()

    async def leave() -> None:
        request = asyncio.create_task(doors.do(operation))
        await asyncio.to_thread(begun.wait, 10.0)
        request.cancel()
        await asyncio.sleep(0.05)
        assert not request.done()
        go_on.set()
        with pytest.raises(asyncio.CancelledError):
            await request
        assert ended.is_set()

    asyncio.run(leave())
