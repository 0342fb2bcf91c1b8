"""Decisions, integers, text and bitmaps as `docs/format.md` describes them, in plain Python."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Hashable, Sequence


def squash_knots() -> list[int]:
    return [round(65536 / (1 + math.exp(-k / 2))) for k in range(-16, 17)]


KNOTS = squash_knots()


def between_knots(values: Sequence[int], log_odds: int) -> int:
    knot, part = divmod(log_odds + 2048, 128)
    return (values[knot] * (128 - part) + values[knot + 1] * part) >> 7


def squash(log_odds: int) -> int:
    return between_knots(KNOTS, log_odds)


STRETCH = [
    next((x for x in range(-2047, 2048) if squash(x) >= 16 * p + 8), 2047) for p in range(4096)
]  # fmt: skip


class PlainDecoder:
    """Reads the decisions of a stream."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.at = 4
        self.range = 2**32 - 1
        self.code = int.from_bytes(data[:4].ljust(4, b"\0"), "big")

    def bit(self, probability: int) -> int:
        bound = (self.range >> 16) * min(max(probability, 24), 65536 - 24)
        if self.code < bound:
            bit, self.range = 1, bound
        else:
            bit, self.code, self.range = 0, self.code - bound, self.range - bound
        while self.range < 1 << 24:
            byte = self.data[self.at] if self.at < len(self.data) else 0
            self.at += 1
            self.range, self.code = self.range << 8, (self.code << 8 | byte) & 0xFFFFFFFF
        return bit


class PlainModel:
    """What is learned about one kind of decision. Counters and rows may go by any names."""

    def __init__(self, inputs: int) -> None:
        self.counters: defaultdict[Hashable, tuple[int, int]] = defaultdict(lambda: (1 << 21, 0))
        self.weights: defaultdict[Hashable, list[int]] = defaultdict(lambda: [72000 // inputs] * 8)
        self.corrections: defaultdict[Hashable, list[int]] = defaultdict(lambda: list(KNOTS))

    def decision(self, decoder: PlainDecoder, counters: Sequence[Hashable], row: Hashable) -> int:
        weights, corrections = self.weights[row], self.corrections[row]
        inputs = []
        for counter in counters:
            probability, seen = self.counters[counter]
            inputs.append(STRETCH[probability >> 10] * ((5 * seen << 8) // (5 * seen + 6)) >> 8)
        dot = sum(w * s for w, s in zip(weights, inputs, strict=False)) >> 16
        dot = min(max(dot, -2047), 2047)
        mixed, corrected = squash(dot), between_knots(corrections, dot)
        bit = decoder.bit((mixed + corrected + 1) >> 1)
        nearest = (dot + 2048 + 64) // 128
        corrections[nearest] += (65536 * bit - corrections[nearest]) >> 6
        for k, (counter, stretched) in enumerate(zip(counters, inputs, strict=True)):
            weights[k] += (stretched * (65536 * bit - mixed) * 2 + 32768) >> 16
            probability, seen = self.counters[counter]
            probability += ((bit << 22) - probability) * ((2 << 16) // (2 * seen + 3)) >> 16
            self.counters[counter] = probability, min(seen + 1, 255)
        return bit

    def integer(
        self, decoder: PlainDecoder, sizes: Sequence[Hashable], signs: Sequence[Hashable], row: Hashable
    ) -> int:
        """`sizes` and `signs` are names of contexts, `row` that of the 64 rows."""

        def bit(contexts: Sequence[Hashable], node: int) -> int:
            return self.decision(decoder, [(context, node) for context in contexts], (row, node))

        n = 0
        while n < 24 and bit(sizes, min(n, 15)):
            n += 1
        if n == 0:
            return 0
        negative = bit(signs, 16 + min(n - 1, 3))
        value = 1
        for k in range(n - 2, -1, -1):
            if k == n - 2:
                node = 20 + min(k, 9)
            elif k == n - 3:
                node = 30 + 2 * min(k, 8) + (value & 1)
            else:
                node = 48 + min(k, 15)
            value = 2 * value + bit(sizes, node)
        return -value if negative else value


def plain_class(value: int) -> int:
    length = value.bit_length()
    return value if value < 4 else 4 * (length - 2) + ((value >> (length - 3)) & 3)


def plain_sign(value: int) -> int:
    return 0 if value == 0 else 1 if value > 0 else 2


def plain_sequence(decoder: PlainDecoder, count: int, model: PlainModel) -> list[int]:
    """Integers as those at the beginning of a file."""
    values = [0]
    for i in range(count):
        sizes = [("place", min(i, 15)), ("before", min(plain_class(abs(values[-1])), 63))]
        values.append(model.integer(decoder, sizes, [("place", 0)], "sizes"))
    return values[1:]


def plain_text(decoder: PlainDecoder, count: int) -> bytes:
    model, text = PlainModel(inputs=3), bytearray()
    for _ in range(count):
        node = 1
        while node < 256:
            h, counters = 0, []
            for order in range(6):
                if 0 < order <= len(text):
                    h = (h + text[-order] + 1) * 0x2C9277B5 % 2**32
                h = (h ^ h >> 15) * 0x1B873593 % 2**32
                counters.append((h + node * 0x3C6EF372) * 0x9E3779B1 % 2**32 >> 16)
            node = 2 * node + model.decision(decoder, counters, node)
        text.append(node - 256)
    return bytes(text)


def plain_bitmap(decoder: PlainDecoder, height: int, width: int) -> list[list[int]]:
    model = PlainModel(inputs=5)
    bitmap = [[0] * width for _ in range(height)]
    column = [0] * (width + 2)
    for y in range(height):
        line = 0
        for x in range(width):

            def o(i: int, j: int, x: int = x, y: int = y) -> int:
                return bitmap[y - j][x + i] if y >= j and 0 <= x + i < width else 0

            touching = o(-1, 0) + 2 * o(0, 1) + 4 * o(-1, 1) + 8 * o(1, 1)
            pattern = touching + 16 * o(-2, 0) + 32 * o(0, 2)
            around = o(-2, 1) + 2 * o(2, 1) + 4 * o(-1, 2) + 8 * o(1, 2)
            few, many = (
                sum(o(-i, 0) for i in range(1, reach + 1))
                + sum(o(i, j) for j in range(1, rows + 1) for i in range(-reach, reach + 1))
                for reach, rows in ((3, 3), (7, 6))
            )
            far = (2 * column[x + 1] + column[x] + column[x + 2] + 4 * line) >> 3
            band = min(plain_class(far >> 5), 31)
            tables = (
                16 * pattern + around,
                32 * few + band,
                16 * many + touching,
                128 * few + many,
                32 * pattern + band,
            )
            bit = bitmap[y][x] = model.decision(decoder, list(enumerate(tables)), 32 * min(few, 23) + band)
            column[x + 1] += (bit * 2**14 - column[x + 1]) >> 4
            line += (bit * 2**14 - line) >> 4
    return bitmap
