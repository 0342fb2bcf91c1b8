"""What can go wrong with a job or a request, in the words of RFC 9457."""

from __future__ import annotations

from dataclasses import asdict, dataclass

from gcvec.errors import InputError

TITLES: dict[str, tuple[int, str]] = {
    "unauthorized": (401, "A valid API key is needed"),
    "forbidden": (403, "This is not allowed from here"),
    "not-found": (404, "There is no such thing here"),
    "method-not-allowed": (405, "This method is not allowed here"),
    "too-slow": (408, "The request came too slowly"),
    "not-ready": (409, "This is not ready yet"),
    "no-result": (409, "The job ended without a result"),
    "in-flight": (409, "The same request is being handled"),
    "gone": (410, "The job has expired or was deleted"),
    "too-large": (413, "The upload is larger than the limit"),
    "quota-exceeded": (413, "Too much is stored for this key"),
    "picture-too-large": (413, "The picture is larger than the limit"),
    "annotations-too-large": (413, "The annotations are larger than the limit"),
    "range-not-satisfiable": (416, "The range lies outside the file"),
    "unsupported-picture": (415, "The picture's format is not supported"),
    "idempotency-mismatch": (422, "The idempotency key was used with another request"),
    "invalid-request": (422, "The request is not valid"),
    "bad-option": (422, "An option is not valid"),
    "bad-webhook": (422, "The webhook is not valid"),
    "unreadable-picture": (422, "The picture cannot be read"),
    "too-many-requests": (429, "Too many requests"),
    "too-many-jobs": (429, "Too many unfinished jobs"),
    "worker-lost": (500, "The job's worker died repeatedly"),
    "internal-error": (500, "Something failed that should not"),
    "time-limit": (500, "The job ran longer than allowed"),
    "memory-limit": (500, "The job needed more memory than allowed"),
    "storage-failed": (500, "The results could not be stored"),
    "unavailable": (503, "A part of the service is not available"),
}
"""Code -> HTTP status and title. A code not listed is an input error (422) titled by its own words."""


@dataclass(frozen=True)
class Problem:
    """One problem: `type` is stable, `detail` for people, `pointer` names the part of the input at fault."""

    type: str
    title: str
    status: int
    detail: str
    pointer: str | None = None

    @property
    def code(self) -> str:
        """The last part of `type`."""
        return self.type.rpartition(":")[2]

    def as_dict(self) -> dict[str, object]:
        return {name: value for name, value in asdict(self).items() if value is not None}


def problem(code: str, detail: str, pointer: str | None = None) -> Problem:
    """The problem with this `code`, a key of `TITLES` or the code of an `InputError`."""
    status, title = TITLES.get(code, (422, code.replace("-", " ").capitalize()))
    return Problem(f"urn:gcvec:problem:{code}", title, status, detail, pointer)


def input_problem(error: InputError) -> Problem:
    """The problem that an input error amounts to."""
    return problem(error.code, str(error), error.pointer)
