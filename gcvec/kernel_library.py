"""Compiles the kernels that pictures need into one library: `python -m gcvec.kernel_library`."""

from __future__ import annotations

import json
import os
import platform
import sys
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from multiprocessing import get_context
from pathlib import Path
from typing import Any
from unittest.mock import patch

from gcvec.kernels import CONTENTS, LIBRARY, LIBRARY_NAME, Kernel, Kinds, kinds, sources_stamp, symbol
from gcvec.parallel import cores

PROCESSORS = {"x86_64": "x86-64-v2", "AMD64": "x86-64-v2"}
"""What code is compiled for on machines of a kind, where that is more than its first processors had: what
NumPy's own wheels ask for. It takes 5 to 10 % less time than without, and as much as with all that newer ones
have."""


class Calls:
    """Which kernels are called from outside, and with arguments of which types."""

    def __init__(self) -> None:
        self._types: dict[tuple[Kernel, Kinds], tuple[Any, ...]] = {}

    def call(self, kernel: Kernel, arguments: tuple[Any, ...]) -> Any:
        """Do a call, and note it."""
        result = kernel.jitted(*arguments)
        self._types.setdefault((kernel, kinds(arguments)), tuple(map(kernel.jitted.typeof_pyval, arguments)))
        return result

    def compile(self, library: Path, contents: Path) -> None:
        """Write a library with machine code for these calls, for any processor of this kind (see
        `PROCESSORS`), and what it holds.

        Raises `ImportError` or `RuntimeError` where that cannot be done here: it takes a C++ compiler; and
        `TypeError` for a bare kernel that returns an array.
        """
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # numba announces that there will be another way
            from numba.pycc.cc import CC
        from numba.core.types import Array

        compiler = CC(LIBRARY_NAME)
        compiler.target_cpu = PROCESSORS.get(platform.machine(), compiler.target_cpu)
        listed = []
        for (kernel, known), types in self._types.items():
            signature = kernel.jitted.overloads[types].signature
            if not kernel.counts_references and isinstance(signature.return_type, Array):
                raise TypeError(f"{kernel.name} hands out an array whose references it does not count")
            compiler.export(symbol(kernel.name, known), signature)(_caller(kernel, len(types)))
            listed.append({"kernel": kernel.name, "kinds": known})
        library.parent.mkdir(exist_ok=True)
        with tempfile.TemporaryDirectory(dir=library.parent) as folder, _without_interpreter_lock():
            made = Path(folder) / library.name
            compiler.output_dir, compiler.output_file = folder, library.name
            compiler.compile()
            list_of_calls = Path(folder) / contents.name
            list_of_calls.write_text(json.dumps({"sources": sources_stamp(), "calls": listed}))
            os.replace(made, library)
            os.replace(list_of_calls, contents)


def _caller(kernel: Kernel, n: int) -> Any:
    """A function of n arguments that does no more than call a kernel, which is compiled as it wants to be."""
    names = ", ".join(f"a{i}" for i in range(n))
    return eval(f"lambda {names}: kernel({names})", {"kernel": kernel.jitted})


@contextmanager
def _without_interpreter_lock() -> Iterator[None]:
    """Inside, functions in libraries release the lock, for which numba has no option there."""
    from numba.core.compiler import Flags

    def flags() -> Any:
        made: Any = Flags()
        made.release_gil = True
        return made

    with patch("numba.pycc.compiler.Flags", flags):
        yield


@contextmanager
def recorded_calls() -> Iterator[Calls]:
    """Inside, all calls of kernels are noted, and none goes to the library."""
    calls = Calls()
    Kernel.recorder = calls
    try:
        yield calls
    finally:
        Kernel.recorder = None


def _call_kernels_of_files() -> None:
    with recorded_calls():
        from gcvec.warm_up import made_image, store_and_draw

        store_and_draw(made_image())


@contextmanager
def _helper() -> Iterator[None]:
    """Inside, another process compiles the kernels that come last, those of files and drawings, so that they
    are found on disk when their turn has come: half the work, for the second core."""
    helper = get_context("spawn").Process(target=_call_kernels_of_files)
    helper.start()
    try:
        yield
    finally:
        helper.join()


def main() -> None:
    """Make the library, or say why pictures will start more slowly."""
    with _helper() if cores() > 1 else nullcontext(), recorded_calls() as calls:
        from gcvec.warm_up import SIDE, warm_up

        warm_up(SIDE)
    try:
        calls.compile(LIBRARY, CONTENTS)
    except (ImportError, RuntimeError, OSError) as problem:
        print(f"gcvec: kernels are loaded one by one, without a library: {problem}", file=sys.stderr)


if __name__ == "__main__":
    main()
