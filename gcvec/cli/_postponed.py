"""Modules that come along with others and that hardly any command uses: loaded when something does."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder
from importlib.util import LazyLoader
from types import ModuleType

POSTPONED = ("numpy.f2py", "numpy.polynomial", "numpy.testing", "urllib.request")
"""scipy takes in everything that numpy has, and readers of XML all that could fetch some: together these take
as long to load as numpy does."""


class _Postpone(MetaPathFinder):
    """Finds them as any others, with a loader that waits."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if fullname not in POSTPONED:
            return None
        spec = PathFinder.find_spec(fullname, path, target)
        if spec is not None and spec.loader is not None:
            spec.loader = LazyLoader(spec.loader)
        return spec


def postpone() -> None:
    """From now on."""
    sys.meta_path.insert(0, _Postpone())
