"""Exports, edits, removals and tidying up.

The messages of exports and edits are acknowledged when they are taken: one that ends its worker is not given
to the next. Whoever waits for the answer asks again; what nobody waits for is not made.
"""

from __future__ import annotations

import logging
import uuid
from collections.abc import Callable, Mapping
from typing import Any

from obstore.exceptions import BaseError

from gcvec.errors import InputError
from worker import logs, storage
from worker.app import app
from worker.artifacts import EXPORTS, KINDS
from worker.orphans import may_judge, remove_orphans
from worker.problems import input_problem, problem
from worker.questions import Answer, Hold, give, question_key, take
from worker.queues import EDIT, EXPORT, REMOVE, TIDY
from worker.steps import NOT_AWAITED, grow, retire, revise
from worker.storage import Manifest
from worker.workshop import Workshop, workshop

logger = logging.getLogger(__name__)

_GONE = problem("gone", "the job has expired or was deleted")
_TOO_LATE = problem("unavailable", "no worker has made the edit in time")


@app.task(name=EXPORT, acks_late=False)
def export_image(key: str, job_id: str, revision: int, kind: str, scale: float, name: str) -> None:
    """Make the derived file `name` of a revision; the answer's value is empty."""
    _answer(key, job_id, lambda shop: _export(shop, job_id, revision, kind, scale, name))


@app.task(name=EDIT, acks_late=False)
def edit_image(key: str, job_id: str, base: int, changes: Mapping[str, Any]) -> None:
    """Make a new revision out of an older one; the answer's value is its number."""
    _answer(key, job_id, lambda shop: _edit(shop, key, job_id, base, changes))


@app.task(name=REMOVE)
def remove_job(job_id: str) -> None:
    """Remove the files of an expired job, then its record."""
    shop = workshop()
    storage.delete_folder(shop.store, storage.job_folder(job_id))
    if shop.records.run(retire(job_id)):
        with logs.about(job_id):
            logger.info("job %s: expired and removed", job_id)


@app.task(name=TIDY)
def tidy() -> None:
    """Remove files that belong to no job."""
    shop = workshop()
    if not may_judge(shop.client, shop.store):
        logger.error(
            "the store belongs to another Redis, or this one has lost its memory: all files are kept"
        )
        return
    for job_id in remove_orphans(shop.store, shop.records, shop.settings.orphan_age.total_seconds()):
        with logs.about(job_id):
            logger.warning("job %s: unknown, its files are removed", job_id)


def _answer(key: str, job_id: str, work: Callable[[Workshop], Answer]) -> None:
    shop = workshop()
    with logs.about(job_id):
        token = uuid.uuid4().hex
        if not shop.records.run(take(key, token)):
            logger.info("job %s: nobody waits for this any more", job_id)
            return
        with Hold(shop.records, key, token):
            answer = _outcome(shop, work)
        shop.records.run(give(key, token, answer))


def _outcome(shop: Workshop, work: Callable[[Workshop], Answer]) -> Answer:
    try:
        return work(shop)
    except InputError as error:
        return Answer(problem=input_problem(error))
    except (BaseError, OSError) as error:
        logger.warning("storing failed: %s", type(error).__name__)
        return Answer(problem=problem("unavailable", "the storage cannot be reached"))
    except MemoryError:
        return Answer(problem=problem("memory-limit", "this needs more memory than allowed"))
    except Exception:
        logger.exception("a short task failed")
        return Answer(problem=problem("internal-error", "this failed for a reason that was logged"))


def _export(shop: Workshop, job_id: str, revision: int, kind: str, scale: float, name: str) -> Answer:
    from worker.export import export, load_image

    if storage.read_derived(shop.store, job_id, revision, name) is not None:
        return Answer()  # the question was forgotten while it waited, and asked again
    manifest = storage.read_manifest(shop.store, job_id, revision)
    if manifest is None:
        return Answer(problem=_GONE)
    data = export(load_image(shop.store, manifest.files["gcv"].path), kind, scale)
    file = storage.write_derived(shop.store, job_id, revision, name, data, (KINDS | EXPORTS)[kind].media_type)
    return _kept(shop, job_id, file.size, f"{revision}/{name}", None)


def _edit(shop: Workshop, key: str, job_id: str, base: int, changes: Mapping[str, Any]) -> Answer:
    from worker.edit import edited, revision_files
    from worker.export import load_image

    if (made := shop.records.revision_for(job_id, question_key(key))) and (
        earlier := storage.read_manifest(shop.store, job_id, made)
    ):  # asked again: the answer was lost
        return _kept(shop, job_id, earlier.size, str(made), made)
    manifest = storage.read_manifest(shop.store, job_id, base)
    if manifest is None:
        return Answer(problem=_GONE)
    files = revision_files(edited(load_image(shop.store, manifest.files["gcv"].path), changes))
    revision = shop.records.run(revise(job_id, question_key(key)))
    if revision == NOT_AWAITED:
        return Answer(problem=_TOO_LATE)
    if not revision:
        return Answer(problem=_GONE)
    folder = storage.revision_folder(job_id, revision)
    stored = {
        name: storage.write(shop.store, f"{folder}/{filename}", data, KINDS[name].media_type)
        for name, (filename, data) in files.items()
    }
    manifest = Manifest(revision, stored)
    storage.commit(shop.store, job_id, manifest, revision)
    return _kept(shop, job_id, manifest.size, str(revision), revision)


def _kept(shop: Workshop, job_id: str, size: int, name: str, value: object) -> Answer:
    """The answer, unless the job was deleted while its file was being made: then that file goes too."""
    if shop.records.run(grow(job_id, size, name)):
        return Answer(value)
    if shop.records.unwanted(job_id):
        storage.delete_folder(shop.store, storage.job_folder(job_id))
    return Answer(problem=_GONE)
