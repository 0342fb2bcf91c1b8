"""The pages of the service in headless Chromium: upload, watch, look."""

from __future__ import annotations

import io
from base64 import b64decode
from pathlib import Path

import httpx
import numpy as np
import pytest
from PIL import Image
from skimage import data

from tests.browser import Browser
from tests.running_service import RunningService

pytestmark = [pytest.mark.browser, pytest.mark.service]


@pytest.fixture(scope="module")
def picture() -> np.ndarray:
    return np.ascontiguousarray(data.astronaut()[40:120, 180:276])


def test_from_upload_to_patches(
    browser: Browser, running_service: RunningService, picture: np.ndarray, tmp_path: Path
) -> None:
    file = tmp_path / "astronaut.png"
    Image.fromarray(picture).save(file)
    with browser.page(900, 700) as page:
        page.open(f"{running_service.url}/")
        page.choose_file("#image", file)
        page.wait_for("!document.getElementById('thumbnail').hidden")
        page.evaluate("document.getElementById('target_mse').value = 30")
        page.evaluate("document.getElementById('submit').click()")
        page.wait_for("location.pathname.endsWith('/view')")
        page.wait_for("window.gcvec", 90)
        page.wait_for("!document.getElementById('compare-toggle').disabled")
        address = page.evaluate("location.pathname").removesuffix("/view")

        height, width = picture.shape[:2]
        assert f"{width} × {height}" in page.evaluate("document.getElementById('summary').textContent")
        expected = {f"{running_service.url}{address}/{name}" for name in ("events", "result", "image")}
        assert expected <= set(page.requests)
        assert page.errors == []
        own = (running_service.url, "data:", "blob:")
        assert {url for url in page.requests if not url.startswith(own)} == set()

        shown = page.evaluate(
            "gcvec.look(0, 0, 1), gcvec.draw(), gcvec.canvas.toDataURL('image/png').split(',')[1]"
        )
        pixels = np.asarray(Image.open(io.BytesIO(b64decode(shown))).convert("RGB")).astype(int)
        preview = httpx.get(f"{running_service.url}{address}/preview.png").content
        off = np.abs(pixels[:height, :width] - np.asarray(Image.open(io.BytesIO(preview)).convert("RGB")))
        assert off.mean() <= 2

        for key, overlay in (("o", "outlines"), ("p", "polygons"), ("c", "points")):
            page.press(key)
            assert page.evaluate(f"gcvec.overlays.{overlay}")
        page.press("x")
        assert page.evaluate("gcvec.split") == 0.5
        assert page.errors == []


def test_what_is_wrong_is_said(browser: Browser, running_service: RunningService, tmp_path: Path) -> None:
    text = tmp_path / "notes.png"
    text.write_text("no picture")
    with browser.page(900, 700) as page:
        page.open(f"{running_service.url}/")
        page.choose_file("#image", text)
        page.evaluate("document.getElementById('submit').click()")
        page.wait_for("!document.getElementById('error').hidden")
        assert "picture" in page.evaluate("document.getElementById('error').textContent")
        page.open(f"{running_service.url}/v1/jobs/unknown/view")
        page.wait_for("!document.getElementById('problem').hidden")


def test_pages_allow_no_other_origin(running_service: RunningService) -> None:
    for path in ("/", "/docs", "/v1/jobs/any/view"):
        policy = httpx.get(f"{running_service.url}{path}").headers["content-security-policy"]
        assert policy.startswith("default-src 'self'")


def test_every_call_is_on_a_page_that_needs_no_other_site(
    browser: Browser, running_service: RunningService
) -> None:
    paths = httpx.get(f"{running_service.url}/openapi.json").json()["paths"].values()
    calls = {call["operationId"] for path in paths for call in path.values()}
    with browser.page(900, 700) as page:
        page.open(f"{running_service.url}/docs")
        page.wait_for("document.querySelector('.opblock')")
        shown = page.evaluate("[...document.querySelectorAll('.opblock')].map((call) => call.id)")
        assert len(shown) == len(calls) > 20
        assert all(any(name.endswith(f"-{call}") for name in shown) for call in calls)
        page.evaluate("document.querySelector('[id$=submit_job] button').click()")
        page.wait_for("document.querySelector('.opblock-body')?.textContent.includes('idempotency-key')")
        page.evaluate("document.querySelector('.try-out button').click()")
        page.wait_for("document.querySelector('.execute')")
        page.resize(360, 640, touch=True)
        assert page.evaluate("document.documentElement.scrollWidth") <= 360
        assert page.errors == []
        own = (running_service.url, "data:")
        assert {url for url in page.requests if not url.startswith(own)} == set()


@pytest.mark.parametrize("path", ["/", "/docs", "/v1/jobs/unknown/view"])
def test_pages_fit_a_phone(browser: Browser, running_service: RunningService, path: str) -> None:
    with browser.page(360, 640, touch=True) as page:
        page.open(running_service.url + path)
        assert page.evaluate("document.documentElement.scrollWidth") <= 360
