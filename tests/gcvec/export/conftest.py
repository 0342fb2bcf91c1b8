"""The pictures that every export is tried on."""

import pytest

from gcvec import VectorImage
from tests.pictures import drawing, photo


@pytest.fixture(scope="session", params=[photo, drawing], ids=lambda make: make.__name__)
def image(request: pytest.FixtureRequest) -> VectorImage:
    made: VectorImage = request.param()
    return made
