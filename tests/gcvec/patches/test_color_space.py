"""The operator from unknown colours to the corners of drawn triangles."""

from dataclasses import replace

import numpy as np
import pytest

from gcvec.borders.planar_graph import OUTSIDE
from gcvec.patches.canonical import Canvas, lay_canvas
from gcvec.patches.color_space import LEFT, RIGHT, boundary_corners
from gcvec.patches.drawing import Drawing
from tests.gcvec.scenes import foundation_of, some_points


def slow_row(canvas: Canvas, drawing: Drawing, corner: int, patch: int) -> np.ndarray:
    """What every unknown gives to a corner of a triangle of a patch."""
    foundation, mesh, blend = canvas.foundation, canvas.mesh, canvas.blend
    network, space = foundation.network, foundation.space
    row = np.zeros(space.size + mesh.n_points)
    curve_of = np.repeat(np.arange(len(network.curves)), np.diff(network.offsets))

    def unknown(control: int) -> int:
        side = LEFT if network.curves[curve_of[control]].left == patch else RIGHT
        return int(space.of_control[side, control])

    if mesh.n_samples <= corner < mesh.first_free:
        row[space.size + corner - mesh.n_samples] = 1
    elif mesh.first_free <= corner < len(mesh.vertices):
        free = corner - mesh.first_free
        for control, weight in enumerate(blend.boundary[[free]].toarray()[0]):
            if weight:
                row[unknown(control)] += weight
        row[space.size :] += blend.points[[free]].toarray()[0]
    else:
        samples, ends = foundation.samples, {corner: 1.0}
        if corner >= mesh.n_samples:
            point = corner - len(mesh.vertices)
            (start, end), along = drawing.ends[point].tolist(), drawing.along[point]
            ends = {start: 1 - along, end: along}
        for sample, share in ends.items():
            key = sample * len(network.loops) + patch
            for control, weight in zip(samples.control[sample], samples.weight[sample], strict=True):
                at_node = samples.curve[sample] < 0
                own = (
                    space.of_node[np.flatnonzero(space.node_keys == key)[0]] if at_node else unknown(control)
                )
                row[own] += share * weight
    return row


@pytest.mark.parametrize("scene", ["ring", "quadrants"])
@pytest.mark.parametrize("hard", [False, True])
def test_every_corner_has_the_colour_of_its_side(scene: str, hard: bool) -> None:
    foundation = foundation_of(scene, hard)
    canvas = lay_canvas(foundation, some_points(foundation, 12))
    drawing = canvas.drawing()
    operator, index = canvas.operator(drawing)
    rng = np.random.default_rng(0)
    for t in rng.choice(len(drawing.triangles), 150, replace=False):
        for k in range(3):
            expected = slow_row(canvas, drawing, int(drawing.triangles[t, k]), int(drawing.patch[t]))
            np.testing.assert_allclose(operator[[index[t, k]]].toarray()[0], expected, rtol=0, atol=1e-14)
    kinds = drawing.triangles[drawing.triangles < len(canvas.mesh.vertices)]
    assert (kinds >= canvas.mesh.first_free).any()


def test_colours_of_corners_are_numbered_by_vertex_and_patch() -> None:
    """Against sorted pairs."""
    foundation = foundation_of("nested")
    canvas = lay_canvas(foundation, some_points(foundation, 12))
    drawing, n_samples, n_vertices = canvas.drawing(), canvas.mesh.n_samples, len(canvas.mesh.vertices)
    n_interior = n_vertices - n_samples
    color, vertex, patch = boundary_corners(drawing.triangles, drawing.patch, n_samples, n_vertices)
    boundary = (drawing.triangles < n_samples) | (drawing.triangles >= n_vertices)
    numbers = np.where(drawing.triangles < n_samples, drawing.triangles, drawing.triangles - n_interior)
    owners = np.broadcast_to(drawing.patch[:, None], numbers.shape)
    pairs = np.unique(np.stack([numbers[boundary], owners[boundary]], axis=1), axis=0)
    np.testing.assert_array_equal(np.stack([vertex, patch], axis=1), pairs)
    place = {(v, p): n_interior + i for i, (v, p) in enumerate(pairs.tolist())}
    expected = [
        place[v, p] for v, p in zip(numbers[boundary].tolist(), owners[boundary].tolist(), strict=True)
    ]
    assert color[boundary].tolist() == expected
    np.testing.assert_array_equal(color[~boundary], drawing.triangles[~boundary] - n_samples)


def test_colours_are_weighted_means() -> None:
    """Rows sum up to 1: a picture of one colour is one."""
    foundation = foundation_of("nested", True)
    canvas = lay_canvas(foundation, some_points(foundation, 30))
    operator, _ = canvas.operator(canvas.drawing())
    np.testing.assert_allclose(operator @ np.ones(operator.shape[1]), 1, rtol=0, atol=1e-9)


def test_a_patch_beside_none_of_its_curves_is_refused() -> None:
    """As a file may say: a colour that is not there would be read from outside the others."""
    foundation = foundation_of("quadrants")
    network, samples, mesh = foundation.network, foundation.samples, foundation.geometry.mesh
    canvas = foundation.bare_canvas
    drawing = canvas.drawing()
    beside_frame = (network.sides[samples.curve] == OUTSIDE).any(axis=1) & (samples.curve >= 0)
    touching = beside_frame[np.minimum(drawing.triangles, mesh.n_samples - 1)]
    touching = (touching & (drawing.triangles < mesh.n_samples)).any(axis=1)
    wrong = np.where(touching, len(network.loops) - 1 - drawing.patch, drawing.patch)
    with pytest.raises(ValueError, match="beside their patches"):
        foundation.space.operator(network, samples, replace(drawing, patch=wrong), mesh, canvas.blend)
