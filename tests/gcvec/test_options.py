"""Options that cannot be meant are refused by name."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from gcvec import InputError, Options


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("target_mse", "5"),
        ("target_mse", None),
        ("target_mse", [5.0]),
        ("snap", "2"),
        ("effort", 5.5),
        ("effort", "5"),
        ("max_points", 10.5),
        ("workers", 2.0),
        ("regions", None),
        ("target_bytes", "many"),
        ("strategy", 1),
    ],
)
def test_a_value_of_another_kind_is_refused_by_name(name: str, value: Any) -> None:
    with pytest.raises(InputError, match=f"^{name} must be ") as refused:
        Options(**{name: value})
    assert (refused.value.code, refused.value.pointer) == ("bad-option", name)
    assert repr(value) in str(refused.value)


@pytest.mark.parametrize(
    ("name", "value", "wanted"),
    [
        ("target_mse", 0, "be above 0 and below 65025"),
        ("target_mse", float("nan"), "be above 0 and below 65025"),
        ("snap", 20.5, "lie between 0 and 20"),
        ("effort", 0, "lie between 1 and 9"),
        ("regions", -1, "lie between 0 and 2147483647"),
    ],
)
def test_a_number_out_of_range_is_refused_with_the_range(name: str, value: float, wanted: str) -> None:
    with pytest.raises(InputError) as refused:
        Options(**{name: value})
    assert str(refused.value) == f"{name} must {wanted}, not {value!r}"
    assert (refused.value.code, refused.value.pointer) == ("bad-option", name)


def test_numbers_of_numpy_are_numbers() -> None:
    options = Options(
        target_mse=np.float32(7.5), snap=np.int64(2), max_points=np.uint16(9), effort=np.int8(3)
    )
    assert (options.target_mse, options.snap, options.max_points, options.effort) == (7.5, 2, 9, 3)
