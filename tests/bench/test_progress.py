"""Progress in a log."""

from aliasbench.bench.progress import SILENCE_S, ProgressLog
from aliasbench.bench.run import Step


def test_a_line_is_said_when_something_begins_with_the_time_that_is_left() -> None:
    now = [100.0]
    log = ProgressLog(lambda: now[0])
    assert log.line(Step("one", 0, 40)) == "[0/40] one"
    now[0] += 5.0
    assert log.line(Step("one", 5, 40)) is None
    now[0] += 5.0
    assert log.line(Step("two\x1b", 10, 40)) == r"[10/40] two\x1b, about 30 s left"
    now[0] += SILENCE_S
    assert log.line(Step("two\x1b", 20, 40)) == r"[20/40] two\x1b, about 40 s left"
    assert log.line(Step("done", 40, 40)) == "[40/40] done"


def test_a_remark_that_counts_nothing_is_said_without_numbers() -> None:
    assert ProgressLog(lambda: 0.0).line(Step("nothing left to do", 0, 0)) == "nothing left to do"


def test_no_time_is_foretold_from_the_first_few_steps_which_compile() -> None:
    times = iter((0.0, 11.0, 12.0))
    log = ProgressLog(lambda: next(times))
    assert log.line(Step("one", 0, 1000)) == "[0/1000] one"
    assert log.line(Step("two", 1, 1000)) == "[1/1000] two"
    assert log.line(Step("three", 20, 1000)) == "[20/1000] three, about 10 min left"
