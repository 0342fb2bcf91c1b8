"""Webhooks: what is told, how it is signed, and where it may not go."""

from __future__ import annotations

import json
import socket
import threading
from socketserver import BaseRequestHandler, TCPServer
from typing import Any

import pytest

from tests.servers import in_background
from tests.webhook_receiver import SECRET, Receiver, signature_of
from worker.job import Job
from worker.problems import problem
from worker.webhooks import UnsafeTargetError, check_target, message, post, signed_headers


def test_a_message_is_signed_over_id_time_and_body() -> None:
    headers = signed_headers(SECRET, "msg_1", 1_614_265_330, b'{"test": 2}')
    assert headers["webhook-id"] == "msg_1"
    assert headers["webhook-timestamp"] == "1614265330"
    assert headers["webhook-signature"] == signature_of(headers, b'{"test": 2}')
    assert headers["webhook-signature"] != signature_of(headers, b'{"test": 3}')


def test_a_message_names_the_job_and_why_it_failed() -> None:
    error = problem("time-limit", "too long").as_dict()
    job = Job(id="x", owner="me", status="failed", created_at=0.0, finished_at=86_400.0, error=error)
    told = json.loads(message(job, "failed"))
    assert told["type"] == "job.failed"
    assert told["timestamp"] == "1970-01-02T00:00:00+00:00"
    assert told["data"] == {"id": "x", "status": "failed", "links": {"self": "/v1/jobs/x"}, "error": error}


@pytest.mark.parametrize(
    "url",
    [
        "http://example.com/",
        "ftp://example.com/",
        "file:///etc/passwd",
        "https://",
        "https:///path",
        "https://user:pass@example.com/",
        "https://example.com:99999/",
        "https://exa mple.com/",
        "https://example.com/\r\nX-Injected: 1",
        "https://bücher.example/",
        "https://[::1/",
        "https://127.0.0.1/",
        "https://10.1.2.3/",
        "https://172.16.0.1/",
        "https://192.168.1.1/",
        "https://169.254.169.254/latest/meta-data",
        "https://100.64.0.1/",
        "https://0.0.0.0/",
        "https://224.0.0.1/",
        "https://255.255.255.255/",
        "https://[::1]/",
        "https://[::]/",
        "https://[fe80::1]/",
        "https://[fd00::1]/",
        "https://[::ffff:127.0.0.1]/",
        "https://[2002:7f00:1::]/",
        "https://[::7f00:1]/",
        "https://[::ffff:0:7f00:1]/",
        "https://[64:ff9b::a9fe:a9fe]/",
        "https://[64:ff9b:1::a9fe:a9fe]/",
        "https://[2001:0:7f00:1::]/",
        "https://[fec0::1]/",
    ],
)
def test_unsafe_addresses_are_refused_at_sight(url: str) -> None:
    with pytest.raises(UnsafeTargetError):
        check_target(url, private=False)


@pytest.mark.parametrize(
    "url",
    [
        "https://example.com/hook?x=1",
        "https://93.184.216.34:8443/",
        "https://[2606:2800:220:1::1]/",
        "HTTPS://a.b/",
    ],
)
def test_public_addresses_are_accepted(url: str) -> None:
    check_target(url, private=False)


@pytest.mark.parametrize("host", ["localhost", "2130706433", "0x7f000001", "127.1", "017700000001"])
def test_names_of_private_addresses_are_refused_when_they_are_resolved(receiver: Receiver, host: str) -> None:
    with pytest.raises(UnsafeTargetError):
        post(f"https://{host}:{receiver.server_port}/", {}, b"", private=False)
    assert receiver.calls == []


def test_one_private_address_among_public_ones_is_enough_to_refuse(monkeypatch: pytest.MonkeyPatch) -> None:
    answers = [(2, 1, 6, "", ("93.184.216.34", 443)), (2, 1, 6, "", ("10.0.0.1", 443))]
    monkeypatch.setattr(socket, "getaddrinfo", lambda *_, **__: answers)
    with pytest.raises(UnsafeTargetError):
        post("https://rebinding.example/", {}, b"", private=False)


def test_the_connection_goes_to_the_address_that_was_checked(
    receiver: Receiver, monkeypatch: pytest.MonkeyPatch
) -> None:
    resolve, asked = socket.getaddrinfo, []

    def once(host: str, port: int, *rest: Any, **more: Any) -> Any:
        asked.append(host)
        return resolve("127.0.0.1" if host == "hooks.example" else host, port, *rest, **more)

    monkeypatch.setattr(socket, "getaddrinfo", once)
    port = receiver.server_port
    assert post(f"http://hooks.example:{port}/a?b=c", {"x": "y"}, b"{}", private=True) == 204
    assert asked.count("hooks.example") == 1
    ((headers, body),) = receiver.calls
    assert (headers["host"], headers["x"], body) == (f"hooks.example:{port}", "y", b"{}")


def test_redirects_are_not_followed(receiver: Receiver) -> None:
    receiver.status = 307
    assert post(receiver.url, {}, b"{}", private=True) == 307
    assert len(receiver.calls) == 1


def test_a_receiver_that_dribbles_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every byte comes soon after the last, but the answer never does."""
    monkeypatch.setattr("worker.webhooks._SECONDS", 0.4)
    left = threading.Event()

    class Dribble(BaseRequestHandler):
        def handle(self) -> None:
            try:
                self.request.sendall(b"HTTP/1.1 200 OK\r\nX: ")
                while not left.wait(0.05):
                    self.request.sendall(b"x")
            except OSError:
                left.set()

    server = TCPServer(("127.0.0.1", 0), Dribble)
    with in_background(server):
        try:
            with pytest.raises(TimeoutError):
                post(f"http://127.0.0.1:{server.server_address[1]}/", {}, b"{}", private=True)
            assert left.wait(10), "the connection is closed"
        finally:
            left.set()
