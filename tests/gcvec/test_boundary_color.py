"""Hard and soft edges, and colours that stay on their own side, on made pictures."""

from __future__ import annotations

import numpy as np
import pytest

from gcvec.borders import borders
from gcvec.boundary import Network
from gcvec.boundary_color import ColorSamples, color_samples, fit_boundary_colors, hard_edges
from gcvec.boundary_fit import fitted_network
from gcvec.color_space import LEFT, RIGHT, color_space
from gcvec.planar_graph import OUTSIDE, planar_graph
from gcvec.quantization import Quantization
from tests.gcvec.scenes import SCENES

RED, BLUE = np.array([0.8, 0.2, 0.1]), np.array([0.1, 0.3, 0.9])


def fitted(labels: np.ndarray) -> tuple[Network, ColorSamples]:
    traced = borders(planar_graph(labels), labels.shape[1], labels.shape[0])
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
