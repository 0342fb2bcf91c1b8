from __future__ import annotations

import json
from dataclasses import fields
from typing import Any

import pytest

from gcvec import InputError, Options
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


def test_the_ranges_that_are_described_are_those_that_are_kept() -> None:
    document = json.loads((openapi.FOLDER / "openapi.json").read_text(encoding="utf-8"))
    form = document["components"]["schemas"]["Body_submit_job"]["properties"]
    options = form["options"]["contentSchema"]["properties"]
    numbers = {name: told for name, told in options.items() if told.get("type") in ("integer", "number")}
    assert numbers.keys() == {option.name for option in fields(Options)} - {"strategy"}
    for name, told in numbers.items():
        kind = {"integer": int, "number": float}[told["type"]]
        kept, refused = edges(told)
        for number in kept:
            Options(**{name: kind(number)})
        for number in refused:
            with pytest.raises(InputError, match=f"^{name} must (lie|be above)"):
                Options(**{name: kind(number)})


def edges(told: dict[str, Any]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Numbers at the ends of a range that is told: those that belong to it, and those that do not."""
    if "minimum" in told:
        return (told["minimum"], told["maximum"]), (told["minimum"] - 1, told["maximum"] + 1)
    least, most = told["exclusiveMinimum"], told["exclusiveMaximum"]
    return (least + 1e-6, most - 1e-6), (least, most)
