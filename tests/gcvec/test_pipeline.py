"""Whole pictures, from pixels and polygons to a vector image."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image
from skimage import data

from examples.scenes import vectorized_balls
from gcvec import Annotations, InputError, Options, Progress, Shape, VectorImage, vectorize
from gcvec.automatic_regions import automatic_regions
from gcvec.progress import AFTER_RUNS, BEFORE_RUNS, GROWTH
from gcvec.raster.painting import paint
from gcvec.regions.partition import Partition
from tests.gcvec.crews import Alone
from tests.gcvec.scenes import SCENES, Scene, noise, vectorized, voronoi
from tests.gcvec.soundness import assert_sound


@pytest.mark.parametrize("scene", SCENES)
def test_made_scenes_reach_their_error(scene: str) -> None:
    image = vectorized(scene)
    assert_sound(image, SCENES[scene].picture())
    assert image.report is not None
    if scene not in ("diagonal", "stripes"):  # all border, a pixel or two wide: beyond what curves can follow
        assert image.report.mse <= 5


def test_smooth_regions_need_few_points() -> None:
    """Four linear gradients: straight hard borders and linear colours hold all of it."""
    image = vectorized("quadrants")
    assert len(image.labels) == 4
    assert len(image.points) < 100


@pytest.mark.parametrize(("width", "height"), [(1, 1), (2, 1), (1, 7), (3, 3), (257, 1), (16, 16), (65, 300)])
def test_small_and_odd_sizes(width: int, height: int) -> None:
    y, x = np.mgrid[:height, :width]
    pixels = np.stack([x % 256, y % 256, (x + y) % 256], axis=-1).astype(np.uint8)
    image = vectorize(pixels)
    assert_sound(image, pixels)


def test_region_of_three_pixels_joins_its_neighbour_with_a_warning() -> None:
    pixels = np.full((30, 40, 3), 90, np.uint8)
    pixels[10, 10:13] = 200
    annotations = Annotations(
        shapes=(
            Shape(label="large", rings=(np.array([(2.0, 2), (38, 2), (38, 28), (2, 28)]),)),
            Shape(label="tiny", rings=(np.array([(10.0, 10), (13, 10), (13, 11), (10, 11)]),), z_order=1),
        )
    )
    image = vectorize(pixels, annotations)
    assert_sound(image, pixels)
    assert "tiny" not in image.labels
    assert image.warnings


@pytest.mark.slow
def test_three_hundred_regions() -> None:
    made = voronoi(240, 320, 300, 9)
    pixels = made.picture()
    image = vectorize(pixels, made.annotations())
    assert_sound(image, pixels)
    assert len(image.labels) > 250


def test_flat_picture_needs_no_points() -> None:
    pixels = np.full((50, 60, 3), (12, 200, 99), np.uint8)
    image = vectorize(pixels)
    assert_sound(image, pixels)
    assert len(image.points) == 0
    assert np.ptp(image.render(), axis=(0, 1)).max() == 0
    np.testing.assert_array_equal(image.render(), pixels)


@pytest.mark.parametrize("most", [1, 30])
def test_points_of_each_region_are_bounded(most: int) -> None:
    made = Scene(40, 50, lambda x, y: (x > 25).astype(int))
    image = vectorize(noise(), made.annotations(), Options(max_points=most))
    assert_sound(image, noise())
    assert image.report is not None
    assert all(0 < region.points <= most for region in image.report.regions)


def test_a_region_at_its_bound_does_not_spend_the_others_points() -> None:
    """Noise far from a gradient: the gradient gets no points for errors that are the noise's."""
    made = Scene(64, 128, lambda x, y: (x > 64).astype(int) + (x > 96))
    pixels = made.picture()
    pixels[:, :64] = noise(64, 64)
    image = vectorize(pixels, made.annotations(), Options(max_points=200))
    assert image.report is not None
    textured, _, smooth = (region.points for region in image.report.regions)
    assert 0 < textured <= 200
    assert smooth < 50


def test_noise_without_a_bound_ends() -> None:
    image = vectorize(noise(), None, Options(max_points=0))
    assert_sound(image, noise())


def test_progress_tells_every_iteration_and_never_falls() -> None:
    made = SCENES["ring"]
    pixels = made.picture() + noise(made.height, made.width) // 16
    told: list[Progress] = []
    image = vectorize(pixels, made.annotations(), Options(target_mse=8), told.append)
    fractions = [p.fraction for p in told]
    assert fractions == sorted(fractions)
    assert fractions[0] > 0
    assert fractions[-1] == 1
    assert list(dict.fromkeys(p.phase for p in told)) == ["regions", "boundary", "mesh", "refine", "encode"]
    rounds = [p for p in told if p.phase == "refine"]
    assert [p.iteration for p in rounds] == list(range(1, len(rounds) + 1))
    assert len(rounds) > 3
    errors = [p.mse for p in rounds if p.mse is not None]
    assert errors[-1] < errors[0]
    assert told[-1].points == len(image.points)
    assert all(p.regions == len(image.labels) for p in rounds)


def test_progress_leaves_room_for_exchanges() -> None:
    """With more effort more of the time is spent on pictures that are as good as they shall be."""
    made = SCENES["ring"]
    pixels = made.picture() + noise(made.height, made.width) // 16
    told: list[Progress] = []
    vectorize(pixels, made.annotations(), Options(target_mse=8, effort=7), told.append)
    fractions = [p.fraction for p in told if p.phase == "refine"]
    growing = [f for f in fractions if f <= BEFORE_RUNS + (AFTER_RUNS - BEFORE_RUNS) * GROWTH + 1e-9]
    assert len(fractions) - len(growing) >= 6
    assert np.diff(fractions[len(growing) :]).min() >= 0
    assert len(set(fractions[len(growing) :])) >= 6


class CancelledError(Exception):
    pass


@pytest.mark.parametrize("phase", ["boundary", "refine"])
def test_an_exception_in_the_callback_ends_the_run(phase: str) -> None:
    told: list[Progress] = []

    def cancel(progress: Progress) -> None:
        told.append(progress)
        if progress.phase == phase:
            raise CancelledError

    with pytest.raises(CancelledError):
        vectorize(noise(), None, Options(), cancel)
    assert told[-1].phase == phase


def test_annotations_beside_the_picture_are_refused() -> None:
    far = Shape(label="far", rings=(np.array([(900.0, 900), (950, 900), (950, 950)]),))
    with pytest.raises(InputError, match=r"no shape covers a pixel .* dropped: outside the picture"):
        vectorize(noise(), Annotations(shapes=(far,)))


def test_annotations_of_a_picture_of_another_size_are_refused() -> None:
    whole = Shape(label="all", rings=(np.array([(0.0, 0), (40, 0), (40, 30)]),))
    with pytest.raises(InputError, match="for a picture of 41 x 30 pixels") as refused:
        vectorize(noise(), Annotations((whole,), 41, 30))
    assert refused.value.code == "size-mismatch"


def test_pixels_may_lie_in_any_order(monkeypatch: pytest.MonkeyPatch) -> None:
    """Kernels see the usual one only: for any other each would be compiled anew, which takes minutes."""
    usual: list[bool] = []

    def watch(pixels: np.ndarray, options: Options) -> Partition:
        usual.append(pixels.flags.c_contiguous)
        return automatic_regions(pixels, options)

    monkeypatch.setattr("gcvec.pipeline.automatic_regions", watch)
    pixels = data.chelsea()[:24, :32]
    files = [vectorize(p).to_bytes() for p in (pixels.copy(), np.asfortranarray(pixels), pixels)]
    assert usual == [True, True, True]
    assert files == files[:1] * 3


def test_same_input_same_file() -> None:
    made = SCENES["voronoi"]
    again = vectorize(made.picture(), made.annotations())
    assert again.to_bytes() == vectorized("voronoi").to_bytes()


@pytest.mark.parametrize("scene", ["voronoi", "ring", "stripes", "balls"])
def test_every_scale_averages_to_the_same_picture(scene: str) -> None:
    """Box filtering at a scale, and then over as many pixels, is box filtering at 1."""
    image = vectorized_balls() if scene == "balls" else vectorized(scene)
    single, border = image.render().astype(float), border_pixels(image)
    for scale in (2, 4, 8):
        fine = image.render(float(scale)).astype(float)
        averaged = fine.reshape(image.height, scale, image.width, scale, 3).mean(axis=(1, 3))
        off = np.abs(averaged - single).max(axis=2)
        # Polylines leave their curves by a sixtieth of an output pixel at any scale.
        assert off[border].max() <= 4
        # Both pictures are rounded to levels.
        assert off[~border].max() <= 1
        assert off.mean() < 0.5


@pytest.mark.parametrize("target_mse", [5, 2000])
def test_every_scale_averages_to_the_same_drawing(target_mse: float) -> None:
    """Before levels are rounded, and where much of the photo is white and black: channels are clipped once a
    pixel's mean is known, so colours must not lie beyond white by more than a level."""
    photo = np.asarray(Image.fromarray(data.astronaut()).resize((160, 160)))
    image = vectorize(photo, None, Options(target_mse=target_mse))
    single, border = drawn(image, 1), border_pixels(image)
    for scale in (2, 4, 8):
        averaged = drawn(image, scale).reshape(160, scale, 160, scale, 3).mean(axis=(1, 3))
        off = np.abs(averaged - single).max(axis=2)
        assert off[border].max() <= 4
        assert off[~border].max() <= 1


def drawn(image: VectorImage, scale: int) -> np.ndarray:
    """The picture at a scale, in levels that are clipped but not rounded."""
    vertices, triangles, colors, corner_color = image.gouraud(scale)
    size = image.width * scale, image.height * scale
    return 255 * np.clip(paint(vertices * scale, triangles, colors, corner_color, *size), 0, 1)


def border_pixels(image: VectorImage) -> np.ndarray:
    """Pixels `(h, w) bool` that more than one patch touches."""
    drawing = image.canvas.drawing()
    coverage = image.canvas.coverage(drawing)
    patch = np.repeat(drawing.patch, coverage.end - coverage.start)
    touched = np.unique(np.stack([coverage.pixel[coverage.entries()], patch], axis=1), axis=0)[:, 0]
    return np.bincount(touched, minlength=image.width * image.height).reshape(image.height, -1) > 1


@pytest.mark.parametrize("raw", [False, True])
def test_bands_of_a_picture_meet(monkeypatch: pytest.MonkeyPatch, raw: bool) -> None:
    image = vectorized("voronoi")
    whole = image.render(2.0, raw=raw)
    monkeypatch.setattr("gcvec.vector_image.BAND", 7 * whole.shape[1])
    np.testing.assert_array_equal(image.render(2.0, raw=raw), whole)


def test_raw_rendering_samples_pixel_centres() -> None:
    image = vectorized("quadrants")
    raw = image.render(raw=True).astype(int)
    assert raw.shape == (image.height, image.width, 3)
    inside = np.s_[5:60, 5:70]
    assert np.abs(raw[inside] - image.render()[inside]).max() <= 2


def test_report_counts_the_iterations_that_gave_a_region_points() -> None:
    """A flat region gets none; a textured one gets some in most rounds, but in no more than there were."""
    made = Scene(40, 80, lambda x, y: (x > 40).astype(int))
    pixels = np.full((40, 80, 3), 128, np.uint8)
    pixels[:, :38] = noise(40, 38)
    told: list[Progress] = []
    image = vectorize(pixels, made.annotations(), Options(max_points=100, snap=0), told.append)
    assert image.report is not None
    textured, flat = image.report.regions
    rounds = sum(p.phase == "refine" for p in told)
    assert 1 < textured.iterations <= rounds
    assert flat.iterations <= textured.iterations
    one_each = vectorize(pixels, made.annotations(), Options(strategy="paper", max_points=7, snap=0)).report
    assert one_each is not None
    assert [r.iterations for r in one_each.regions] == [r.points for r in one_each.regions]
    assert one_each.regions[0].points == 7


def test_borders_stay_where_they_were_drawn_if_asked() -> None:
    """However strong the edges around them are: to what a label map and the curves' tolerance leave open."""
    pixels = np.ascontiguousarray(data.astronaut()[:200, 100:300])
    left, top, right, bottom = 40.5, 50.0, 120.0, 149.9
    ring = np.array([[left, top], [right, top], [right, bottom], [left, bottom]])
    annotations = Annotations((Shape("box", rings=(ring,)),))
    off = {}
    for snap in (0.0, 2.5):
        image = vectorize(pixels, annotations, Options(snap=snap, target_mse=200, max_points=0))
        samples = image.foundation.samples
        inner = [k for k, curve in enumerate(image.curves) if not curve.on_frame]
        x, y = samples.on_curves(image.foundation.control_points)[np.isin(samples.curve, inner)].T
        away = np.maximum(np.maximum(left - x, x - right), np.maximum(top - y, y - bottom))
        off[snap] = float(np.sqrt((away**2).mean()))
    assert off[0.0] < 0.35 < off[2.5]


@pytest.mark.parametrize("scene", SCENES)
def test_every_scene_keeps_to_a_bound(scene: str) -> None:
    """Patches too thin to hold the centre of a pixel among them, and some that fill up at once."""
    made = SCENES[scene]
    rng = np.random.default_rng(0)
    pixels = np.clip(made.picture() + rng.normal(0, 12, (made.height, made.width, 3)), 0, 255).astype(
        np.uint8
    )
    for crew in (None, Alone(3)):
        image = vectorize(pixels, made.annotations(), Options(max_points=15), None, crew)
        assert_sound(image, pixels)
        assert max(r.points for r in image.report.regions) <= 15
