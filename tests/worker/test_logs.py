from __future__ import annotations

import json
import logging
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from worker import logs
from worker.settings import Settings


@pytest.fixture(autouse=True)
def root() -> Iterator[None]:
    """The root logger is ours for a while."""
    logger = logging.getLogger()
    handlers, level = logger.handlers, logger.level
    yield
    logger.handlers, logger.level = handlers, level


def records(capsys: pytest.CaptureFixture[str]) -> list[dict[str, Any]]:
    return [json.loads(line) for line in capsys.readouterr().err.splitlines()]


def test_a_record_for_programs_names_its_job(capsys: pytest.CaptureFixture[str]) -> None:
    logs.start(Settings(log_format="json"))
    logger = logging.getLogger("worker.tasks")
    with logs.about("abc"):
        logger.warning("attempt %d\nof 3", 2)
    logger.debug("not told")
    logger.info("done")
    inside, outside = records(capsys)
    assert inside["job"] == "abc"
    assert (inside["message"], inside["level"], inside["logger"]) == (
        "attempt 2\nof 3",
        "warning",
        "worker.tasks",
    )
    assert inside["time"].endswith("Z")
    assert "job" not in outside


def test_an_exception_is_part_of_its_record(capsys: pytest.CaptureFixture[str]) -> None:
    logs.start(Settings(log_format="json"))
    try:
        raise ValueError("no such thing")
    except ValueError:
        logging.getLogger("service").exception("failed")
    (record,) = records(capsys)
    assert "ValueError: no such thing" in record["exception"]


def test_people_read_plain_lines(capsys: pytest.CaptureFixture[str]) -> None:
    logs.start(Settings(log_format="text"), logging.WARNING)
    logging.getLogger("a").info("not told")
    logging.getLogger("a.b").warning("told")
    (line,) = capsys.readouterr().err.splitlines()
    assert line.endswith(" WARNING a.b: told")


def test_an_outage_is_told_of_once_a_minute(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = SimpleNamespace(now=0.0)
    monkeypatch.setattr(logs, "time", SimpleNamespace(monotonic=lambda: clock.now))
    outage = logs.Outage(logging.getLogger("worker"), "away", "back")
    with caplog.at_level("INFO", "worker"):
        outage.is_over()
        for clock.now in range(0, 130, 5):
            outage.goes_on(OSError())
        outage.is_over()
        outage.is_over()
        outage.goes_on(OSError())
    assert caplog.messages == [*["away (OSError)"] * 3, "back", "away (OSError)"]
