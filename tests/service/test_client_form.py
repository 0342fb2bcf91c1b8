"""The upload form in headless Chromium, on a service without workers."""

from __future__ import annotations

from pathlib import Path

import httpx
import pytest

from gcvec.options import LARGEST_COUNT, MOST_SNAP
from tests.browser import Browser, Page
from tests.service.in_process import Jobs
from tests.uploads import cvat, png

pytestmark = [pytest.mark.browser, pytest.mark.service]


def open_form(page: Page, api: httpx.Client, folder: Path) -> None:
    """Open the form and choose a photo."""
    (folder / "a.png").write_bytes(png())
    page.open(f"{api.base_url}/")
    page.choose_file("#image", folder / "a.png")


def fill(page: Page, field: str, value: object) -> None:
    page.evaluate(f"document.getElementById('{field}').value = '{value}'")


def test_an_option_that_is_not_valid_is_shown(browser: Browser, api: httpx.Client, tmp_path: Path) -> None:
    with browser.page(900, 700) as page:
        open_form(page, api, tmp_path)
        fill(page, "snap", -1)
        page.evaluate("document.getElementById('submit').click()")
        page.wait_for("document.querySelector('form details').open")
        page.wait_for("document.activeElement.id === 'snap'")
        fill(page, "snap", "")
        page.evaluate("document.getElementById('submit').click()")
        page.wait_for("location.pathname.endsWith('/view')")


@pytest.mark.parametrize(
    ("field", "values"),
    [
        ("target_mse", (0.01, 65_024)),
        ("snap", (0, MOST_SNAP)),
        ("max_points", (0, LARGEST_COUNT)),
        ("regions", (0, LARGEST_COUNT)),
    ],
)
def test_the_form_allows_what_the_engine_allows(
    browser: Browser, api: httpx.Client, tmp_path: Path, field: str, values: tuple[float, float]
) -> None:
    with browser.page(900, 700) as page:
        open_form(page, api, tmp_path)
        for value in values:
            fill(page, field, value)
            assert page.evaluate("document.getElementById('form').checkValidity()"), value


def test_a_photo_is_found_among_several(
    browser: Browser, api: httpx.Client, jobs: Jobs, tmp_path: Path
) -> None:
    """The regions are those of photos under other names."""
    first, second = (cvat(name).decode() for name in ("b.png", "c.png"))
    image = second[second.index("<image ") : second.index("</annotations>")]
    file = tmp_path / "regions.xml"
    file.write_text(first.replace("</annotations>", f"{image}</annotations>"))
    with browser.page(900, 700) as page:
        open_form(page, api, tmp_path)
        page.choose_file("#annotations", file)
        page.evaluate("document.getElementById('submit').click()")
        page.wait_for("!document.getElementById('error').hidden")
        fill(page, "image_name", " c.png ")
        page.evaluate("document.getElementById('submit').click()")
        page.wait_for("location.pathname.endsWith('/view')")
        job = jobs.records.get(page.evaluate("location.pathname").split("/")[3])
    assert job is not None
    assert job.request["image_name"] == "c.png"


def test_an_error_goes_when_something_else_is_chosen(
    browser: Browser, api: httpx.Client, tmp_path: Path
) -> None:
    error = "document.getElementById('error')"
    drop = """(() => {
        const dataTransfer = new DataTransfer();
        dataTransfer.items.add(new File(["no picture"], "c.png"));
        document.getElementById("drop").dispatchEvent(new DragEvent("drop", { dataTransfer }));
    })()"""
    (tmp_path / "notes.png").write_text("no picture")
    with browser.page(900, 700) as page:
        open_form(page, api, tmp_path)
        for choose in (lambda: page.choose_file("#image", tmp_path / "a.png"), lambda: page.evaluate(drop)):
            page.choose_file("#image", tmp_path / "notes.png")
            page.evaluate("document.getElementById('submit').click()")
            page.wait_for(f"!{error}.hidden")
            choose()
            page.wait_for(f"{error}.hidden", 5)


def test_a_file_that_has_gone_is_told_of(browser: Browser, api: httpx.Client, tmp_path: Path) -> None:
    with browser.page(900, 700) as page:
        open_form(page, api, tmp_path)
        (tmp_path / "a.png").unlink()
        page.evaluate("document.getElementById('submit').click()")
        page.wait_for("document.getElementById('error').textContent.includes('a file has changed')")
        assert not page.evaluate("document.getElementById('submit').disabled")
