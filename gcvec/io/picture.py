"""Pictures in: whatever a camera, a scanner or an editor writes becomes 8-bit sRGB, upright and opaque."""

from __future__ import annotations

import ctypes
import threading
import warnings as python_warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from io import BytesIO
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import ExifTags, Image, ImageCms, PngImagePlugin, TiffImagePlugin, _imaging

from gcvec.errors import InputError
from gcvec.io.limits import DEFAULT_LIMITS, Limits

_FORMATS = ("PNG", "JPEG", "WEBP", "TIFF")
_SIGNATURES = (b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff", b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_WHITE = (255, 255, 255)

_UPRIGHT = {
    2: Image.Transpose.FLIP_LEFT_RIGHT,
    3: Image.Transpose.ROTATE_180,
    4: Image.Transpose.FLIP_TOP_BOTTOM,
    5: Image.Transpose.TRANSPOSE,
    6: Image.Transpose.ROTATE_270,
    7: Image.Transpose.TRANSVERSE,
    8: Image.Transpose.ROTATE_90,
}
"""EXIF orientation -> what turns the stored pixels upright."""

_WHITE_IS_ZERO = 0
"""How a TIFF says that its grey samples are those of a negative."""

_PROFILE_MODES = {"RGB": "RGB", "GRAY": "L", "CMYK": "CMYK"}
"""ICC colour space -> the Pillow mode such a profile reads."""


_PLANES = 2
"""TIFF 6.0, PlanarConfiguration: every sample has a plane of its own."""

_SCALES = {"L;2": 85, "L;4": 17}
"""Pillow's layout of few bits a sample -> the 8-bit value of 1."""


@dataclass(frozen=True)
class Picture:
    """Upright sRGB pixels, `(h, w, 3) uint8`, and what had to be assumed or left out to get them."""

    pixels: NDArray[np.uint8]
    warnings: tuple[str, ...] = ()


class PictureHeader(NamedTuple):
    """What a file says of itself: `format` ("PNG", "JPEG", "WEBP", "TIFF") and the upright size in pixels."""

    format: str
    width: int
    height: int


def probe_picture(data: bytes, *, limits: Limits = DEFAULT_LIMITS) -> PictureHeader:
    """Format and upright size from the header alone; no pixel is decoded.

    Raises `InputError` ("unreadable-picture", "unsupported-picture", "picture-too-large"). A file that
    passes can still turn out to be damaged when `read_picture` decodes it.
    """
    with _quiet_pillow():
        image = _open(data, limits)
        width, height = image.size
        if _stored_sideways(image):
            width, height = height, width
        return PictureHeader(_format(image), width, height)


def read_picture(
    data: bytes, *, limits: Limits = DEFAULT_LIMITS, matte: tuple[int, int, int] = _WHITE
) -> Picture:
    """Decode a PNG, JPEG, WebP or TIFF file, told apart by content, never by name.

    EXIF orientation is applied; an embedded ICC profile is converted to sRGB; CMYK, grey and palette pictures
    become RGB; transparent pixels are laid over `matte`. Of an animation or a multi-page file the first frame
    is taken. 16-bit grey is rounded to 8 bits; of 16-bit colour samples Pillow keeps the high byte, which is
    up to one level darker than rounding.

    Raises `InputError`: "unreadable-picture" (damaged), "unsupported-picture" (another format, or samples
    of 32 bits), "picture-too-large" (by its header, before anything is decoded); and MemoryError.
    """
    notes: list[str] = []
    with _quiet_pillow():
        image = _open(data, limits)
        if image.format != "MPO" and getattr(image, "is_animated", False):
            notes.append("the file holds several frames or pages; the first one is used")
        try:
            _require_readable(image)
            _bring_key_to_eight_bits(image, notes)
            image.load()
            image = _upright(image, notes)
            profile = image.info.get("icc_profile")
            color, alpha = _split_alpha(_eight_bit(image))
            color = _to_srgb(color, profile, notes)
        except InputError:
            raise
        except Exception as error:  # on damaged files Pillow's decoders raise nearly anything
            _raise_if_out_of_memory(error)
            raise _unreadable(str(error)) from error
    if alpha is not None and alpha.getextrema() != (255, 255):
        notes.append("transparent pixels are laid over rgb({}, {}, {})".format(*matte))
        background = Image.new("RGB", color.size, matte)
        background.paste(color, mask=alpha)
        color = background
    return Picture(np.array(color, dtype=np.uint8), tuple(notes))


def _silence_libtiff() -> None:
    """Keep libtiff from writing to stderr what it finds wrong with a file: the exceptions say enough.

    Pillow has no way to ask for this; its own copy of the library has, where it can be reached.
    """
    with suppress(OSError, AttributeError):
        set_error_handler = ctypes.CDLL(_imaging.__file__).TIFFSetErrorHandler
        set_error_handler.argtypes, set_error_handler.restype = [ctypes.c_void_p], ctypes.c_void_p
        set_error_handler(None)


_silence_libtiff()


_ONE_AT_A_TIME = threading.Lock()
"""What Python warns of is the same for all threads: two that put it back at once would leave it silenced."""


@contextmanager
def _quiet_pillow() -> Iterator[None]:
    """Pillow warns about sizes and metadata on stderr; what matters is checked and reported here instead."""
    with _ONE_AT_A_TIME, python_warnings.catch_warnings():
        python_warnings.simplefilter("ignore")
        yield


def _open(data: bytes, limits: Limits) -> Image.Image:
    """Read the header and check the size it states. Decodes nothing."""
    try:
        image = Image.open(BytesIO(data), formats=_FORMATS)
    except Image.DecompressionBombError as error:
        raise _too_large("picture has too many pixels", limits) from error
    except Exception as error:  # see read_picture
        _raise_if_out_of_memory(error)
        if not data:
            raise _unreadable("the file is empty") from error
        if data.startswith(_SIGNATURES) or (data[:4] == b"RIFF" and data[8:12] == b"WEBP"):
            raise _unreadable("its header is damaged or of an unknown kind") from error
        raise InputError(
            "unsupported picture: not a PNG, JPEG, WebP or TIFF file", code="unsupported-picture"
        ) from error
    width, height = image.size
    if max(width, height) > limits.max_side or width * height > limits.max_pixels:
        raise _too_large(f"picture is {width} x {height} pixels", limits)
    if min(width, height) < 1:
        raise _unreadable(f"its header states a size of {width} x {height} pixels")
    return image


def _raise_if_out_of_memory(error: Exception) -> None:
    """Raise MemoryError where that is what went wrong, which is no fault of the file's.

    Some of Pillow's decoders have a status of their own for it, which comes out as an OSError.
    """
    if isinstance(error, MemoryError) or (isinstance(error, OSError) and "out of memory" in str(error)):
        raise MemoryError from error


def _unreadable(why: str) -> InputError:
    return InputError(f"unreadable picture: {' '.join(why.split())}", code="unreadable-picture")


def _too_large(what: str, limits: Limits) -> InputError:
    megapixels = limits.max_pixels / 1e6
    return InputError(
        f"{what}; at most {limits.max_side} a side and {megapixels:g} megapixels are accepted",
        code="picture-too-large",
    )


def _format(image: Image.Image) -> str:
    """The container's name; a JPEG with a second picture inside ("MPO", as phones write them) is a JPEG."""
    return "JPEG" if image.format == "MPO" else str(image.format)


def _stored_sideways(image: Image.Image) -> bool:
    if isinstance(image, TiffImagePlugin.TiffImageFile):
        return False  # Pillow states the upright size of a TIFF, and turns it on loading
    try:
        # the plain method: PNG's own decodes the whole picture to look for EXIF data behind it
        return Image.Image.getexif(image).get(ExifTags.Base.Orientation) in (5, 6, 7, 8)
    except Exception:  # damaged EXIF data counts as none, as in _upright
        return False


def _require_readable(image: Image.Image) -> None:
    """Refuse what Pillow reads as something else."""
    tags = image.tag_v2 if isinstance(image, TiffImagePlugin.TiffImageFile) else {}
    planes = tags.get(TiffImagePlugin.PLANAR_CONFIGURATION) == _PLANES
    plain = tags.get(TiffImagePlugin.COMPRESSION, 1) == 1
    if planes and plain and max(tags.get(TiffImagePlugin.BITSPERSAMPLE, (8,))) > 8:
        raise InputError(
            "unsupported picture: 16-bit samples in separate planes; save it with its samples together",
            code="unsupported-picture",
        )


def _bring_key_to_eight_bits(image: Image.Image, notes: list[str]) -> None:
    """Where a PNG states which colour is transparent, it does so in the file's own bits."""
    key = image.info.get("transparency")
    if not isinstance(image, PngImagePlugin.PngImageFile) or key is None:
        return
    layout = image.tile[0].args if image.tile else None
    if layout in _SCALES and isinstance(key, int):
        image.info["transparency"] = key * _SCALES[layout]
    elif layout == "RGB;16B":  # its samples have lost their low bytes, which may tell them from the key
        del image.info["transparency"]
        notes.append("the transparent colour of 16-bit samples is ignored")


def _upright(image: Image.Image, notes: list[str]) -> Image.Image:
    try:
        orientation = image.getexif().get(ExifTags.Base.Orientation)
    except Exception:  # see read_picture
        notes.append("the EXIF data is damaged; the picture is taken as upright")
        return image
    return image.transpose(_UPRIGHT[orientation]) if orientation in _UPRIGHT else image


def _eight_bit(image: Image.Image) -> Image.Image:
    """Bring 16-bit grey to 8 bits, rounding; a transparent grey value becomes an alpha channel."""
    if image.mode in ("I", "F", "LAB"):
        raise InputError(
            f"unsupported picture: samples of kind {image.mode!r}; save it as RGB of 8 or 16 bits",
            code="unsupported-picture",
        )
    if not image.mode.startswith("I;16"):
        return image
    samples = np.asarray(image).astype(np.uint16)
    tags = image.tag_v2 if isinstance(image, TiffImagePlugin.TiffImageFile) else {}
    white = (1 << tags.get(TiffImagePlugin.BITSPERSAMPLE, (16,))[0]) - 1
    if tags.get(TiffImagePlugin.PHOTOMETRIC_INTERPRETATION) == _WHITE_IS_ZERO:
        samples = white - samples  # which Pillow does at 8 bits only
    grey = Image.fromarray(((samples.astype(np.uint32) * 255 + white // 2) // white).astype(np.uint8))
    transparent = image.info.get("transparency")
    if transparent is not None:
        grey.putalpha(Image.fromarray(np.where(samples == transparent, 0, 255).astype(np.uint8)))
    return grey


def _split_alpha(image: Image.Image) -> tuple[Image.Image, Image.Image | None]:
    """The colours as "L", "RGB" or "CMYK", and the alpha channel where there is one."""
    if image.has_transparency_data:
        if image.mode == "La":
            image = image.convert("LA")
        rgba = image.convert("RGBA")
        return rgba.convert("RGB"), rgba.getchannel("A")
    if image.mode == "1":
        return image.convert("L"), None
    return image if image.mode in ("L", "RGB", "CMYK") else image.convert("RGB"), None


def _to_srgb(color: Image.Image, icc: bytes | None, notes: list[str]) -> Image.Image:
    if icc:
        try:
            return _through_profile(color, icc)
        except (ImageCms.PyCMSError, OSError, ValueError, KeyError):
            notes.append("the colour profile is damaged or does not fit the picture; it is ignored")
    if color.mode == "CMYK":
        notes.append("CMYK without a usable colour profile: converted by the plain formula")
    return color.convert("RGB")


def _through_profile(color: Image.Image, icc: bytes) -> Image.Image:
    profile = ImageCms.ImageCmsProfile(BytesIO(icc))
    mode = _PROFILE_MODES[profile.profile.xcolor_space.strip()]
    if (color.mode == "CMYK") != (mode == "CMYK") or (mode == "L" and not _is_grey(color)):
        raise ValueError("profile of another colour space")
    transform = ImageCms.buildTransform(
        profile,
        ImageCms.createProfile("sRGB"),
        mode,
        "RGB",
        ImageCms.Intent.RELATIVE_COLORIMETRIC,
        ImageCms.Flags.BLACKPOINTCOMPENSATION,
    )
    color = color.convert(mode)
    if mode == "RGB" and _is_identity(transform):
        return color
    converted = ImageCms.applyTransform(color, transform)
    assert converted is not None  # None only for a transformation in place
    return converted


def _is_grey(color: Image.Image) -> bool:
    samples = np.asarray(color)
    return color.mode == "L" or bool((samples == samples[..., :1]).all())


def _is_identity(transform: ImageCms.ImageCmsTransform) -> bool:
    """Whether a profile is sRGB but for rounding; then pixels had better stay untouched."""
    levels = np.linspace(0, 255, 18).astype(np.uint8)
    cube = np.stack(np.meshgrid(levels, levels, levels, indexing="ij"), axis=-1).reshape(1, -1, 3)
    converted = ImageCms.applyTransform(Image.fromarray(cube), transform)
    return bool(np.abs(np.asarray(converted).astype(int) - cube).max() <= 1)
