from __future__ import annotations

import dataclasses
import io
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from gcvec.parts.messages import (
    DamagedPartError,
    request_bytes,
    request_from,
    result_bytes,
    result_from,
)
from gcvec.parts.part import refine_part
from tests.gcvec.parts.made import a_request, a_result


def assert_same(one: Any, other: Any) -> None:
    for field in dataclasses.fields(one):
        a, b = getattr(one, field.name), getattr(other, field.name)
        if dataclasses.is_dataclass(a):
            assert_same(a, b)
        elif field.name == "curves":
            for left, right in zip(a, b, strict=True):
                assert_same(left, right)
        elif isinstance(a, np.ndarray):
            assert a.dtype == b.dtype, field.name
            np.testing.assert_array_equal(a, b)
        else:
            assert a == b, field.name


def test_a_request_is_what_it_was() -> None:
    assert_same(request_from(request_bytes(a_request())), a_request())


def test_a_result_is_what_it_was() -> None:
    assert len(a_result().points) > 0
    assert_same(result_from(result_bytes(a_result())), a_result())


def test_a_request_that_has_travelled_has_the_same_result() -> None:
    pixels = np.random.default_rng(0).integers(0, 256, (300, 700, 3)).astype(np.uint8)
    again = refine_part(request_from(request_bytes(a_request())), pixels, lambda _: None)
    assert_same(again, a_result())


@pytest.mark.parametrize("kind", ["request", "result"])
def test_damage_is_told_in_one_line(kind: str) -> None:
    data = request_bytes(a_request()) if kind == "request" else result_bytes(a_result())
    read = request_from if kind == "request" else result_from
    rng = np.random.default_rng(1)
    damaged = [b"", b"GCV", data[:100], data[: len(data) // 2], data[:-1], data[:-30]]
    for _ in range(100):
        at = int(rng.integers(len(data)))
        changed = bytes([data[at] ^ int(rng.integers(1, 256))])
        damaged.append(data[:at] + changed + data[at + 1 :])
    told = [told_of(read, bad) for bad in damaged]
    assert all("damaged" in text and "\n" not in text for text in told if text is not None)
    assert None not in told[:6]
    assert told.count(None) < 0.2 * len(told)  # dates and the like


def told_of(read: Callable[[bytes], Any], data: bytes) -> str | None:
    """What is said of a damaged file; None if the damage concerns nobody."""
    try:
        read(data)
    except DamagedPartError as error:
        return str(error)
    return None


def test_one_kind_is_not_taken_for_the_other() -> None:
    with pytest.raises(DamagedPartError, match="damaged"):
        request_from(result_bytes(a_result()))
    with pytest.raises(DamagedPartError, match="damaged"):
        result_from(request_bytes(a_request()))


def test_no_code_is_read() -> None:
    buffer = io.BytesIO()
    np.savez(buffer, kind=np.array([print], dtype=object))
    with pytest.raises(DamagedPartError, match="damaged"):
        result_from(buffer.getvalue())
