"""GLB as a glTF reader finds it, interpolated in linear light."""

from pathlib import Path

import numpy as np
import pytest
from pygltflib import GLTF2

from gcvec import VectorImage, raster
from gcvec.export.glb import glb
from gcvec.export.linear_light import linear_light, srgb, subdivided
from gcvec.export.triangles import Triangles, drawn_triangles
from gcvec.vector_image import to_8_bit
from tests.gcvec.export.fidelity import SCALE, assert_faithful

DTYPES = {5126: np.float32, 5123: np.uint16, 5125: np.uint32}
COMPONENTS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}


@pytest.fixture
def gltf(image: VectorImage, tmp_path: Path) -> GLTF2:
    file = tmp_path / "picture.glb"
    file.write_bytes(glb(image))
    return GLTF2().load(str(file))


def values(gltf: GLTF2, number: int) -> np.ndarray:
    accessor = gltf.accessors[number]
    view = gltf.bufferViews[accessor.bufferView]
    dtype = DTYPES[accessor.componentType]
    assert view.byteOffset % np.dtype(dtype).itemsize == 0
    count = accessor.count * COMPONENTS[accessor.type]
    assert view.byteLength == count * np.dtype(dtype).itemsize
    data = gltf.binary_blob()[view.byteOffset : view.byteOffset + view.byteLength]
    return np.frombuffer(data, dtype).reshape(accessor.count, -1)


def test_drawn_in_linear_light(image: VectorImage, gltf: GLTF2) -> None:
    (primitive,) = gltf.meshes[0].primitives
    positions = values(gltf, primitive.attributes.POSITION).astype(float)
    colors = values(gltf, primitive.attributes.COLOR_0)[:, :3] / 65535
    triangles = values(gltf, primitive.indices).reshape(-1, 3).astype(np.int64)
    flat = (positions[:, :2] * (1, -1) + (0, image.height)) * SCALE
    # As a graphics card does it: multisampled, blended to light, shown as sRGB.
    corners, size = triangles[:, ::-1], (4 * SCALE * image.width, 4 * SCALE * image.height)
    fine = raster.sample(flat * 4, corners, colors, corners, *size)
    blocks = srgb(fine).reshape(SCALE * image.height, 4, SCALE * image.width, 4, 3).mean(axis=(1, 3))
    assert_faithful(to_8_bit(blocks), image)


def test_what_viewers_rely_on(image: VectorImage, gltf: GLTF2) -> None:
    accessor = gltf.accessors[gltf.meshes[0].primitives[0].attributes.POSITION]
    positions = values(gltf, 0)
    assert accessor.min == pytest.approx(positions.min(axis=0).tolist())
    assert accessor.max == pytest.approx([image.width, image.height, 0])
    colors = gltf.accessors[1]
    assert (colors.componentType, colors.normalized, colors.type) == (5123, True, "VEC4")
    assert gltf.materials[0].extensions == {"KHR_materials_unlit": {}}
    a, b, c = (positions[values(gltf, 2).reshape(-1, 3)[:, k]].astype(float) for k in range(3))
    assert (np.cross(b - a, c - a)[:, 2] > -1e-6).all()
    node = gltf.nodes[0]
    corner = np.array(accessor.max) * node.scale + node.translation
    assert max(corner) == pytest.approx(0.5)


def test_subdividing_keeps_the_picture(image: VectorImage) -> None:
    plain = drawn_triangles(image)
    cut = subdivided(plain)
    assert area(cut) == pytest.approx(area(plain))
    width, height = image.width, image.height
    pictures = [
        raster.paint(part.positions, part.corners, part.colors, part.corners, width, height)
        for part in (plain, cut)
    ]
    assert np.abs(pictures[0] - pictures[1]).max() < 1e-9
    assert length_of_lonely_edges(cut) == pytest.approx(length_of_lonely_edges(plain))


def length_of_lonely_edges(triangles: Triangles) -> float:
    """Length of the edges that belong to one triangle alone: it grows where a corner meets an edge."""
    corners = triangles.places[triangles.corners]
    edges = np.sort(np.stack([corners, np.roll(corners, 1, axis=1)], axis=2).reshape(-1, 2))
    different, count = np.unique(edges, axis=0, return_counts=True)
    place = np.zeros((triangles.places.max() + 1, 2))
    place[triangles.places] = triangles.positions
    return float(np.hypot(*np.diff(place[different[count == 1]], axis=1)[:, 0].T).sum())


def area(triangles: Triangles) -> float:
    a, b, c = (triangles.positions[triangles.corners[:, k]] for k in range(3))
    return float(np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]).sum() / 2)


def test_light_and_back() -> None:
    levels = np.arange(256) / 255
    assert np.abs(srgb(linear_light(levels)) - levels).max() < 1e-12
    assert linear_light(np.array([0.5]))[0] == pytest.approx(0.21404, abs=1e-5)
