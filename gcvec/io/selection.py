"""Which image of the annotations belongs to the picture."""

from __future__ import annotations

import unicodedata
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import PurePosixPath

from gcvec.errors import InputError

_NAMES_SHOWN = 5


def select_image(names: Sequence[Sequence[str]], image_name: str | None, picture_name: str | None) -> int:
    """Index of the image meant, where `names` has for each image what it may be called.

    `image_name` is a demand: it must be found. `picture_name`, the picture's own file name or path, is a
    hint: when it is not found the only image is taken. Both match exactly, else by base name, else without
    ending; of several such names by as many folders before it as can be, `a/b/cat.png` by `x/b/cat.png`
    rather than by `x/c/cat.png`, and then by one that needs no more. How accents are encoded does not matter
    (macOS writes them apart from their letters).

    Raises `InputError` ("unknown-image") when there is none, or no way to choose.
    """
    if not names:
        raise InputError("the annotations hold no image", code="unknown-image")
    wanted = image_name if image_name is not None else picture_name
    if wanted is not None:
        matches = _matches(names, wanted)
        if len(matches) == 1:
            return matches[0]
        if len(matches) > 1:
            shown = wanted if image_name is not None else "/".join(_parts(wanted)[-1:])
            raise _unknown(f"several images match {shown!r}", names, matches)
        if image_name is not None:
            raise _unknown(f"no image named {image_name!r}", names, range(len(names)))
    if len(names) == 1:
        return 0
    why = "several images and none named like the picture; name the one meant"
    raise _unknown(why, names, range(len(names)))


def _matches(names: Sequence[Sequence[str]], wanted: str) -> list[int]:
    exact = [index for index, of_image in enumerate(names) if wanted in of_image]
    return exact or _closest(names, wanted, _parts) or _closest(names, wanted, _parts_without_ending)


def _closest(names: Sequence[Sequence[str]], wanted: str, parts: Callable[[str], Sequence[str]]) -> list[int]:
    """Indices of the images with a name that ends in most of what `wanted` ends in, in its last part at
    least."""
    of_wanted = parts(wanted)
    common = [max(_common(parts(name), of_wanted) for name in of_image) for of_image in names]
    most = max(common)
    return [index for index, found in enumerate(common) if found == most] if most[0] else []


def _common(name: Sequence[str], wanted: Sequence[str]) -> tuple[int, bool]:
    """How many parts a name and the one wanted have in common at their ends, and whether the name has no
    others."""
    count = 0
    while count < min(len(name), len(wanted)) and name[-1 - count] == wanted[-1 - count]:
        count += 1
    return count, count == len(name)


def _parts(name: str) -> list[str]:
    composed = unicodedata.normalize("NFC", name).replace("\\", "/")
    return [part for part in composed.split("/") if part not in ("", ".")]


def _parts_without_ending(name: str) -> list[str]:
    *folders, base = _parts(name) or [""]
    return [*folders, PurePosixPath(base).stem]


def _unknown(what: str, names: Sequence[Sequence[str]], indices: Sequence[int]) -> InputError:
    shown = ", ".join(repr(name) for name in distinct_names(names, indices[:_NAMES_SHOWN]))
    more = f" and {len(indices) - _NAMES_SHOWN} more" if len(indices) > _NAMES_SHOWN else ""
    return InputError(f"{what} (the annotations hold {shown}{more})", code="unknown-image")


def distinct_names(names: Sequence[Sequence[str]], indices: Sequence[int]) -> list[str]:
    """For each of some images the first of its names that no other image has; the last, where others have
    them all."""
    theirs = {name for index in indices for name in names[index]}
    counts = Counter(name for of_image in names for name in of_image if name in theirs)
    return [next((n for n in names[i] if counts[n] == 1), names[i][-1]) for i in indices]
