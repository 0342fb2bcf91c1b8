"""Damaged files of every kind are read or refused, in bounded time, and never in another way."""

from __future__ import annotations

import json
import random
import resource
import signal
import struct
import sys
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import BytesIO
from types import FrameType

import numpy as np
import pytest
from PIL import Image

from gcvec.annotations import Annotations
from gcvec.errors import InputError
from gcvec.io import Limits, check_size, probe_picture, read_annotations, read_picture
from gcvec.regions.partition import partition

SECONDS = 2
"""Processor time that no input may take; they are small."""

MEMORY = 64 * 2**20
"""Bytes by which reading one input may raise the most that this process has ever held."""

LIMITS = Limits(max_pixels=20_000, max_side=2_000, annotation_bytes=200_000, mask_pixels=100_000)
WIDTH, HEIGHT = 40, 30

XML = b"""<?xml version="1.0" encoding="utf-8"?>
<annotations><version>1.1</version><meta><task><size>1</size></task></meta>
<image id="0" name="a.png" width="40" height="30">
<polygon label="sky" occluded="0" points="0.0,0.0;40.0,0.0;40.0,15.5;0,15" z_order="0"></polygon>
<box label="door" xtl="3.5" ytl="4" xbr="20" ybr="21.25" rotation="30" z_order="1">
<attribute name="a">b</attribute></box>
<ellipse label="sun" cx="30" cy="8" rx="6" ry="4.5" rotation="10" z_order="2"/>
<mask label="tree" rle="3, 5, 7, 9, 1" left="10" top="12" width="5" height="5" z_order="-1"/>
<polyline label="wire" points="1,1;2,2"/>
</image></annotations>"""

COCO = json.dumps(
    {
        "images": [{"id": 7, "file_name": "a.png", "width": WIDTH, "height": HEIGHT}],
        "categories": [{"id": 1, "name": "sky"}, {"id": 2, "name": "tree"}],
        "annotations": [
            {
                "image_id": 7,
                "category_id": 1,
                "segmentation": [[0, 0, 40, 0.5, 20, 15], [1, 1, 9, 1, 9, 9.5]],
            },
            {"image_id": 7, "category_id": 2, "segmentation": {"size": [30, 40], "counts": [600, 90, 510]}},
            {"image_id": 7, "category_id": 2, "segmentation": {"size": [30, 40], "counts": "hb0j2n?"}},
            {"image_id": 7, "category_id": 1, "bbox": [3, 4, 10.5, 12]},
        ],
    }
).encode()

TOKENS = [
    b"-1",
    b"0",
    b"1e999",
    b"nan",
    b"NaN",
    b"Infinity",
    b"1e-320",
    b"9" * 40,
    b"99999",
    b"",
    b",",
    b";",
    b'"',
]
TOKENS += [
    b"<",
    b">",
    b"&",
    b"&#0;",
    b"&lt;",
    b"<!DOCTYPE a []>",
    b"<!--",
    b"]]>",
    b"\xff",
    b"\x00",
    b"\xc3\xa9",
]
TOKENS += [b"{", b"}", b"[", b"]", b"null", b"true", b"[[]]", b"{}", b'"\\ud800"', b"PK\x03\x04", b" " * 100]

Mutate = Callable[[random.Random, bytes], bytes]


def archive(compression: int) -> bytes:
    buffer = BytesIO()
    with zipfile.ZipFile(buffer, "w", compression) as target:
        target.writestr("task/annotations.xml", XML)
        target.writestr("images/a.png", b"not looked at")
    return buffer.getvalue()


def archive_of_subsets() -> bytes:
    buffer = BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_STORED) as target:
        for subset, name in (("train", b"a.png"), ("val", b"b.png")):
            target.writestr(f"annotations/instances_{subset}.json", COCO.replace(b"a.png", name))
    return buffer.getvalue()


def pictures() -> list[bytes]:
    colours = np.random.default_rng(0).integers(0, 256, (HEIGHT, WIDTH, 4), dtype=np.uint8)
    colours[10:, 10:] = 99
    colour, exif = Image.fromarray(colours[..., :3]), Image.Exif()
    exif[0x0112] = 6
    files = []

    def add(image: Image.Image, kind: str, **options: object) -> None:
        buffer = BytesIO()
        image.save(buffer, kind, **options)
        files.append(buffer.getvalue())

    add(colour, "PNG", exif=exif)
    add(Image.fromarray(colours), "PNG")
    add(colour.quantize(16), "PNG", transparency=3)
    add(Image.fromarray(colours[..., 0].astype(np.uint16) * 257), "PNG")
    add(colour, "JPEG", exif=exif)
    add(colour.convert("CMYK"), "JPEG", progressive=True)
    add(colour, "WEBP", exif=exif)
    add(Image.fromarray(colours), "WEBP", lossless=True)
    add(colour, "TIFF", compression="tiff_lzw")
    add(colour.convert("CMYK"), "TIFF")
    add(Image.fromarray(colours), "TIFF", compression="tiff_adobe_deflate")
    return files


def flipped(rng: random.Random, data: bytes) -> bytes:
    damaged = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 5, 20))):
        damaged[rng.randrange(len(damaged))] = rng.randrange(256)
    return bytes(damaged)


def cut(rng: random.Random, data: bytes) -> bytes:
    return data[: rng.randrange(len(data))]


def spliced(rng: random.Random, data: bytes) -> bytes:
    """Some part left out, repeated or moved."""
    start, stop = sorted((rng.randrange(len(data)), rng.randrange(len(data))))
    target = rng.randrange(len(data))
    return data[:target] + data[start:stop] * rng.choice((0, 1, 1, 3)) + data[rng.choice((target, stop)) :]


def with_tokens(rng: random.Random, data: bytes) -> bytes:
    for _ in range(rng.choice((1, 1, 2, 4))):
        start = rng.randrange(len(data))
        data = data[:start] + rng.choice(TOKENS) + data[start + rng.choice((0, 1, 3)) :]
    return data


def with_other_numbers(rng: random.Random, data: bytes) -> bytes:
    """Digits replaced by digits: the document stays well-formed, its values do not stay sensible."""
    places = [i for i, byte in enumerate(data) if 48 <= byte <= 57]
    damaged = bytearray(data)
    for place in rng.sample(places, min(len(places), rng.choice((1, 2, 5)))):
        damaged[place] = rng.choice(b"0123456789-.e")
    return bytes(damaged)


def with_other_counts(rng: random.Random, data: bytes) -> bytes:
    """A COCO file with other run lengths: of a right or wrong sum, with a character off, or noise."""
    document = json.loads(data)
    masks = [annotation["segmentation"] for annotation in document["annotations"][1:3]]
    ends = sorted(rng.randrange(WIDTH * HEIGHT) for _ in range(rng.randrange(40)))
    runs = np.diff([0, *ends, WIDTH * HEIGHT + rng.choice((0, 0, 0, 1, -1))]).tolist()
    code = list(masks[1]["counts"])
    code[rng.randrange(len(code))] = chr(rng.randrange(40, 120))
    noise = "".join(chr(rng.randrange(40, 120)) for _ in range(rng.randrange(20)))
    rng.choice(masks)["counts"] = rng.choice((runs, runs, "".join(code), noise))
    return json.dumps(document).encode()


def with_good_checksums(rng: random.Random, data: bytes) -> bytes:
    """A PNG with a chunk damaged, repeated, left out or claimed to be longer, and every checksum right."""
    chunks = [list(chunk) for chunk in png_chunks(data)]
    for _ in range(rng.choice((1, 1, 3))):
        place = rng.randrange(len(chunks))
        kind, content = chunks[place]
        action = rng.choice(("damage", "damage", "damage", "repeat", "drop", "grow", "rename"))
        if action == "damage" and content:
            chunks[place][1] = flipped(rng, content)
        elif action == "repeat":
            chunks[place:place] = [[kind, content]] * rng.choice((1, 1, 50))
        elif action == "drop" and len(chunks) > 1:
            del chunks[place]
        elif action == "grow":
            chunks[place][1] = content + rng.randbytes(rng.randrange(2_000))
        elif action == "rename":
            chunks[place][0] = rng.choice((b"iCCP", b"zTXt", b"eXIf", b"acTL", b"tRNS", b"PLTE", b"fdAT"))
    return data[:8] + b"".join(sealed(kind, content) for kind, content in chunks)


def png_chunks(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    place = 8
    while place + 12 <= len(data):
        (length,) = struct.unpack_from(">I", data, place)
        yield data[place + 4 : place + 8], data[place + 8 : place + 8 + length]
        place += length + 12


def sealed(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))


def with_other_sizes(rng: random.Random, data: bytes) -> bytes:
    """A zip whose headers claim other sizes, offsets, methods and flags than its files have."""
    damaged = bytearray(data)
    places = [at for mark in (b"PK\1\2", b"PK\3\4", b"PK\5\6") for at in all_places(data, mark)]
    for place in rng.sample(places, rng.choice((1, 1, 2))):
        field = place + rng.randrange(4, 46, 2)
        value = rng.choice((0, 1, 8, 0xFFFF, 0xFFFF_FFFF, rng.randrange(2**16), len(data)))
        struct.pack_into("<I", damaged, min(field, len(damaged) - 4), value)
    return bytes(damaged)


def all_places(data: bytes, mark: bytes) -> Iterator[int]:
    place = data.find(mark)
    while place >= 0:
        yield place
        place = data.find(mark, place + 1)


def with_very_much(rng: random.Random, data: bytes) -> bytes:
    """Some part very often, or brackets very deep: what is cheap to send must be cheap to refuse."""
    start = rng.randrange(len(data))
    part = data[start : start + rng.choice((1, 10, 100, 1_000))]
    part = rng.choice((part, part, rng.choice(TOKENS), b"<a>", b'<a b="">', b'{"a":', b"[", b"0,0;", b"1,"))
    often = rng.choice((100, 1_000, 100_000)) // max(len(part), 1)
    return data[:start] + part * often + data[start + rng.choice((0, len(part))) :]


@contextmanager
def time_limit() -> Iterator[None]:
    def expired(signum: int, frame: FrameType | None) -> None:
        raise TimeoutError(f"not done after {SECONDS} s")

    before = signal.signal(signal.SIGPROF, expired)
    signal.setitimer(signal.ITIMER_PROF, SECONDS)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def peak_memory() -> int:
    """Bytes that this process has held at most."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else 1024 * peak


def annotated(data: bytes) -> Annotations:
    annotations = read_annotations(data, picture_name="a.png", limits=LIMITS)
    check_size(annotations, WIDTH, HEIGHT)
    partition(annotations, WIDTH, HEIGHT)
    return annotations


def pictured(data: bytes) -> None:
    header = probe_picture(data, limits=LIMITS)
    pixels = read_picture(data, limits=LIMITS).pixels
    assert pixels.shape == (header.height, header.width, 3)


def pictured_or_sideways(data: bytes) -> None:
    """A PNG may tell its orientation behind its pixels, where probing does not look."""
    header = probe_picture(data, limits=LIMITS)
    sides = read_picture(data, limits=LIMITS).pixels.shape[:2]
    assert sides in ((header.height, header.width), (header.width, header.height))


def read_many(
    read: Callable[[bytes], object], seeds: list[bytes], mutations: list[Mutate], count: int
) -> None:
    for seed in seeds:
        read(seed)
    rng = random.Random(2024)
    refused, message = 0, ""
    for number in range(count):
        damaged = rng.choice(mutations)(rng, rng.choice(seeds))
        before = peak_memory()
        try:
            with time_limit():
                read(damaged)
        except InputError as error:
            refused += 1
            message = str(error)
        except BaseException as error:
            error.add_note(f"input {number}: {damaged!r}")
            raise
        assert "\n" not in message
        grown = peak_memory() - before
        assert grown < MEMORY, f"input {number} takes {grown} bytes: {damaged!r}"
    assert count // 50 < refused < count - count // 50, "both must happen, or the mutations are no test"


BYTES: list[Mutate] = [flipped, cut, spliced]
TEXT: list[Mutate] = [*BYTES, with_tokens, with_other_numbers, with_very_much]
CORPORA: dict[str, tuple[Callable[[bytes], object], list[bytes], list[Mutate]]] = {
    "xml": (annotated, [XML], TEXT),
    "json": (annotated, [COCO], TEXT),
    "rle": (annotated, [COCO], [with_other_counts]),
    "zip": (
        annotated,
        [archive(zipfile.ZIP_DEFLATED), archive(zipfile.ZIP_STORED), archive_of_subsets()],
        [*BYTES, with_other_sizes],
    ),
    "picture": (pictured, pictures(), BYTES),
    "png": (
        pictured_or_sideways,
        [file for file in pictures() if file.startswith(b"\x89PNG")],
        [with_good_checksums],
    ),
}

corpora = pytest.mark.parametrize("corpus", list(CORPORA))


@corpora
def test_damaged_files_are_read_or_refused(corpus: str) -> None:
    read_many(*CORPORA[corpus], count=300)


@pytest.mark.slow
@corpora
def test_thousands_of_damaged_files_are_read_or_refused(corpus: str) -> None:
    read_many(*CORPORA[corpus], count=10_000)
