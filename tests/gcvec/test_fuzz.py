"""Ten thousand broken files: each is read or refused, soon and without much memory."""

from __future__ import annotations

import resource
import sys
import time
import tracemalloc
from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from gcvec import InputError
from gcvec.codec.file import decode, encode, sealed
from gcvec.codec.integers import SEQUENCE_COUNTERS, SEQUENCE_INPUTS, SEQUENCE_ROWS, code_sequence
from gcvec.codec.mixing import fresh_model
from gcvec.codec.range_coder import finish, writer
from gcvec.codec.text import TEXT_COUNTERS, TEXT_INPUTS, TEXT_ROWS, code_text
from gcvec.edit import Recolor, edit
from tests.gcvec.scenes import vectorized

FILES = 10_000
SCENES = ("pixel", "whole", "ring", "quadrants", "diagonal")

SECONDS = 1.0
MEMORY = 64 * 2**20
MEMORY_A_BYTE = 400 * 1024
"""What one file may take: processor time, and bytes at once, of which so many more for each of its own."""

Mutation = Callable[[np.random.Generator, bytes], bytes]


@cache
def streams() -> list[bytes]:
    """The streams of some whole files: what follows their checksum."""
    images = [vectorized(scene) for scene in SCENES]
    images.append(edit(images[-1], recolors=[Recolor(1, (0.2, 0.5, 0.9))]))
    return [encode(image)[8:] for image in images]


def with_changed_bytes(rng: np.random.Generator, stream: bytes) -> bytes:
    changed = np.frombuffer(stream, np.uint8).copy()
    at = rng.integers(0, len(changed), rng.integers(1, 4))
    changed[at] ^= rng.integers(1, 256, len(at)).astype(np.uint8)
    return changed.tobytes()


def with_changed_bit(rng: np.random.Generator, stream: bytes) -> bytes:
    """Late in the file, so that most of it is read before the damage shows."""
    changed = bytearray(stream)
    changed[-1 - int(rng.integers(0, len(changed)) * rng.random())] ^= 1 << int(rng.integers(0, 8))
    return bytes(changed)


def cut(rng: np.random.Generator, stream: bytes) -> bytes:
    return stream[: rng.integers(0, len(stream))]


def padded(rng: np.random.Generator, stream: bytes) -> bytes:
    """Cut somewhere, and long: that allows large claims."""
    fill = bytes([int(rng.choice([0, 255, rng.integers(0, 256)]))])
    return cut(rng, stream).ljust(int(rng.integers(1, 3000)), fill)


def spliced(rng: np.random.Generator, stream: bytes) -> bytes:
    return cut(rng, stream) + streams()[rng.integers(len(streams()))][rng.integers(0, 60) :]


def noise(rng: np.random.Generator, stream: bytes) -> bytes:
    return rng.bytes(int(rng.integers(0, 3000)))


def coded_head(sizes: NDArray[np.int64]) -> bytes:
    """The beginning of a stream: sizes `(10,)`, and one empty label."""
    coder = writer(256)
    code_sequence(coder, fresh_model(SEQUENCE_COUNTERS, SEQUENCE_ROWS, SEQUENCE_INPUTS), sizes)
    text = np.frombuffer(b'[""]', np.uint8).astype(np.int64)
    code_text(coder, fresh_model(TEXT_COUNTERS, TEXT_ROWS, TEXT_INPUTS), text)
    head = finish(coder)
    assert head is not None
    return head


def with_forged_sizes(rng: np.random.Generator, stream: bytes) -> bytes:
    """Well-coded sizes and labels, as large as they come, before the rest of another file."""
    sizes = np.array([400, 300, 4, 4, 1, 4, 16, 16, 0, 4])
    large = rng.integers(0, 10, rng.integers(0, 4))
    sizes[large] = np.minimum(2.0 ** rng.uniform(0, 24, len(large)), 2**24 - 1).astype(np.int64)
    head = coded_head(sizes)
    tail = stream if rng.random() < 0.5 else bytes([int(rng.choice([0, 255]))]) * int(rng.integers(3000))
    return head[:-3] + tail[rng.integers(0, 40) :]


MUTATIONS: tuple[Mutation, ...] = (
    with_changed_bytes,
    with_changed_bit,
    cut,
    padded,
    spliced,
    noise,
    with_forged_sizes,
)


def refused(data: bytes) -> bool:
    try:
        decode(data)
    except InputError:
        return True
    return False


@pytest.mark.slow
def test_ten_thousand_broken_files_do_no_harm() -> None:
    rng = np.random.default_rng(20)
    for stream in streams():
        assert not refused(sealed(stream))
    outcomes = {True: 0, False: 0}
    for i in range(FILES):
        mutation = MUTATIONS[i % len(MUTATIONS)]
        stream = mutation(rng, streams()[rng.integers(len(streams()))])
        data = sealed(stream) if i % 10 else rng.bytes(4) + sealed(stream)[4:]
        before = _peak_memory()
        start = time.thread_time()
        outcomes[refused(data)] += 1
        seconds = time.thread_time() - start
        told = f"file {i}, {mutation.__name__}, {len(data)} bytes"
        assert seconds < SECONDS, f"{told}: {seconds:.2f} s"
        assert _peak_memory() - before < MEMORY + MEMORY_A_BYTE * len(data), told
    # Both happen often, or the mutations are no test: most are noticed, many harmless ones are read.
    assert outcomes[True] > FILES / 2
    assert outcomes[False] > FILES / 100


@pytest.mark.parametrize("which", range(10))
def test_claims_beyond_the_files_length_cost_nothing(which: int) -> None:
    """Each size and count of the header by itself, as large as it can be written."""
    sizes = np.array([400, 300, 4, 4, 1, 4, 16, 16, 0, 4])
    sizes[which] = 2**24 - 1
    data = sealed(coded_head(sizes).ljust(300, b"\xff"))
    tracemalloc.start()
    try:
        assert refused(data)
        assert tracemalloc.get_traced_memory()[1] < 2**20
    finally:
        tracemalloc.stop()


def _peak_memory() -> int:
    """Bytes that this process has held at most."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)
