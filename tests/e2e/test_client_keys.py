"""The pages of a service that asks for API keys, in headless Chromium."""

from __future__ import annotations

import json
import os
import signal
from collections.abc import Iterator
from pathlib import Path

import httpx
import numpy as np
import pytest
from PIL import Image
from skimage import data

from tests.browser import Browser, Page
from tests.fleet import LONG, one_region, picture
from tests.running_service import RunningService, start_service
from tests.waiting import within

pytestmark = [pytest.mark.browser, pytest.mark.service, pytest.mark.slow]

KEY = "gcvec_0123456789abcdefghij"


@pytest.fixture(scope="module")
def locked_service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningService]:
    folder = tmp_path_factory.mktemp("locked") / "data"
    service = start_service(folder, "--workers", "1", GCVEC_API_KEYS=KEY)
    yield service
    assert service.stop() == 0


def enter(page: Page, key: str) -> None:
    page.wait_for("document.querySelector('dialog')?.open")
    page.evaluate(f"document.querySelector('dialog input').value = '{key}'")
    page.evaluate("document.querySelector('dialog button').click()")


def test_with_a_key_everything_works(
    browser: Browser, locked_service: RunningService, tmp_path: Path
) -> None:
    file = tmp_path / "astronaut.png"
    Image.fromarray(np.ascontiguousarray(data.astronaut()[40:120, 180:276])).save(file)
    with browser.page(900, 700) as page:
        page.send("Page.setDownloadBehavior", behavior="allow", downloadPath=str(tmp_path))
        page.open(f"{locked_service.url}/")
        enter(page, "a-key-that-is-not-ours")
        page.wait_for("document.querySelector('dialog .error')?.hidden === false")
        enter(page, KEY)
        page.wait_for("!document.querySelector('dialog')")

        page.choose_file("#image", file)
        page.evaluate("document.getElementById('target_mse').value = 30")
        page.evaluate("document.getElementById('submit').click()")
        page.wait_for("location.pathname.endsWith('/view')")
        page.wait_for("window.gcvec", 90)
        page.wait_for("!document.getElementById('compare-toggle').disabled")
        address = f"{locked_service.url}{page.evaluate('location.pathname').removesuffix('/view')}"
        expected = {f"{address}/{name}" for name in ("events", "result", "image")}
        assert expected <= set(page.requests)

        page.evaluate("document.querySelector('#downloads a[href$=\"result.svg\"]').click()")
        answer = httpx.get(f"{address}/result.svg", headers={"Authorization": f"Bearer {KEY}"})
        svg = tmp_path / answer.headers["content-disposition"].split('"')[1]
        within(30, svg.exists)
        within(10, lambda: svg.read_bytes() == answer.content)

        page.open(f"{locked_service.url}/")
        page.wait_for("document.querySelector('#jobs img')")
        page.evaluate("document.getElementById('jobs').scrollIntoView()")
        page.wait_for("document.querySelector('#jobs img').naturalWidth === 96")
        assert not [url for url in page.requests if KEY in url]
        assert all("401" in error for error in page.errors), page.errors

        page.evaluate("document.getElementById('forget').click()")
        page.wait_for("document.querySelector('dialog')?.open")
        assert page.evaluate("sessionStorage.length") == 0


@pytest.mark.parametrize(("key", "status"), [(KEY, 202), ("a-key-that-is-not-ours", 401)])
def test_calls_can_be_tried_out(
    browser: Browser, locked_service: RunningService, tmp_path: Path, key: str, status: int
) -> None:
    file = tmp_path / "a.png"
    file.write_bytes(picture())
    with browser.page(900, 700) as page:
        page.open(f"{locked_service.url}/docs")
        page.wait_for("document.querySelector('.btn.authorize')")
        page.evaluate("document.querySelector('.btn.authorize').click()")
        page.wait_for("document.querySelector('.auth-container input')")
        page.evaluate("document.querySelector('.auth-container input').focus()")
        page.send("Input.insertText", text=key)
        page.evaluate("document.querySelector('.auth-btn-wrapper .authorize').click()")
        page.wait_for("document.querySelector('.auth-btn-wrapper .btn-done')")
        page.evaluate("document.querySelector('.auth-btn-wrapper .btn-done').click()")

        page.evaluate("document.querySelector('[id$=submit_job] button').click()")
        page.wait_for("document.querySelector('.try-out button')")
        page.evaluate("document.querySelector('.try-out button').click()")
        page.wait_for("document.querySelector('.execute')")
        page.choose_file("[data-property-name=image] input", file)
        page.evaluate("document.querySelector('.execute').click()")
        page.wait_for("document.querySelector('.live-responses-table .response')")
        said = page.evaluate("document.querySelector('.live-responses-table .response').innerText")
        assert said.startswith(str(status)), said
        assert page.evaluate("sessionStorage.length + localStorage.length") == 0


def test_progress_goes_on_when_the_api_was_started_again(
    browser: Browser, locked_service: RunningService
) -> None:
    files = {"image": ("a.png", picture()), "annotations": ("a.xml", one_region(48))}
    headers = {"Authorization": f"Bearer {KEY}"}
    form = {"options": json.dumps(LONG)}
    answer = httpx.post(f"{locked_service.url}/v1/jobs", files=files, data=form, headers=headers)
    address = f"{locked_service.url}{answer.headers['location']}"
    with browser.page(900, 700) as page:
        page.open(f"{address}/view")
        enter(page, KEY)
        page.wait_for("document.getElementById('iteration').textContent > 0", 60)
        os.kill(api_of(locked_service), signal.SIGKILL)
        page.wait_for("window.gcvec", 90)
        assert page.requests.count(f"{address}/events") >= 2


def api_of(service: RunningService) -> int:
    """The process of its API."""
    pid = service.process.pid
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    (found,) = (child for child in children if "service.server" in Path(f"/proc/{child}/cmdline").read_text())
    return int(found)


def test_the_page_of_a_job_asks_for_the_key_itself(browser: Browser, locked_service: RunningService) -> None:
    """As when its address is opened in another tab."""
    with browser.page(360, 640, touch=True) as page:
        page.open(f"{locked_service.url}/v1/jobs/unknown/view")
        page.wait_for("document.querySelector('dialog')?.open")
        assert page.evaluate("document.documentElement.scrollWidth") <= 360
        enter(page, KEY)
        page.wait_for("!document.getElementById('problem').hidden")
        assert "no job" in page.evaluate("document.getElementById('problem-detail').textContent")


@pytest.mark.parametrize(
    "path", ["/v1/jobs/x/view/..", "/v1/jobs/x/y/view", "/v1/jobs/view", "/v1/jobs/x/image"]
)
def test_nothing_but_that_page_is_open(locked_service: RunningService, path: str) -> None:
    assert httpx.get(f"{locked_service.url}{path}").status_code == 401
