/** What there is to draw in a result: triangles, and the lines and points laid over them. */

const CURVE_STEPS = 24; // line pieces a curve segment

/** Overlays by name; width in CSS pixels, 0 for points. */
export const OVERLAYS = {
  polygons: { color: [0.25, 0.78, 1], width: 1.5 },
  outlines: { color: [1, 0.3, 0.16], width: 2 },
  points: { color: [1, 0.88, 0.25], width: 0 },
  handles: { color: [1, 1, 1], width: 0 },
};

/** Colour of the thin rim that sets overlays off. */
export const RIM = [0.1, 0.1, 0.12];

export function meshOf({ mesh }) {
  return {
    positions: new Float32Array(mesh.positions.flat()),
    colors: new Float32Array(mesh.colors.flat()),
    triangles: new Uint32Array(mesh.triangles.flat()),
  };
}

/** Line pieces `[ax, ay, bx, by, ...]` of every overlay; a point is a piece without length. */
export function overlaysOf({ curves, patches }) {
  const outlines = [];
  const points = [];
  const polygons = [];
  const handles = [];
  for (const curve of curves) {
    for (const p of curve.control_points) handles.push(...p, ...p);
    const n = curve.segments * CURVE_STEPS;
    let before = pointOfCurve(curve, 0);
    for (let k = 1; k <= n; k++) {
      const after = pointOfCurve(curve, k / CURVE_STEPS);
      outlines.push(...before, ...after);
      before = after;
    }
  }
  for (const { domain, points: interior } of patches) {
    for (const polygon of domain) polygon.forEach((p, k) => polygons.push(...p, ...polygon[(k + 1) % polygon.length]));
    for (const { image } of interior) points.push(...image, ...image);
  }
  return {
    outlines: new Float32Array(outlines),
    polygons: new Float32Array(polygons),
    points: new Float32Array(points),
    handles: new Float32Array(handles),
  };
}

/** De Boor's algorithm on uniform knots: clamped at both ends, or periodic. */
function pointOfCurve({ control_points: control, segments, closed }, u) {
  const knot = (i) => (closed ? i - 3 : Math.min(Math.max(i - 3, 0), segments));
  const segment = Math.min(Math.floor(u), segments - 1);
  const d = [0, 1, 2, 3].map((k) => [...control[(segment + k) % control.length]]);
  for (let level = 1; level <= 3; level++) {
    for (let k = 3; k >= level; k--) {
      const left = knot(segment + k);
      const t = (u - left) / (knot(segment + k + 4 - level) - left);
      d[k] = [d[k - 1][0] + t * (d[k][0] - d[k - 1][0]), d[k - 1][1] + t * (d[k][1] - d[k - 1][1])];
    }
  }
  return d[3];
}

/** Radius of control points in device pixels. */
export function pointRadius(place, density) {
  return Math.min(Math.max(place.scale * 0.3, 1.2 * density), 4 * density);
}
