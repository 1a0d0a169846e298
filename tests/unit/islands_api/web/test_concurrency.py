"""What waits is carried out in a thread, as if it were here, and never left behind."""

import asyncio
import threading
from collections.abc import Iterator
from contextvars import ContextVar

import pytest

from islands_api.web.concurrency import BlockingExecutor

who: ContextVar[str] = ContextVar("who", default="nobody")


@pytest.fixture
def threads() -> Iterator[BlockingExecutor]:
    opened = BlockingExecutor()
    yield opened
    opened.close()


def test_an_operation_runs_in_a_thread_and_what_it_returns_or_raises_comes_back(
    threads: BlockingExecutor,
) -> None:
    async def ask() -> None:
        assert await threads.run(threading.get_ident) != threading.get_ident()
        assert await threads.run(int, "ff", base=16) == 255
        with pytest.raises(ZeroDivisionError):
            await threads.run(lambda: 1 / 0)

    asyncio.run(ask())


def test_an_operation_knows_whose_request_it_serves(threads: BlockingExecutor) -> None:
    """Every line of the log has its request's id."""

    async def ask(name: str) -> str:
        who.set(name)
        await asyncio.sleep(0)
        return await threads.run(who.get)

    async def all_ask() -> list[str]:
        return await asyncio.gather(*(ask(name) for name in "abc"))

    assert asyncio.run(all_ask()) == ["a", "b", "c"]


def test_where_a_client_goes_away_its_operation_is_waited_for(threads: BlockingExecutor) -> None:
    """What it works with, a file that is received perhaps, is closed only then."""
    begun, go_on, ended = threading.Event(), threading.Event(), threading.Event()

    def operation() -> None:
        begun.set()
        go_on.wait(10.0)
        ended.set()

    async def leave() -> None:
        request = asyncio.create_task(threads.run(operation))
        await asyncio.to_thread(begun.wait, 10.0)
        request.cancel()
        await asyncio.sleep(0.05)
        assert not request.done()
        go_on.set()
        with pytest.raises(asyncio.CancelledError):
            await request
        assert ended.is_set()

    asyncio.run(leave())
