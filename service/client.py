"""A client of the HTTP interface."""

from __future__ import annotations

import json
import time
import uuid
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from http import HTTPStatus
from types import TracebackType
from typing import Any, Final, NamedTuple, TypeVar

import httpx

from gcvec.errors import FailureError, InputError
from gcvec.plain_text import plain_text
from gcvec.progress import OnProgress, Progress
from worker.fields import known_fields

T = TypeVar("T")

_PATIENCE: Final = 10
_PAUSE_SECONDS: Final = 1.0
_LONGEST_PAUSE_SECONDS: Final = 60.0
_BROKEN: Final = (
    httpx.ReadError,
    httpx.WriteError,
    httpx.ReadTimeout,
    httpx.WriteTimeout,
    httpx.RemoteProtocolError,
)
"""What ends a connection that there was."""
_BUSY: Final = (HTTPStatus.REQUEST_TIMEOUT, HTTPStatus.CONFLICT, HTTPStatus.TOO_MANY_REQUESTS)


class BusyError(FailureError):
    """The service cannot answer now, but says that it may in a while: after `seconds`."""

    def __init__(self, message: str, seconds: float) -> None:
        super().__init__(message)
        self.seconds = seconds


class NamedFile(NamedTuple):
    """A file as it is uploaded: its name, without folders, and what it holds."""

    name: str
    content: bytes


class Client:
    """Submits pictures, follows jobs and fetches their files.

    Raises InputError for what the service refuses, FailureError for what goes wrong on its side, and
    httpx.TransportError where it cannot be reached.
    """

    def __init__(self, url: str, key: str | None = None) -> None:
        headers = {"Authorization": f"Bearer {key}"} if key else {}
        self._http = httpx.Client(base_url=url, headers=headers, timeout=60, follow_redirects=True)

    def __enter__(self) -> Client:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._http.close()

    def submit(
        self, image: NamedFile, annotations: NamedFile | None, options: Mapping[str, Any]
    ) -> dict[str, Any]:
        """Upload a picture; the job that was made of it."""
        files = {"image": (plain_text(image.name), image.content)}
        if annotations is not None:
            files["annotations"] = (plain_text(annotations.name), annotations.content)
        data = {"options": json.dumps(options)}
        headers = {"Idempotency-Key": uuid.uuid4().hex}  # it is one job, however often it is sent
        lost: tuple[type[Exception], ...] = _BROKEN

        def send() -> dict[str, Any]:
            nonlocal lost
            try:
                answer = self._http.post("/v1/jobs", files=files, data=data, headers=headers)
            except lost as error:
                lost = (httpx.TransportError,)  # there is a service, which may be starting again
                raise BusyError(str(error), _PAUSE_SECONDS) from error
            _raise_if_busy(answer)
            return _content(answer)

        return _patiently(send)

    def follow(self, job: Mapping[str, Any], on_progress: OnProgress | None) -> dict[str, Any]:
        """Wait for the end of a job, telling of its progress; the job as it ended."""
        last, failures = "0", 0
        while True:
            pause = _PAUSE_SECONDS
            try:
                for identity, kind, data in self._events(job["links"]["events"], last):
                    last, failures = identity or last, 0
                    if kind == "progress" and on_progress is not None:
                        on_progress(Progress(**known_fields(Progress, data)))
                    if kind == "state":
                        return data
            except (httpx.TransportError, BusyError) as error:
                failures += 1
                if failures > _PATIENCE:
                    raise
                if isinstance(error, BusyError):
                    pause = error.seconds
            time.sleep(pause)

    def download(self, link: str) -> bytes:
        """A file of a job; one that is made on demand is asked for until it is there."""

        def fetch() -> bytes:
            try:
                answer = self._http.get(link)
            except httpx.TransportError as error:
                raise BusyError(str(error), _PAUSE_SECONDS) from error
            _raise_if_busy(answer)
            if answer.is_error:
                raise _refusal(answer)
            return answer.content

        return _patiently(fetch)

    def _events(self, link: str, last: str) -> Iterator[tuple[str, str, dict[str, Any]]]:
        """The events of a job after the one numbered `last`: id, kind and data of each."""
        with self._http.stream("GET", link, headers={"Last-Event-ID": last}) as answer:
            if answer.is_error:
                answer.read()
                _raise_if_busy(answer)
                _content(answer)
            event: dict[str, str] = {}
            for line in answer.iter_lines():
                name, _, value = line.partition(":")
                if name:
                    event[name] = value.removeprefix(" ")
                elif "data" in event:
                    yield event.get("id", ""), event.get("event", "message"), json.loads(event["data"])
                    event = {}


def _patiently(step: Callable[[], T]) -> T:
    """What a step comes to, which is done again while the service is busy."""
    for _ in range(_PATIENCE):
        try:
            return step()
        except BusyError as error:
            time.sleep(error.seconds)
    return step()


def _raise_if_busy(answer: httpx.Response) -> None:
    if answer.is_server_error or answer.status_code in _BUSY:
        raise BusyError(str(_refusal(answer)), _pause(answer))


def _pause(answer: httpx.Response) -> float:
    """The seconds after which the answer says to ask again; a date, as of a proxy, is passed over."""
    stated = answer.headers.get("Retry-After", "")
    return min(float(stated), _LONGEST_PAUSE_SECONDS) if stated.isdecimal() else _PAUSE_SECONDS


def _content(answer: httpx.Response) -> dict[str, Any]:
    """The JSON of an answer. Raises InputError or FailureError for a problem document, or what is no JSON."""
    if answer.is_error:
        raise _refusal(answer)
    try:
        content: dict[str, Any] = answer.json()
    except ValueError:
        raise _stranger(answer) from None
    return content


def _refusal(answer: httpx.Response) -> InputError | FailureError:
    """What an answer means that is an error."""
    if answer.headers.get("content-type", "").startswith("application/problem+json"):
        with suppress(ValueError):
            return problem_error(answer.json())
    return _stranger(answer)


def _stranger(answer: httpx.Response) -> InputError | FailureError:
    """What an answer means that is not the service's own: another program's, or a proxy's."""
    if answer.is_server_error:
        return FailureError(f"the service cannot be reached (HTTP {answer.status_code})")
    return InputError(f"no gcvec service answers there (HTTP {answer.status_code})", code="no-service")


def problem_error(problem: Mapping[str, Any]) -> InputError | FailureError:
    """What a problem document means to a caller: input at fault, or the service."""
    if problem["status"] >= 500:
        return FailureError(problem["detail"])
    code = str(problem.get("type", "refused")).rpartition(":")[2]
    return InputError(problem["detail"], code=code, pointer=problem.get("pointer"))
