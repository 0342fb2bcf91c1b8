"""Ten thousand requests made from the interface description: every answer is one that it documents."""

from __future__ import annotations

import json
import random
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import pytest
import requests
import schemathesis
from hypothesis import HealthCheck, Phase, given, seed, settings
from schemathesis import Case, GenerationMode
from schemathesis.config import GenerationConfig
from schemathesis.specs.openapi import checks

from service.app import create_app
from tests.fleet import Fleet, one_region, picture
from tests.readers import missing
from tests.uploads import png
from worker import storage
from worker.artifacts import KINDS
from worker.problems import problem
from worker.produce import produce
from worker.queues import SHORT_QUEUE
from worker.settings import Settings
from worker.steps import claim, finish
from worker.storage import Manifest

pytestmark = [pytest.mark.service, pytest.mark.slow]

REQUESTS = 10_000
CASES = 50
"""Generated for each operation, half of them valid and half not; each is asked of several jobs."""
OFTEN = {"POST /v1/jobs": 250, "POST /v1/jobs/{job_id}/edits": 100, "GET /v1/jobs": 60}

EDITS = 8
"""So many edits are made; after that a job is asked for them that has no result."""
UNFINISHED = ("queued", "running")

SIDE = 24
IMAGES = (picture(SIDE), picture(SIDE, 1)[:40], png(501, 500), b"GIF89a")
ANNOTATIONS = (one_region(SIDE), one_region(SIDE - 1), b"<annotations>", b"{}")
OPTIONS: dict[str, tuple[Any, ...]] = {
    "strategy": ("batch", "paper", "slow", None),
    "target_mse": (5, 0, -1, 1e300, float("nan"), "5", None),
    "max_points": (0, 10, -1, 2**70, 1.5, True),
    "workers": (0, 1, -1, 10**9),
    "regions": (0, 3, -1, 2**40),
    "snap": (0, 2.5, -0.1, 1e9),
    "image_name": ("a.png", "b.png", "", "\ud800", "x" * 2000, None),
    "unknown": (1,),
}
WEBHOOKS: dict[str, tuple[Any, ...]] = {
    "url": ("https://a.example", "http://a.example", "https://10.0.0.1/", "https://[", "", "x" * 3000),
    "secret": ("whsec_" + "A" * 32, "whsec_", "whsec_%", ""),
    "events": (["job.failed"], [], ["x"], "job.failed", None),
}

CHECKS = [
    schemathesis.checks.not_a_server_error,
    checks.status_code_conformance,
    checks.content_type_conformance,
    checks.response_headers_conformance,
    checks.response_schema_conformance,
    checks.unsupported_method,
]

SCHEMA = schemathesis.openapi.from_dict(create_app().openapi())
OPERATIONS = {found.ok().label: found.ok() for found in SCHEMA.get_all_operations()}


@dataclass
class World:
    """A service, jobs in every state, and what was asked so far."""

    url: str
    jobs: dict[str, str]
    session: requests.Session
    statuses: Counter[tuple[str, int]] = field(default_factory=Counter)

    def ask(self, case: Case) -> None:
        """Send the request and check the answer against the description."""
        answer = case.call(self.url, session=self.session)
        self.statuses[case.operation.label, answer.status_code] += 1
        case.validate_response(answer, checks=CHECKS)
        if answer.status_code >= 400 and answer.request.method != "HEAD":
            assert answer.headers["content-type"] == ["application/problem+json"], answer.text
            document = json.loads(answer.content)
            assert document["status"] == answer.status_code
            assert document["detail"], document

    def jobs_for(self, case: Case) -> list[str]:
        """The jobs to ask the same of: those that it neither harms nor has to wait for."""
        label = case.operation.label
        if label.endswith("/edits"):
            return [self.jobs["done" if self.statuses[label, 200] < EDITS else "queued"]]
        if label.startswith("DELETE"):
            return [self.jobs["gone"], self.jobs["canceled"]]
        if label.endswith("/events") or "wait" in (case.query or {}):
            return [job_id for name, job_id in self.jobs.items() if name not in UNFINISHED]
        return list(self.jobs.values())


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Iterator[World]:
    fleet = Fleet(
        tmp_path_factory.mktemp("contract"),
        GCVEC_REQUESTS_PER_MINUTE="0",
        GCVEC_MAX_UNFINISHED_JOBS="0",
        GCVEC_MAX_PIXELS="250000",
    )
    try:
        api = fleet.start_api()
        fleet.start_worker(queues=(SHORT_QUEUE,))
        names = ("done", "failed", "canceled", "gone", *UNFINISHED)
        ids = {name: api.submit(SIDE, target_mse=60) for name in names}
        for name in ("done", "failed", "gone", "running"):
            assert fleet.records.run(claim(ids[name]))
        succeed(fleet, ids["done"])
        error = problem("time-limit", "it took too long")
        for name in ("failed", "gone"):
            assert fleet.records.run(finish(ids[name], "failed", retention=3600, attempt=1, error=error))
        for name in ("canceled", "gone"):
            assert api.http.delete(f"/v1/jobs/{ids[name]}").status_code == 204
        edits = {"recolors": [{"patch": 0, "color": "#203040"}]}
        assert api.http.post(f"/v1/jobs/{ids['done']}/edits", json=edits).status_code == 200
        with requests.Session() as session:
            session.trust_env = False
            yield World(f"http://127.0.0.1:{api.port}", ids, session)
        assert "unexpected error" not in api.process.log.read_text()
    finally:
        fleet.close()


def succeed(fleet: Fleet, job_id: str) -> None:
    """Do what a worker does for a job."""
    store = storage.open_store(fleet.environment["GCVEC_STORAGE_URL"])
    product = produce(picture(SIDE), None, fleet.job(job_id).request, Settings(), lambda _: None)
    folder = storage.attempt_folder(job_id, 1)
    files = {
        name: storage.write(store, f"{folder}/{KINDS[name].filename}", data)
        for name, data in product.artifacts.items()
    }
    storage.commit(store, job_id, Manifest(1, files))
    assert fleet.records.run(finish(job_id, "succeeded", retention=3600, attempt=1))


@pytest.mark.parametrize("label", OPERATIONS)
def test_every_answer_is_documented(world: World, label: str) -> None:
    operation, rng = OPERATIONS[label], random.Random(label)
    modes = list(GenerationMode)
    boundaries = SCHEMA.iter_coverage_cases(
        operation, generation_modes=modes, generation_config=GenerationConfig()
    )
    for case in boundaries:
        ask_everywhere(world, rng, case)

    valid, invalid = (operation.as_strategy(generation_mode=mode) for mode in modes)

    @seed(1)
    @settings(
        max_examples=OFTEN.get(label, CASES),
        deadline=None,
        database=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(case=valid | invalid)
    def generated(case: Case) -> None:
        if label == "POST /v1/jobs":
            world.ask(sensible_upload(rng, case.derive()))
        if label.endswith("/edits") and rng.random() < 0.1:
            ask_everywhere(world, rng, sensible_edits(rng, case.derive()))
        ask_everywhere(world, rng, case)

    generated()


def ask_everywhere(world: World, rng: random.Random, case: Case) -> None:
    """Ask as it was generated, and the same of the jobs there are."""
    world.ask(case.derive())
    if "job_id" in (case.path_parameters or {}):
        for job_id in world.jobs_for(case):
            known = case.derive()
            known.path_parameters["job_id"] = job_id
            if rng.random() < 0.5 and "revision" in known.path_parameters:
                known.path_parameters["revision"] = 1
            world.ask(known)


def sensible_upload(rng: random.Random, case: Case) -> Case:
    """The upload with parts that mean something: whole or nearly so."""
    case.body = {"image": rng.choice(IMAGES), "options": chosen(rng, OPTIONS)}
    case.media_type = "multipart/form-data"
    if rng.random() < 0.5:
        case.body["annotations"] = rng.choice(ANNOTATIONS)
    if rng.random() < 0.3:
        case.body["webhook"] = chosen(rng, WEBHOOKS)
    return case


def sensible_edits(rng: random.Random, case: Case) -> Case:
    """Edits that can be made, or nearly so: what is generated hardly ever names what there is."""
    moves = [{"curve": 0, "index": rng.choice((0, 99)), "dx": 0.0, "dy": 0}]
    recolors = [{"patch": rng.choice((0, 0, 99)), "color": f"#{rng.randrange(1 << 24):06x}"}]
    case.body = {"moves": rng.choice(([], moves)), "recolors": recolors, "revision": rng.choice((0, 0, 999))}
    case.media_type = "application/json"
    return case


def chosen(rng: random.Random, values: dict[str, tuple[Any, ...]]) -> str:
    """A JSON object with some of the names and one of the values of each, the first most often."""
    names = rng.sample(list(values), rng.randrange(len(values)))
    return json.dumps({name: rng.choice((values[name][0], *values[name])) for name in names})


def test_ten_thousand_requests_were_sent(world: World) -> None:
    if {label for label, _ in world.statuses} != set(OPERATIONS):
        missing("not every operation was selected")
    assert sum(world.statuses.values()) >= REQUESTS
    answered = {label: {status for known, status in world.statuses if known == label} for label in OPERATIONS}
    for label, statuses in answered.items():
        assert any(status < 300 for status in statuses), f"{label} never succeeded: {statuses}"
    assert {202, 413, 415, 422} <= answered["POST /v1/jobs"]
    assert {200, 404, 409, 410, 422} <= answered["GET /v1/jobs/{job_id}/preview.png"]
