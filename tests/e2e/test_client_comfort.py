"""The pages on small screens, after the browser's Back, and while a file is still being made."""

from __future__ import annotations

import json
from io import BytesIO
from pathlib import Path

import httpx
import pytest
from PIL import Image

from tests.browser import Browser, failing
from tests.running_service import RunningService
from tests.uploads import png
from tests.waiting import within

pytestmark = [pytest.mark.browser, pytest.mark.service]

FAINT = """(() => {
    const canvas = new OffscreenCanvas(1, 1).getContext("2d", { willReadFrequently: true });
    const paint = (...colors) => {
        for (const color of colors) (canvas.fillStyle = color), canvas.fillRect(0, 0, 1, 1);
        const linear = [...canvas.getImageData(0, 0, 1, 1).data].map((value) => (value / 255) ** 2.2);
        return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2] + 0.05;
    };
    const faint = [];
    for (const element of document.querySelectorAll("body *")) {
        const hasText = [...element.childNodes].some((node) => node.nodeType === 3 && node.data.trim());
        if (!element.checkVisibility() || !(hasText || element.placeholder)) continue;
        const grounds = ["Canvas"];
        for (let at = element; at; at = at.parentElement) {
            grounds.splice(1, 0, getComputedStyle(at).backgroundColor);
        }
        const ink = getComputedStyle(element, hasText ? null : "::placeholder").color;
        const [dark, light] = [paint(...grounds), paint(...grounds, ink)].sort((a, b) => a - b);
        if (light / dark < 4.5) faint.push(`${element.id || element.textContent}: ${light / dark}`);
    }
    return faint;
})()"""
"""Visible text, by JavaScript, that stands out from its ground by less than WCAG 2.2 asks for (1.4.3)."""


@pytest.fixture(scope="module")
def job(running_service: RunningService) -> str:
    """The address of a job that has succeeded, with a warning."""
    return finished(running_service, png(), image_name="in no file of regions")


def finished(service: RunningService, photo: bytes, **options: object) -> str:
    """The address of a job that has succeeded."""
    form = {"options": json.dumps(options)}
    answer = httpx.post(f"{service.url}/v1/jobs", files={"image": ("a.png", photo)}, data=form)
    address = service.url + answer.headers["location"]
    while (ended := httpx.get(f"{address}?wait=30", timeout=40).json())["status"] in ("queued", "running"):
        pass
    assert ended["status"] == "succeeded", ended
    return address


@pytest.mark.parametrize("width", [320, 375, 414])
def test_the_sheets_are_all_on_the_screen_of_a_phone(browser: Browser, job: str, width: int) -> None:
    with browser.page(width, 640, touch=True) as page:
        page.open(f"{job}/view")
        page.wait_for("window.gcvec")
        for number in range(2):
            menu = f"document.querySelectorAll('details.menu')[{number}]"
            page.evaluate(f"{menu}.open = true")
            box = page.evaluate(f"{menu}.querySelector('.sheet').getBoundingClientRect().toJSON()")
            assert box["width"] > 200
            assert box["left"] >= 0
            assert box["right"] <= width
            assert page.evaluate(f"{menu}.querySelector('summary').offsetHeight") <= 40
            page.evaluate(f"{menu}.open = false")


@pytest.mark.parametrize("width", [320, 360, 412])
def test_a_phone_shows_size_and_patches_whole(browser: Browser, job: str, width: int) -> None:
    with browser.page(width, 640, touch=True) as page:
        page.open(f"{job}/view")
        page.wait_for("document.getElementById('summary').textContent.includes('patch')")
        assert page.evaluate("(({ scrollWidth, clientWidth }) => clientWidth - scrollWidth)(summary)") >= 0
        assert page.evaluate("document.documentElement.scrollWidth") <= width


@pytest.mark.parametrize("width", [320, 360, 412])
def test_the_form_stays_within_its_card(
    browser: Browser, running_service: RunningService, width: int
) -> None:
    with browser.page(width, 640, touch=True) as page:
        page.open(f"{running_service.url}/")
        page.evaluate("document.querySelector('form details').open = true")
        left, right = page.evaluate(
            "(({ left, right }) => [left, right])(document.getElementById('form').getBoundingClientRect())"
        )
        boxes = page.evaluate(
            "[...document.querySelectorAll('#form *')].map((part) => part.getBoundingClientRect().toJSON())"
        )
        assert all(left < box["left"] and box["right"] <= right - 16 for box in boxes if box["width"])
        assert page.evaluate("document.documentElement.scrollWidth") <= width


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_stands_out_from_its_ground(
    browser: Browser, running_service: RunningService, job: str, scheme: str
) -> None:
    with browser.page(900, 700) as page:
        preference = {"name": "prefers-color-scheme", "value": scheme}
        page.send("Emulation.setEmulatedMedia", features=[preference])
        page.open(f"{running_service.url}/")
        page.evaluate("document.querySelector('form details').open = true")
        assert page.evaluate(FAINT) == []
        page.open(f"{job}/view")
        page.wait_for("window.gcvec")
        page.press("o")
        page.evaluate("for (const menu of document.querySelectorAll('details.menu')) menu.open = true")
        assert page.evaluate(FAINT) == []


def test_escape_closes_a_menu_and_stays_where_it_was(browser: Browser, job: str) -> None:
    with browser.page(900, 700) as page:
        page.open(f"{job}/view")
        page.wait_for("window.gcvec")
        page.evaluate("document.querySelectorAll('details.menu')[1].open = true")
        page.evaluate("document.querySelector('#downloads a').focus()")
        page.press("Escape")
        assert page.evaluate("document.querySelectorAll('details.menu[open]').length") == 0
        assert page.evaluate("document.activeElement.textContent") == "Download"


def test_a_photo_that_does_not_come_at_once_hides_no_patches(browser: Browser, job: str) -> None:
    path = httpx.URL(f"{job}/image").path
    with browser.page(900, 700) as page:
        page.send("Page.addScriptToEvaluateOnNewDocument", source=failing("GET", path))
        page.open(f"{job}/view")
        page.wait_for("window.gcvec")
        page.wait_for("!document.getElementById('compare-toggle').disabled")
        assert page.evaluate("away") == 0
        assert page.evaluate("document.getElementById('problem').hidden")


def test_a_photo_that_browsers_cannot_show_is_told_of(
    browser: Browser, running_service: RunningService
) -> None:
    tiff = BytesIO()
    Image.open(BytesIO(png())).save(tiff, "TIFF")
    job = finished(running_service, tiff.getvalue())
    with browser.page(900, 700) as page:
        page.open(f"{job}/view")
        page.wait_for("window.gcvec")
        toggle = "document.getElementById('compare-toggle')"
        page.wait_for(f"{toggle}.title === 'This browser cannot show the photo'")
        assert page.evaluate(f"{toggle}.disabled")


def test_a_result_that_breaks_off_is_asked_for_again(browser: Browser, job: str) -> None:
    path = httpx.URL(f"{job}/result").path
    cut = "new Response(new ReadableStream({ pull: (body) => body.error(new TypeError('away')) }))"
    first = f"(real) => (url, more) => url === '{path}' && !asked++ ? {cut} : real(url, more)"
    with browser.page(900, 700) as page:
        source = f"window.asked = 0; fetch = ({first})(fetch)"
        page.send("Page.addScriptToEvaluateOnNewDocument", source=source)
        page.open(f"{job}/view")
        page.wait_for("window.gcvec", 10)
        assert page.evaluate("asked") == 2
        assert page.evaluate("document.getElementById('problem').hidden")


def test_warnings_are_counted_where_they_can_be_looked_at(browser: Browser, job: str) -> None:
    with browser.page(900, 700) as page:
        page.open(f"{job}/view")
        page.wait_for("window.gcvec")
        title = page.evaluate("document.querySelector('#result-menu summary').textContent")
        assert title == "Details · 1 warning"


def test_the_form_lives_again_when_the_browser_goes_back_to_it(
    browser: Browser, running_service: RunningService
) -> None:
    with browser.page(900, 700) as page:
        page.open(f"{running_service.url}/")
        recent = f"{running_service.url}/v1/jobs?limit=12"
        never = "(real) => (url, more) => more.method ? new Promise(() => {}) : real(url, more)"
        page.evaluate(f"fetch = ({never})(fetch); 0")
        page.evaluate(
            "document.getElementById('form').dispatchEvent(new Event('submit', { cancelable: true }))"
        )
        page.wait_for("document.getElementById('submit').disabled")
        before = page.requests.count(recent)
        page.evaluate("dispatchEvent(new PageTransitionEvent('pageshow', { persisted: true }))")
        page.wait_for("!document.getElementById('submit').disabled")
        assert page.evaluate("document.getElementById('submit').textContent") == "Vectorize"
        assert page.requests.count(recent) == before + 1


def test_a_download_waits_for_a_file_that_is_being_made(browser: Browser, job: str, tmp_path: Path) -> None:
    busy = "new Response('{}', { status: 409, headers: { 'Retry-After': '1' } })"
    first = f"(real) => (url, more) => url.endsWith('.pdf') && !asked++ ? {busy} : real(url, more)"
    with browser.page(900, 700) as page:
        page.send("Page.setDownloadBehavior", behavior="allow", downloadPath=str(tmp_path))
        page.open(f"{job}/view")
        page.wait_for("window.gcvec")
        page.evaluate(f"window.asked = 0; fetch = ({first})(fetch); 0")
        link = "document.querySelector('#downloads a[href$=\".pdf\"]')"
        summary = page.evaluate("document.getElementById('summary').textContent")
        page.evaluate(f"{link}.click()")
        page.evaluate(f"{link}.click()")
        assert page.evaluate("document.getElementById('summary').textContent") == "Making the PDF…"
        assert page.evaluate(f"{link}.ariaBusy") == "true"
        made = httpx.get(f"{job}/result.pdf")
        file = tmp_path / made.headers["content-disposition"].split('"')[1]
        within(30, file.exists)
        within(10, lambda: file.read_bytes() == made.content)
        assert page.evaluate("asked") == 2
        page.wait_for(f"{link}.ariaBusy === 'false'")
        assert page.evaluate("document.getElementById('summary').textContent") == summary


def test_a_download_that_takes_too_long_is_given_up(browser: Browser, job: str) -> None:
    busy = "new Response('{}', { status: 409, headers: { 'Retry-After': '1' } })"
    with browser.page(900, 700) as page:
        page.open(f"{job}/view")
        page.wait_for("window.gcvec")
        page.evaluate(f"fetch = async () => {busy}; 0")
        page.evaluate("document.querySelector('#downloads a[href$=\".glb\"]').click()")
        page.evaluate("Date.now = ((real) => () => real() + 120_000)(Date.now); 0")
        page.wait_for("document.getElementById('summary').textContent.includes('Try again later')")


@pytest.mark.parametrize("width", [320, 900])
def test_why_there_is_no_download_is_told_in_full(browser: Browser, job: str, width: int) -> None:
    detail = "the service has no memory left for this now, nor will it have any soon"
    refused = f"new Response('{json.dumps({'detail': detail})}', {{ status: 503 }})"
    with browser.page(width, 640) as page:
        page.open(f"{job}/view")
        page.wait_for("window.gcvec")
        page.evaluate("document.querySelectorAll('details.menu')[1].open = true")
        link = "document.querySelector('#downloads a[href$=\".svg\"]')"
        hint = page.evaluate(f"{link}.querySelector('small').textContent")
        page.evaluate(f"window.real = fetch; fetch = async () => {refused}; {link}.click()")
        page.wait_for(f"{link}.querySelector('small').textContent === '{detail}'")
        sheet, told = page.evaluate(
            f"['.sheet', 'small'].map((name) => {link}.closest(name) ?? {link}.querySelector(name))"
            ".map((part) => part.getBoundingClientRect().toJSON())"
        )
        assert sheet["left"] >= 0
        assert sheet["left"] < told["left"] < told["right"] < sheet["right"] <= width
        page.evaluate(f"fetch = real; {link}.click()")
        assert page.evaluate(f"{link}.querySelector('small').textContent") == hint
