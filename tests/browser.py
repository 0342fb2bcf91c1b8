"""Headless Chromium, driven through the DevTools protocol."""

from __future__ import annotations

import json
import subprocess
from base64 import b64decode
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any

import httpx
import numpy as np
from numpy.typing import NDArray
from PIL import Image
from websockets.sync.client import ClientConnection, connect

from tests.readers import require
from tests.waiting import within

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")

FLAGS = (
    "--headless",
    "--no-sandbox",
    "--no-first-run",
    "--hide-scrollbars",
    "--force-color-profile=srgb",
    "--enable-unsafe-swiftshader",
    "--disable-quic",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-extensions",
    "--remote-debugging-port=0",
)


class Browser:
    """A Chromium of our own, with a fresh profile in `profile`."""

    def __init__(self, profile: Path) -> None:
        command = require("Chromium", *NAMES)
        self._process = subprocess.Popen(
            [command, *FLAGS, f"--user-data-dir={profile}", "about:blank"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        port_file = profile / "DevToolsActivePort"
        within(30, lambda: port_file.exists() and "\n" in port_file.read_text(), "the browser")
        self._address = f"127.0.0.1:{port_file.read_text().splitlines()[0]}"

    @contextmanager
    def page(self, width: int, height: int, scale: float = 1, touch: bool = False) -> Iterator[Page]:
        """A new tab whose viewport has this size, in CSS pixels of `scale` device pixels."""
        target = httpx.put(f"http://{self._address}/json/new?about:blank").json()
        # Without a bound on what it keeps: events that nobody reads would hold up the answer to its closing.
        with connect(target["webSocketDebuggerUrl"], max_size=None, max_queue=None) as socket:
            page = Page(socket)
            page.resize(width, height, scale, touch)
            yield page
        httpx.put(f"http://{self._address}/json/close/{target['id']}")

    def close(self) -> None:
        self._process.terminate()
        self._process.wait(20)


class Page:
    """A tab. It remembers every request it made and everything it complained about."""

    def __init__(self, socket: ClientConnection) -> None:
        self._socket = socket
        self._calls = 0
        self._loaded = False
        self.requests: list[str] = []
        self.errors: list[str] = []
        for domain in ("Page", "Runtime", "Network", "Log"):
            self.send(f"{domain}.enable")

    def send(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Call a method of the protocol; its result."""
        self._calls += 1
        self._socket.send(json.dumps({"id": self._calls, "method": method, "params": parameters}))
        while True:
            answer = json.loads(self._socket.recv(60))
            if answer.get("id") == self._calls:
                assert "error" not in answer, (method, answer["error"])
                result: dict[str, Any] = answer["result"]
                return result
            self._note(answer)

    def _note(self, event: dict[str, Any]) -> None:
        name, about = event.get("method"), event.get("params", {})
        if name == "Page.loadEventFired":
            self._loaded = True
        elif name == "Network.requestWillBeSent":
            self.requests.append(about["request"]["url"])
        elif name == "Runtime.exceptionThrown":
            self.errors.append(json.dumps(about["exceptionDetails"]))
        elif name == "Runtime.consoleAPICalled" and about["type"] in ("error", "warning", "assert"):
            self.errors.append(json.dumps(about["args"]))
        elif name == "Log.entryAdded" and about["entry"]["level"] == "error":
            self.errors.append(json.dumps(about["entry"]))

    def resize(self, width: int, height: int, scale: float = 1, touch: bool = False) -> None:
        size = {"width": width, "height": height, "deviceScaleFactor": scale}
        self.send("Emulation.setDeviceMetricsOverride", mobile=touch, **size)
        self.send("Emulation.setTouchEmulationEnabled", enabled=touch)

    def open(self, url: str) -> None:
        """Go there and wait until everything is loaded."""
        self._loaded = False
        self.send("Page.navigate", url=url)
        within(30, lambda: (self.evaluate("1"), self._loaded)[1], url)

    def evaluate(self, expression: str) -> Any:
        """The value of a JavaScript expression, awaited if it is a promise."""
        answer = self.send("Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def wait_for(self, expression: str, seconds: float = 30) -> None:
        """Wait until the expression is true."""
        within(seconds, lambda: self.evaluate(f"Boolean({expression})"), expression)

    def screenshot(self) -> NDArray[np.uint8]:
        """What the viewport shows, `(h, w, 3) uint8`."""
        data = b64decode(self.send("Page.captureScreenshot", format="png")["data"])
        return np.asarray(Image.open(BytesIO(data)).convert("RGB"))

    def choose_file(self, selector: str, file: Path) -> None:
        """Choose a file in a file field, as its user does."""
        root = self.send("DOM.getDocument")["root"]["nodeId"]
        node = self.send("DOM.querySelector", nodeId=root, selector=selector)["nodeId"]
        self.send("DOM.setFileInputFiles", nodeId=node, files=[str(file)])

    def press(self, key: str) -> None:
        """Press and release a key, by the name that `KeyboardEvent.key` gives it."""
        text = {"text": key} if len(key) == 1 else {}
        self.send("Input.dispatchKeyEvent", type="keyDown", key=key, **text)
        self.send("Input.dispatchKeyEvent", type="keyUp", key=key)

    def drag(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        """Drag with the left mouse button."""
        mouse = {"button": "left", "buttons": 1, "clickCount": 1}
        self._mouse("mousePressed", start, **mouse)
        for step in range(1, 5):
            middle = tuple(a + (b - a) * step / 4 for a, b in zip(start, end, strict=True))
            self._mouse("mouseMoved", (middle[0], middle[1]), **mouse)
        self._mouse("mouseReleased", end, button="left", clickCount=1)

    def wheel(self, at: tuple[float, float], delta: float) -> None:
        self._mouse("mouseWheel", at, deltaX=0, deltaY=delta)

    def touch(self, kind: str, *fingers: tuple[float, float]) -> None:
        """One touch event: "touchStart", "touchMove" or "touchEnd"."""
        points = [{"x": x, "y": y, "id": number} for number, (x, y) in enumerate(fingers)]
        self.send("Input.dispatchTouchEvent", type=kind, touchPoints=points)

    def _mouse(self, kind: str, at: tuple[float, float], **more: Any) -> None:
        self.send("Input.dispatchMouseEvent", type=kind, x=at[0], y=at[1], **more)


def failing(method: str, path: str) -> str:
    """JavaScript that has the next two calls of a method to a path fail: a network's way, then a proxy's."""
    broken = "away ? Promise.reject(new TypeError('away')) : new Response('<html>', { status: 502 })"
    ours = f"(more?.method ?? 'GET') === '{method}' && String(url) === '{path}'"
    step = f"(real) => (url, more) => {ours} && away && away-- ? {broken} : real(url, more)"
    return f"window.away = 2; window.fetch = ({step})(fetch); 0"
