"""Section 3: the HTTP interface, a test a row."""

from __future__ import annotations

import io
import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import jsonschema
import numpy as np
import pytest
from PIL import Image
from skimage import data

from gcvec import VectorImage
from tests.contract.client import ended, post, submitted
from tests.event_stream import events_of
from tests.fleet import ENDLESS
from tests.keys import BOB, key
from tests.picture_files import encoded, pixels
from tests.problems import refused
from tests.shaded_box import BOX, GROUND, HEIGHT, WIDTH, cvat
from tests.waiting import within

pytestmark = pytest.mark.service

ROOT = Path(__file__).parents[2]
JOB_FIELDS = {
    *("id", "status", "created_at", "started_at", "finished_at", "expires_at"),
    *("progress", "error", "links"),
}
ARTIFACTS = {
    "result.gcv": b"GCV",
    "result.svg": b"<?xml",
    "result.pdf": b"%PDF-",
    "result.glb": b"glTF",
    "preview.png": b"\x89PNG",
    "error.png": b"\x89PNG",
    "patches.png": b"\x89PNG",
    "report": b"{",
}


@pytest.fixture
def endless(api: httpx.Client) -> Iterator[dict[str, Any]]:
    """A job that does not end by itself."""
    noise = np.random.default_rng(0).integers(0, 256, (120, 120, 3), dtype=np.uint8)
    job = submitted(api, encoded(Image.fromarray(noise)), **ENDLESS)
    yield job
    api.delete(job["links"]["self"])


def running(api: httpx.Client, job: dict[str, Any]) -> dict[str, Any]:
    """The job once it runs and tells of its progress."""
    now: dict[str, Any] = {}

    def runs() -> bool:
        now.update(api.get(job["links"]["self"]).json())
        return now["status"] == "running" and bool(now["progress"])

    within(120, runs, "the job runs")
    return now


def events(api: httpx.Client, link: str, after: int | None = None) -> list[dict[str, Any]]:
    """The events of a stream that ends."""
    headers = {} if after is None else {"Last-Event-ID": str(after)}
    with api.stream("GET", link, headers=headers) as answer:
        assert answer.headers["content-type"].startswith("text/event-stream")
        return [event for event in events_of(answer) if "data" in event]


@pytest.mark.contract("3: POST /v1/jobs")
def test_post_jobs_accepts_and_says_where(api: httpx.Client, photo: bytes) -> None:
    answer = post(api, photo, cvat(GROUND, BOX), target_mse=20, max_points=50, strategy="batch", workers=1)
    assert answer.status_code == 202
    job = answer.json()
    assert answer.headers["location"] == f"/v1/jobs/{job['id']}"
    assert int(answer.headers["retry-after"]) >= 1
    assert set(job) >= JOB_FIELDS
    assert job["status"] == "queued"
    report = api.get(ended(api, job)["links"]["report"]).json()
    assert report["mse"] <= 20
    assert report["warnings"] == []
    assert {region["label"] for region in report["regions"]} == {"ground", "box"}


@pytest.mark.contract("3: POST /v1/jobs: options")
def test_post_jobs_takes_the_options_of_the_command_line(
    api: httpx.Client, finished: dict[str, Any], folder: Path
) -> None:
    assert api.get(finished["links"]["gcv"]).content == (folder / "photo.gcv").read_bytes()
    form = api.get("/openapi.json").json()["components"]["schemas"]["Body_submit_job"]["properties"]
    described = form["options"]["contentSchema"]["properties"]
    assert "image_name" in described
    command = {"strategy": "batch", "target_mse": 5, "max_points": 2000, "workers": 0}
    assert {name: described[name]["default"] for name in command} == command


@pytest.mark.contract("3: POST /v1/jobs: Idempotency-Key")
def test_an_idempotency_key_stands_for_one_request(api: httpx.Client, photo: bytes) -> None:
    headers = {"Idempotency-Key": "contract"}
    first, again = (post(api, photo, target_mse=30, headers=headers) for _ in range(2))
    assert (first.status_code, again.status_code) == (202, 202)
    assert first.json()["id"] == again.json()["id"]
    assert first.headers["location"] == again.headers["location"]
    refused(post(api, photo, target_mse=31, headers=headers), 422, "idempotency-mismatch")


@pytest.mark.contract("3: GET /v1/jobs/{id}")
def test_get_jobs_id_tells_everything(api: httpx.Client, endless: dict[str, Any]) -> None:
    job = running(api, endless)
    assert set(job) >= JOB_FIELDS
    figures = {"phase", "region", "regions", "iteration", "points", "mse", "fraction"}
    assert set(job["progress"]) >= figures
    assert (job["finished_at"], job["expires_at"], job["error"]) == (None, None, None)
    assert job["created_at"] <= job["started_at"]


@pytest.mark.contract("3: GET /v1/jobs/{id}?wait=")
def test_get_jobs_id_waits(api: httpx.Client, photo: bytes, endless: dict[str, Any]) -> None:
    link = submitted(api, photo)["links"]["self"]
    job = api.get(f"{link}?wait=30").json()
    assert job["status"] == "succeeded"
    assert job["finished_at"] < job["expires_at"]
    start = time.monotonic()
    assert api.get(f"{endless['links']['self']}?wait=1").json()["status"] in ("queued", "running")
    assert time.monotonic() - start >= 1
    for wait in ("31", "-1", "nan", "soon"):
        answer = refused(api.get(f"{link}?wait={wait}"), 422, "invalid-request")
        assert answer["pointer"] == "/query/wait"


@pytest.mark.contract("3: GET /v1/jobs/{id}/events")
def test_get_events_streams_replays_and_ends(api: httpx.Client) -> None:
    photo = encoded(Image.fromarray(data.chelsea()[100 : 100 + HEIGHT, 200 : 200 + WIDTH]))
    job = submitted(api, photo, cvat(GROUND, BOX))
    first, *middle, last = events(api, job["links"]["events"])
    assert (first["event"], first["data"]["id"]) == ("snapshot", job["id"])
    assert {event["event"] for event in middle} == {"progress"}
    iterations = [event["data"]["iteration"] for event in middle if event["data"]["phase"] == "refine"]
    assert iterations == list(range(1, len(iterations) + 1))
    assert len(iterations) > 1
    assert (last["event"], last["data"]["status"]) == ("state", "succeeded")
    seen = int(middle[2]["id"])
    snapshot, *replayed = events(api, job["links"]["events"], after=seen)
    assert snapshot["event"] == "snapshot"
    assert replayed == [*middle[3:], last]
    everything = {"Last-Event-ID": last["id"]}
    assert api.get(job["links"]["events"], headers=everything).status_code == 204


@pytest.mark.contract("3: GET /v1/jobs")
def test_get_jobs_lists_newest_first_by_an_opaque_cursor(api: httpx.Client, photo: bytes) -> None:
    made = [submitted(api, photo, target_mse=60)["id"] for _ in range(3)]
    seen: list[str] = []
    link = "/v1/jobs?limit=2"
    while link:
        page = api.get(link).json()
        assert len(page["jobs"]) <= 2
        seen += [job["id"] for job in page["jobs"]]
        link = page["next"]
    assert seen[:3] == made[::-1]
    assert len(set(seen)) == len(seen)
    assert refused(api.get("/v1/jobs?cursor=guess"), 422, "invalid-request")["pointer"] == "/query/cursor"


@pytest.mark.contract("3: GET /v1/jobs: own jobs")
def test_get_jobs_shows_own_jobs_only(guarded: httpx.Client, photo: bytes) -> None:
    job = submitted(guarded, photo, target_mse=60)
    assert job["id"] in [each["id"] for each in guarded.get("/v1/jobs").json()["jobs"]]
    assert guarded.get("/v1/jobs", headers=key(BOB)).json() == {"jobs": [], "next": None}


@pytest.mark.contract("3: GET /v1/jobs/{id}/result")
def test_get_result_is_a_complete_description(api: httpx.Client, finished: dict[str, Any]) -> None:
    result = api.get(finished["links"]["result"]).json()
    jsonschema.validate(result, json.loads((ROOT / "openapi" / "result.schema.json").read_text()))
    assert set(result) >= {"format", "image", "curves", "patches", "metrics", "seconds"}
    assert result["format"] == "gcvec/1"
    assert result["image"] == {"width": WIDTH, "height": HEIGHT}
    for curve in result["curves"]:
        hard = curve["hard"]
        sets = [curve["colors"][side] for side in ("left", "right")] if hard else [curve["colors"]]
        assert {len(colors) for colors in sets} == {len(curve["control_points"])}
        assert {"left", "right"} <= set(curve)
    assert any(curve["hard"] for curve in result["curves"])
    for patch in result["patches"]:
        assert set(patch) >= {"label", "loops", "domain", "points", "metrics"}
        assert all({"curve", "from", "to"} <= set(span) for loop in patch["loops"] for span in loop)
        assert all({"domain", "image", "color"} <= set(point) for point in patch["points"])
    xs, ys = np.array([point for curve in result["curves"] for point in curve["control_points"]]).T
    assert (xs.min(), xs.max(), ys.min(), ys.max()) == (0, WIDTH, 0, HEIGHT)


@pytest.mark.contract("3: GET /v1/jobs/{id}/result: warnings")
def test_a_job_that_misses_its_target_says_so(api: httpx.Client, photo: bytes) -> None:
    job = ended(api, submitted(api, photo, regions=1, target_mse=1, max_points=5))
    assert job["status"] == "succeeded"
    (warning,) = job["warnings"]
    assert "above the target of 1: 1 of 1 regions need more than the 5 control points" in warning
    assert api.get(job["links"]["result"]).json()["warnings"] == [warning]


@pytest.mark.contract("3: GET /v1/jobs/{id}/result: drawn from it alone")
def test_the_description_is_enough_to_draw_the_picture(api: httpx.Client, finished: dict[str, Any]) -> None:
    from gcvec.raster.painting import paint

    mesh = api.get(finished["links"]["result"]).json()["mesh"]
    triangles = np.array(mesh["triangles"])
    drawn = paint(np.array(mesh["positions"]), triangles, np.array(mesh["colors"]), triangles, WIDTH, HEIGHT)
    preview = pixels(api.get(finished["links"]["preview"]).content)
    assert np.abs(np.clip(drawn, 0, 1) * 255 - preview).max() < 1.5


@pytest.mark.contract("3: artefacts; ETag, 304, Range")
@pytest.mark.parametrize("name", ARTIFACTS)
def test_artefacts_have_tags_and_ranges(api: httpx.Client, finished: dict[str, Any], name: str) -> None:
    link = f"{finished['links']['self']}/{name}"
    whole = api.get(link, headers={"Accept-Encoding": "identity"})
    assert whole.status_code == 200, whole.text
    assert whole.content.startswith(ARTIFACTS[name])
    known = api.get(link, headers={"If-None-Match": whole.headers["etag"]})
    assert (known.status_code, known.content) == (304, b"")
    part = api.get(link, headers={"Range": "bytes=2-9", "Accept-Encoding": "identity"})
    assert (part.status_code, part.content) == (206, whole.content[2:10])
    assert part.headers["content-range"] == f"bytes 2-9/{len(whole.content)}"


@pytest.mark.contract("3: GET /v1/jobs/{id}/preview.png?scale=")
def test_the_preview_has_any_scale(api: httpx.Client, finished: dict[str, Any]) -> None:
    answer = api.get(f"{finished['links']['preview']}?scale=2.5")
    assert Image.open(io.BytesIO(answer.content)).size == (160, 120)


@pytest.mark.contract("3: POST /v1/jobs/{id}/edits")
def test_post_edits_makes_a_revision_and_keeps_the_original(
    api: httpx.Client, finished: dict[str, Any]
) -> None:
    original = api.get(finished["links"]["gcv"]).content
    image = VectorImage.from_bytes(original)
    curve = next(number for number, curve in enumerate(image.curves) if not curve.on_frame)
    move = {"curve": curve, "index": 1, "dx": 2, "dy": -1}
    edits = {"moves": [move], "recolors": [{"patch": 0, "color": "#204060"}]}
    answer = api.post(finished["links"]["edits"], json=edits)
    assert answer.status_code == 200, answer.text
    revision = answer.json()
    edited = api.get(revision["links"]["gcv"]).content
    assert edited != original
    assert api.get(finished["links"]["gcv"]).content == original
    for name in ("result", "preview", "patches", "svg", "pdf", "glb"):
        assert api.get(revision["links"][name]).status_code == 200
    wrong = {"moves": [move, {**move, "curve": 999}]}
    answer = refused(api.post(finished["links"]["edits"], json=wrong), 422, "unknown-curve")
    assert answer["pointer"] == "/body/moves/1"


@pytest.mark.contract("3: DELETE /v1/jobs/{id}: running")
def test_delete_cancels_a_running_job(api: httpx.Client, endless: dict[str, Any]) -> None:
    running(api, endless)
    assert api.delete(endless["links"]["self"]).status_code == 204
    assert api.get(endless["links"]["self"]).json()["status"] == "canceled"


@pytest.mark.contract("3: DELETE /v1/jobs/{id}: finished")
def test_delete_removes_input_and_results(api: httpx.Client, photo: bytes, running_service: Any) -> None:
    job = ended(api, submitted(api, photo, target_mse=60))
    files = running_service.data / "storage" / "jobs" / job["id"]
    assert {path.name for path in files.rglob("*")} >= {"image", "result.gcv"}
    assert api.delete(job["links"]["self"]).status_code == 204
    assert not files.exists()
    for link in job["links"].values():
        if not link.endswith("/edits"):
            refused(api.get(link), 410, "gone")


@pytest.mark.contract("3: /livez /readyz /metrics, /docs, /openapi.json, /")
@pytest.mark.parametrize(
    ("path", "media_type"),
    [
        ("/livez", "application/json"),
        ("/readyz", "application/json"),
        ("/metrics", "text/plain"),
        ("/docs", "text/html"),
        ("/openapi.json", "application/json"),
        ("/", "text/html"),
    ],
)
def test_get_other_pages(api: httpx.Client, path: str, media_type: str) -> None:
    answer = api.get(path)
    assert answer.status_code == 200
    assert answer.headers["content-type"].startswith(media_type)


@pytest.mark.contract("3: not ready -> 409")
def test_what_is_not_ready_is_a_conflict(api: httpx.Client, endless: dict[str, Any]) -> None:
    base = endless["links"]["self"]
    for name in ("result", *ARTIFACTS):
        answer = api.get(f"{base}/{name}")
        refused(answer, 409, "not-ready")
        assert int(answer.headers["retry-after"]) >= 1
    refused(api.post(f"{base}/edits", json={}), 409, "not-ready")


@pytest.mark.contract("3: expired -> 410")
def test_what_has_expired_is_gone(guarded: httpx.Client, photo: bytes) -> None:
    job = ended(guarded, submitted(guarded, photo, target_mse=60))
    assert job["status"] == "succeeded"
    within(30, lambda: guarded.get(job["links"]["self"]).status_code != 200, "its expiry")
    for name in ("self", "events", "result", "gcv", "preview"):
        refused(guarded.get(job["links"][name]), 410, "gone")


@pytest.mark.contract("3: unknown or another key's -> 404")
def test_unknown_and_others_jobs_are_not_found(guarded: httpx.Client, photo: bytes) -> None:
    job = submitted(guarded, photo, target_mse=60)
    for link, headers in ((job["links"]["self"], key(BOB)), (f"/v1/jobs/{'0' * 32}", {})):
        for path in ("", "/events", "/result", "/report", "/image"):
            refused(guarded.get(link + path, headers=headers), 404, "not-found")
        refused(guarded.delete(link, headers=headers), 404, "not-found")
        refused(guarded.post(f"{link}/edits", json={}, headers=headers), 404, "not-found")
    refused(guarded.get("/v1/nothing"), 404, "not-found")
    refused(guarded.put("/v1/jobs"), 405, "method-not-allowed")
    refused(guarded.get("/v1/jobs", headers={"Authorization": "Bearer guess"}), 401, "unauthorized")
