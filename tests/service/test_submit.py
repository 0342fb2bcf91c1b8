from __future__ import annotations

import json
import socket
from errno import ENOSPC
from io import BytesIO
from pathlib import Path
from tempfile import SpooledTemporaryFile
from typing import Any, NoReturn
from zipfile import ZipFile

import httpx
import pytest

from tests.broker import client_of
from tests.problems import refused
from tests.service.in_process import Jobs, files_in, serving
from tests.uploads import cvat, png
from worker.settings import Settings

IMAGE = ("a.png", png())


def test_a_picture_becomes_a_queued_job(api: httpx.Client, settings: Settings, tmp_path: Path) -> None:
    answer = api.post("/v1/jobs", files={"image": IMAGE, "annotations": ("a.xml", cvat())})
    assert answer.status_code == 202
    job = answer.json()
    assert answer.headers["location"] == f"/v1/jobs/{job['id']}" == job["links"]["self"]
    assert int(answer.headers["retry-after"]) >= 1
    assert job["status"] == "queued"
    assert api.get(job["links"]["self"]).json() == job
    folder = tmp_path / "storage" / "jobs" / job["id"]
    assert files_in(folder) == ["input/annotations", "input/image"]
    assert (folder / "input/image").read_bytes() == IMAGE[1]


@pytest.mark.parametrize(
    ("sent", "annotated"), [('a "b".png', "a &quot;b&quot;.png"), ("gru\u0308n.png", "gr\u00fcn.png")]
)
def test_a_picture_is_found_by_its_name(api: httpx.Client, sent: str, annotated: str) -> None:
    two = cvat("other.png").replace(b"</annotations>", cvat(annotated).partition(b"</version>")[2])
    answer = api.post("/v1/jobs", files={"image": (sent, png()), "annotations": ("a.xml", two)})
    assert answer.status_code == 202, answer.text


def test_a_zip_may_hold_annotations_of_several_subsets(api: httpx.Client) -> None:
    buffer = BytesIO()
    with ZipFile(buffer, "w") as target:
        for subset in ("train", "val"):
            target.writestr(f"{subset}.xml", cvat())
    files = {"image": IMAGE, "annotations": ("task.zip", buffer.getvalue())}
    problem = refused(api.post("/v1/jobs", files=files), 422, "unknown-image")
    assert "'train/a.png', 'val/a.png'" in problem["detail"]
    assert problem["pointer"] == "/annotations"
    options = {"options": json.dumps({"image_name": "val/a.png"})}
    assert api.post("/v1/jobs", files=files, data=options).status_code == 202


def test_the_message_is_a_job_id_and_nothing_large_is_in_redis(api: httpx.Client, settings: Settings) -> None:
    job = api.post("/v1/jobs", files={"image": IMAGE, "annotations": ("a.xml", cvat())}).json()
    client = client_of(settings.broker_url)
    (message,) = client.lrange("gcvec-jobs", 0, -1)
    assert json.loads(message)["headers"]["argsrepr"] == f"['{job['id']}']"
    assert all(client.memory_usage(key) < 10_000 for key in client.scan_iter())


@pytest.mark.parametrize(
    ("files", "status", "code", "pointer"),
    [
        ({"image": ("a.png", b"no picture")}, 415, "unsupported-picture", "/image"),
        ({"image": ("a.png", png()[:20])}, 422, "unreadable-picture", "/image"),
        ({"image": ("a.png", b"")}, 422, "unreadable-picture", "/image"),
        ({"image": ("a.png", png(201, 5))}, 413, "picture-too-large", "/image"),
        ({"image": ("a.png", b"x" * 100_001)}, 413, "too-large", "/image"),
        ({"image": IMAGE, "annotations": ("a.xml", b"x" * 100_001)}, 413, "too-large", "/annotations"),
        ({"image": IMAGE, "annotations": ("a.xml", b"<annotations>")}, 422, "broken-annotations", ...),
        ({"image": IMAGE, "annotations": ("a.xml", cvat(width=31))}, 422, "size-mismatch", "/annotations"),
        ({"image": IMAGE, "annotations": ("a.xml", b"<annotations/>")}, 422, "unknown-image", "/annotations"),
        ({"annotations": ("a.xml", cvat())}, 422, "invalid-request", "/image"),
    ],
)
def test_unusable_uploads_are_refused(
    api: httpx.Client, tmp_path: Path, files: dict[str, Any], status: int, code: str, pointer: Any
) -> None:
    problem = refused(api.post("/v1/jobs", files=files), status, code)
    if pointer is not ...:
        assert problem.get("pointer") == pointer
    assert api.get("/v1/jobs").json()["jobs"] == []
    assert files_in(tmp_path / "storage") == []


@pytest.mark.parametrize(
    ("options", "pointer"),
    [
        ('{"target_mse": 0}', "/options/target_mse"),
        ('{"target_mse": NaN}', "/options"),
        ('{"target_mse": 1e999}', "/options/target_mse"),
        ('{"max_points": -1}', "/options/max_points"),
        ('{"max_points": 9223372036854775808}', "/options/max_points"),
        ('{"snap": -1}', "/options/snap"),
        ('{"effort": 0}', "/options/effort"),
        ('{"max_points": 1.5}', "/options/max_points"),
        ('{"strategy": "slow"}', "/options/strategy"),
        ('{"colour": 1}', "/options/colour"),
        ("[1]", "/options"),
        ("{", "/options"),
        ("[" * 100_000, "/options"),
    ],
)
def test_options_that_make_no_sense_are_refused(api: httpx.Client, options: str, pointer: str) -> None:
    answer = api.post("/v1/jobs", files={"image": IMAGE}, data={"options": options})
    assert refused(answer, 422, "bad-option")["pointer"] == pointer


@pytest.mark.parametrize(
    ("request_of", "detail"),
    [
        ({"data": {"image": "text"}}, "the part 'image' should be a file"),
        (
            {"files": {"image": IMAGE}, "data": {"annotations": "text"}},
            "the part 'annotations' should be a file",
        ),
        ({"files": {"image": IMAGE, "options": ("o.json", b"{}")}}, "the part 'options' should be text"),
        ({}, "the part 'image' is missing"),
        ({"options": {"colour": 1}}, "there is no option 'colour'"),
        ({"options": [1]}, "the options should be a JSON object"),
        ({"options": {"strategy": "slow"}}, "the option 'strategy' should be 'batch' or 'paper'"),
        ({"options": {"max_points": True}}, "the option 'max_points' should be a whole number"),
        ({"options": {"max_points": "5"}}, "the option 'max_points' should be a whole number"),
        ({"options": {"target_mse": "5"}}, "the option 'target_mse' should be a number"),
        ({"options": {"snap": False}}, "the option 'snap' should be a number"),
        ({"webhook": {"url": "https://a.example"}}, "the field 'secret' is missing"),
    ],
)
def test_what_is_wrong_is_named_in_words(api: httpx.Client, request_of: dict[str, Any], detail: str) -> None:
    texts = {part: json.dumps(value) for part, value in request_of.items() if part in ("options", "webhook")}
    form = {"files": {"image": IMAGE}, "data": texts} if texts else request_of
    answer = api.post("/v1/jobs", **form)
    assert (answer.status_code, answer.json()["detail"]) == (422, detail)


def test_whole_numbers_are_numbers_whatever_way_they_are_written(jobs: Jobs) -> None:
    job = jobs.records.get(jobs.submit(target_mse=5, snap=2, max_points=300.0, regions=4))
    assert job is not None
    assert (
        job.request["options"].items()
        >= {"target_mse": 5, "snap": 2, "max_points": 300, "regions": 4}.items()
    )


@pytest.mark.parametrize("matte", ["#10c020", "10C020"])
def test_a_colour_may_be_written_without_its_sign(jobs: Jobs, matte: str) -> None:
    job = jobs.records.get(jobs.submit(matte=matte))
    assert job is not None
    assert job.request["matte"] == matte


def test_the_image_must_be_in_the_annotations_when_it_is_named(api: httpx.Client) -> None:
    files = {"image": IMAGE, "annotations": ("a.xml", cvat("other.png"))}
    assert api.post("/v1/jobs", files=files).status_code == 202
    answer = api.post("/v1/jobs", files=files, data={"options": '{"image_name": "b.png"}'})
    assert "b.png" in refused(answer, 422, "unknown-image")["detail"]


@pytest.mark.parametrize(
    ("request_of", "pointer"),
    [
        ({}, "/image"),
        ({"json": {}}, "/image"),
        ({"data": {"image": "text"}}, "/image"),
        ({"files": {"image": IMAGE, "options": ("o.json", b"{}")}}, "/options"),
    ],
)
def test_a_part_that_is_missing_or_of_another_kind_is_named(
    api: httpx.Client, request_of: dict[str, Any], pointer: str
) -> None:
    assert refused(api.post("/v1/jobs", **request_of), 422, "invalid-request")["pointer"] == pointer


def test_a_body_beyond_every_limit_is_refused_while_it_streams(api: httpx.Client) -> None:
    def flood() -> Any:
        yield b'--b\r\nContent-Disposition: form-data; name="image"; filename="a.png"\r\n\r\n'
        for _ in range(100):
            yield b"x" * 100_000

    headers = {"content-type": "multipart/form-data; boundary=b"}
    refused(api.post("/v1/jobs", content=flood(), headers=headers), 413, "too-large")


def test_a_body_that_states_too_large_a_size_is_not_awaited(api: httpx.Client) -> None:
    address = (api.base_url.host, api.base_url.port or 0)
    with socket.create_connection(address, timeout=10) as connection:
        stated = b"Content-Length: 10000000000"
        connection.sendall(b"POST /v1/jobs HTTP/1.1\r\nHost: localhost\r\n" + stated + b"\r\n\r\n")
        assert connection.recv(1000).startswith(b"HTTP/1.1 413 ")


def test_nothing_is_left_when_the_broker_is_away(tmp_path: Path) -> None:
    away = Settings(broker_url="redis://127.0.0.1:1/0", data_dir=tmp_path)
    with serving(away) as api:
        answer = api.post("/v1/jobs", files={"image": IMAGE})
        refused(answer, 503, "unavailable")
        assert int(answer.headers["retry-after"]) >= 1
        refused(api.get("/v1/jobs/x"), 503, "unavailable")
        refused(api.get("/readyz"), 503, "unavailable")
        assert api.get("/livez").status_code == 200
    assert files_in(tmp_path / "storage") == []


def test_an_upload_that_no_disk_has_room_for_is_refused_for_now(
    settings: Settings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is larger than a megabyte lies in a temporary file while it comes in."""

    def full(*_: object) -> NoReturn:
        raise OSError(ENOSPC, "No space left on device")

    monkeypatch.setattr(SpooledTemporaryFile, "rollover", full)
    with serving(settings.model_copy(update={"max_upload_bytes": 2_000_000})) as api:
        answer = api.post("/v1/jobs", files={"image": ("a.png", png() + bytes(1_500_000))})
        assert "disk" in refused(answer, 503, "unavailable")["detail"]
        assert int(answer.headers["retry-after"]) >= 1
        assert api.post("/v1/jobs", files={"image": IMAGE}).status_code == 202


@pytest.mark.parametrize(
    "place",
    [
        "starlette.datastructures.UploadFile.write",  # while the framework reads the form
        "service.jobs.endpoints.read_file",
        "service.jobs.service.fingerprint_of",
        "service.jobs.uploads.read_annotations",
        "service.jobs.service.storage.annotations_path",  # once the picture is in the store
    ],
)
def test_an_upload_that_memory_is_too_short_for_is_refused_for_now(
    api: httpx.Client, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, place: str
) -> None:
    """Nothing of it is left, and the same request may be sent again."""

    def fail(*_: object, **__: object) -> NoReturn:
        raise MemoryError

    def send() -> httpx.Response:
        files = {"image": IMAGE, "annotations": ("a.xml", cvat())}
        return api.post("/v1/jobs", files=files, headers={"Idempotency-Key": "again"})

    with monkeypatch.context() as patch:
        patch.setattr(place, fail)
        answer = send()
    assert "memory" in refused(answer, 503, "unavailable")["detail"]
    assert int(answer.headers["retry-after"]) >= 1
    assert api.get("/v1/jobs").json()["jobs"] == []
    assert files_in(tmp_path / "storage") == []
    assert send().status_code == 202


@pytest.mark.parametrize(
    ("webhook", "pointer"),
    [
        ("{", "/webhook"),
        ("[]", "/webhook"),
        ('{"url": "https://a.example"}', "/webhook/secret"),
        ('{"url": "https://a.example", "secret": "abc"}', "/webhook/secret"),
        ('{"url": "https://a.example", "secret": "whsec_AAAA"}', "/webhook/secret"),
        ('{"url": "https://a.example", "secret": "whsec_%%%"}', "/webhook/secret"),
        ('{"url": "https://10.0.0.1", "secret": "whsec_' + "A" * 32 + '"}', "/webhook/url"),
        (
            '{"url": "https://a.example", "secret": "whsec_' + "A" * 32 + '", "events": ["x"]}',
            "/webhook/events/0",
        ),
    ],
)
def test_a_webhook_that_cannot_be_called_is_refused(api: httpx.Client, webhook: str, pointer: str) -> None:
    answer = api.post("/v1/jobs", files={"image": IMAGE}, data={"webhook": webhook})
    assert refused(answer, 422, "bad-webhook")["pointer"] == pointer
