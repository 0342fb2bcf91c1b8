"""Photos into vector images made of generalized Coons patches."""

from gcvec.annotations import Annotations, Shape
from gcvec.errors import InputError
from gcvec.options import Options
from gcvec.progress import OnProgress, Progress

__all__ = ["Annotations", "InputError", "OnProgress", "Options", "Progress", "Shape"]
