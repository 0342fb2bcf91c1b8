from __future__ import annotations

import pytest

from gcvec.errors import InputError
from tests.uploads import cvat, png
from worker.produce import Product, produce
from worker.settings import Settings


def produced(annotations: bytes | None = None, image_name: str | None = None, **options: object) -> Product:
    request = {"image_name": image_name, "picture_name": "a.png", "options": options}
    return produce(png(), annotations, request, Settings(), lambda _: None)


def test_a_name_that_picks_nothing_is_warned_of() -> None:
    assert any("image_name" in warning for warning in produced(image_name="a.png").warnings)
    assert not any("image_name" in warning for warning in produced(cvat(), "a.png").warnings)


@pytest.mark.parametrize(
    ("annotations", "options", "warning"),
    [
        (cvat(), {"regions": 7}, "regions has no effect: the annotations say what the regions are"),
        (None, {"snap": 1.0}, "snap has no effect: there are no annotations"),
        (None, {"target_mse": 9.0, "target_bytes": 5000}, "target_mse has no effect: target_bytes decides"),
        (None, {"effort": 3, "strategy": "paper"}, "effort has no effect: it is for the strategy batch"),
    ],
)
def test_an_option_without_effect_is_warned_of(
    annotations: bytes | None, options: dict[str, object], warning: str
) -> None:
    assert warning in produced(annotations, **options).warnings


def test_defaults_without_effect_are_not_warned_of() -> None:
    warnings = produced(strategy="paper", target_bytes=5000).warnings
    assert not any("no effect" in warning for warning in warnings)


def test_an_option_that_cannot_be_met_is_pointed_at() -> None:
    with pytest.raises(InputError) as caught:
        produced(target_bytes=10)
    assert caught.value.pointer == "/options/target_bytes"


def test_stages_are_counted_and_not_their_sum_again() -> None:
    totals = produced().totals
    stages = {name for name in totals if name.startswith("seconds:")}
    assert {"seconds:regions", "seconds:encode"} <= stages
    assert "seconds:total" not in stages
