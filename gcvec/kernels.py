"""How loops are compiled.

numba compiles a kernel for the types it is called with, at the first call, and keeps it on disk. To load a
hundred of them that way takes longer than many a picture. So the calls that pictures need are recorded once,
when the package is set up, and their kernels compiled into one library (`gcvec.kernel_library`), which is
there at once and without numba. Other calls, and all of them where there is no library or the sources have
changed since, go the first way.
"""

from __future__ import annotations

import functools
import json
import logging
import zlib
from collections.abc import Callable, Mapping
from importlib.machinery import EXTENSION_SUFFIXES, ExtensionFileLoader, ModuleSpec
from importlib.util import module_from_spec
from pathlib import Path
from typing import Any, Protocol

import numpy as np

PACKAGE = Path(__file__).parent
LIBRARY_NAME = "gcvec_kernels"
LIBRARY = PACKAGE / "__pycache__" / f"{LIBRARY_NAME}{EXTENSION_SUFFIXES[0]}"
CONTENTS = LIBRARY.with_suffix(".json")

REMEDY = "`python -m gcvec.kernel_library` makes it anew"

logger = logging.getLogger(__name__)

Kinds = tuple[Any, ...]

_SCALARS = {int: "int64", np.int64: "int64", float: "float64", np.float64: "float64", np.bool_: "bool"}


def kinds(values: tuple[Any, ...]) -> Kinds:
    """What kernels tell apart about their arguments: calls with equal kinds run the same machine code."""
    return tuple(map(_kind, values))


def _kind(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        flags = value.flags
        layout = "C" if flags.c_contiguous else "F" if flags.f_contiguous else "A"
        return _name(value.dtype), value.ndim, layout, flags.writeable, flags.aligned
    if isinstance(value, tuple):
        return type(value).__name__, *map(_kind, value)
    return _SCALARS.get(type(value)) or type(value).__name__


@functools.cache
def _name(dtype: np.dtype[Any]) -> str:
    return dtype.str


class Recorder(Protocol):
    """Whoever wants to know of all calls of kernels."""

    def call(self, kernel: Kernel, arguments: tuple[Any, ...]) -> Any:
        """Do the call."""
        ...


class Kernel:
    """A function that runs as machine code, and without the interpreter's lock. Kernels can call each other.

    name                its module's and its own
    counts_references   whether it may allocate, and hand out, arrays
    """

    recorder: Recorder | None = None
    """Where all calls go, if it is there; kernels that are made meanwhile do not look for a library."""

    def __init__(self, function: Callable[..., Any], bare: bool = False) -> None:
        functools.update_wrapper(self, function)
        self.name = f"{function.__module__}.{function.__qualname__}"
        self.counts_references = not bare
        self._function = function
        self._known = {} if Kernel.recorder is not None else library().get(self.name, {})

    @functools.cached_property
    def jitted(self) -> Any:
        """numba's dispatcher for the function."""
        from numba import njit

        options: dict[str, Any] = {} if self.counts_references else {"error_model": "numpy", "_nrt": False}
        return njit(cache=True, nogil=True, **options)(self._function)

    @property
    def _numba_type_(self) -> Any:
        """By this numba takes a kernel that another one calls for its dispatcher."""
        return self.jitted._numba_type_

    def __call__(self, *arguments: Any) -> Any:
        if Kernel.recorder is not None:
            return Kernel.recorder.call(self, arguments)
        known = self._known.get(kinds(arguments))
        return self.jitted(*arguments) if known is None else known(*arguments)


def kernel(function: Callable[..., Any]) -> Any:
    """Compiles a function."""
    return Kernel(function)


def bare_kernel(function: Callable[..., Any]) -> Any:
    """Compiles a function that allocates nothing: it works in the arrays it is given, and returns none.

    Nothing is reference-counted in it. For small functions that are handed many arrays, and called for every
    triangle, that is most of the time they would take.
    """
    return Kernel(function, bare=True)


@functools.cache
def library() -> Mapping[str, Mapping[Kinds, Callable[..., Any]]]:
    """The kernels of the library, by name and kinds of arguments; none where it is missing or out of date.

    The log says why there are none: pictures are made all the same, but start slowly.
    """
    try:
        return _loaded()
    except (OSError, ImportError, ValueError, KeyError, TypeError, AttributeError) as problem:
        # Where none can be made, as without a C++ compiler, that was told when it was tried.
        level = logging.INFO if isinstance(problem, FileNotFoundError) else logging.WARNING
        logger.log(level, "kernels are loaded one by one: %s: %r; %s", LIBRARY.name, problem, REMEDY)
        return {}


def _loaded() -> dict[str, dict[Kinds, Callable[..., Any]]]:
    contents = json.loads(CONTENTS.read_text())
    if contents["sources"] != sources_stamp():
        raise ImportError("it was compiled from other sources")
    loader = ExtensionFileLoader(LIBRARY_NAME, str(LIBRARY))
    module = module_from_spec(ModuleSpec(LIBRARY_NAME, loader, origin=str(LIBRARY)))
    loader.exec_module(module)
    found: dict[str, dict[Kinds, Callable[..., Any]]] = {}
    for call in contents["calls"]:
        known = _as_tuple(call["kinds"])
        found.setdefault(call["kernel"], {})[known] = getattr(module, symbol(call["kernel"], known))
    return found


def symbol(name: str, kinds: Kinds) -> str:
    """What a library calls a kernel for these kinds of arguments.

    So what is listed for another library does not lead to a wrong kernel.
    """
    return f"{name.replace('.', '_')}_{zlib.crc32(repr(kinds).encode()):08x}"


def sources_stamp() -> int:
    """A checksum of all the sources that kernels are compiled from."""
    stamp = 0
    for path in sorted(PACKAGE.rglob("*.py")):
        stamp = zlib.crc32(path.read_bytes(), stamp)
    return stamp


def _as_tuple(value: Any) -> Any:
    return tuple(map(_as_tuple, value)) if isinstance(value, list) else value
