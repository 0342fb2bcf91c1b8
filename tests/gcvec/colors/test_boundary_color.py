"""Hard and soft edges, and colours that stay on their own side, on made pictures."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage
from skimage import filters

from gcvec.borders.border import sample_borders
from gcvec.borders.planar_graph import OUTSIDE, planar_graph
from gcvec.colors.boundary_color import (
    ColorSamples,
    _inward,
    color_samples,
    colors_at,
    fit_boundary_colors,
    gradient_strength,
    hard_edges,
    mean_colors,
    medians,
)
from gcvec.curves.network import Network
from gcvec.curves.network_fit import fitted_network
from gcvec.patches.color_space import LEFT, RIGHT, color_space
from gcvec.quantization import Quantization
from tests.gcvec.scenes import SCENES, noise

RED, BLUE = np.array([0.8, 0.2, 0.1]), np.array([0.1, 0.3, 0.9])


def fitted(labels: np.ndarray) -> tuple[Network, ColorSamples]:
    traced = sample_borders(planar_graph(labels), labels.shape[1], labels.shape[0])
    network = fitted_network(traced, traced, Quantization().grid)
    return network, color_samples(network)


def halves(width: int = 40, height: int = 30) -> np.ndarray:
    labels = np.zeros((height, width), np.int32)
    labels[:, width // 2 :] = 1
    return labels


def inner(network: Network) -> np.ndarray:
    return np.array([not curve.on_frame for curve in network.curves])


def test_a_step_is_a_hard_edge() -> None:
    labels = halves()
    network, samples = fitted(labels)
    picture = np.where(labels[..., None] == 0, RED, BLUE)
    np.testing.assert_array_equal(hard_edges(network, samples, picture, labels), inner(network))


def test_a_step_too_faint_is_a_soft_edge() -> None:
    labels = halves()
    network, samples = fitted(labels)
    picture = np.where(labels[..., None] == 0, RED, RED + 0.01)
    assert not hard_edges(network, samples, picture, labels).any()


def test_a_gentle_ramp_between_different_colours_is_a_soft_edge() -> None:
    """The means differ as much as across a step (D_e); the gradient at the edge does not (G_e)."""
    labels = halves(200)
    network, samples = fitted(labels)
    share = (np.arange(200) / 199)[None, :, None]
    picture = np.broadcast_to((1 - share) * RED + share * BLUE, (30, 200, 3)).copy()
    assert not hard_edges(network, samples, picture, labels).any()


def test_texture_across_a_border_of_equal_means_is_a_soft_edge() -> None:
    """A strong gradient (G_e) alone makes no hard edge: the mean colours are equal (D_e)."""
    labels = halves()
    network, samples = fitted(labels)
    stripes = (np.arange(40) % 2)[None, :, None]
    picture = np.broadcast_to(0.3 + 0.4 * stripes, (30, 40, 3)).copy()
    assert not hard_edges(network, samples, picture, labels).any()


@pytest.mark.parametrize("scene", ["ring", "voronoi"])
def test_samples_lie_a_pixel_apart_with_normals_to_the_right(scene: str) -> None:
    labels = SCENES[scene].labels
    network, samples = fitted(labels)
    np.testing.assert_allclose(np.hypot(*samples.normal.T), 1, atol=1e-9)
    height, width = labels.shape
    for c, curve in enumerate(network.curves):
        own = samples.curve == c
        steps = np.hypot(*np.diff(samples.position[own], axis=0).T)
        assert steps.max() < 2
        if curve.on_frame:
            continue
        right = np.floor(samples.position[own] + 1.6 * samples.normal[own]).astype(int)
        right = np.clip(right, 0, [width - 1, height - 1])
        assert np.mean(labels[right[:, 1], right[:, 0]] == curve.right) > 0.8


def colors_along(labels: np.ndarray, picture: np.ndarray, hard: np.ndarray | None = None) -> tuple:
    network, samples = fitted(labels)
    hard = hard_edges(network, samples, picture, labels) if hard is None else hard
    space = color_space(network, hard)
    return network, space, fit_boundary_colors(network, space, hard, samples, picture, labels)


def blurred_disc() -> tuple[np.ndarray, np.ndarray]:
    """An anti-aliased disc: the pixels on its border show a mixture."""
    labels = SCENES["ring"].labels
    labels = np.asarray(labels == 1, np.int32) + np.asarray(labels == 2, np.int32)
    y, x = np.mgrid[: labels.shape[0], : labels.shape[1]]
    share = np.clip(90.5 - np.hypot(x + 0.5 - 112, y + 0.5 - 98), 0, 1)[..., None]
    return np.minimum(labels, 1), (1 - share) * RED + share * BLUE


def test_offset_sampling_keeps_the_other_sides_colour_out() -> None:
    labels, picture = blurred_disc()
    network, space, colors = colors_along(labels, picture)
    (edge,) = np.flatnonzero(inner(network))
    curve = network.curves[edge]
    first = sum(len(c.control_points) for c in network.curves[:edge])
    own = slice(first, first + len(curve.control_points))
    for side, region in ((RIGHT, curve.right), (LEFT, curve.left)):
        expected = RED if region == 0 else BLUE
        np.testing.assert_allclose(
            colors[space.of_control[side, own]],
            np.broadcast_to(expected, (own.stop - own.start, 3)),
            atol=1e-3,
        )


def test_soft_edges_share_one_set_of_colours() -> None:
    labels = halves(200)
    share = (np.arange(200) / 199)[None, :, None]
    picture = np.broadcast_to((1 - share) * RED + share * BLUE, (30, 200, 3)).copy()
    network, space, colors = colors_along(labels, picture)
    first = 0
    for curve in network.curves:
        own = slice(first, first + len(curve.control_points))
        first = own.stop
        if OUTSIDE not in (curve.left, curve.right):
            np.testing.assert_array_equal(space.of_control[LEFT, own], space.of_control[RIGHT, own])
            middle = colors[space.of_control[RIGHT, own]]
            np.testing.assert_allclose(middle, np.broadcast_to((RED + BLUE) / 2, middle.shape), atol=0.01)


def test_colours_stay_in_the_box() -> None:
    """Black and white bars along a border make an unbounded cubic overshoot."""
    labels = halves(40, 120)
    bars = np.where((np.arange(120) // 15 % 2)[:, None, None] == 0, 0.0, 1.0)
    picture = np.broadcast_to(bars, (120, 40, 3)).copy()
    _, _, colors = colors_along(labels, picture)
    assert colors.min() >= 0
    assert colors.max() <= 1
    assert colors.min() < 0.02
    assert colors.max() > 0.98


def test_gradient_strength_equals_scikit_images() -> None:
    picture = noise(20, 30) / 255
    magnitude = np.sqrt(sum(filters.sobel(picture[..., c]) ** 2 for c in range(3)) / 3)
    y, x = (k.ravel() for k in np.mgrid[:20, :30])
    expected = ndimage.uniform_filter(magnitude, 3)[y, x]
    np.testing.assert_allclose(gradient_strength(picture, y, x), expected, atol=1e-12)


def test_medians_and_means_equal_numpys() -> None:
    rng = np.random.default_rng(6)
    group, values = np.append(rng.integers(0, 5, 60), np.arange(5)), rng.random(65)
    expected = [np.median(values[group == k]) for k in range(5)]
    np.testing.assert_allclose(medians(values, group, 5), expected)
    picture, labels = noise(8, 9) / 255, rng.integers(0, 4, (8, 9)).astype(np.int32)
    means = [picture[labels == k].mean(axis=0) for k in range(4)]
    np.testing.assert_allclose(mean_colors(picture, labels, 4), means)


def test_colors_between_pixel_centres_equal_scipys() -> None:
    picture = noise(8, 9) / 255
    places = np.random.default_rng(7).uniform([-1, -1], [10, 9], (50, 2))
    expected = [
        ndimage.map_coordinates(picture[..., c], places.T[::-1] - 0.5, order=1, mode="nearest")
        for c in range(3)
    ]
    np.testing.assert_allclose(colors_at(picture, places), np.stack(expected, axis=1), atol=1e-12)


def test_inward_pixels_are_the_nearest_whole_ones_of_their_region() -> None:
    labels = SCENES["voronoi"].labels
    height, width = labels.shape
    padded = np.pad(labels, 1, mode="edge")
    steps = [(1 + i, 1 + j) for i in (-1, 0, 1) for j in (-1, 0, 1)]
    blocks = np.stack([padded[i : i + height, j : j + width] for i, j in steps])
    whole = (blocks == labels).all(axis=0)
    found = _inward(labels)
    assert (found[whole] == np.arange(labels.size).reshape(labels.shape)[whole]).all()
    y, x = np.divmod(found, width)
    np.testing.assert_array_equal(labels[y, x], labels)
    steps = np.abs(y - np.arange(height)[:, None]) + np.abs(x - np.arange(width))
    for own in range(labels.max() + 1):
        region, inner = labels == own, whole & (labels == own)
        if not inner.any():
            assert (steps[region] == 0).all()
            continue
        distance, reached = np.where(inner, 0, 10**6), inner
        for n in range(1, 60):
            reached = ndimage.binary_dilation(reached) & region
            distance = np.where(reached, np.minimum(distance, n), distance)
        assert (steps[region] <= distance[region]).all()
