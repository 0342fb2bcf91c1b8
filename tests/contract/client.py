"""A client of the HTTP interface."""

from __future__ import annotations

import json
from typing import Any

import httpx


def post(
    api: httpx.Client,
    image: bytes,
    annotations: str | None = None,
    *,
    name: str = "photo.png",
    headers: dict[str, str] | None = None,
    **options: Any,
) -> httpx.Response:
    files = {"image": (name, image)}
    if annotations is not None:
        files["annotations"] = ("regions.xml", annotations.encode())
    return api.post("/v1/jobs", files=files, data={"options": json.dumps(options)}, headers=headers)


def submitted(api: httpx.Client, image: bytes, annotations: str | None = None, **more: Any) -> dict[str, Any]:
    answer = post(api, image, annotations, **more)
    assert answer.status_code == 202, answer.text
    job: dict[str, Any] = answer.json()
    return job


def ended(api: httpx.Client, job: dict[str, Any]) -> dict[str, Any]:
    """The job once it has ended."""
    for _ in range(8):
        now: dict[str, Any] = api.get(f"{job['links']['self']}?wait=30").json()
        if now["status"] not in ("queued", "running"):
            return now
    raise AssertionError(f"not ended: {now}")
