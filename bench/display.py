"""What is shown while something goes on: on a terminal a spinner or a bar with the time left, elsewhere lines.

Everything goes to standard error, by the function that the command line hands in or by rich's console; nothing of it is
a result.
"""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic
from typing import TYPE_CHECKING

from aliasbench.bench.wording import printable

if TYPE_CHECKING:
    from aliasbench.bench.run import Step


SILENCE_S = 10.0  # between two lines about one picture


@contextmanager
def waiting(what: str, tell: Callable[[str], None]) -> Iterator[Callable[[float], None]]:
    """Yield a listener to the share that is done: a spinner on a terminal, elsewhere a line by `tell` now and then."""
    if not sys.stderr.isatty():
        said_at = monotonic()

        def say(share: float) -> None:
            nonlocal said_at
            if share < 1.0 and monotonic() - said_at >= SILENCE_S:
                said_at = monotonic()
                tell(printable(f"{what}: {share:.0%}"))

        yield say
        return
    from rich.console import Console
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = (SpinnerColumn(), TimeElapsedColumn(), TextColumn("{task.description}", markup=False))
    with Progress(*columns, console=Console(stderr=True), transient=True) as spinner:
        task = spinner.add_task(printable(what), total=None)
        yield lambda share: spinner.update(task, description=printable(f"{what}: {share:.0%}"))


@contextmanager
def progress(tell: Callable[[str], None]) -> "Iterator[Callable[[Step], None]]":
    """Yield a listener that shows how far a run is: a bar with the time left, or a line by `tell` for each begin."""
    from aliasbench.bench.progress import ProgressLog

    log = ProgressLog()

    def say(step: "Step") -> None:
        line = log.line(step)
        if line is not None:
            tell(line)

    if not sys.stderr.isatty():
        yield say
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

    columns = (BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(), TextColumn("{task.description}", markup=False))
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        tasks: list[TaskID] = []

        def show(step: "Step") -> None:
            if step.total == 0:
                bar.console.print(printable(step.doing), markup=False, highlight=False)
                return
            if not tasks:
                tasks.append(bar.add_task("", total=step.total))
            bar.update(tasks[0], completed=step.done, total=step.total, description=printable(step.doing))

        yield show
