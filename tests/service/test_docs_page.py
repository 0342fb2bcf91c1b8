"""The page of the interface in headless Chromium, on a service without workers."""

from __future__ import annotations

import httpx
import pytest

from tests.browser import Browser

pytestmark = [pytest.mark.browser, pytest.mark.service]


def test_every_call_and_type_is_there_and_nothing_comes_from_elsewhere(
    browser: Browser, api: httpx.Client
) -> None:
    described = api.get("/openapi.json").json()
    with browser.page(900, 700) as page:
        page.open(f"{api.base_url}/docs")
        page.wait_for("document.getElementById('state').hidden")
        shown = page.evaluate("[...document.querySelectorAll('#calls details')].map((one) => one.id)")
        operations = [one for path in described["paths"].values() for one in path.values()]
        assert shown == [one["operationId"] for one in operations]
        types = page.evaluate("[...document.querySelectorAll('#types details')].map((one) => one.id)")
        assert types == list(described["components"]["schemas"])
        assert page.evaluate(
            "[...document.querySelectorAll('td a')].every((link) => document.querySelector(link.hash))"
        )
        assert page.errors == []
        assert {url for url in page.requests if not url.startswith(str(api.base_url))} == set()


def test_a_call_tells_what_it_takes_and_gives(browser: Browser, api: httpx.Client) -> None:
    with browser.page(900, 700) as page:
        page.open(f"{api.base_url}/docs#submit_job")
        page.wait_for("document.getElementById('submit_job')?.open")
        text = page.evaluate("document.getElementById('submit_job').innerText")
        for part in ("POST", "/v1/jobs", "idempotency-key (header)", "multipart/form-data", "202", "JobView"):
            assert part in text
        page.evaluate("document.querySelector('#submit_job a[href=\"#JobView\"]').click()")
        page.wait_for("document.getElementById('JobView').open")
        assert "progress" in page.evaluate("document.getElementById('JobView').innerText")


def test_the_page_fits_a_phone(browser: Browser, api: httpx.Client) -> None:
    with browser.page(360, 640, touch=True) as page:
        page.open(f"{api.base_url}/docs")
        page.wait_for("document.getElementById('state').hidden")
        page.evaluate("document.querySelectorAll('details').forEach((one) => (one.open = true))")
        assert page.evaluate("document.documentElement.scrollWidth") <= 360


def test_the_pages_of_the_framework_are_not_there(api: httpx.Client) -> None:
    assert api.get("/redoc").status_code == 404
    policy = api.get("/docs").headers["content-security-policy"]
    assert "unsafe" not in policy
    assert "https:" not in policy
