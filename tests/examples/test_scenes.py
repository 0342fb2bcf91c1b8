"""The made scene is what it says."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from PIL import Image

from examples.scenes import HAND, Scene, balls, color
from gcvec import Options, vectorize


@pytest.fixture(scope="module")
def scene() -> Scene:
    return balls()


def test_pictures_agree_at_both_sizes(scene: Scene) -> None:
    assert scene.pixels.shape == (180, 240, 3)
    averaged = scene.enlarged.reshape(180, 4, 240, 4, 3).mean(axis=(1, 3))
    assert np.abs(averaged - scene.pixels).max() <= 1.0


def test_pixels_inside_a_ball_have_its_color(scene: Scene) -> None:
    for ball in scene.balls:
        x, y = int(ball.x), int(ball.y)
        truth = color(scene.balls, np.array([x + 0.5]), np.array([y + 0.5]), 240, 180)[0]
        assert np.abs(scene.pixels[y, x] / 255 - truth).max() < 0.01


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_polygons_are_off_by_no_more_than_the_hand(seed: int) -> None:
    scene = balls(seed)
    for shape, ball in zip(scene.annotations.shapes, scene.balls, strict=True):
        ring = np.concatenate([shape.rings[0], shape.rings[0][:1]])
        edges = np.concatenate([np.linspace(a, b, 20) for a, b in pairwise(ring)])
        off = np.hypot(edges[:, 0] - ball.x, edges[:, 1] - ball.y) - ball.radius
        assert np.abs(off).max() <= HAND + 1e-9
        assert np.abs(off).max() > HAND / 2


def test_distance_to_circles(scene: Scene) -> None:
    ball = scene.balls[0]
    points = np.array([[ball.x + ball.radius + 0.5, ball.y], [ball.x, ball.y - ball.radius + 0.25]])
    np.testing.assert_allclose(scene.distance_to_circles(points), [0.5, 0.25])


@pytest.mark.parametrize("seed", [0, 1])
def test_the_vector_image_knows_more_than_the_pixels(seed: int) -> None:
    """Enlarged four times it is 8.8 dB nearer to the truth than the photo interpolated by Lanczos' kernel."""
    scene = balls(seed)
    image = vectorize(scene.pixels, scene.annotations, Options(target_mse=1.0))
    size = scene.enlarged.shape[1], scene.enlarged.shape[0]
    interpolated = np.asarray(Image.fromarray(scene.pixels).resize(size, Image.Resampling.LANCZOS))
    gain = psnr(image.render(scale=4), scene.enlarged) - psnr(interpolated, scene.enlarged)
    assert image.report
    assert image.report.mse <= 1.0
    assert gain >= 8.8


def psnr(picture: np.ndarray, truth: np.ndarray) -> float:
    return float(10 * np.log10(255**2 / ((picture.astype(float) - truth) ** 2).mean()))
