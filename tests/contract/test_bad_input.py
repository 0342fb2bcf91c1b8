"""Section 4: limits and bad input."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from PIL import Image

from gcvec.io import DEFAULT_LIMITS, probe_picture, read_annotations
from tests.command import gcvec
from tests.contract.client import ended, post, submitted
from tests.picture_files import encoded, pixels, png_with_header, swapped_profile
from tests.problems import refused
from tests.shaded_box import BOX, GROUND, HEIGHT, WIDTH, cvat, polygon
from worker.settings import Settings, limits

pytestmark = pytest.mark.service

RED, BLUE = (220, 30, 40), (30, 60, 200)


@pytest.mark.contract("4: limits: defaults")
def test_default_limits_are_the_stated_ones() -> None:
    settings = Settings.model_construct()
    assert settings.max_upload_bytes == 25_000_000
    assert limits(settings) == DEFAULT_LIMITS
    assert (DEFAULT_LIMITS.max_pixels, DEFAULT_LIMITS.max_side) == (64_000_000, 16_384)
    assert DEFAULT_LIMITS.max_polygons == 2_000
    assert DEFAULT_LIMITS.max_vertices_per_polygon == 20_000
    assert DEFAULT_LIMITS.max_vertices == 200_000


@pytest.mark.contract("4: limits: upload")
def test_25_megabytes_are_accepted_and_not_a_byte_more(api: httpx.Client, photo: bytes) -> None:
    fits = photo + bytes(25_000_000 - len(photo))
    api.delete(submitted(api, fits)["links"]["self"])
    assert refused(post(api, fits + b"\0"), 413, "too-large")["pointer"] == "/image"
    padded = cvat(GROUND) + " " * (25_000_001 - len(cvat(GROUND)))
    assert refused(post(api, photo, padded), 413, "too-large")["pointer"] == "/annotations"


@pytest.mark.contract("4: limits: megapixels and sides")
@pytest.mark.parametrize(("width", "height"), [(16_385, 1), (1, 16_385), (8_001, 8_000)])
def test_64_megapixels_and_16384_a_side_are_accepted(api: httpx.Client, width: int, height: int) -> None:
    for w, h in ((16_384, 1), (8_000, 8_000), (16_384, 3_906)):
        assert probe_picture(png_with_header(w, h))[1:] == (w, h)
    refusal = refused(post(api, png_with_header(width, height)), 413, "picture-too-large")
    assert refusal["pointer"] == "/image"
    assert f"{width} x {height}" in refusal["detail"]


def ring(vertices: int) -> str:
    angle = np.linspace(0, 2 * np.pi, vertices, endpoint=False)
    circle = np.column_stack([32 + 20 * np.cos(angle), 24 + 20 * np.sin(angle)])
    return polygon(";".join(f"{x:.2f},{y:.2f}" for x, y in circle))


@pytest.mark.contract("4: limits: polygons and vertices")
@pytest.mark.parametrize(
    ("fits", "too_many", "pointer"),
    [
        ([BOX] * 2_000, [BOX] * 2_001, "polygon 2001, line 2004"),
        ([ring(20_000)], [BOX, ring(20_001)], "polygon 2, line 5"),
        ([ring(20_000)] * 10, [*[ring(20_000)] * 10, BOX], "polygon 11, line 14"),
    ],
    ids=["2000 polygons", "20000 vertices each", "200000 vertices"],
)
def test_polygons_and_vertices_are_counted(
    api: httpx.Client, photo: bytes, fits: list[str], too_many: list[str], pointer: str
) -> None:
    assert len(read_annotations(cvat(*fits).encode()).shapes) == len(fits)
    refusal = refused(post(api, photo, cvat(*too_many)), 413, "annotations-too-large")
    assert refusal["pointer"] == pointer


def halves(size: tuple[int, int] = (32, 24)) -> Image.Image:
    """Red at the left, blue at the right."""
    image = Image.new("RGB", size, BLUE)
    image.paste(RED, (0, 0, size[0] // 2, size[1]))
    return image


def turned() -> bytes:
    exif = Image.Exif()
    exif[0x0112] = 6
    stored = halves().transpose(Image.Transpose.ROTATE_90)
    return encoded(stored, "JPEG", quality=95, subsampling=0, exif=exif)


def see_through(color: str) -> bytes:
    image = halves().convert("RGBA")
    image.paste((0, 0, 0, 0), (16, 0, 32, 24))
    return encoded(image, color)


def sixteen_bits() -> bytes:
    samples = np.full((24, 32), 0x2000, np.uint16)
    samples[:, 16:] = 0xE0FF
    return encoded(Image.fromarray(samples))


def animation() -> bytes:
    second = Image.new("RGB", (32, 24), (1, 250, 1))
    return encoded(halves(), "WEBP", lossless=True, save_all=True, append_images=[second])


PLAIN = (RED, BLUE)
PICTURES: dict[str, tuple[Callable[[], bytes], Any, str]] = {
    "PNG": (lambda: encoded(halves(), "PNG"), PLAIN, ""),
    "JPEG": (lambda: encoded(halves(), "JPEG", quality=95, subsampling=0), PLAIN, ""),
    "WebP": (lambda: encoded(halves(), "WEBP", lossless=True), PLAIN, ""),
    "TIFF": (lambda: encoded(halves(), "TIFF", compression="tiff_lzw"), PLAIN, ""),
    "EXIF orientation": (turned, PLAIN, ""),
    "ICC profile": (
        lambda: encoded(halves(), icc_profile=swapped_profile()),
        ((30, 220, 40), (60, 30, 200)),
        "",
    ),
    "CMYK": (lambda: encoded(halves().convert("CMYK"), "TIFF"), PLAIN, "CMYK"),
    "grey": (lambda: encoded(halves().convert("L")), ((88,) * 3, (67,) * 3), ""),
    "palette": (lambda: encoded(halves().quantize(4)), PLAIN, ""),
    "16 bits": (sixteen_bits, ((32,) * 3, (224,) * 3), ""),
    "alpha": (lambda: see_through("PNG"), (RED, (255, 255, 255)), "transparent"),
    "animation": (animation, PLAIN, "frame"),
}


@pytest.mark.contract("4: formats by content; EXIF, ICC, CMYK, grey, palette, 16-bit, alpha, animation")
@pytest.mark.parametrize("kind", PICTURES)
def test_pictures_of_every_kind_become_upright_srgb(api: httpx.Client, kind: str) -> None:
    make, (left, right), warning = PICTURES[kind]
    job = ended(api, submitted(api, make(), name="picture.txt", target_mse=2))
    assert job["status"] == "succeeded", job
    drawn = pixels(api.get(job["links"]["preview"]).content)
    assert drawn.shape == (24, 32, 3)
    assert np.abs(drawn[12, 6] - left).max() <= 14, drawn[12, 6]
    assert np.abs(drawn[12, 26] - right).max() <= 14, drawn[12, 26]
    assert len(job["warnings"]) == bool(warning)
    assert all(warning in told for told in job["warnings"])
    assert api.get(job["links"]["result"]).json()["warnings"] == job["warnings"]


@pytest.mark.contract("4: alpha over white, settable")
def test_the_colour_under_transparent_pixels_can_be_chosen(api: httpx.Client, tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(see_through("PNG"))
    job = ended(api, submitted(api, see_through("PNG"), matte="#10c020"))
    run = gcvec("vectorize", "a.png", "-o", "a.gcv", "--matte", "#10c020", "--preview", "p.png", cwd=tmp_path)
    assert run.returncode == 0
    for drawn in (pixels(api.get(job["links"]["preview"]).content), pixels(tmp_path / "p.png")):
        assert np.abs(drawn[12, 26] - (0x10, 0xC0, 0x20)).max() <= 10
    compared = gcvec("compare", "a.png", "a.gcv", "--matte", "#10c020", "--json", cwd=tmp_path)
    assert json.loads(compared.stdout)["mse"] < 5
    assert (
        refused(post(api, see_through("PNG"), matte="white"), 422, "bad-option")["pointer"]
        == "/options/matte"
    )


@pytest.mark.contract("4: other formats, by content")
def test_a_gif_named_png_is_refused(api: httpx.Client) -> None:
    refusal = refused(post(api, encoded(halves(), "GIF"), name="a.png"), 415, "unsupported-picture")
    assert refusal["pointer"] == "/image"


@pytest.mark.contract("4: repaired or dropped with a warning in the result")
def test_bad_polygons_are_repaired_or_dropped_with_warnings(
    api: httpx.Client, photo: bytes, tmp_path: Path
) -> None:
    bow = polygon("2,2;20,20;2,20;20,2", "bow", 2)
    tiny = polygon("50,40;50.2,40;50.2,40.2", "tiny", 3)
    outside = polygon("300,300;310,300;310,310", "outside", 3)
    regions = cvat(GROUND, BOX, BOX, bow, tiny, outside)
    expected = ("crossing itself", "same outline", "too small", "outside")
    job = ended(api, submitted(api, photo, regions))
    assert job["status"] == "succeeded", job
    told = api.get(job["links"]["result"]).json()["warnings"]
    assert told == job["warnings"]
    (tmp_path / "photo.png").write_bytes(photo)
    (tmp_path / "photo.xml").write_text(regions)
    run = gcvec("vectorize", "photo.png", "-a", "photo.xml", "-o", "a.gcv", cwd=tmp_path)
    assert run.returncode == 0
    lines = run.stderr.splitlines()
    assert all(line.startswith("gcvec: warning: photo.xml: ") for line in lines)
    for words in expected:
        assert sum(words in warning for warning in told) == 1, words
        assert sum(words in line for line in lines) == 1, words
    labels = {region["label"] for region in api.get(job["links"]["report"]).json()["regions"]}
    assert {"ground", "box", "bow"} <= labels <= {"ground", "box", "bow", "background"}


def bomb() -> str:
    entities = "".join(f'<!ENTITY e{n} "{f"&e{n - 1};" * 10}">' for n in range(1, 9))
    return (
        f'<!DOCTYPE annotations [<!ENTITY e0 "boom">{entities}]>' + cvat(polygon("&e8;")).partition("?>")[2]
    )


def zipped(name: str, content: bytes) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(name, content)
    return buffer.getvalue()


BAD_ANNOTATIONS: dict[str, tuple[str | bytes, int, str, str]] = {
    "another size": (cvat(GROUND, width=65), 422, "size-mismatch", "/annotations"),
    "no usable polygon": (cvat(), 422, "no-usable-polygon", "/annotations"),
    "broken XML": (cvat(GROUND)[:150], 422, "broken-annotations", "line 4"),
    "a polygon without numbers": (
        cvat(GROUND, polygon("a,b;c,d")),
        422,
        "broken-annotations",
        "polygon 2, line 5",
    ),
    "not a number": (cvat(polygon("nan,1;2,2;3,1")), 422, "broken-annotations", "polygon 1, line 4"),
    "not a number in JSON": (
        '{"images": [{"width": NaN}], "annotations": []}',
        422,
        "broken-annotations",
        "/annotations",
    ),
    "entity bomb": (bomb(), 422, "unsafe-annotations", "/annotations"),
    "zip bomb": (zipped("a.xml", bytes(60_000_000)), 413, "annotations-too-large", "/annotations"),
    "path trick": (zipped("../../a.xml", b"<a/>"), 422, "unsafe-annotations", "/annotations"),
    "neither XML nor JSON": ("regions: none", 422, "unsupported-annotations", "/annotations"),
}


@pytest.mark.contract("4: one clear error")
@pytest.mark.parametrize("kind", BAD_ANNOTATIONS)
def test_unusable_annotations_are_one_clear_error(
    api: httpx.Client, photo: bytes, tmp_path: Path, kind: str
) -> None:
    content, status, code, pointer = BAD_ANNOTATIONS[kind]
    data = content if isinstance(content, bytes) else content.encode()
    answer = api.post("/v1/jobs", files={"image": ("photo.png", photo), "annotations": ("a.xml", data)})
    assert refused(answer, status, code)["pointer"] == pointer
    (tmp_path / "photo.png").write_bytes(photo)
    (tmp_path / "a.xml").write_bytes(data)
    run = gcvec("vectorize", "photo.png", "-a", "a.xml", "-o", "a.gcv", cwd=tmp_path)
    assert (run.returncode, run.stdout) == (2, "")
    assert run.stderr.startswith("gcvec: a.xml: ")
    assert run.stderr.count("\n") == 1


@pytest.mark.contract("4: unknown image name")
def test_an_unknown_image_name_is_one_clear_error(api: httpx.Client, photo: bytes) -> None:
    refusal = refused(post(api, photo, cvat(GROUND), image_name="other.png"), 422, "unknown-image")
    assert "other.png" in refusal["detail"]
    assert refusal["pointer"] == "/annotations"


@pytest.mark.contract("4: no usable polygon, found by the worker")
def test_polygons_that_cover_nothing_fail_the_job_with_one_clear_error(
    api: httpx.Client, photo: bytes
) -> None:
    far = polygon(f"{WIDTH + 9},{HEIGHT + 9};{WIDTH + 30},{HEIGHT + 9};{WIDTH + 30},{HEIGHT + 30}")
    job = ended(api, submitted(api, photo, cvat(far)))
    assert job["status"] == "failed"
    assert job["error"]["type"] == "urn:gcvec:problem:no-usable-polygon"
    assert job["error"]["pointer"] == "/annotations"
    refused(api.get(f"{job['links']['self']}/result"), 409, "no-result")


@pytest.mark.contract("4: a damaged picture, found by the worker")
def test_a_damaged_picture_fails_the_job_with_one_clear_error(api: httpx.Client) -> None:
    noise = np.random.default_rng(0).integers(0, 256, (60, 60, 3), dtype=np.uint8)
    damaged = bytearray(encoded(Image.fromarray(noise)))
    damaged[2000:2100] = bytes(100)
    job = ended(api, submitted(api, bytes(damaged)))
    assert job["status"] == "failed"
    assert job["error"]["type"] == "urn:gcvec:problem:unreadable-picture"
    assert job["error"]["pointer"] == "/image"
