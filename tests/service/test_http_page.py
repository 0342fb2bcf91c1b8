"""docs/http.md says what the interface description and the code say."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

from worker.artifacts import EXPORTS, KINDS, REVISED
from worker.problems import TITLES, problem
from worker.settings import Settings
from worker.steps import EVENTS_KEPT

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "http.md").read_text()
REVISION = "/v1/jobs/{job_id}/revisions/{revision}"


def rows(columns: int) -> list[list[str]]:
    """The cells of all table rows with so many columns, without headings."""
    lines = [line[2:-1].split("|") for line in PAGE.splitlines() if line.startswith("| `")]
    return [[cell.strip() for cell in cells] for cells in lines if len(cells) == columns]


def numbers(text: str) -> set[str]:
    return set(re.findall(r"\b[2-5]\d\d\b", text))


def described() -> dict[str, dict[str, Any]]:
    """The operations of the interface description by method and path."""
    paths = json.loads((ROOT / "openapi" / "openapi.json").read_text())["paths"]
    return {
        f"{method.upper()} {path}": operation
        for path, operations in paths.items()
        for method, operation in operations.items()
    }


def test_every_call_is_listed_with_its_answers() -> None:
    listed = {call.strip("`"): numbers(f"{answers} {refusals}") for call, _, answers, refusals in rows(4)}
    operations = described()
    files = {call: operation for call, operation in operations.items() if f"{REVISION}/" in call}
    assert listed == {
        call: set(operation["responses"]) for call, operation in operations.items() if call not in files
    }
    for call, operation in files.items():
        original = operations[call.replace("/revisions/{revision}", "")]
        assert set(operation["responses"]) == set(original["responses"])
    revised = {KINDS[name].route for name in REVISED} | {kind.route for kind in EXPORTS.values()}
    assert set(files) == {f"GET {REVISION}/{route}" for route in revised}


def test_parameters_are_named() -> None:
    for call, operation in described().items():
        row = next((cells for cells in rows(4) if cells[0] == f"`{call}`"), None)
        for parameter in operation.get("parameters", []) if row else ():
            if parameter["in"] == "query":
                assert f"`{parameter['name']}`" in row[1], call
            if parameter["in"] == "header":
                assert parameter["name"] in PAGE.lower(), call


def test_every_problem_type_is_listed_with_its_status() -> None:
    listed = {code.strip("`"): int(status) for code, status, _ in rows(3)}
    engine = [file for file in (ROOT / "gcvec").rglob("*.py") if "cli" not in file.parts]
    raised = {code for file in engine for code in re.findall(r'code="([a-z-]+)"', file.read_text())}
    internal = {"broken-gcv", "bad-picture"}  # of what programs hand over; the service reads its own alone
    assert raised >= internal
    assert listed == {code: problem(code, "").status for code in {*TITLES, *raised} - internal}


def test_the_example_is_a_problem() -> None:
    example = json.loads(re.search(r"    (\{\"type\": \"urn.*?\})\n", PAGE, re.DOTALL)[1])
    found = problem("broken-annotations", example["detail"], example["pointer"])
    assert example == found.as_dict()


def test_settings_and_numbers_are_the_real_ones() -> None:
    named = set(re.findall(r"GCVEC_(\w+)", PAGE))
    assert named <= {name.upper() for name in Settings.model_fields}
    assert f"{EVENTS_KEPT:,} events" in PAGE
    wait = next(p for p in described()["GET /v1/jobs/{job_id}"]["parameters"] if p["name"] == "wait")
    assert (wait["schema"]["minimum"], wait["schema"]["maximum"]) == (0, 30)
