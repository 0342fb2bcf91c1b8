"""Photos into vector images made of generalized Coons patches."""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gcvec.annotations import Annotations, Shape
    from gcvec.errors import InputError
    from gcvec.metrics import Report
    from gcvec.options import Options
    from gcvec.pipeline import vectorize
    from gcvec.progress import OnProgress, Progress
    from gcvec.vector_image import VectorImage

_HOMES = {
    "Annotations": "gcvec.annotations",
    "InputError": "gcvec.errors",
    "OnProgress": "gcvec.progress",
    "Options": "gcvec.options",
    "Progress": "gcvec.progress",
    "Report": "gcvec.metrics",
    "Shape": "gcvec.annotations",
    "VectorImage": "gcvec.vector_image",
    "vectorize": "gcvec.pipeline",
}

__all__ = [
    "Annotations",
    "InputError",
    "OnProgress",
    "Options",
    "Progress",
    "Report",
    "Shape",
    "VectorImage",
    "vectorize",
]

if not TYPE_CHECKING:  # a type checker that saw this would accept any name

    def __getattr__(name):
        """Import a public name when it is first asked for: most users of the package need few of them."""
        if name not in _HOMES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        globals()[name] = getattr(import_module(_HOMES[name]), name)
        return globals()[name]
