"""Where a renderer's failure ends: it becomes a reason in a record, and the run goes on."""

import traceback
from dataclasses import dataclass
from types import TracebackType
from typing import Self

from aliasbench.bench.quality import MetricError
from aliasbench.scenes.errors import InputError, UnsupportedScene


@dataclass(slots=True)
class Attempt:
    """A context in which whatever breaks is kept, not raised: the one place where a renderer's failure ends.

    `except Exception` would do the same; here the reason and its trace are data that the record needs. Ctrl-C and exits
    are no failures and pass through.
    """

    error: Exception | None = None
    trace: str | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> bool:
        if not isinstance(error, Exception):
            return False
        self.error = error
        self.trace = "".join(traceback.format_exception(error))
        return True

    @property
    def status(self) -> str:
        """The record's status: "ok", "unsupported" or "failed"."""
        if self.error is None:
            return "ok"
        return "unsupported" if isinstance(self.error, UnsupportedScene) else "failed"

    @property
    def reason(self) -> str | None:
        """The record's sentence; the kind of error is named where its text alone was not written for users."""
        if self.error is None:
            return None
        text = " ".join(str(self.error).split())
        if isinstance(self.error, (InputError, UnsupportedScene, MetricError)) and text:
            return text
        return f"{type(self.error).__name__}: {text}" if text else type(self.error).__name__
