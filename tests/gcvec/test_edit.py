"""Edits move what they say and nothing else, can be taken back, and survive the file."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from examples.scenes import balls
from gcvec import Annotations, InputError, Options, Shape, VectorImage, vectorize
from gcvec.borders.planar_graph import OUTSIDE
from gcvec.edit import Move, Recolor, edit, hex_color, mean_color
from gcvec.patches.canonical import lay_canvas, lay_foundation
from gcvec.recoloring import FULL_SHIFT

Points = list[tuple[float, float]]


def ring(points: Points) -> tuple[np.ndarray]:
    return (np.array(points, np.float64),)


@cache
def quarters() -> VectorImage:
    """Four regions that meet in one junction, in soft and in hard borders, and reach the frame."""
    y, x = np.mgrid[:60, :80] + 0.5
    picture = np.stack([60 + x, 80 + y, 120 + 20 * np.sin(x / 9) * np.cos(y / 7)], axis=-1)
    picture[:30, :40] += [60, 0, -60]
    shapes = (
        Shape("nw", rings=ring([(0, 0), (42, 0), (40, 30), (0, 31)])),
        Shape("ne", rings=ring([(42, 0), (80, 0), (80, 28), (40, 30)])),
        Shape("sw", rings=ring([(0, 31), (40, 30), (38, 60), (0, 60)])),
        Shape("se", rings=ring([(40, 30), (80, 28), (80, 60), (38, 60)])),
    )
    pixels = np.clip(picture, 0, 255).astype(np.uint8)
    return vectorize(pixels, Annotations(shapes, 80, 60), Options(target_mse=3.0))


@cache
def spheres() -> VectorImage:
    scene = balls()
    return vectorize(scene.pixels, scene.annotations, Options(target_mse=4.0))


def inner_curve(image: VectorImage) -> int:
    """The longest curve between two patches."""
    inside = [(len(c.control_points), k) for k, c in enumerate(image.network.curves) if not c.on_frame]
    return max(inside)[1]


def junction(image: VectorImage) -> tuple[int, int]:
    """Curve and control point of a node inside the picture where at least three curves meet."""
    on_frame = {n for c in image.network.curves if c.on_frame for n in (c.start, c.end)}
    ends = [n for c in image.network.curves for n in (c.start, c.end) if n >= 0 and n not in on_frame]
    node = max(set(ends), key=ends.count)
    assert ends.count(node) >= 3
    for k, curve in enumerate(image.network.curves):
        if node in (curve.start, curve.end):
            return k, 0 if curve.start == node else len(curve.control_points) - 1
    raise AssertionError


def coverage(image: VectorImage) -> np.ndarray:
    """How much of each pixel the patches cover."""
    found = image.canvas.coverage(image.canvas.drawing())
    own = found.entries()
    return np.bincount(found.pixel[own], found.weights[own].sum(axis=1), image.width * image.height)


def patches_touched(image: VectorImage, curve: int) -> set[int]:
    return {image.network.curves[curve].left, image.network.curves[curve].right}


def area_of(image: VectorImage, patches: set[int]) -> np.ndarray:
    """Pixels `(h, w) bool` that the patches touch."""
    drawing = image.canvas.drawing()
    found = image.canvas.coverage(drawing)
    patch_of_entry = np.repeat(drawing.patch, found.end - found.start)
    own = found.entries()[np.isin(patch_of_entry, list(patches))]
    touched = np.zeros(image.width * image.height, bool)
    touched[found.pixel[own]] = True
    return touched.reshape(image.height, image.width)


def test_a_move_changes_only_the_two_patches_beside_the_curve() -> None:
    image = spheres()
    curve = inner_curve(image)
    edited = edit(image, [Move(curve, 3, 2.0, -1.5)])
    changed = (image.render() != edited.render()).any(axis=2)
    patches = patches_touched(image, curve)
    assert changed.any()
    assert not (changed & ~area_of(image, patches) & ~area_of(edited, patches)).any()
    assert edited.network is image.network
    assert np.array_equal(edited.canvas.mesh.vertices, image.canvas.mesh.vertices)
    assert edited.canvas.blend is image.canvas.blend


def test_moved_curve_is_reproduced() -> None:
    """Boundary samples lie on the moved curve, as equation (1) says, and equal a solution from scratch."""
    image = quarters()
    edited = edit(image, [Move(inner_curve(image), 2, 1.0, 2.0)])
    assert edited.control_points is not None
    afresh = lay_canvas(lay_foundation(image.network, image.hard, edited.control_points), image.points)
    np.testing.assert_allclose(edited.canvas.places, afresh.places, atol=1e-9)
    np.testing.assert_allclose(edited.foundation.geometry.image, afresh.foundation.geometry.image, atol=1e-9)


def test_junctions_stay_joined() -> None:
    image = quarters()
    curve, index = junction(image)
    edited = edit(image, [Move(curve, index, 0.75, 1.0)])
    offsets, control = edited.foundation.samples.offsets, edited.foundation.control_points
    before = image.foundation.control_points
    places: dict[int, list[np.ndarray]] = {}
    for k, c in enumerate(image.network.curves):
        if not c.closed:
            places.setdefault(c.start, []).append(control[offsets[k]])
            places.setdefault(c.end, []).append(control[offsets[k + 1] - 1])
    assert all(np.array_equal(p, same[0]) for same in places.values() for p in same)
    moved = (control != before).any(axis=1).sum()
    node = image.network.curves[curve].start if index == 0 else image.network.curves[curve].end
    assert moved == len(places[node]) >= 3


def test_watertight_after_moves() -> None:
    image = quarters()
    curve, index = junction(image)
    inner = inner_curve(image)
    edited = edit(image, [Move(curve, index, 0.5, -1.0), Move(inner, 2, 0.75, 0.75)])
    assert edited.foldovers == 0
    np.testing.assert_allclose(coverage(edited), 1.0, atol=1e-9)


def test_ends_on_the_frame_slide_along_it() -> None:
    image = quarters()
    k, c = next(
        (k, c)
        for k, c in enumerate(image.network.curves)
        if c.on_frame and c.control_points[0, 0] > 0 and (c.control_points[[0, -1], 1] == 0).all()
    )
    edited = edit(image, [Move(k, 0, 4.0, 0.0)])
    assert edited.foldovers == 0
    np.testing.assert_allclose(coverage(edited), 1.0, atol=1e-9)
    offsets, control = edited.foundation.samples.offsets, edited.foundation.control_points
    own = control[offsets[k] : offsets[k + 1]]
    assert (own[:, 1] == 0).all()
    assert own[0, 0] == c.control_points[0, 0] + 4.0
    with pytest.raises(InputError, match=f"control point 0 of curve {k} .* only along it"):
        edit(image, [Move(k, 0, 0.0, 1.0)])
    with pytest.raises(InputError, match=f"control point 1 of curve {k} .* stays straight"):
        edit(image, [Move(k, 1, 1.0, 0.0)])
    with pytest.raises(InputError, match="would pass each other"):
        edit(image, [Move(k, 0, 100.0, 0.0)])
    corner = next(
        (j, i)
        for j, d in enumerate(image.network.curves)
        for i in (0, len(d.control_points) - 1)
        if (d.control_points[i] == 0).all()
    )
    with pytest.raises(InputError, match="only along it"):
        edit(image, [Move(*corner, 1.0, 0.0)])


def test_moves_compose_and_can_be_undone() -> None:
    image = quarters()
    curve, index = junction(image)
    inner = inner_curve(image)
    first, second = Move(curve, index, 2.0, 1.0), Move(inner, 2, -1.03, 0.7)
    one_by_one = edit(edit(image, [first]), [second])
    together = edit(image, [first, second])
    assert np.array_equal(one_by_one.render(), together.render())
    back = edit(together, [Move(curve, index, -2.0, -1.0), Move(inner, 2, 1.03, -0.7)])
    assert np.array_equal(back.render(), image.render())
    assert back.to_bytes() == image.to_bytes()


def test_recolor_shifts_a_patch_and_keeps_its_shading() -> None:
    image = spheres()
    before = mean_color(image, 0)
    target = before + np.array([0.05, 0.1, -0.02])
    edited = edit(image, recolors=[Recolor(0, tuple(target))])
    np.testing.assert_allclose(mean_color(edited, 0), target, atol=0.004)
    own = area_of(image, {0})
    others = area_of(image, set(range(1, len(image.labels))))
    shift = edited.render().astype(int) - image.render()
    wanted = np.rint((target - before) * 255)
    inside = shift[own & ~others]
    assert np.median(np.abs(inside - wanted)) <= 1
    assert (np.abs(inside - wanted) <= 1).mean() > 0.95  # the rest is clipped
    assert not shift[others & ~own].any()
    assert edited.foldovers == image.foldovers
    assert np.array_equal(edited.canvas.places, image.canvas.places)


def test_recolor_leaves_a_soft_neighbour_alone() -> None:
    image = quarters()
    soft = [
        c
        for c, h in zip(image.network.curves, image.hard, strict=True)
        if not h and OUTSIDE not in (c.left, c.right)
    ]
    assert soft
    patch = soft[0].left
    edited = edit(image, recolors=[Recolor(patch, tuple(mean_color(image, patch) + 0.1))])
    own, others = area_of(image, {patch}), area_of(image, set(range(len(image.labels))) - {patch})
    shift = edited.render().astype(int) - image.render()
    assert not shift[others & ~own].any()
    assert (shift[own & ~others] != 0).all()
    assert edited.hard.sum() > image.hard.sum()


def test_recolor_can_be_undone() -> None:
    image = quarters()
    before = mean_color(image, 1)
    edited = edit(image, recolors=[Recolor(1, tuple(before * 0.8 + 0.1))])
    assert (edited.render() != image.render()).any()
    back = edit(edited, recolors=[Recolor(1, tuple(before))])
    assert back.to_bytes() == image.to_bytes()
    clipped = edit(edited, recolors=[Recolor(1, (1.0, 1.0, 1.0))])
    assert edit(clipped, recolors=[Recolor(1, tuple(before))]).to_bytes() == image.to_bytes()


def test_of_many_recolors_of_a_patch_the_last_counts() -> None:
    image = quarters()
    colors = [(k / 10_000, 0.3, 0.6) for k in range(10_000)]
    edited = edit(image, recolors=[Recolor(1, color) for color in colors])
    assert edited.to_bytes() == edit(image, recolors=[Recolor(1, colors[-1])]).to_bytes()
    with pytest.raises(InputError) as refusal:
        edit(image, recolors=[Recolor(1, (2.0, 0.0, 0.0)), Recolor(1, colors[0])])
    assert refusal.value.pointer == "recolors/0"


def test_recolors_through_files_leave_all_other_patches_as_they_were() -> None:
    image = quarters()
    final = image
    for step in range(10):
        color = (0.1 + 0.08 * step, 0.9 - 0.07 * step, 0.5)
        final = VectorImage.from_bytes(edit(final, recolors=[Recolor(3, color)]).to_bytes())
    others = area_of(image, {0, 1, 2}) & ~area_of(image, {3})
    np.testing.assert_array_equal(final.render()[others], image.render()[others])
    at_once = edit(image, recolors=[Recolor(3, color)])
    assert final.to_bytes() == at_once.to_bytes()
    assert len(at_once.to_bytes()) < len(image.to_bytes()) + 16


def test_moves_and_recolors_do_not_mind_their_order() -> None:
    image = quarters()
    moves, recolors = [Move(inner_curve(image), 2, 1.0, 2.0)], [Recolor(0, (0.2, 0.7, 0.4))]
    moved_first = edit(edit(image, moves), recolors=recolors)
    assert edit(image, moves, recolors).to_bytes() == moved_first.to_bytes()
    color = tuple(mean_color(edit(image, recolors=recolors), 0))
    then_moved = edit(edit(image, recolors=recolors), moves)
    assert np.abs(mean_color(then_moved, 0) - color).max() < 0.02
    np.testing.assert_array_equal(then_moved.control_points, moved_first.control_points)


@pytest.mark.parametrize("color", [(1.0, 0.0, 0.0), (0.95, 0.9, 0.02), (0.5, 0.5, 0.5), (0.0, 0.0, 0.0)])
def test_a_patch_has_the_mean_color_it_is_given(color: tuple[float, float, float]) -> None:
    image = spheres()
    edited = edit(image, recolors=[Recolor(1, color)])
    np.testing.assert_allclose(mean_color(edited, 1), color, atol=0.51 / FULL_SHIFT)
    drawn = edited.render()[area_of(image, {1}) & ~area_of(image, {0})] / 255
    np.testing.assert_allclose(drawn.mean(axis=0), color, atol=0.02)


def test_colors_that_rounding_took_out_of_gamut_leave_the_mean_color_as_it_is_given() -> None:
    """What is shifted are the colours of the file, which may lie further out than they are drawn."""
    image = spheres()
    image = replace(image, boundary_colors=image.boundary_colors - 0.4, point_colors=image.point_colors - 0.1)
    assert image.boundary_colors.min() < -0.1
    edited = edit(image, recolors=[Recolor(1, (0.6, 0.5, 0.4))])
    np.testing.assert_allclose(mean_color(edited, 1), (0.6, 0.5, 0.4), atol=0.51 / FULL_SHIFT)


def test_a_patch_without_an_area_has_a_mean_color() -> None:
    """All control points of the curve around it are in one place."""
    image = spheres()
    curve, around = next((k, c) for k, c in enumerate(image.network.curves) if c.closed)
    to = around.control_points[0]
    moves = [Move(curve, i, *(to - at)) for i, at in enumerate(around.control_points)]
    flat = edit(image, moves)
    assert (mean_color(flat, around.right) >= 0).all()
    assert edit(flat, recolors=[Recolor(around.right, (0.5, 0.5, 0.5))]).recoloring is not None


def test_colors_out_of_gamut_are_clipped() -> None:
    white = edit(quarters(), recolors=[Recolor(0, (1.0, 1.0, 1.0))])
    own = white.point_colors[white.patch_of_points == 0]
    assert own.max() == 1.0
    assert white.render().max() == 255


def test_edits_survive_the_file() -> None:
    image = quarters()
    curve, index = junction(image)
    edited = edit(image, [Move(curve, index, 2.0, 1.0)], [Recolor(2, (0.3, 0.5, 0.7))])
    loaded = VectorImage.from_bytes(edited.to_bytes())
    assert loaded.control_points is not None
    assert np.array_equal(loaded.control_points, edited.control_points)
    assert np.array_equal(loaded.hard, edited.hard)
    assert np.array_equal(loaded.boundary_colors, edited.boundary_colors)
    assert np.array_equal(loaded.render(), edited.render())
    assert loaded.to_bytes() == edited.to_bytes()


def test_foldovers_are_reported() -> None:
    image = quarters()
    curve, index = junction(image)
    assert edit(image, [Move(curve, index, 60.0, 0.0)]).foldovers > 0


@pytest.mark.parametrize(
    ("moves", "recolors", "cause"),
    [
        ([Move(999, 0, 1, 1)], [], "no curve 999"),
        ([Move(-1, 0, 1, 1)], [], "no curve -1"),
        ([Move(0, 999, 1, 1)], [], "no control point 999 of curve 0"),
        ([Move(0, 0, float("nan"), 1)], [], "control point 0 of curve 0"),
        ([], [Recolor(99, (0.5, 0.5, 0.5))], "no patch 99"),
        ([], [Recolor(0, (0.5, 0.5, 1.5))], "patch 0 cannot have colour"),
        ([], [Recolor(0, (0.5, 0.5, float("nan")))], "patch 0 cannot have colour"),
    ],
)
def test_refusals_name_the_culprit(moves: list[Move], recolors: list[Recolor], cause: str) -> None:
    with pytest.raises(InputError, match=cause):
        edit(quarters(), moves, recolors)


def test_hex_colors() -> None:
    assert hex_color("#ff0033") == hex_color("ff0033") == (1.0, 0.0, 0.2)
    for text in ("#ff003", "#ff00330", "red", "#gg0000", ""):
        with pytest.raises(InputError, match="is not #rrggbb"):
            hex_color(text)
