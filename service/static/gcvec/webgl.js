/** Draws with WebGL2: colours interpolated as sRGB, multisampled edges, lines as antialiased capsules. */

import { OVERLAYS, RIM, pointRadius } from "./scene.js";

const TO_CLIP = `
  uniform vec2 size; uniform vec3 place;
  vec2 onCanvas(vec2 p) { return (p - place.yz) * place.x; }
  vec4 clip(vec2 p) { return vec4(2.0 * p.x / size.x - 1.0, 1.0 - 2.0 * p.y / size.y, 0, 1); }`;

const MESH = [
  `layout(location = 0) in vec2 position; layout(location = 1) in vec3 color; ${TO_CLIP}
  centroid out vec3 shade;
  void main() { shade = color; gl_Position = clip(onCanvas(position)); }`,
  `centroid in vec3 shade; out vec4 pixel;
  void main() { pixel = vec4(shade, 1); }`,
];

// A rectangle around each piece; its pixels ask how far they are from it.
const LINES = [
  `layout(location = 0) in vec4 ends; uniform float radius; ${TO_CLIP}
  out vec2 at; flat out vec2 a, b;
  void main() {
    a = onCanvas(ends.xy); b = onCanvas(ends.zw);
    vec2 along = length(b - a) > 1e-6 ? normalize(b - a) : vec2(1, 0);
    float s = gl_VertexID % 2 == 0 ? -1.0 : 1.0;
    float reach = radius + 2.0;
    at = (gl_VertexID < 2 ? a - along * reach : b + along * reach) + s * reach * vec2(-along.y, along.x);
    gl_Position = clip(at);
  }`,
  `in vec2 at; flat in vec2 a, b; uniform vec3 color; uniform float radius; out vec4 pixel;
  void main() {
    vec2 d = b - a;
    float t = clamp(dot(at - a, d) / max(dot(d, d), 1e-12), 0.0, 1.0);
    float away = length(at - a - t * d);
    pixel = vec4(color, 1) * clamp(radius + 0.5 - away, 0.0, 1.0);
  }`,
];

const PHOTO = [
  `uniform vec2 extent; ${TO_CLIP} out vec2 at;
  void main() {
    at = vec2(gl_VertexID % 2, gl_VertexID / 2);
    gl_Position = clip(onCanvas(at * extent));
  }`,
  `in vec2 at; uniform sampler2D photo; out vec4 pixel;
  void main() { pixel = texture(photo, at); }`,
];

export class WebGLPainter {
  constructor(gl) {
    this.gl = gl;
    this.programs = { mesh: program(gl, MESH), lines: program(gl, LINES), photo: program(gl, PHOTO) };
    this.nothing = gl.createVertexArray();
    this.arrays = [];
    this.buffers = [];
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  }

  load({ positions, colors, triangles }, overlays) {
    const { gl } = this;
    this._forget();
    this.mesh = this._vertexArray();
    this.corners = triangles.length;
    this._attribute(0, 2, positions);
    this._attribute(1, 3, colors);
    this._fill(gl.ELEMENT_ARRAY_BUFFER, triangles);
    this.overlays = {};
    for (const [name, pieces] of Object.entries(overlays)) {
      const lines = this._vertexArray();
      this._attribute(0, 4, pieces);
      gl.vertexAttribDivisor(0, 1);
      this.overlays[name] = { lines, count: pieces.length / 4 };
    }
    gl.bindVertexArray(null);
  }

  /** Give back what holds the picture drawn so far: an edited one may take its place again and again. */
  _forget() {
    for (const array of this.arrays) this.gl.deleteVertexArray(array);
    for (const buffer of this.buffers) this.gl.deleteBuffer(buffer);
    this.arrays = [];
    this.buffers = [];
  }

  _vertexArray() {
    const array = this.gl.createVertexArray();
    this.arrays.push(array);
    this.gl.bindVertexArray(array);
    return array;
  }

  _fill(target, values) {
    const buffer = this.gl.createBuffer();
    this.buffers.push(buffer);
    this.gl.bindBuffer(target, buffer);
    this.gl.bufferData(target, values, this.gl.STATIC_DRAW);
  }

  _attribute(location, size, values) {
    this._fill(this.gl.ARRAY_BUFFER, values);
    this.gl.enableVertexAttribArray(location);
    this.gl.vertexAttribPointer(location, size, this.gl.FLOAT, false, 0, 0);
  }

  setOriginal(original) {
    const { gl } = this;
    if (this.photo) gl.deleteTexture(this.photo);
    this.photo = null;
    if (!original) return;
    this.photo = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, this.photo);
    const picture = fitted(original, gl.getParameter(gl.MAX_TEXTURE_SIZE));
    gl.pixelStorei(gl.UNPACK_PREMULTIPLY_ALPHA_WEBGL, true); // as the canvas has its colours
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, picture);
    gl.generateMipmap(gl.TEXTURE_2D);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR_MIPMAP_LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
  }

  draw(place, { width, height }, share, overlays, density) {
    const { gl, programs } = this;
    gl.viewport(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT);

    this._use(programs.mesh, place);
    gl.bindVertexArray(this.mesh);
    gl.drawElements(gl.TRIANGLES, this.corners, gl.UNSIGNED_INT, 0);

    if (share > 0 && this.photo) {
      this._use(programs.photo, place);
      gl.uniform2f(programs.photo.uniforms.extent, width, height);
      gl.bindVertexArray(this.nothing);
      gl.enable(gl.SCISSOR_TEST);
      gl.scissor(0, 0, Math.round(share * gl.drawingBufferWidth), gl.drawingBufferHeight);
      gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
      gl.disable(gl.SCISSOR_TEST);
    }

    gl.enable(gl.BLEND);
    for (const name of overlays) {
      const { uniforms } = this._use(programs.lines, place);
      const { color, width: stroke } = OVERLAYS[name];
      const radius = stroke ? (stroke * density) / 2 : pointRadius(place, density);
      gl.bindVertexArray(this.overlays[name].lines);
      for (const [ink, rim] of [[RIM, density], [color, 0]]) {
        gl.uniform3fv(uniforms.color, ink);
        gl.uniform1f(uniforms.radius, radius + rim);
        gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, this.overlays[name].count);
      }
    }
    gl.disable(gl.BLEND);
    gl.bindVertexArray(null);
  }

  _use(chosen, place) {
    const { gl } = this;
    gl.useProgram(chosen.program);
    gl.uniform2f(chosen.uniforms.size, gl.drawingBufferWidth, gl.drawingBufferHeight);
    gl.uniform3f(chosen.uniforms.place, place.scale, place.x, place.y);
    return chosen;
  }
}

/** A picture none of whose sides is longer: itself, or a smaller one. */
function fitted(picture, side) {
  const scale = side / Math.max(picture.width, picture.height);
  if (scale >= 1) return picture;
  const [width, height] = [picture.width, picture.height].map((length) => Math.max(1, Math.round(length * scale)));
  const smaller = new OffscreenCanvas(width, height);
  const context = smaller.getContext("2d");
  context.imageSmoothingQuality = "high";
  context.drawImage(picture, 0, 0, width, height);
  return smaller;
}

function program(gl, sources) {
  const linked = gl.createProgram();
  sources.forEach((source, k) => {
    const shader = gl.createShader(k ? gl.FRAGMENT_SHADER : gl.VERTEX_SHADER);
    gl.shaderSource(shader, `#version 300 es\nprecision highp float;\n${source}`);
    gl.compileShader(shader);
    gl.attachShader(linked, shader);
  });
  gl.linkProgram(linked);
  if (!gl.getProgramParameter(linked, gl.LINK_STATUS) && !gl.isContextLost()) {
    throw new Error(gl.getAttachedShaders(linked).map((s) => gl.getShaderInfoLog(s)).join("\n"));
  }
  const uniforms = {};
  for (let k = gl.getProgramParameter(linked, gl.ACTIVE_UNIFORMS); k--; ) {
    const { name } = gl.getActiveUniform(linked, k);
    uniforms[name] = gl.getUniformLocation(linked, name);
  }
  return { program: linked, uniforms };
}
