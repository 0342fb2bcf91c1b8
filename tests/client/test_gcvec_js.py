"""The drawing module alone, in a page of five lines, in headless Chromium."""

from __future__ import annotations

import json
from base64 import b64decode
from collections.abc import Iterator
from functools import partial
from http.server import ThreadingHTTPServer
from io import BytesIO
from pathlib import Path
from shutil import copytree

import numpy as np
import pytest
from PIL import Image

from gcvec import VectorImage
from gcvec.curves import bspline
from tests.browser import Browser, Page
from tests.pictures import HEIGHT, WIDTH, drawing, photo
from tests.servers import QuietFiles, in_background

pytestmark = pytest.mark.browser

STATIC = Path(__file__).parents[2] / "service" / "static"

PAGE = """<!doctype html><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<link rel="icon" href="data:,">
<style>body { margin: 0 } canvas { width: 100vw; height: 100vh; display: block }</style>
<canvas></canvas>
<script type="module">
  import { GcvecView } from "./gcvec.js";
  const view = new GcvecView(document.querySelector("canvas"), OPTIONS);
  view.load(await (await fetch("result.json")).json());
  window.view = view;
</script>"""


@pytest.fixture(scope="module", params=[photo, drawing], ids=lambda make: make.__name__)
def image(request: pytest.FixtureRequest) -> VectorImage:
    made: VectorImage = request.param()
    return made


@pytest.fixture
def site(image: VectorImage, tmp_path: Path) -> Iterator[str]:
    """A page that shows the image, served."""
    folder = tmp_path / "site"
    copytree(STATIC, folder)
    (folder / "result.json").write_text(json.dumps(image.description()))
    for name, options in (("webgl.html", "{}"), ("software.html", "{ software: true }")):
        (folder / name).write_text(PAGE.replace("OPTIONS", options))
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(QuietFiles, directory=str(folder)))
    with in_background(server):
        yield f"http://127.0.0.1:{server.server_port}"


def open_page(page: Page, site: str, name: str) -> None:
    page.open(f"{site}/{name}.html")
    page.wait_for("window.view")


def pixels(page: Page, x: float, y: float, scale: float) -> np.ndarray:
    """What is on the canvas once it shows the picture from `x`, `y` on at `scale`, without its opacity."""
    return drawn(page, x, y, scale)[..., :3]


def drawn(page: Page, x: float, y: float, scale: float) -> np.ndarray:
    """The same, with its opacity, read back from it."""
    data = page.evaluate(
        f"view.look({x}, {y}, {scale}), view.draw(), view.canvas.toDataURL('image/png').split(',')[1]"
    )
    return np.asarray(Image.open(BytesIO(b64decode(data))).convert("RGBA")).astype(int)


@pytest.mark.parametrize("name", ["webgl", "software"])
def test_it_draws_what_we_render(browser: Browser, image: VectorImage, site: str, name: str) -> None:
    with browser.page(WIDTH, HEIGHT) as page:
        open_page(page, site, name)
        assert page.evaluate("view.accelerated") == (name == "webgl")
        assert np.abs(pixels(page, 0, 0, 1) - image.render()).mean() <= 2
        large = image.render(8)
        for x, y in ((0, 0), (52, 36), (WIDTH * 7 / 8, HEIGHT * 7 / 8)):
            part = large[int(8 * y) : int(8 * y) + HEIGHT, int(8 * x) : int(8 * x) + WIDTH]
            off = np.abs(pixels(page, x, y, 8) - part)
            assert off.mean() <= 2
            assert (off.max(axis=2) > 24).mean() < 0.02
        assert page.errors == []
        assert {url for url in page.requests if not url.startswith((site, "data:"))} == set()


def test_edges_are_multisampled(browser: Browser, site: str) -> None:
    with browser.page(WIDTH, HEIGHT) as page:
        open_page(page, site, "webgl")
        context = "view.canvas.getContext('webgl2')"
        assert page.evaluate(f"{context}.getParameter({context}.SAMPLES)") >= 4


@pytest.mark.parametrize("name", ["webgl", "software"])
def test_overlays_lie_where_the_curves_are(
    browser: Browser, image: VectorImage, site: str, name: str
) -> None:
    with browser.page(WIDTH * 4, HEIGHT * 4) as page:
        open_page(page, site, name)
        plain = pixels(page, 0, 0, 4)
        for overlay in ("outlines", "polygons", "points", "handles"):
            page.evaluate(f"view.overlays.{overlay} = true")
            shown = pixels(page, 0, 0, 4)
            changed = (shown != plain).any(axis=2)
            assert changed.any() or (overlay == "points" and not len(image.points))
            page.evaluate(f"view.overlays.{overlay} = false")
            if overlay == "outlines":
                for curve in image.network.curves:
                    u = np.linspace(0, curve.segments, 50)
                    x, y = (bspline.evaluate(curve.control_points, u, curve.closed) * 4).T.astype(int)
                    assert changed[y.clip(0, 4 * HEIGHT - 1), x.clip(0, 4 * WIDTH - 1)].all()
        assert page.errors == []


def state(page: Page) -> tuple[float, float, float]:
    x, y, scale = page.evaluate("[view.x, view.y, view.scale]")
    return x, y, scale


def test_mouse_and_keys(browser: Browser, site: str) -> None:
    with browser.page(WIDTH, HEIGHT) as page:
        open_page(page, site, "webgl")
        assert state(page) == (0, 0, 1)
        page.wheel((30, 20), -500)
        page.wait_for("view.scale > 2")
        x, y, scale = state(page)
        assert (x + 30 / scale, y + 20 / scale) == pytest.approx((30, 20))
        page.drag((60, 40), (40, 50))
        assert state(page) == pytest.approx((x + 20 / scale, y - 10 / scale, scale))
        page.evaluate("view.canvas.focus()")
        page.press("0")
        assert state(page) == (0, 0, 1)
        page.press("+")
        assert state(page)[2] == 1.25
        page.press("ArrowRight")
        assert state(page)[0] == pytest.approx(12 + 60 / 1.25)
        assert page.errors == []


def test_the_smallest_of_pictures_can_be_zoomed_into_no_further_than_others(
    browser: Browser, site: str
) -> None:
    with browser.page(1000, 800) as page:
        open_page(page, site, "webgl")
        page.evaluate("view.result.image = { width: 1, height: 1 }, view.fit()")
        fitted = state(page)
        assert fitted[0] + 500 / fitted[2] == pytest.approx(0.5)
        page.evaluate("view.zoom(1.5)")
        assert state(page) == pytest.approx(fitted)


def test_pinch(browser: Browser, site: str) -> None:
    with browser.page(WIDTH, HEIGHT, touch=True) as page:
        open_page(page, site, "webgl")
        page.touch("touchStart", (50, 40), (70, 40))
        page.touch("touchMove", (40, 40), (80, 40))
        page.touch("touchEnd")
        x, y, scale = state(page)
        assert scale == pytest.approx(2)
        assert (x + 60 / scale, y + 40 / scale) == pytest.approx((60, 40))


@pytest.mark.parametrize("name", ["webgl", "software"])
@pytest.mark.parametrize(
    "size",
    [(WIDTH, HEIGHT), (20_000, 10), (10, 20_000)],
    ids=["as it is", "wider than graphics cards take", "higher than they take"],
)
def test_the_original_is_shown_left_of_the_split(
    browser: Browser, site: str, name: str, size: tuple[int, int]
) -> None:
    with browser.page(WIDTH, HEIGHT) as page:
        open_page(page, site, name)
        plain = pixels(page, 0, 0, 1)
        page.evaluate(f"""(() => {{
            const green = new OffscreenCanvas({size[0]}, {size[1]});
            const context = green.getContext("2d");
            context.fillStyle = "rgb(0 255 0)";
            context.fillRect(0, 0, {size[0]}, {size[1]});
            view.setOriginal(green);
            view.split = 0.25;
        }})()""")
        split = pixels(page, 0, 0, 1)
        assert (split[:, : WIDTH // 4] == (0, 255, 0)).all()
        assert (split[:, WIDTH // 4 :] == plain[:, WIDTH // 4 :]).all()


@pytest.mark.parametrize("name", ["webgl", "software"])
@pytest.mark.parametrize("kind", ["canvas", "bitmap"])
def test_an_original_that_is_transparent_is_shown_so(
    browser: Browser, site: str, name: str, kind: str
) -> None:
    with browser.page(WIDTH, HEIGHT) as page:
        open_page(page, site, name)
        page.evaluate(f"""(async () => {{
            const clear = new OffscreenCanvas({WIDTH}, {HEIGHT});
            const context = clear.getContext("2d");
            context.fillStyle = "rgb(0 255 0 / 50%)";
            context.fillRect({WIDTH // 2}, 0, {WIDTH}, {HEIGHT});
            view.setOriginal("{kind}" === "bitmap" ? await createImageBitmap(clear) : clear);
            view.split = 1;
        }})()""")
        shown = drawn(page, 0, 0, 1)
        assert (shown[:, : WIDTH // 2 - 1] == 0).all()
        assert np.abs(shown[:, WIDTH // 2 + 1 :] - (0, 255, 0, 128)).max() <= 2


def test_a_result_that_takes_the_place_of_another_takes_its_memory(browser: Browser, site: str) -> None:
    counted = """for (const kind of ["Buffer", "VertexArray"]) {
        for (const [step, by] of [["create", 1], ["delete", -1]]) {
            const real = WebGL2RenderingContext.prototype[step + kind];
            WebGL2RenderingContext.prototype[step + kind] = function (...more) {
                window.held = (window.held ?? 0) + by;
                return real.apply(this, more);
            };
        }
    }"""
    with browser.page(WIDTH, HEIGHT) as page:
        page.send("Page.addScriptToEvaluateOnNewDocument", source=counted)
        open_page(page, site, "webgl")
        before, held = pixels(page, 0, 0, 1), page.evaluate("held")
        page.evaluate("view.load(view.result)")
        assert page.evaluate("held") == held > 0
        assert (pixels(page, 0, 0, 1) == before).all()
        assert page.errors == []
