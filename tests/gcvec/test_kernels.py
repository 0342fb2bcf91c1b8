"""Kernels run the same wherever their machine code comes from."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from gcvec import kernels
from gcvec.kernel_library import Calls, recorded_calls
from gcvec.kernels import Kernel, bare_kernel, kernel, kinds
from tests.readers import missing

TURNS = 2_000_000_000


class Pair(NamedTuple):
    first: np.ndarray
    second: np.ndarray


@kernel
def doubled(values):
    return 2 * values


@kernel
def quadrupled(values):
    return doubled(doubled(values))


@bare_kernel
def add_up(pair, total):
    for i in range(len(pair.first)):
        total[0] += pair.first[i] * pair.second[i]


@kernel
def wait_for(flag, elsewhere, turns):
    while turns > 0 and flag[0] == 0:
        flag[elsewhere[0]] = turns  # so that no compiler can take the flag for constant
        turns -= 1
    return turns > 0


PAIR = Pair(np.arange(4.0), np.array([1.0, 0.0, 2.0, 1.0]))


def test_kernels_call_each_other() -> None:
    assert quadrupled(np.array([1.0, 2.5])).tolist() == [4.0, 10.0]


def test_a_kernel_takes_named_tuples() -> None:
    total = np.zeros(1)
    add_up(PAIR, total)
    assert total[0] == 7.0


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (np.zeros(3), np.zeros(3, np.float32)),
        (np.zeros((3, 2)), np.zeros((2, 3)).T),
        (np.zeros((4, 4)), np.zeros((8, 8))[::2, ::2]),
        (np.zeros(3), np.frombuffer(bytes(24), np.float64)),
        (np.zeros(3), np.zeros((3, 1))),
        (1, 1.0),
        (True, 1),
        (np.float32(1), 1.0),
        (PAIR, (PAIR.first, PAIR.second)),
        (PAIR, Pair(PAIR.first, PAIR.second.astype(np.int64))),
    ],
)
def test_what_needs_other_machine_code_is_of_another_kind(one: object, other: object) -> None:
    assert kinds((one,)) != kinds((other,))


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (np.zeros(3), np.ones(7)),
        (np.zeros((1, 5)), np.zeros((5, 5))),
        (np.zeros((0, 2)), np.zeros((3, 2))),
        (3, np.int64(4)),
        (0.5, np.float64(1)),
        (True, np.bool_(False)),
        (PAIR, Pair(np.ones(1), np.ones(1))),
    ],
)
def test_what_runs_the_same_machine_code_is_of_one_kind(one: object, other: object) -> None:
    assert kinds((one,)) == kinds((other,))


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A library with the calls below, and what it holds."""
    folder = tmp_path_factory.mktemp("library")
    with recorded_calls() as calls:
        quadrupled(np.zeros(2))
        add_up(PAIR, np.zeros(1))
        wait_for(np.ones(2, np.int64), np.ones(1, np.int64), 1)
    return compiled(calls, folder)


def compiled(calls: Calls, folder: Path) -> tuple[Path, Path]:
    library, contents = folder / kernels.LIBRARY.name, folder / kernels.CONTENTS.name
    try:
        calls.compile(library, contents)
    except (ImportError, RuntimeError) as problem:
        missing(f"no library can be made here: {problem}")
    return library, contents


@pytest.fixture
def in_use(made: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[Path, Path]]:
    """The library, used instead of the package's own."""
    monkeypatch.setattr(kernels, "LIBRARY", made[0])
    monkeypatch.setattr(kernels, "CONTENTS", made[1])
    kernels.library.cache_clear()
    yield made
    kernels.library.cache_clear()


def again(known: Kernel) -> Kernel:
    """The kernel as a new process has it, which cannot compile anything."""
    fresh = Kernel(known.__wrapped__)
    fresh.__dict__["jitted"] = None
    return fresh


@pytest.mark.slow
def test_a_library_does_what_was_recorded(in_use: tuple[Path, Path]) -> None:
    assert again(quadrupled)(np.array([1.0, 2.5])).tolist() == [4.0, 10.0]
    total = np.zeros(1)
    again(add_up)(PAIR, total)
    assert total[0] == 7.0


@pytest.mark.slow
def test_other_calls_are_compiled_when_they_come(in_use: tuple[Path, Path]) -> None:
    with pytest.raises(TypeError, match="NoneType"):
        again(quadrupled)(np.array([1, 2]))
    fresh = Kernel(quadrupled.__wrapped__)
    assert fresh(np.array([1, 2])).tolist() == [4, 8]


@pytest.mark.slow
def test_kernels_of_a_library_let_other_threads_run(in_use: tuple[Path, Path]) -> None:
    flag, elsewhere, seen = np.zeros(2, np.int64), np.ones(1, np.int64), []
    thread = threading.Thread(target=lambda: seen.append(again(wait_for)(flag, elsewhere, TURNS)))
    thread.start()
    while flag[1] == 0:
        time.sleep(0.001)
    flag[0] = 1
    thread.join()
    assert seen == [True]


@pytest.mark.slow
def test_a_library_of_other_sources_is_not_used(
    in_use: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    assert kernels.library()
    assert not caplog.records
    kernels.library.cache_clear()
    monkeypatch.setattr(kernels, "sources_stamp", lambda: 0)
    assert kernels.library() == kernels.library() == {}
    assert [record.levelname for record in caplog.records] == ["WARNING"]
    assert "other sources" in caplog.text


@pytest.mark.slow
@pytest.mark.parametrize("name", [kernels.LIBRARY.name, kernels.CONTENTS.name])
@pytest.mark.parametrize("content", [None, b"", b"[1]", b'{"calls": []}', b"\x7fELF"])
def test_a_library_that_is_not_whole_is_not_used(
    in_use: tuple[Path, Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    name: str,
    content: bytes | None,
) -> None:
    for path, variable in zip(in_use, ("LIBRARY", "CONTENTS"), strict=True):
        copy = tmp_path / path.name
        if path.name != name:
            copy.write_bytes(path.read_bytes())
        elif content is not None:
            copy.write_bytes(content)
        monkeypatch.setattr(kernels, variable, copy)
    assert kernels.library() == {}
    is_missing = content is None and name == kernels.CONTENTS.name
    assert [record.levelname for record in caplog.records] == ([] if is_missing else ["WARNING"])


@bare_kernel
def same(values):
    return values


@pytest.mark.slow
def test_a_bare_kernel_must_not_return_arrays(tmp_path: Path) -> None:
    with recorded_calls() as calls:
        same(np.zeros(3))
    with pytest.raises(TypeError, match=r"test_kernels\.same hands out an array"):
        compiled(calls, tmp_path)


@pytest.mark.slow
def test_a_library_says_what_it_holds(made: tuple[Path, Path]) -> None:
    contents = json.loads(made[1].read_text())
    assert contents["sources"] == kernels.sources_stamp()
    assert [call["kernel"].rsplit(".", 1)[1] for call in contents["calls"]] == [
        "quadrupled",
        "add_up",
        "wait_for",
    ]
