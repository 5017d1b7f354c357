"""What may be kept in a record, and how failures are worded."""

import math

import numpy as np
import pytest

from aliasbench.bench.attempt import Attempt
from aliasbench.bench.quality import MetricError, describe_nonfinite, plain
from aliasbench.scenes.errors import InputError, UnsupportedScene


def test_records_hold_plain_numbers_lists_and_texts() -> None:
    value = {"a": np.float32(0.5), 3: (np.int64(2), True, None, np.bool_(False)), "b": np.array([[1.0, 2.0]])}
    found = plain(value)
    assert found == {"a": 0.5, "3": [2, True, None, False], "b": [[1.0, 2.0]]}
    assert isinstance(found, dict)
    assert [type(v) for v in found["3"]] == [int, bool, type(None), bool]


@pytest.mark.parametrize("bad", [math.nan, np.float32("inf"), [0.0, -math.inf], {"a": np.array([np.nan])}])
def test_records_hold_no_number_that_is_not_finite(bad: object) -> None:
    with pytest.raises(ValueError, match="is not finite"):
        plain(bad)


def test_records_hold_nothing_that_json_has_no_form_for() -> None:
    with pytest.raises(TypeError, match="set cannot be kept in a record"):
        plain({"a": {1, 2}})


def test_the_first_bad_value_is_named_by_frame_row_and_column() -> None:
    test = np.zeros((2, 3, 4, 5, 3), np.float32)
    assert describe_nonfinite(test) is None
    test[1, 2, 3, 4, 0] = np.nan
    assert describe_nonfinite(test) == "1 values are not finite, the first in frame 2 at row 3, column 4"
    assert describe_nonfinite(test[1]) == "1 values are not finite, the first in frame 2 at row 3, column 4"


@pytest.mark.parametrize(
    ("error", "status", "reason"),
    [
        (InputError("msaa=3: the device has 4"), "failed", "msaa=3: the device has 4"),
        (UnsupportedScene("no dispersion"), "unsupported", "no dispersion"),
        (MetricError("metrics: x"), "failed", "metrics: x"),
        (ZeroDivisionError("a\n  b"), "failed", "ZeroDivisionError: a b"),
        (Exception(), "failed", "Exception"),
    ],
)
def test_whatever_breaks_has_a_status_a_reason_and_a_trace(error: Exception, status: str, reason: str) -> None:
    with Attempt() as attempt:
        raise error
    assert (attempt.status, attempt.reason) == (status, reason)
    assert attempt.trace is not None
    assert "test_quality" in attempt.trace


@pytest.mark.parametrize("signal", [KeyboardInterrupt, SystemExit])
def test_interruptions_are_no_failures(signal: type[BaseException]) -> None:
    with pytest.raises(signal), Attempt():
        raise signal


def test_what_does_not_break_is_ok() -> None:
    with Attempt() as attempt:
        pass
    assert (attempt.status, attempt.reason, attempt.trace) == ("ok", None, None)
