"""How far a run is, in words for a log: what begins, how much is done, and how long the rest will take."""

from collections.abc import Callable
from time import monotonic

from aliasbench.bench.run import Step
from aliasbench.bench.wording import duration, printable

FEW = 0.02  # of the steps: until they are done, compiling and other beginnings would pass for the pace of the rest
SILENCE_S = 30.0  # at most between two lines while one thing goes on


class ProgressLog:
    """Turns steps into lines: one for each thing begun, and now and then one while it goes on.

    Parameters
    ----------
    clock : callable
        Returns seconds, never going back.
    """

    def __init__(self, clock: Callable[[], float] = monotonic) -> None:
        self._clock = clock
        self._begun: float | None = None
        self._said_at = 0.0
        self._doing = ""

    def line(self, step: Step) -> str | None:
        """Return the line for a step, or None where there is nothing new to say."""
        now = self._clock()
        if self._begun is None:
            self._begun = now
        if step.doing == self._doing and now - self._said_at < SILENCE_S:
            return None
        self._doing, self._said_at = step.doing, now
        if step.total == 0:
            return printable(step.doing)
        text = f"[{step.done}/{step.total}] {printable(step.doing)}"
        if FEW * step.total <= step.done < step.total and step.done > 0:
            left = (now - self._begun) / step.done * (step.total - step.done)
            text += f", about {duration(max(round(left), 1))} left"
        return text
