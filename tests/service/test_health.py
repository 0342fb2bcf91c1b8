from __future__ import annotations

from pathlib import Path

import httpx

from tests.problems import refused
from tests.service.in_process import Jobs


def test_who_asks_for_the_headers_gets_them_alone(api: httpx.Client, jobs: Jobs) -> None:
    job = f"/v1/jobs/{jobs.submit()}"
    for path in ("/", "/livez", "/readyz", job, f"{job}/view"):
        answer = api.head(path)
        assert (answer.status_code, answer.content) == (200, b"")
        assert answer.headers["content-type"] == api.get(path).headers["content-type"]


def test_without_its_folder_the_service_is_not_ready(api: httpx.Client, tmp_path: Path) -> None:
    folder, away = tmp_path / "storage", tmp_path / "away"
    assert api.get("/readyz").status_code == 200
    folder.rename(away)
    answer = api.get("/readyz")
    refused(answer, 503, "unavailable")
    assert int(answer.headers["retry-after"]) > 0
    assert str(tmp_path) not in answer.text
    assert api.get("/livez").status_code == 200
    away.rename(folder)
    assert api.get("/readyz").status_code == 200
