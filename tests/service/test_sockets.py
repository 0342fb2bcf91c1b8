"""Which addresses can only be reached from this machine."""

from __future__ import annotations

import pytest

from service.sockets import is_loopback


@pytest.mark.parametrize(
    ("host", "expected"),
    [
        ("127.0.0.1", True),
        ("127.9.9.9", True),
        ("::1", True),
        ("localhost", True),
        ("LocalHost", True),
        ("localhost.example", False),
        ("0.0.0.0", False),
        ("::", False),
        ("10.0.0.1", False),
        ("example.com", False),
        ("", False),
    ],
)
def test_names_that_can_only_mean_this_machine(host: str, expected: bool) -> None:
    assert is_loopback(host) is expected
