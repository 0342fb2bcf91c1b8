"""Who is let in, on headers alone: the middleware by itself, without a server."""

from __future__ import annotations

import asyncio
import hashlib
import json
from types import SimpleNamespace
from typing import Any

import pytest
from redis.exceptions import ConnectionError as RedisConnectionError

from service.access.gate import Gate
from service.access.keys import ANYONE, KeyRing
from tests.keys import ALICE, BOB
from worker.settings import Settings

LOCAL = ("127.0.0.1", 8000)


class Rates:
    """An allowance that is used up for so many seconds, or cannot be asked for."""

    def __init__(self, seconds: float = 0.0, *, away: bool = False) -> None:
        self.seconds, self.away = seconds, away
        self.asked: list[str] = []

    async def take(self, owner: str) -> float:
        self.asked.append(owner)
        if self.away:
            raise RedisConnectionError
        return self.seconds


class Inside:
    """What lies behind the gate: it notes the requests that come through."""

    def __init__(self) -> None:
        self.scopes: list[Any] = []

    async def __call__(self, scope: Any, _receive: Any, _send: Any) -> None:
        self.scopes.append(scope)


class Answer:
    """What the gate has made of one request."""

    def __init__(self, settings: Settings, rates: Rates, scope: dict[str, Any]) -> None:
        self._inside = Inside()
        self._sent: list[Any] = []
        state_of: Any = SimpleNamespace(state=SimpleNamespace(services=SimpleNamespace(rates=rates)))
        asyncio.run(Gate(self._inside, settings, state_of)(scope, self._receive, self._send))

    async def _receive(self) -> Any:
        raise AssertionError("the body must not be read")

    async def _send(self, message: Any) -> None:
        self._sent.append(message)

    @property
    def let_in(self) -> bool:
        return bool(self._inside.scopes)

    @property
    def owner(self) -> str:
        (scope,) = self._inside.scopes
        return str(scope["state"]["owner"])

    @property
    def status(self) -> int:
        return int(self._sent[0]["status"])

    @property
    def headers(self) -> dict[str, str]:
        return {name.decode(): value.decode() for name, value in self._sent[0]["headers"]}

    @property
    def code(self) -> str:
        return str(json.loads(self._sent[1]["body"])["type"]).rpartition(":")[2]


def ask(
    path: str = "/v1/jobs",
    *,
    keys: str = "",
    headers: dict[str, str] | None = None,
    rates: Rates | None = None,
    server: tuple[str, int] | None = LOCAL,
    settings: dict[str, Any] | None = None,
    **scope: Any,
) -> Answer:
    """One request; by default from this machine, for a service without keys."""
    named = {"host": "localhost:8000", **(headers or {})}
    request = {
        "type": "http",
        "method": "GET",
        "path": path,
        "server": server,
        "headers": [(name.encode(), value.encode()) for name, value in named.items()],
        **scope,
    }
    return Answer(Settings(api_keys=keys, **(settings or {})), rates or Rates(), request)


def bearer(key: str) -> dict[str, str]:
    return {"authorization": f"Bearer {key}"}


@pytest.mark.parametrize(
    ("path", "guarded"),
    [
        ("/v1/jobs", True),
        ("/v1/jobs/x", True),
        ("/v1/jobs/x/result", True),
        ("/v1/jobs/x/view/", True),
        ("/v1/jobs/x/y/view", True),
        ("/v1/jobs//view", True),
        ("/v1/nothing", True),
        ("/metrics", True),
        ("/v1/jobs/x/view", False),
        ("/", False),
        ("/livez", False),
        ("/readyz", False),
        ("/docs", False),
        ("/openapi.json", False),
    ],
)
def test_calls_and_metrics_need_a_key_and_pages_do_not(path: str, guarded: bool) -> None:
    assert ask(path, keys=ALICE).let_in is not guarded
    assert ask(path, keys=ALICE, headers=bearer(ALICE)).let_in


@pytest.mark.parametrize(("path", "let_in"), [("/metrics", True), ("/v1/jobs", False)])
def test_metrics_can_be_open_and_nothing_else(path: str, let_in: bool) -> None:
    assert ask(path, keys=ALICE, settings={"metrics_open": True}).let_in is let_in


def test_behind_a_prefix_the_same_calls_are_guarded() -> None:
    assert not ask("/below/v1/jobs", keys=ALICE, root_path="/below").let_in
    assert ask("/below/livez", keys=ALICE, root_path="/below").let_in


def test_what_is_no_request_passes() -> None:
    assert ask(keys=ALICE, type="lifespan").let_in


def test_each_key_is_an_owner_of_its_own() -> None:
    both = f"{ALICE},{BOB}"
    owners = [ask(keys=both, headers=bearer(key)).owner for key in (ALICE, BOB, ALICE)]
    assert owners[0] == owners[2] != owners[1]
    assert owners[0] == hashlib.sha256(ALICE.encode()).hexdigest()[:32]
    assert KeyRing(()).owner(ALICE) is None


def test_an_owner_stands_beside_what_else_is_known_of_a_request() -> None:
    answer = ask(keys=ALICE, headers=bearer(ALICE), state={"other": 1})
    assert answer._inside.scopes[0]["state"] == {"other": 1, "owner": answer.owner}


@pytest.mark.parametrize(
    "authorization", ["", "Bearer", "Bearer ", f"Basic {ALICE}", ALICE, f"Bearer {BOB}", f"Bearer {ALICE} x"]
)
def test_without_a_key_of_ours_a_request_ends_at_the_gate(authorization: str) -> None:
    """It counts for nobody."""
    rates = Rates()
    answer = ask(keys=ALICE, headers={"authorization": authorization}, rates=rates)
    assert not answer.let_in
    assert (answer.status, answer.code) == (401, "unauthorized")
    assert answer.headers["www-authenticate"] == "Bearer"
    assert rates.asked == []


def test_the_scheme_may_be_written_in_any_case() -> None:
    assert ask(keys=ALICE, headers={"authorization": f"bEARER  {ALICE} "}).let_in


def test_a_key_needs_no_loopback() -> None:
    elsewhere = {"host": "gcvec.example", "origin": "https://other.example", **bearer(ALICE)}
    assert ask(keys=ALICE, headers=elsewhere, server=("192.0.2.1", 80)).let_in


@pytest.mark.parametrize("server", [("192.0.2.1", 8000), ("0.0.0.0", 8000), ("", 0), None])
def test_without_keys_only_connections_to_the_loopback_get_in(server: tuple[str, int] | None) -> None:
    assert ask().owner == ANYONE
    answer = ask(server=server)
    assert (answer.let_in, answer.status, answer.code) == (False, 403, "forbidden")


@pytest.mark.parametrize(
    ("headers", "let_in"),
    [
        ({}, True),
        ({"origin": "http://localhost:8000"}, True),
        ({"origin": "https://localhost:8000"}, True),
        ({"origin": "http://localhost:9000"}, False),
        ({"origin": "http://other.example"}, False),
        ({"origin": "https://friend.example"}, True),
        ({"host": "other.example", "origin": "https://friend.example"}, False),
        ({"host": "127.0.0.1"}, True),
        ({"host": "[::1]:1"}, True),
        ({"host": "127.0.0.1.other.example"}, False),
        ({"host": "["}, False),
        ({"host": ""}, False),
    ],
)
def test_without_keys_pages_of_other_sites_are_kept_out(headers: dict[str, str], let_in: bool) -> None:
    """By the name they call us by, and by where they come from; but for those that the settings name."""
    assert ask(headers=headers, settings={"cors_origins": "https://friend.example"}).let_in is let_in


@pytest.mark.parametrize(("seconds", "told"), [(0.2, "1"), (1.0, "1"), (1.01, "2"), (59.5, "60")])
def test_who_asks_too_often_is_told_when_to_come_back(seconds: float, told: str) -> None:
    """In whole seconds, and none too early."""
    rates = Rates(seconds)
    answer = ask(keys=ALICE, headers=bearer(ALICE), rates=rates)
    assert (answer.let_in, answer.status, answer.code) == (False, 429, "too-many-requests")
    assert answer.headers["retry-after"] == told
    assert rates.asked == [KeyRing(Settings(api_keys=ALICE).api_keys).owner(ALICE)]


def test_requests_that_cannot_be_counted_are_put_off() -> None:
    answer = ask(rates=Rates(away=True))
    assert (answer.let_in, answer.status, answer.code) == (False, 503, "unavailable")
    assert "retry-after" in answer.headers
