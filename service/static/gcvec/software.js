/** Draws on a 2-D canvas, where there is no WebGL2: Gouraud by hand, sampled at the middle of pixels. */

import { OVERLAYS, RIM, pointRadius } from "./scene.js";

export class SoftwarePainter {
  constructor(context) {
    this.context = context;
  }

  load(mesh, overlays) {
    this.mesh = mesh;
    this.overlays = overlays;
  }

  setOriginal(original) {
    this.photo = original;
  }

  draw(place, { width, height }, share, overlays, density) {
    const { context } = this;
    const canvas = context.canvas;
    const picture = context.createImageData(canvas.width, canvas.height);
    gouraud(this.mesh, place, picture);
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.putImageData(picture, 0, 0);
    context.save();
    if (share > 0 && this.photo) {
      context.beginPath();
      context.rect(0, 0, Math.round(share * canvas.width), canvas.height);
      context.clip();
      context.clearRect(0, 0, canvas.width, canvas.height);
      context.imageSmoothingEnabled = place.scale < 1;
      const { scale, x, y } = place;
      context.drawImage(this.photo, -x * scale, -y * scale, width * scale, height * scale);
    }
    context.restore();
    for (const name of overlays) this._lines(name, place, density);
  }

  _lines(name, { scale, x, y }, density) {
    const { context } = this;
    const pieces = this.overlays[name];
    const { color, width } = OVERLAYS[name];
    context.beginPath();
    for (let k = 0; k < pieces.length; k += 4) {
      context.moveTo((pieces[k] - x) * scale, (pieces[k + 1] - y) * scale);
      context.lineTo((pieces[k + 2] - x) * scale + (width ? 0 : 0.01), (pieces[k + 3] - y) * scale);
    }
    const stroke = width ? width * density : 2 * pointRadius({ scale }, density);
    context.lineCap = "round";
    for (const [ink, rim] of [[RIM, density], [color, 0]]) {
      context.strokeStyle = `rgb(${ink.map((c) => c * 255).join(" ")})`;
      context.lineWidth = stroke + 2 * rim;
      context.stroke();
    }
  }
}

function gouraud({ positions, colors, triangles }, { scale, x, y }, { data, width, height }) {
  for (let t = 0; t < triangles.length; t += 3) {
    const [i, j, k] = [triangles[t], triangles[t + 1], triangles[t + 2]];
    const ax = (positions[2 * i] - x) * scale;
    const ay = (positions[2 * i + 1] - y) * scale;
    const ux = (positions[2 * j] - x) * scale - ax;
    const uy = (positions[2 * j + 1] - y) * scale - ay;
    const vx = (positions[2 * k] - x) * scale - ax;
    const vy = (positions[2 * k + 1] - y) * scale - ay;
    const area = ux * vy - uy * vx;
    if (!area) continue;
    const top = Math.max(Math.ceil(ay + Math.min(0, uy, vy) - 0.5), 0);
    const bottom = Math.min(Math.floor(ay + Math.max(0, uy, vy) - 0.5), height - 1);
    const left = Math.max(Math.ceil(ax + Math.min(0, ux, vx) - 0.5), 0);
    const right = Math.min(Math.floor(ax + Math.max(0, ux, vx) - 0.5), width - 1);
    for (let row = top; row <= bottom; row++) {
      for (let column = left; column <= right; column++) {
        const px = column + 0.5 - ax;
        const py = row + 0.5 - ay;
        const s = (px * vy - py * vx) / area;
        const r = (ux * py - uy * px) / area;
        if (s < -1e-6 || r < -1e-6 || s + r > 1 + 1e-6) continue;
        const at = 4 * (row * width + column);
        for (let c = 0; c < 3; c++) {
          data[at + c] = 255 * ((1 - s - r) * colors[3 * i + c] + s * colors[3 * j + c] + r * colors[3 * k + c]);
        }
        data[at + 3] = 255;
      }
    }
  }
}
