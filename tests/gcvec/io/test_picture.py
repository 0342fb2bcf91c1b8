from __future__ import annotations

import io
import struct
import warnings
from dataclasses import replace
from typing import Any, NoReturn

import numpy as np
import pytest
import tifffile
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from PIL import Image, ImageCms

from gcvec.errors import InputError
from gcvec.io import DEFAULT_LIMITS, picture, probe_picture, read_picture
from tests.picture_files import encoded, png, png_with_header, swapped_profile

FORMATS = ("PNG", "JPEG", "WEBP", "TIFF")


def blocks() -> Image.Image:
    """48 x 32, quarters of four colours: flat enough for any codec, different in every orientation."""
    colours = np.array([[(250, 10, 10), (10, 250, 10)], [(10, 10, 250), (240, 240, 20)]], dtype=np.uint8)
    return Image.fromarray(colours.repeat(16, axis=0).repeat(24, axis=1))


def pixels(image: Image.Image) -> NDArray[np.uint8]:
    return np.asarray(image.convert("RGB"))


@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.parametrize("orientation", range(1, 9))
def test_every_format_comes_upright_from_every_orientation(kind: str, orientation: int) -> None:
    upright = blocks()
    # how a camera stores the picture so that `orientation` turns it upright again
    stored = {
        1: None,
        2: Image.Transpose.FLIP_LEFT_RIGHT,
        3: Image.Transpose.ROTATE_180,
        4: Image.Transpose.FLIP_TOP_BOTTOM,
        5: Image.Transpose.TRANSPOSE,
        6: Image.Transpose.ROTATE_90,
        7: Image.Transpose.TRANSVERSE,
        8: Image.Transpose.ROTATE_270,
    }[orientation]
    exif = Image.Exif()
    exif[0x0112] = orientation
    options: dict[str, Any] = {"quality": 95} if kind in ("JPEG", "WEBP") else {}
    data = encoded(upright.transpose(stored) if stored is not None else upright, kind, exif=exif, **options)
    picture = read_picture(data)
    assert picture.pixels.shape == (32, 48, 3)
    assert picture.pixels.dtype == np.uint8
    difference = np.abs(picture.pixels.astype(int) - pixels(upright))
    assert np.median(difference) <= 3
    assert picture.warnings == ()
    assert probe_picture(data) == (kind, 48, 32)


@pytest.mark.parametrize("mode", ["1", "L", "P", "RGB"])
def test_grey_palette_and_bilevel_become_rgb(mode: str) -> None:
    image = blocks().convert(mode)
    np.testing.assert_array_equal(read_picture(encoded(image)).pixels, pixels(image))


def test_cmyk_without_profile_is_converted_plainly_and_said_so() -> None:
    image = blocks().convert("CMYK")
    picture = read_picture(encoded(image, "TIFF"))
    np.testing.assert_array_equal(picture.pixels, pixels(image))
    assert "CMYK without" in picture.warnings[0]


def test_adobe_cmyk_jpeg_is_not_inverted() -> None:
    picture = read_picture(encoded(blocks().convert("CMYK"), "JPEG", quality=95))
    assert np.abs(picture.pixels[4, 4].astype(int) - (250, 10, 10)).max() < 12


@pytest.mark.parametrize("kind", ["PNG", "TIFF"])
def test_16_bit_grey_is_rounded(kind: str) -> None:
    samples = np.linspace(0, 65535, 64 * 8).astype(np.uint16).reshape(8, 64)
    expected = np.round(samples / 257).astype(int)
    picture = read_picture(encoded(Image.fromarray(samples), kind))
    np.testing.assert_array_equal(picture.pixels, np.repeat(expected[..., None], 3, axis=-1))


@pytest.mark.parametrize("compression", [None, "tiff_deflate"])
def test_a_16_bit_tiff_whose_zero_is_white_is_no_negative(compression: str | None) -> None:
    samples = np.linspace(0, 65535, 64).astype(np.uint16).reshape(8, 8)
    data = encoded(Image.fromarray(samples), "TIFF", compression=compression)
    photometric = struct.pack("<HHIHH", 262, 3, 1, 1, 0)
    assert photometric in data
    found = read_picture(data.replace(photometric, struct.pack("<HHIHH", 262, 3, 1, 0, 0))).pixels
    np.testing.assert_array_equal(found, 255 - read_picture(data).pixels)


def test_16_bit_grey_keeps_its_transparent_value() -> None:
    samples = np.array([[0, 30000], [40000, 65535]], dtype=np.uint16)
    picture = read_picture(encoded(Image.fromarray(samples), transparency=30000))
    assert picture.pixels[..., 0].tolist() == [[0, 255], [156, 255]]


def test_16_bit_rgb_png_loses_its_low_bytes() -> None:
    row = struct.pack(">6H", 0x1234, 0xABCD, 0xFFFF, 0, 0x80FF, 0x7F00)
    picture = read_picture(png((2, 2), 16, 2, [row, row]))
    assert picture.pixels[0].tolist() == [[0x12, 0xAB, 0xFF], [0, 0x80, 0x7F]]


@pytest.mark.parametrize(("bits", "row"), [(2, 0b11_00_10_01), (4, 0x30)])
def test_a_transparent_grey_of_few_bits_counts_as_alpha(bits: int, row: int) -> None:
    """It is the first pixel's, 3."""
    data = png((8 // bits, 1), bits, 0, [bytes([row])], key=struct.pack(">H", 3))
    picture = read_picture(data, matte=(255, 0, 0))
    assert picture.pixels[0, :2].tolist() == [[255, 0, 0], [0, 0, 0]]
    assert "transparent" in picture.warnings[0]


def test_a_transparent_colour_of_16_bits_is_ignored_with_a_warning() -> None:
    row = struct.pack(">6H", 0, 0, 0, 0xFF, 0xFF, 0xFF)
    picture = read_picture(png((2, 1), 16, 2, [row], key=bytes(6)), matte=(255, 0, 0))
    assert not picture.pixels.any()
    assert picture.warnings == ("the transparent colour of 16-bit samples is ignored",)


@pytest.mark.parametrize("byteorder", ["<", ">"])
@pytest.mark.parametrize("compression", [None, "zlib"])
def test_16_bit_planes_are_read_right_or_refused(byteorder: Any, compression: str | None) -> None:
    """Uncompressed ones are refused: Pillow takes them for something else."""
    planes = np.moveaxis(pixels(blocks()).astype(np.uint16) * 257, 2, 0)
    file = io.BytesIO()
    tifffile.imwrite(
        file, planes, photometric="rgb", planarconfig="separate", byteorder=byteorder, compression=compression
    )
    if compression is None:
        with pytest.raises(InputError, match="planes"):
            read_picture(file.getvalue())
    else:
        np.testing.assert_array_equal(read_picture(file.getvalue()).pixels, pixels(blocks()))


@pytest.mark.parametrize("matte", [(255, 255, 255), (0, 128, 255)])
def test_transparent_pixels_show_the_matte(matte: tuple[int, int, int]) -> None:
    image = blocks().convert("RGBA")
    alpha = Image.new("L", image.size, 255)
    alpha.paste(0, (0, 0, 24, 16))
    alpha.paste(128, (24, 0, 48, 16))
    image.putalpha(alpha)
    picture = read_picture(encoded(image), matte=matte)
    assert picture.pixels[4, 4].tolist() == list(matte)
    blended = (np.array((10, 250, 10)) * 128 + np.array(matte) * 127) / 255
    assert np.abs(picture.pixels[4, 30] - blended).max() <= 1
    assert picture.pixels[20, 4].tolist() == [10, 10, 250]
    assert len(picture.warnings) == 1


def test_a_transparent_palette_entry_counts_as_alpha() -> None:
    image = blocks().convert("P", palette=Image.Palette.ADAPTIVE, colors=4)
    index = image.getpixel((4, 4))
    picture = read_picture(encoded(image, transparency=index))
    assert picture.pixels[4, 4].tolist() == [255, 255, 255]
    assert picture.pixels[20, 4].tolist() == [10, 10, 250]


def test_an_opaque_alpha_channel_is_nothing_to_warn_of() -> None:
    assert read_picture(encoded(blocks().convert("RGBA"))).warnings == ()


def test_srgb_profiles_leave_the_pixels_alone() -> None:
    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    noise = Image.fromarray(np.random.default_rng(1).integers(0, 256, (20, 30, 3), dtype=np.uint8))
    picture = read_picture(encoded(noise, icc_profile=profile))
    np.testing.assert_array_equal(picture.pixels, pixels(noise))


@pytest.mark.parametrize("kind", FORMATS)
def test_icc_profiles_are_converted_to_srgb(kind: str) -> None:
    options: dict[str, Any] = {"quality": 95} if kind in ("JPEG", "WEBP") else {}
    picture = read_picture(encoded(blocks(), kind, icc_profile=swapped_profile(), **options))
    assert np.abs(picture.pixels[8, 8].astype(int) - (10, 250, 10)).max() <= 12
    assert picture.warnings == ()


@pytest.mark.parametrize("mode", ["L", "P", "RGB"])
def test_a_damaged_or_foreign_profile_is_ignored_with_a_warning(mode: str) -> None:
    image = blocks().convert(mode)
    picture = read_picture(encoded(image, icc_profile=b"not a profile"))
    np.testing.assert_array_equal(picture.pixels, pixels(image))
    assert "profile" in picture.warnings[0]


def test_a_grey_profile_is_for_grey_pictures_only() -> None:
    profile = bytearray(ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes())
    profile[16:20] = b"GRAY"
    at = profile.index(b"rTRC")
    profile[at : at + 4] = b"kTRC"
    colorful = read_picture(encoded(blocks(), icc_profile=bytes(profile)))
    np.testing.assert_array_equal(colorful.pixels, pixels(blocks()))
    assert "does not fit" in colorful.warnings[0]
    for mode in ("L", "LA"):
        assert read_picture(encoded(blocks().convert(mode), icc_profile=bytes(profile))).warnings == ()


@pytest.mark.parametrize("kind", ["PNG", "WEBP", "TIFF"])
def test_the_first_of_several_frames_is_used(kind: str) -> None:
    second = Image.new("RGB", (48, 32), (1, 2, 3))
    options: dict[str, Any] = {"lossless": True} if kind == "WEBP" else {}
    data = encoded(blocks(), kind, save_all=True, append_images=[second], **options)
    picture = read_picture(data)
    np.testing.assert_array_equal(picture.pixels, pixels(blocks()))
    assert "first" in picture.warnings[0]


def test_a_phone_jpeg_with_a_second_picture_inside_is_a_plain_jpeg() -> None:
    data = encoded(blocks(), "MPO", save_all=True, append_images=[blocks()])
    assert read_picture(data).warnings == ()
    assert probe_picture(data) == ("JPEG", 48, 32)


@pytest.mark.parametrize("kind", ["GIF", "BMP", "PPM"])
def test_other_formats_are_named_unsupported(kind: str) -> None:
    for read in (read_picture, probe_picture):
        with pytest.raises(InputError, match="not a PNG, JPEG, WebP or TIFF") as error:
            read(encoded(blocks(), kind))
        assert error.value.code == "unsupported-picture"


@pytest.mark.parametrize("mode", ["I", "F"])
def test_32_bit_samples_are_unsupported(mode: str) -> None:
    with pytest.raises(InputError) as error:
        read_picture(encoded(blocks().convert("L").convert(mode), "TIFF"))
    assert error.value.code == "unsupported-picture"


@pytest.mark.parametrize("kind", FORMATS)
def test_damaged_files_are_unreadable(kind: str) -> None:
    noise = Image.fromarray(np.random.default_rng(2).integers(0, 256, (64, 64, 3), dtype=np.uint8))
    data = encoded(noise, kind)
    for part in (data[:20], data[: len(data) // 2]):
        with pytest.raises(InputError) as error:
            read_picture(part)
        assert error.value.code == "unreadable-picture"
        assert "\n" not in str(error.value)


@pytest.mark.parametrize("error", [MemoryError(), OSError("out of memory when reading image file")])
@pytest.mark.parametrize("step", ["Image.open", "JpegImagePlugin.JpegImageFile.load"])
def test_a_lack_of_memory_is_no_fault_of_the_file(
    monkeypatch: pytest.MonkeyPatch, step: str, error: Exception
) -> None:
    def fail(*_: Any, **__: Any) -> NoReturn:
        raise error

    data = encoded(blocks(), "JPEG")
    monkeypatch.setattr(f"PIL.{step}", fail)
    with pytest.raises(MemoryError):
        read_picture(data)


def test_an_empty_file_is_unreadable() -> None:
    with pytest.raises(InputError, match="empty") as error:
        read_picture(b"")
    assert error.value.code == "unreadable-picture"


@pytest.mark.parametrize(
    ("width", "height"), [(16385, 1), (1, 16385), (8001, 8000), (13000, 13000), (60000, 60000)]
)
def test_the_header_is_checked_before_anything_is_decoded(width: int, height: int) -> None:
    for read in (read_picture, probe_picture):
        with pytest.raises(InputError) as error:
            read(png_with_header(width, height))
        assert error.value.code == "picture-too-large"


def test_limits_are_settable_and_inclusive() -> None:
    data = encoded(blocks())
    exact = replace(DEFAULT_LIMITS, max_side=48, max_pixels=48 * 32)
    assert probe_picture(data, limits=exact) == ("PNG", 48, 32)
    for limits in (replace(exact, max_side=47), replace(exact, max_pixels=48 * 32 - 1)):
        with pytest.raises(InputError):
            probe_picture(data, limits=limits)


def test_probing_decodes_no_pixel() -> None:
    """The pixels of this file are missing altogether."""
    assert probe_picture(png_with_header(640, 480)) == ("PNG", 640, 480)
    with pytest.raises(InputError):
        read_picture(png_with_header(640, 480))


@pytest.mark.parametrize("kind", FORMATS)
@given(data=st.data())
def test_a_file_with_flipped_bytes_reads_or_is_refused(kind: str, data: st.DataObject) -> None:
    file = bytearray(encoded(blocks(), kind))
    for _ in range(data.draw(st.integers(1, 4))):
        file[data.draw(st.integers(0, len(file) - 1))] = data.draw(st.integers(0, 255))
    limits = replace(DEFAULT_LIMITS, max_side=256)
    try:
        picture = read_picture(bytes(file), limits=limits)
    except InputError:
        return
    header = probe_picture(bytes(file), limits=limits)
    assert picture.pixels.shape == (header.height, header.width, 3)


def test_pictures_are_read_one_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """What Python warns of belongs to the process: two threads that put it back would undo each other's."""
    opened = picture._open

    def open_alone(*arguments: Any) -> Any:
        assert not picture._ONE_AT_A_TIME.acquire(blocking=False)
        return opened(*arguments)

    monkeypatch.setattr(picture, "_open", open_alone)
    data = encoded(blocks())
    assert probe_picture(data).width == read_picture(data).pixels.shape[1] == 48
    assert not picture._ONE_AT_A_TIME.locked()


def test_reading_leaves_warnings_as_they_were() -> None:
    before = list(warnings.filters)
    read_picture(encoded(blocks()))
    with pytest.raises(InputError):
        read_picture(b"\x89PNG\r\n\x1a\n")
    assert warnings.filters == before
    assert not picture._ONE_AT_A_TIME.locked()
