/**
 * Draws a result of the format "gcvec/1" on a canvas: the patches as the service sent them, at any scale.
 *
 *     import { GcvecView } from "./gcvec.js";
 *     const view = new GcvecView(document.querySelector("canvas"));
 *     view.load(await (await fetch("/v1/jobs/ID/result")).json());
 *
 * Pan and zoom by wheel, drag, pinch, double click and keys (arrows, + - 0). The canvas fires "viewchange"
 * whenever what it shows has moved. Uses WebGL2, or a 2-D canvas where there is none.
 */

import { listen } from "./gcvec/controls.js";
import { OVERLAYS, meshOf, overlaysOf } from "./gcvec/scene.js";
import { SoftwarePainter } from "./gcvec/software.js";
import { WebGLPainter } from "./gcvec/webgl.js";

const LARGEST_SCALE = 256; // CSS pixels a pixel of the picture

export class GcvecView {
  /** `controls`: whether the canvas listens to mouse, fingers and keys; `software`: never use WebGL2. */
  constructor(canvas, { controls = true, software = false } = {}) {
    this.canvas = canvas;
    /** Outlines, parameter polygons, interior control points, control points of the outlines. */
    this.overlays = { outlines: false, polygons: false, points: false, handles: false };
    this.padding = { top: 0, right: 0, bottom: 0, left: 0 }; // CSS pixels that `fit` keeps free
    this.split = 0; // share of the width, from the left, that shows the original picture
    this.scale = 1; // CSS pixels a pixel of the picture
    this.x = 0; // position in the picture of the canvas's top left corner
    this.y = 0;
    const gl = software ? null : canvas.getContext("webgl2", { antialias: true, alpha: true });
    this._painter = gl ? new WebGLPainter(gl) : new SoftwarePainter(canvas.getContext("2d"));
    this._listening = new AbortController();
    this._resizing = new ResizeObserver(() => this._resized());
    this._resizing.observe(canvas);
    canvas.addEventListener("webglcontextlost", (event) => event.preventDefault(), this._listening);
    canvas.addEventListener("webglcontextrestored", () => this._restored(), this._listening);
    if (controls) listen(this, this._listening.signal);
  }

  /** Whether WebGL2 draws. */
  get accelerated() {
    return this._painter instanceof WebGLPainter;
  }

  /** Show a result, the whole of it. */
  load(result) {
    if (result.format !== "gcvec/1") throw new Error(`not a gcvec/1 result: ${result.format}`);
    this.result = result;
    this._painter.load(meshOf(result), overlaysOf(result));
    this._resized();
    this.fit();
  }

  /** The picture that the result was made from, to compare with: an ImageBitmap, image or canvas; null: none. */
  setOriginal(original) {
    this._original = original;
    this._painter.setOriginal(original);
    this.draw();
  }

  /** Show the whole picture, centred. */
  fit() {
    this._fitted = true;
    const { width, height } = this.result.image;
    const { top, right, bottom, left } = this.padding;
    const freeWidth = Math.max(this.canvas.clientWidth - left - right, 1);
    const freeHeight = Math.max(this.canvas.clientHeight - top - bottom, 1);
    this.scale = Math.min(freeWidth / width, freeHeight / height, LARGEST_SCALE);
    this.x = (width - freeWidth / this.scale) / 2 - left / this.scale;
    this.y = (height - freeHeight / this.scale) / 2 - top / this.scale;
    this._changed();
  }

  /** Show the picture at `scale` with its position `x`, `y` in the top left corner. */
  look(x, y, scale) {
    this._fitted = false;
    Object.assign(this, { x, y, scale });
    this._changed();
  }

  /** Zoom by `factor`, keeping what is at a place of the canvas, in CSS pixels, by default its middle. */
  zoom(factor, atX = this.canvas.clientWidth / 2, atY = this.canvas.clientHeight / 2) {
    const { width, height } = this.result?.image ?? { width: 1, height: 1 };
    const { clientWidth, clientHeight } = this.canvas;
    const smallest = Math.min(1, clientWidth / width, clientHeight / height) / 4;
    const scale = Math.min(Math.max(this.scale * factor, smallest), LARGEST_SCALE);
    this.look(this.x + atX / this.scale - atX / scale, this.y + atY / this.scale - atY / scale, scale);
  }

  /** Move the picture by CSS pixels. */
  pan(dx, dy) {
    this.look(this.x - dx / this.scale, this.y - dy / this.scale, this.scale);
  }

  /** Draw now. Changing what is shown draws by itself, at the next frame. */
  draw() {
    cancelAnimationFrame(this._frame);
    this._frame = 0;
    if (!this.result || !this.canvas.width) return;
    const density = this.canvas.width / this.canvas.clientWidth;
    const place = { scale: this.scale * density, x: this.x, y: this.y };
    const overlays = Object.keys(OVERLAYS).filter((name) => this.overlays[name]);
    const share = this._original ? this.split : 0;
    this._painter.draw(place, this.result.image, share, overlays, density);
  }

  /** Draw at the next frame, after `overlays` or `split` were set. */
  redraw() {
    this._frame ||= requestAnimationFrame(() => this.draw());
  }

  /** Let go of the canvas. */
  dispose() {
    cancelAnimationFrame(this._frame);
    this._listening.abort();
    this._resizing.disconnect();
  }

  _changed() {
    this.redraw();
    this.canvas.dispatchEvent(new Event("viewchange"));
  }

  _resized() {
    const { canvas } = this;
    const density = window.devicePixelRatio || 1;
    const width = Math.round(canvas.clientWidth * density);
    const height = Math.round(canvas.clientHeight * density);
    if (canvas.width === width && canvas.height === height) return;
    Object.assign(canvas, { width, height });
    if (this.result && this._fitted) this.fit();
    this.draw();
  }

  _restored() {
    this._painter = new WebGLPainter(this.canvas.getContext("webgl2"));
    if (this.result) this._painter.load(meshOf(this.result), overlaysOf(this.result));
    if (this._original) this._painter.setOriginal(this._original);
    this.draw();
  }
}
