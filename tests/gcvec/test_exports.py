"""The names the package promises."""

import gcvec


def test_exported_names() -> None:
    assert sorted(gcvec.__all__) == [
        "Annotations",
        "InputError",
        "OnProgress",
        "Options",
        "Progress",
        "Report",
        "Shape",
        "VectorImage",
        "vectorize",
    ]
    for name in gcvec.__all__:
        assert getattr(gcvec, name) is not None
