"""Labels of strangers, from annotations to file and back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gcvec import Annotations, InputError, Shape, VectorImage
from gcvec.codec.integers import LONGEST
from gcvec.plain_text import LONGEST_LABEL, plain_label
from gcvec.regions.partition import partition
from tests.pictures import drawing


def labelled(label: str) -> Annotations:
    return Annotations((Shape(label, mask=np.ones((4, 4), bool)),))


@pytest.mark.parametrize("label", ["\ud800", "b\x01", "\x00", "\ufffe", "x" * 2000, "\u96ea \U0001f600"])
def test_labels_are_stored_as_plain_text(label: str) -> None:
    (name,) = partition(labelled(label), 4, 4).names
    assert name == plain_label(label)
    assert len(name) <= LONGEST_LABEL
    image = drawing()
    named = replace(image, labels=(name, *image.labels[1:]))
    assert VectorImage.from_bytes(named.to_bytes()).labels == named.labels


def test_what_can_be_written_stays() -> None:
    assert plain_label("na\u00efve \u96ea \U0001f600 <&>\"'") == "na\u00efve \u96ea \U0001f600 <&>\"'"


def test_labels_longer_than_a_file_can_say_are_refused() -> None:
    image = drawing()
    with pytest.raises(InputError, match="too long"):
        replace(image, labels=("x" * 2**LONGEST, *image.labels[1:])).to_bytes()
