from __future__ import annotations

from collections.abc import Sequence

import pytest

from gcvec.errors import InputError
from gcvec.io import selection


def select_image(names: Sequence[str], image_name: str | None, picture_name: str | None) -> int:
    return selection.select_image([[name] for name in names], image_name, picture_name)


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


@pytest.mark.parametrize(
    ("wanted", "names", "index"),
    [
        ("a/b/cat.png", ["x/b/cat.png", "y/c/cat.png"], 0),
        ("/home/b/train/cat.png", ["b/test/cat.png", "train/cat.png", "cat.png"], 1),
        ("/home/photos/cat.png", ["train/cat.png", "cat.png"], 1),
        ("C:\\photos\\train\\cat.png", ["test/cat.png", "./train//cat.png"], 1),
        ("train/cat.webp", ["test/cat.png", "train/cat.png", "train/dog.png"], 1),
        ("train/cat.png", ["train/cat.jpg", "test/cat.png"], 1),
        ("gru\u0308n/cat.png", ["rot/cat.png", "gr\u00fcn/cat.png"], 1),
    ],
)
def test_of_several_of_a_name_the_one_whose_folders_fit_best_is_taken(
    wanted: str, names: list[str], index: int
) -> None:
    assert select_image(names, None, wanted) == index
    assert select_image(names, wanted, None) == index


@pytest.mark.parametrize("names", [["a/cat.png", "b/cat.png"], ["x/b/cat.png", "y/b/cat.png", "c/cat.png"]])
def test_folders_that_fit_equally_well_leave_it_open(names: list[str]) -> None:
    with pytest.raises(InputError, match=r"several images match 'cat\.png'"):
        select_image(names, None, "/home/c/b/cat.png" if len(names) > 2 else "/home/cat.png")


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
