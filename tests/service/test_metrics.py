from __future__ import annotations

import httpx
from prometheus_client.parser import text_string_to_metric_families

from tests.broker import client_of
from tests.service.in_process import Jobs
from worker.problems import problem
from worker.settings import Settings
from worker.steps import claim, finish, lease_key


def figures(api: httpx.Client) -> dict[tuple[str, str], float]:
    """Every sample by name and label value."""
    answer = api.get("/metrics")
    assert answer.status_code == 200
    assert answer.headers["content-type"].startswith("text/plain")
    return {
        (sample.name, "".join(sample.labels.values())): sample.value
        for family in text_string_to_metric_families(answer.text)
        for sample in family.samples
    }


def test_what_happens_is_counted(api: httpx.Client, jobs: Jobs) -> None:
    before = figures(api)
    assert before["gcvec_jobs", "queued"] == 0
    waiting, running, failing, made = (jobs.submit() for _ in range(4))
    for job_id in (running, failing, made):
        jobs.records.run(claim(job_id))
    jobs.records.run(finish(failing, "failed", retention=60, error=problem("time-limit", "too long")))
    totals = {"points": 7, "seconds:evaluation": 1.5}
    for _ in range(2):  # the second is too late, and not counted
        jobs.records.run(finish(made, "succeeded", retention=60, totals=totals))
    api.delete(f"/v1/jobs/{waiting}")
    jobs.submit()

    now = figures(api)
    assert now["gcvec_jobs", "queued"] == 1
    assert now["gcvec_jobs", "running"] == 1
    assert now["gcvec_queue_messages", "gcvec-jobs"] == 5
    assert 0 < now["gcvec_oldest_queued_seconds", ""] < 60
    assert now["gcvec_jobs_finished_total", "failed"] == 1
    assert now["gcvec_jobs_finished_total", "canceled"] == 1
    assert now["gcvec_jobs_finished_total", "succeeded"] == 1
    assert now["gcvec_jobs_failed_total", "time-limit"] == 1
    assert now["gcvec_stage_seconds_total", "evaluation"] == 1.5
    assert now["gcvec_points_total", ""] == 7
    assert now["gcvec_attempts_total", ""] == 3


def test_a_job_whose_worker_was_killed_does_not_run(
    api: httpx.Client, jobs: Jobs, settings: Settings
) -> None:
    for job_id in (lost := jobs.submit(), jobs.submit()):
        jobs.records.run(claim(job_id))
    client_of(settings.broker_url).delete(lease_key(lost))  # as it is some seconds later
    now = figures(api)
    assert (now["gcvec_jobs", "queued"], now["gcvec_jobs", "running"]) == (1, 1)
    assert now["gcvec_oldest_queued_seconds", ""] > 0
