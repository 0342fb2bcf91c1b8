"""The page of a job that runs, in headless Chromium. The tests play the worker's part."""

from __future__ import annotations

import json
import re
from contextlib import ExitStack
from typing import Any

import httpx
import pytest

from tests.browser import Browser, Page, failing
from tests.service.in_process import Jobs
from worker.problems import problem
from worker.steps import claim, finish, report

pytestmark = [pytest.mark.browser, pytest.mark.service]


def iteration(number: int, mse: float | None) -> dict[str, Any]:
    figures = {"iteration": number, "points": number, "worst_error": 8.0, "mse": mse, "fraction": 0.5}
    return {"phase": "refine", "region": 1, "regions": 1, **figures}


def begun(jobs: Jobs, *errors: float | None) -> str:
    """A job that has come so far."""
    job_id = jobs.submit()
    assert jobs.records.run(claim(job_id)) == 1
    steps = [iteration(number, mse) for number, mse in enumerate(errors, 1)]
    for start in range(0, len(steps), 500):
        assert jobs.records.run(report(job_id, 1, steps[start : start + 500], start + 1))
    return job_id


def text(page: Page, name: str) -> str:
    return str(page.evaluate(f"document.getElementById('{name}').textContent"))


def heights(page: Page) -> list[float]:
    """The chart's points, from the left: how far below the top each is."""
    path = page.evaluate("document.getElementById('errors').getAttribute('d')")
    return [float(y) for y in re.findall(r"[ML]\S+ (\S+?)(?=[ML]|$)", path)]


def test_what_has_happened_so_far_is_soon_drawn(browser: Browser, api: httpx.Client, jobs: Jobs) -> None:
    n_steps = 9_000
    job_id = begun(jobs, *(1000 / number for number in range(1, n_steps + 1)))
    with browser.page(900, 700) as page:
        page.open(f"{api.base_url}/v1/jobs/{job_id}/view")
        page.wait_for(f"document.getElementById('iteration').textContent === '{n_steps}'", 10)
        page.wait_for("document.getElementById('errors').hasAttribute('d')")
        falling = heights(page)
        assert 250 <= len(falling) <= 301
        assert falling == sorted(falling)
        assert (falling[0], falling[-1]) == (5, 85)
        assert page.errors == []


def test_only_a_new_phase_is_read_out(browser: Browser, api: httpx.Client, jobs: Jobs) -> None:
    job_id = begun(jobs, 100)
    with browser.page(900, 700) as page:
        page.open(f"{api.base_url}/v1/jobs/{job_id}/view")
        page.wait_for("document.getElementById('iteration').textContent === '1'")
        page.evaluate("""
            window.told = [];
            for (const region of document.querySelectorAll("[aria-live], [role=status]")) {
                new MutationObserver(() => told.push(region.textContent))
                    .observe(region, { childList: true, characterData: true, subtree: true });
            }
        """)
        for number in (2, 3):
            assert jobs.records.run(report(job_id, 1, [iteration(number, 100 / number)], number))
            page.wait_for(f"document.getElementById('iteration').textContent === '{number}'")
        assert jobs.records.run(report(job_id, 1, [{**iteration(3, None), "phase": "encode"}], 4))
        page.wait_for("told.length")
        assert page.evaluate("told") == ["Writing the file"]


def test_an_outage_is_waited_for(browser: Browser, api: httpx.Client, jobs: Jobs) -> None:
    job_id = begun(jobs, None)
    with browser.page(900, 700) as page:
        page.send("Page.addScriptToEvaluateOnNewDocument", source=failing("GET", f"/v1/jobs/{job_id}"))
        page.open(f"{api.base_url}/v1/jobs/{job_id}/view")
        page.wait_for("document.getElementById('summary').textContent.includes('does not answer')")
        page.wait_for("!document.getElementById('progress').hidden")
        assert text(page, "summary") == ""
        page.evaluate("away = 2")
        reason = problem("time-limit", "it took 900 s")
        assert jobs.records.run(finish(job_id, "failed", retention=60, error=reason))
        page.wait_for("!document.getElementById('problem').hidden")
        assert page.evaluate("away") == 0
        assert text(page, "problem-detail") == "it took 900 s"


def test_a_cancellation_that_fails_is_said_to(browser: Browser, api: httpx.Client, jobs: Jobs) -> None:
    job_id = begun(jobs, None)
    with browser.page(900, 700) as page:
        page.open(f"{api.base_url}/v1/jobs/{job_id}/view")
        page.wait_for("!document.getElementById('progress').hidden")
        page.evaluate(failing("DELETE", f"/v1/jobs/{job_id}"))
        for cause in ("away", "HTTP 502"):
            page.evaluate("document.getElementById('cancel').click()")
            page.wait_for(f"document.getElementById('cancel-error').textContent === 'Not canceled: {cause}'")
            assert page.evaluate("document.getElementById('cancel').disabled") is False
            assert page.evaluate("document.getElementById('cancel-error').hidden") is False
        page.evaluate("document.getElementById('cancel').click()")
        page.wait_for("!document.getElementById('problem').hidden")
        assert text(page, "problem-title") == "Canceled"


def turn(page: Page, hidden: bool) -> None:
    """Have the page believe that its tab was hidden, or shown again."""
    page.evaluate(
        f"Object.defineProperty(document, 'hidden', {{ value: {json.dumps(hidden)}, configurable: true }});"
        "document.dispatchEvent(new Event('visibilitychange'))"
    )


def test_hidden_tabs_hold_no_connection(browser: Browser, api: httpx.Client, jobs: Jobs) -> None:
    """A browser makes six to a service, for all of its tabs."""
    job_id = begun(jobs, 100)
    with ExitStack() as tabs:
        pages = [tabs.enter_context(browser.page(900, 700)) for _ in range(7)]
        for page in pages:
            page.open(f"{api.base_url}/v1/jobs/{job_id}/view")
            page.wait_for("document.getElementById('iteration').textContent === '1'", 10)
            turn(page, hidden=True)
        first, second, *_ = pages
        assert jobs.records.run(report(job_id, 1, [{**iteration(2, 50), "fraction": 0.75}], 2))
        second.wait_for("document.title.startsWith('75%')", 10)
        turn(first, hidden=False)
        first.wait_for("document.getElementById('errors').getAttribute('d')?.includes('L')", 10)
        assert heights(first) == [5, 85]
        assert jobs.records.run(finish(job_id, "failed", retention=60, error=problem("time-limit", "late")))
        for page in (first, second):
            page.wait_for("!document.getElementById('problem').hidden", 10)
            assert page.errors == []


def test_an_outage_while_a_job_runs_is_told(browser: Browser, api: httpx.Client, jobs: Jobs) -> None:
    job_id = begun(jobs, 100)
    with browser.page(900, 700) as page:
        page.open(f"{api.base_url}/v1/jobs/{job_id}/view")
        page.wait_for("document.getElementById('iteration').textContent === '1'")
        page.evaluate(failing("GET", f"/v1/jobs/{job_id}/events"))
        turn(page, hidden=True)
        turn(page, hidden=False)
        page.wait_for("document.getElementById('summary').textContent.includes('does not answer')")
        page.wait_for("document.getElementById('summary').textContent === ''")
        assert page.evaluate("away") == 0


def test_the_form_says_that_the_service_is_away(browser: Browser, api: httpx.Client, jobs: Jobs) -> None:
    jobs.submit()
    with browser.page(900, 700) as page:
        page.send("Page.addScriptToEvaluateOnNewDocument", source=failing("GET", "/v1/jobs?limit=12"))
        page.open(f"{api.base_url}/")
        page.wait_for("!document.getElementById('away').hidden")
        page.wait_for("!document.getElementById('recent').hidden")
        assert page.evaluate("document.getElementById('away').hidden")
