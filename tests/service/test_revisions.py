from __future__ import annotations

from typing import Any

import httpx
import pytest

from service.errors import unavailable
from service.questions import Questions
from tests.service.in_process import Jobs
from worker import storage
from worker.questions import Answer
from worker.storage import Manifest

MOVE = {"curve": 0, "index": 1, "dx": 1.5, "dy": 0}


@pytest.mark.parametrize(
    ("edits", "pointer"),
    [
        ({"moves": [{**MOVE, "dx": "wide"}]}, "/body/moves/0/dx"),
        ({"moves": [{**MOVE, "curve": -1}]}, "/body/moves/0/curve"),
        ({"moves": [{**MOVE, "curve": True}]}, "/body/moves/0/curve"),
        ({"moves": [{**MOVE, "index": "1"}]}, "/body/moves/0/index"),
        ({"moves": [{**MOVE, "index": 1.5}]}, "/body/moves/0/index"),
        ({"moves": [{**MOVE, "dx": 1e6}]}, "/body/moves/0/dx"),
        ({"recolors": [{"patch": 0, "color": "red"}]}, "/body/recolors/0/color"),
        ({"recolors": [{"patch": 0, "color": "204060"}, {"patch": 0}]}, "/body/recolors/1/color"),
        ({"recolors": [{"patch": 0}]}, "/body/recolors/0/color"),
        ({"paint": []}, "/body/paint"),
        ([], "/body"),
        ({}, "/body"),
        ({"moves": [], "recolors": [], "revision": 0}, "/body"),
    ],
)
def test_edits_that_make_no_sense_are_refused(
    api: httpx.Client, jobs: Jobs, edits: Any, pointer: str
) -> None:
    answer = api.post(f"/v1/jobs/{jobs.finished()}/edits", json=edits)
    assert (answer.status_code, answer.json()["pointer"]) == (422, pointer)


@pytest.mark.parametrize("text", ["", "{", '{"moves": [}'])
def test_edits_that_are_no_json_are_refused(api: httpx.Client, jobs: Jobs, text: str) -> None:
    headers = {"Content-Type": "application/json"}
    answer = api.post(f"/v1/jobs/{jobs.finished()}/edits", content=text, headers=headers)
    assert (answer.status_code, answer.json()["pointer"]) == (422, "/body")


@pytest.mark.parametrize("media_type", ["application/x-www-form-urlencoded", "text/plain", None])
def test_edits_that_are_not_sent_as_json_are_told_so(
    api: httpx.Client, jobs: Jobs, media_type: str | None
) -> None:
    headers = {"Content-Type": media_type} if media_type else {}
    content = '{"recolors": [{"patch": 0, "color": "#204060"}]}'
    answer = api.post(f"/v1/jobs/{jobs.finished()}/edits", content=content, headers=headers)
    assert (answer.status_code, answer.json()["pointer"]) == (422, "/header/content-type")
    assert "application/json" in answer.json()["detail"]


def test_what_is_not_there_cannot_be_edited(api: httpx.Client, jobs: Jobs) -> None:
    assert api.post(f"/v1/jobs/{'0' * 32}/edits", json={}).status_code == 404
    assert api.post(f"/v1/jobs/{jobs.submit()}/edits", json={}).status_code == 409
    assert api.post(f"/v1/jobs/{jobs.finished()}/edits", json={"revision": 3}).status_code == 404


def test_a_revision_has_files_of_its_own(api: httpx.Client, jobs: Jobs) -> None:
    job_id = jobs.finished(b"original")
    files = {"gcv": storage.write(jobs.store, f"{storage.revision_folder(job_id, 1)}/result.gcv", b"edited")}
    storage.commit(jobs.store, job_id, Manifest(1, files), 1)
    links = api.get(f"/v1/jobs/{job_id}/revisions/1").json()["links"]
    assert api.get(links["gcv"]).content == b"edited"
    assert api.get(api.get(links["job"]).json()["links"]["gcv"]).content == b"original"
    for revision in ("2", "0", "x"):
        answer = api.get(f"/v1/jobs/{job_id}/revisions/{revision}/result.gcv")
        assert answer.status_code == (404 if revision == "2" else 422)


@pytest.mark.parametrize("scale", ["0", "-1", "nan", "inf", "33", "x", "7"])
def test_a_preview_of_no_sensible_size_is_refused(api: httpx.Client, jobs: Jobs, scale: str) -> None:
    """The picture is 30 pixels wide and the limit here 200: seven times is one too many."""
    answer = api.get(f"/v1/jobs/{jobs.finished()}/preview.png?scale={scale}")
    assert (answer.status_code, answer.json()["pointer"]) == (422, "/query/scale")


def test_a_derived_file_is_served_from_the_store(api: httpx.Client, jobs: Jobs) -> None:
    job_id = jobs.finished()
    storage.write_derived(jobs.store, job_id, 0, "preview-2.5.png", b"drawn before")
    answer = api.get(f"/v1/jobs/{job_id}/preview.png?scale=2.5")
    assert (answer.status_code, answer.content) == (200, b"drawn before")
    assert answer.headers["content-type"] == "image/png"


def test_a_whole_number_may_be_written_with_a_fraction(
    api: httpx.Client, jobs: Jobs, monkeypatch: pytest.MonkeyPatch
) -> None:
    """To JSON, and so to the interface description, 1.0 is an integer."""
    asked: list[Any] = []

    async def ask_alone(_: Questions, task: str, args: Any, *more: Any) -> Answer:
        asked.append(args[2])
        return Answer(1)

    monkeypatch.setattr(Questions, "ask_alone", ask_alone)
    edits = {
        "moves": [{**MOVE, "index": 1.0}],
        "recolors": [{"patch": 2.0, "color": "#204060"}],
        "revision": 0.0,
    }
    answer = api.post(f"/v1/jobs/{jobs.finished()}/edits", json=edits)
    assert answer.status_code == 200, answer.text
    assert asked == [{"moves": [MOVE], "recolors": [{"patch": 2, "color": "#204060"}]}]


def test_an_edit_that_is_asked_for_again_is_the_same_to_workers(
    api: httpx.Client, jobs: Jobs, monkeypatch: pytest.MonkeyPatch
) -> None:
    """So they know the revision that they have made, if the answer was lost."""
    asked: list[str | None] = []

    async def ask_alone(_: Questions, task: str, args: Any, seconds: float, identity: str | None) -> Answer:
        asked.append(identity)
        if len(asked) == 1:
            raise unavailable("the job records cannot be reached")
        return Answer(1)

    monkeypatch.setattr(Questions, "ask_alone", ask_alone)
    path = f"/v1/jobs/{jobs.finished()}/edits"
    calls = [("k", 0), ("k", 0), ("k", 0), ("other", 0), ("third", 1), (None, 0)]
    statuses = []
    for key, patch in calls:
        edits = {"recolors": [{"patch": patch, "color": "#204060"}]}
        headers = {"Idempotency-Key": key} if key else {}
        statuses.append(api.post(path, json=edits, headers=headers).status_code)
    assert statuses == [503, 200, 200, 200, 200, 200]
    first, again, *others, without = asked  # the third call is answered without a worker
    assert first == again
    assert len({first, *others}) == 3
    assert without is None
