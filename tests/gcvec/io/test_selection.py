from __future__ import annotations

import pytest

from gcvec.errors import InputError
from gcvec.io.selection import select_image

NAMES = ("train/cat.jpg", "train/dog.jpg", "test/cat.jpg", "bird.png")


@pytest.mark.parametrize(
    ("wanted", "index"),
    [("train/cat.jpg", 0), ("test/cat.jpg", 2), ("dog.jpg", 1), ("C:\\photos\\dog.jpg", 1), ("bird.jpeg", 3)],
)
def test_names_match_exactly_else_by_base_name_else_without_ending(wanted: str, index: int) -> None:
    assert select_image(NAMES, wanted, None) == index
    assert select_image(NAMES, None, wanted) == index
    assert select_image(NAMES, wanted, "bird.png") == index


@pytest.mark.parametrize("wanted", ["gru\u0308n.jpg", "gru\u0308n.png", "train/gru\u0308n.jpg"])
def test_accents_may_be_encoded_in_another_way(wanted: str) -> None:
    names = ["cat.jpg", "train/gr\u00fcn.jpg"]
    assert select_image(names, None, wanted) == 1
    assert select_image([wanted, "cat.jpg"], names[1], None) == 0


def test_an_ambiguous_name_is_an_error_that_lists_the_matches() -> None:
    with pytest.raises(InputError, match=r"'train/cat.jpg', 'test/cat.jpg'") as error:
        select_image(NAMES, "cat.jpg", None)
    assert error.value.code == "unknown-image"


def test_the_only_image_is_taken_unless_another_was_demanded() -> None:
    assert select_image(["a.png"], None, None) == 0
    assert select_image(["a.png"], None, "upload.png") == 0
    with pytest.raises(InputError, match=r"no image named 'upload.png' .*'a.png'"):
        select_image(["a.png"], "upload.png", None)


def test_no_way_to_choose_lists_a_few_names() -> None:
    with pytest.raises(InputError, match=r"'0.png', '1.png', '2.png', '3.png', '4.png' and 95 more"):
        select_image([f"{i}.png" for i in range(100)], None, "upload.png")
    with pytest.raises(InputError, match="no image"):
        select_image([], None, None)
