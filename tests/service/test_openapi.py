from __future__ import annotations

import json

import pytest

from service import openapi


def test_the_descriptions_are_in_step_with_the_application() -> None:
    for path, text in openapi.files().items():
        assert path.read_text(encoding="utf-8") == text


@pytest.mark.parametrize(
    ("call", "status", "headers"),
    [
        ("post /v1/jobs", "202", {"Location": True, "Retry-After": True}),
        ("get /v1/jobs/{job_id}", "200", {"Retry-After": False}),
        ("get /v1/jobs/{job_id}/result", "200", {"ETag": True}),
        ("get /v1/jobs/{job_id}/image", "206", {"ETag": True, "Content-Range": True}),
        ("get /v1/jobs", "503", {"Retry-After": True}),
    ],
)
def test_headers_that_clients_go_by_are_described(call: str, status: str, headers: dict[str, bool]) -> None:
    """That answers have them tests/service/test_contract_fuzz.py shows."""
    method, path = call.split()
    document = json.loads((openapi.FOLDER / "openapi.json").read_text(encoding="utf-8"))
    described = document["paths"][path][method]["responses"][status]["headers"]
    assert {name: header["required"] for name, header in described.items()} == headers
