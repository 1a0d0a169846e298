"""Progress of a command on the terminal: a bar, the time left, and lines below it."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from functools import partial
from threading import Thread
from time import monotonic
from typing import Protocol

from rich.console import Group
from rich.live import Live
from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    SpinnerColumn,
    Task,
    TextColumn,
    TimeElapsedColumn,
)
from rich.text import Text

from islands.cli.console import errors
from islands.cli.stop_requests import end_at_once
from islands.progress import MIN_FRACTION, TimeLeft

#: Seconds between two checks whether another thread has ended.
_JOIN_SECONDS = 0.1


class Display(Protocol):
    """Progress callback that can show lines below its bar."""

    def __call__(
        self,
        message: str | None = None,
        fraction: float | None = None,
        /,
        lines: Sequence[str] | None = None,
        seconds_left: float | None = None,
    ) -> None:
        """Show a message next to the bar, the completed fraction, and lines below the bar.

        Message and lines stay until others are given. The time left follows from the fractions, unless it is
        given.
        """
        ...


class FractionColumn(ProgressColumn):
    """The completed fraction, and the time left.

    Parameters
    ----------
    left : TimeLeft
        Estimate by the clock of the bar.
    """

    def __init__(self, left: TimeLeft) -> None:
        super().__init__()
        self._left = left

    def render(self, task: Task) -> Text:
        """Return the text; it is empty before the first fraction."""
        if not task.completed:
            return Text()
        left = self._left.at(task.get_time())
        return Text(f"{task.completed:.0%}{'' if left is None else f', {format_duration(left)} left'}")


def format_duration(seconds: float) -> str:
    """Return a duration as text."""
    return f"{seconds:.0f} s" if seconds < 100 else f"{seconds / 60:.0f} min"


@contextmanager
def progress(title: str, least: float = MIN_FRACTION) -> Iterator[Display]:
    """Show a progress bar during the context.

    Parameters
    ----------
    least : float
        Fraction from which the time left is shown.
    """
    left = TimeLeft(monotonic(), least)
    columns = (
        SpinnerColumn(),
        TextColumn("{task.fields[title]}"),
        BarColumn(),
        TimeElapsedColumn(),
        FractionColumn(left),
        TextColumn("{task.description}"),
    )
    bar = Progress(*columns, console=errors, get_time=monotonic)
    task = bar.add_task("", total=1.0, title=title)
    # The thread that refreshes the bar takes time from the command; a file or a pipe shows no bar.
    shown = errors.is_terminal
    with Live(bar, console=errors, transient=True, refresh_per_second=10, auto_refresh=shown) as live:

        def show(
            message: str | None = None,
            fraction: float | None = None,
            /,
            lines: Sequence[str] | None = None,
            seconds_left: float | None = None,
        ) -> None:
            if fraction is not None:
                left.update(fraction, monotonic())
            if seconds_left is not None:
                left.expect(seconds_left, monotonic())
            bar.update(task, description=message, completed=fraction)
            if lines is not None:
                live.update(Group(bar, *(Text(line) for line in lines)))

        yield show


def compile_kernels() -> None:
    """Compile the kernels if they are not in the cache, with a progress bar, and prepare for a long run."""
    # Imported here because other commands must start fast.
    from islands.kernels.jit_cache import are_stored  # noqa: PLC0415
    from islands.processes import freeze_garbage_collector  # noqa: PLC0415

    if are_stored():
        freeze_garbage_collector()
        return
    # It loads most of the core.
    from islands.facade.warm_up import warm_up  # noqa: PLC0415

    with ExitStack() as stack:

        def announce(line: str) -> None:
            errors.print(line, markup=False)
            stack.enter_context(progress("kernels"))("", 0.0)

        freeze_garbage_collector()  # before the compilation, which makes many objects
        try:
            _call_in_thread(partial(warm_up, announce))
        except KeyboardInterrupt as interrupt:
            stack.close()
            end_at_once(interrupt)


def _call_in_thread(function: Callable[[], object]) -> None:
    """Call a function in another thread, so that this one handles signals while a library does not return."""
    raised: list[BaseException] = []

    def call() -> None:
        try:
            function()
        except BaseException as error:
            raised.append(error)

    thread = Thread(target=call, daemon=True)
    thread.start()
    while thread.is_alive():
        thread.join(_JOIN_SECONDS)  # a signal that another thread receives does not end a longer wait
    if raised:
        raise raised[0]
