"use strict";

const BACKGROUND = [0.07, 0.086, 0.11];
const COLORS = ["#4c9be8", "#f2695c", "#5fc56d", "#ffae42", "#b48ae0", "#c58f7d", "#f08cc8", "#35c9d8", "#d3d34a",
  "#a9b4c0"];
const colorOf = (k) => COLORS[k % COLORS.length];
const channels = (color) => [1, 3, 5].map((at) => parseInt(color.slice(at, at + 2), 16) / 255);

const PARTICLE = [`#version 300 es
layout(location=0) in vec3 place;
uniform mat4 view, projection;
uniform vec3 low, size;
uniform float radius, height, least;
out float away;
void main() {
  vec4 at = view * vec4(low + size * place, 1.0);
  gl_Position = projection * at;
  away = -at.z;
  gl_PointSize = max(least, radius * projection[1][1] * height / max(away, 1e-6));
}`, `#version 300 es
precision highp float;
uniform vec3 color, background;
uniform vec2 haze;
in float away;
out vec4 shade;
void main() {
  vec2 c = 2.0 * gl_PointCoord - 1.0;
  float square = dot(c, c);
  if (square > 1.0) discard;
  vec3 normal = vec3(c.x, -c.y, sqrt(1.0 - square));
  float light = 0.4 + 0.6 * max(dot(normal, normalize(vec3(0.3, 0.6, 0.75))), 0.0);
  float far = clamp((away - haze.x) / (haze.y - haze.x), 0.0, 1.0);
  shade = vec4(mix(color * light, background, 0.65 * far), 1.0);
}`];

const SOLID = [`#version 300 es
layout(location=0) in vec3 place;
layout(location=1) in vec3 normal;
uniform mat4 view, projection;
uniform vec3 center, size;
out vec3 outward, toward;
void main() {
  vec4 at = view * vec4(center + size * place, 1.0);
  gl_Position = projection * at;
  outward = mat3(view) * (normal / size);
  toward = -at.xyz;
}`, `#version 300 es
precision highp float;
uniform vec3 color;
in vec3 outward, toward;
out vec4 shade;
void main() {
  float facing = abs(dot(normalize(outward), normalize(toward)));
  float rim = 1.0 - facing;
  shade = vec4(color * (0.6 + 0.4 * facing), 0.1 + 0.5 * rim * rim);
}`];

const LINE = [`#version 300 es
layout(location=0) in vec3 place;
uniform mat4 view, projection;
void main() { gl_Position = projection * view * vec4(place, 1.0); }`, `#version 300 es
precision highp float;
out vec4 shade;
void main() { shade = vec4(0.45, 0.52, 0.6, 1.0); }`];

function program(gl, [vertex, fragment]) {
  const made = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    gl.attachShader(made, shader);
  }
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(made));
  const places = {};
  for (let k = 0; k < gl.getProgramParameter(made, gl.ACTIVE_UNIFORMS); k++) {
    const { name } = gl.getActiveUniform(made, k);
    places[name] = gl.getUniformLocation(made, name);
  }
  return { made, places };
}

// A surface of revolution about the first axis. A corner of `outline` has a position on the axis, a distance from it,
// and a normal.
function revolved(outline, along, turns = 48) {
  const points = [], turned = (v) => (along === 0 ? v : along === 1 ? [v[2], v[0], v[1]] : [v[1], v[2], v[0]]);
  const corner = ([x, r, nx, nr], k) => {
    const [c, s] = [Math.cos((2 * Math.PI * k) / turns), Math.sin((2 * Math.PI * k) / turns)];
    points.push(...turned([x, r * c, r * s]), ...turned([nx, nr * c, nr * s]));
  };
  for (let k = 0; k < outline.length - 1; k++)
    for (let turn = 0; turn < turns; turn++) {
      const [a, b] = [outline[k], outline[k + 1]];
      for (const [at, by] of [[a, 0], [b, 0], [b, 1], [a, 0], [b, 1], [a, 1]]) corner(at, turn + by);
    }
  return points;
}

function solid(kind, along) {
  if (kind === "box") {
    const points = [];
    for (let axis = 0; axis < 3; axis++)
      for (const side of [-1, 1])
        for (const [u, v] of [[-1, -1], [1, -1], [1, 1], [-1, -1], [1, 1], [-1, 1]]) {
          const at = [0, 0, 0], normal = [0, 0, 0];
          at[axis] = side;
          at[(axis + 1) % 3] = u;
          at[(axis + 2) % 3] = v * side;
          normal[axis] = side;
          points.push(...at, ...normal);
        }
    return points;
  }
  if (kind === "cylinder")
    return [[[-1, 0, -1, 0], [-1, 1, -1, 0]], [[-1, 1, 0, 1], [1, 1, 0, 1]], [[1, 1, 1, 0], [1, 0, 1, 0]]]
      .flatMap((outline) => revolved(outline, along));
  const arc = [...Array(25).keys()].map((k) => (Math.PI * k) / 24);
  return revolved(arc.map((a) => [-Math.cos(a), Math.sin(a), -Math.cos(a), Math.sin(a)]), along);
}

function walls(scene) {
  const lines = [], ring = (along, center, radius, at) => {
    const point = (k) => {
      const p = [...center];
      p[along] = at;
      p[(along + 1) % 3] += radius * Math.cos((2 * Math.PI * k) / 64);
      p[(along + 2) % 3] += radius * Math.sin((2 * Math.PI * k) / 64);
      return p;
    };
    for (let k = 0; k < 64; k++) lines.push(...point(k), ...point(k + 1));
  };
  const { vessel, walls: room, view } = scene;
  if (vessel?.along === null) {
    for (let k = 0; k < 3; k++) ring(k, vessel.center, vessel.radius, vessel.center[k]);
    return lines;
  }
  if (vessel) {
    const [low, high] = room[vessel.along] ??
      [view.center[vessel.along] - view.radius, view.center[vessel.along] + view.radius];
    for (let k = 0; k <= 8; k++) ring(vessel.along, vessel.center, vessel.radius, low + ((high - low) * k) / 8);
    for (let k = 0; k < 4; k++) {
      const [a, b] = [[...vessel.center], [...vessel.center]];
      [a, b].forEach((p) => {
        p[(vessel.along + 1) % 3] += vessel.radius * Math.round(Math.cos((Math.PI * k) / 2));
        p[(vessel.along + 2) % 3] += vessel.radius * Math.round(Math.sin((Math.PI * k) / 2));
      });
      a[vessel.along] = low;
      b[vessel.along] = high;
      lines.push(...a, ...b);
    }
    return lines;
  }
  const spans = room.map((wall, k) => wall ?? [view.center[k] - view.radius, view.center[k] + view.radius]);
  if (room.every((wall) => !wall)) return lines;
  for (let axis = 0; axis < 3; axis++)
    for (const u of [0, 1])
      for (const v of [0, 1]) {
        const [one, two] = [(axis + 1) % 3, (axis + 2) % 3];
        if (!room[one] || !room[two]) continue;
        for (const end of [0, 1]) {
          const point = [0, 0, 0];
          point[axis] = spans[axis][end];
          point[one] = spans[one][u];
          point[two] = spans[two][v];
          lines.push(...point);
        }
      }
  return lines;
}

class Camera {
  constructor({ center, radius }) {
    Object.assign(this, { center: [...center], reach: radius, distance: 2.3 * radius, turn: 0.7, tilt: 0.45 });
  }
  axes() {
    const [ct, st, ce, se] = [Math.cos(this.turn), Math.sin(this.turn), Math.cos(this.tilt), Math.sin(this.tilt)];
    return [[ct, 0, -st], [-st * se, ce, -ct * se], [st * ce, se, ct * ce]];
  }
  view() {
    const rows = this.axes(), dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    const shift = rows.map((row) => -dot(row, this.center));
    return new Float32Array([
      ...[0, 1, 2].flatMap((k) => [rows[0][k], rows[1][k], rows[2][k], 0]), shift[0], shift[1],
      shift[2] - this.distance, 1]);
  }
  projection(aspect) {
    const f = 1.9 / Math.min(1, aspect);
    const near = Math.max(this.distance - 8 * this.reach, this.distance * 0.01), far = this.distance + 12 * this.reach;
    return new Float32Array([f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0,
      (2 * far * near) / (near - far), 0]);
  }
  pan(x, y) {
    const [right, up] = this.axes(), by = this.distance / 900;
    this.center = this.center.map((c, k) => c - by * (x * right[k] - y * up[k]));
  }
}

class Stage {
  constructor(canvas, scene) {
    // Discs have no edges to smooth, and multisampling takes three times as long on software drivers.
    const gl = canvas.getContext("webgl2", { antialias: false, preserveDrawingBuffer: true });
    if (!gl) throw new Error("This browser has no WebGL 2, or it is switched off.");
    Object.assign(this, { gl, canvas, scene, camera: new Camera(scene.view), hidden: new Set() });
    [this.particle, this.solid, this.line] = [PARTICLE, SOLID, LINE].map((text) => program(gl, text));
    this.cloud = this.mesh([], 6, [[0, 3, gl.UNSIGNED_SHORT, 0]]);
    this.walls = this.mesh(walls(scene), 12, [[0, 3, gl.FLOAT, 0]]);
    const kinds = scene.transceivers.map(({ shape }) => solid(shape.kind, shape.along ?? 0));
    this.solids = kinds.map((points) => this.mesh(points, 24, [[0, 3, gl.FLOAT, 0], [1, 3, gl.FLOAT, 12]]));
  }
  mesh(points, stride, columns) {
    const { gl } = this, array = gl.createVertexArray(), buffer = gl.createBuffer();
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(points), gl.STATIC_DRAW);
    for (const [place, width, kind, offset] of columns) {
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, width, kind, kind !== gl.FLOAT, stride, offset);
    }
    return { array, buffer, count: (points.length * 4) / stride };
  }
  show(frame, places) {
    const { gl } = this;
    this.frame = frame;
    gl.bindBuffer(gl.ARRAY_BUFFER, this.cloud.buffer);
    gl.bufferData(gl.ARRAY_BUFFER, places, gl.STREAM_DRAW);
  }
  use({ made, places }, values) {
    const { gl } = this;
    gl.useProgram(made);
    for (const [name, value] of Object.entries({ view: this.view, projection: this.projection, ...values }))
      if (value.length === 16) gl.uniformMatrix4fv(places[name], false, value);
      else gl[`uniform${value.length ?? 1}fv`](places[name], [value].flat());
  }
  draw() {
    const { gl, canvas, camera, scene } = this, ratio = window.devicePixelRatio || 1;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((l) => Math.max(1, Math.round(l * ratio)));
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    gl.viewport(0, 0, width, height);
    [this.view, this.projection] = [camera.view(), camera.projection(width / height)];
    gl.clearColor(...BACKGROUND, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    this.use(this.line, {});
    gl.bindVertexArray(this.walls.array);
    gl.drawArrays(gl.LINES, 0, this.walls.count);
    const haze = [camera.distance - 0.8 * camera.reach, camera.distance + 2.2 * camera.reach];
    gl.bindVertexArray(this.cloud.array);
    let first = 0;
    this.frame.counts.forEach((count, k) => {
      if (!this.hidden.has(k)) {
        this.use(this.particle, { low: this.frame.low, size: this.frame.size, radius: scene.species[k].radius, height,
          least: 3 * ratio, color: channels(colorOf(k)), background: BACKGROUND, haze });
        gl.drawArrays(gl.POINTS, first, count);
      }
      first += count;
    });
    this.drawSolids();
  }
  drawSolids() {
    const { gl, scene } = this;
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    gl.depthMask(false);
    gl.enable(gl.CULL_FACE);
    // Back faces first.
    for (const side of [gl.FRONT, gl.BACK])
      scene.transceivers.forEach(({ role, shape }, k) => {
        gl.cullFace(side);
        this.use(this.solid, { center: this.centerOf(k), size: shape.size, color: role === "receiver" ? [0.55, 0.75, 1] : [1, 0.8, 0.45] });
        gl.bindVertexArray(this.solids[k].array);
        gl.drawArrays(gl.TRIANGLES, 0, this.solids[k].count);
      });
    gl.disable(gl.CULL_FACE);
    gl.depthMask(true);
    gl.disable(gl.BLEND);
  }
  centerOf(k) {
    const { center, moves } = this.scene.transceivers[k];
    return moves === undefined ? center : this.frame.centers[moves];
  }
  // The position of a point on the page, or nothing if the camera looks away from it.
  place([x, y, z]) {
    const apply = (m, v) => [0, 1, 2, 3].map((k) => m[k] * v[0] + m[4 + k] * v[1] + m[8 + k] * v[2] + m[12 + k] * v[3]);
    const [cx, cy, , w] = apply(this.projection, apply(this.view, [x, y, z, 1]));
    if (w <= 0) return null;
    return [(0.5 + 0.5 * (cx / w)) * this.canvas.clientWidth, (0.5 - 0.5 * (cy / w)) * this.canvas.clientHeight];
  }
}
