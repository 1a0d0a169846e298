"""Where the command line writes: results to standard output, progress and errors to standard error."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from islands.warm_up import warm_up

output = Console(highlight=False, soft_wrap=True)
errors = Console(stderr=True, highlight=False, soft_wrap=True)


@contextmanager
def progress(title: str) -> Iterator[Callable[[str, float], None]]:
    """Show a moving bar while something runs; call what is yielded with a text and the share done."""
    columns = (
        SpinnerColumn(),
        TextColumn("{task.fields[title]}"),
        BarColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.description}"),
    )
    with Progress(*columns, console=errors, transient=True) as bar:
        task = bar.add_task("", total=1.0, title=title)
        yield lambda text, share: bar.update(task, description=text, completed=share)


def compile_kernels() -> None:
    """Compile the kernels where that has not been done, and show that it goes on."""
    with ExitStack() as stack:

        def tell(line: str) -> None:
            errors.print(line, markup=False)
            stack.enter_context(progress("kernels"))("", 0.0)

        warm_up(tell)
