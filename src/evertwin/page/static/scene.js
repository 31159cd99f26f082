// A machine and its simulated ghost in three dimensions: capsules, cylinders, boxes and lines, drawn by
// WebGL, or as thick strokes on a plain canvas where there is none.

import { h } from "./dom.js";

const VERTEX = `attribute vec3 at; attribute vec3 normal; uniform mat4 view, model; uniform mat3 turn;
varying vec3 facing; void main() { facing = turn * normal; gl_Position = view * model * vec4(at, 1.0); }`;
const FRAGMENT = `precision mediump float; varying vec3 facing; uniform vec4 colour; uniform float lit;
void main() { float light = mix(1.0, 0.45 + 0.55 * max(dot(normalize(facing), vec3(0.35, -0.45, 0.82)), 0.0), lit);
gl_FragColor = vec4(colour.rgb * light, colour.a); }`;

// ------------------------------------------------------------------ matrices, column by column

export const multiply = (a, b) => {
  const out = new Float32Array(16);
  for (let c = 0; c < 4; c += 1) for (let r = 0; r < 4; r += 1) {
    for (let k = 0; k < 4; k += 1) out[c * 4 + r] += a[k * 4 + r] * b[c * 4 + k];
  }
  return out;
};
const sub = (a, b) => a.map((v, k) => v - b[k]);
const dot = (a, b) => a.reduce((sum, v, k) => sum + v * b[k], 0);
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => {
  const size = Math.hypot(...a) || 1;
  return a.map((v) => v / size);
};

function lookFrom(eye, to, up) {
  const z = unit(sub(eye, to));
  const x = unit(cross(up, z));
  const y = cross(z, x);
  return new Float32Array([x[0], y[0], z[0], 0, x[1], y[1], z[1], 0, x[2], y[2], z[2], 0, -dot(x, eye), -dot(y, eye), -dot(z, eye), 1]);
}

function perspective(angle, aspect, near, far) {
  const f = 1 / Math.tan(angle / 2);
  return new Float32Array([f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, (2 * far * near) / (near - far), 0]);
}

/** The frame that carries a shape of unit length along z from `a` to `b`, so thick. */
function between(a, b, radius) {
  const z = sub(b, a);
  const n = unit(z);
  const x = unit(cross(Math.abs(n[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0], n));
  const y = cross(n, x);
  return new Float32Array([...x.map((v) => v * radius), 0, ...y.map((v) => v * radius), 0, ...z, 0, ...a, 1]);
}

// ------------------------------------------------------------------ shapes of unit size

function tube() {
  const out = [];
  for (let k = 0; k < 20; k += 1) {
    const [p, q] = [k, k + 1].map((j) => [Math.cos((j * Math.PI) / 10), Math.sin((j * Math.PI) / 10)]);
    const corner = ([x, y], z, n) => out.push(x, y, z, ...n);
    for (const [one, z] of [[p, 0], [q, 0], [q, 1], [p, 0], [q, 1], [p, 1]]) corner(one, z, [one[0], one[1], 0]);
    for (const z of [0, 1]) {
      for (const one of [[0, 0], p, q]) corner(one, z, [0, 0, z * 2 - 1]);
    }
  }
  return out;
}

function ball() {
  const out = [];
  const point = (i, j) => {
    const [a, b] = [(i * Math.PI) / 8, (j * Math.PI) / 8];
    const p = [Math.sin(a) * Math.cos(b), Math.sin(a) * Math.sin(b), Math.cos(a)];
    out.push(...p, ...p);
  };
  for (let i = 0; i < 8; i += 1) for (let j = 0; j < 16; j += 1) {
    for (const [m, n] of [[0, 0], [1, 0], [1, 1], [0, 0], [1, 1], [0, 1]]) point(i + m, j + n);
  }
  return out;
}

// ------------------------------------------------------------------ the two ways to draw

class Solid {
  constructor(canvas) {
    const gl = canvas.getContext("webgl", { antialias: true, alpha: true });
    if (!gl) throw new Error("no WebGL");
    this.gl = gl;
    const program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error("no shaders");
    gl.useProgram(program);
    this.at = gl.getAttribLocation(program, "at");
    this.normal = gl.getAttribLocation(program, "normal");
    this.of = Object.fromEntries(["view", "model", "turn", "colour", "lit"].map((n) => [n, gl.getUniformLocation(program, n)]));
    gl.enableVertexAttribArray(this.at);
    this.shapes = { tube: this.#buffer(tube()), ball: this.#buffer(ball()) };
    this.lines = gl.createBuffer();
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.BLEND);
    gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  }

  #buffer(values) {
    const { gl } = this;
    const buffer = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(values), gl.STATIC_DRAW);
    return { buffer, corners: values.length / 6 };
  }

  draw(things, view, wide, high) {
    const { gl } = this;
    gl.viewport(0, 0, wide, high);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.uniformMatrix4fv(this.of.view, false, view);
    for (const thing of [...things].sort((a, b) => b.colour[3] - a.colour[3])) {
      gl.depthMask(thing.colour[3] >= 1);
      gl.uniform4fv(this.of.colour, thing.colour);
      if (thing.points) this.#line(thing);
      else {
        const { a, b, radius, flat } = thing;
        this.#shape("tube", between(a, b, radius));
        if (!flat) for (const end of [a, b]) this.#shape("ball", ballAt(end, radius));
      }
    }
    gl.depthMask(true);
  }

  #shape(name, model) {
    const { gl } = this;
    const { buffer, corners } = this.shapes[name];
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.vertexAttribPointer(this.at, 3, gl.FLOAT, false, 24, 0);
    gl.enableVertexAttribArray(this.normal);
    gl.vertexAttribPointer(this.normal, 3, gl.FLOAT, false, 24, 12);
    gl.uniform1f(this.of.lit, 1);
    gl.uniformMatrix4fv(this.of.model, false, model);
    const columns = [0, 4, 8].map((k) => unit([model[k], model[k + 1], model[k + 2]]));
    gl.uniformMatrix3fv(this.of.turn, false, new Float32Array(columns.flat()));
    gl.drawArrays(gl.TRIANGLES, 0, corners);
  }

  #line({ points, apart }) {
    const { gl } = this;
    gl.bindBuffer(gl.ARRAY_BUFFER, this.lines);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(points.flat()), gl.DYNAMIC_DRAW);
    gl.vertexAttribPointer(this.at, 3, gl.FLOAT, false, 12, 0);
    gl.disableVertexAttribArray(this.normal);
    gl.uniform1f(this.of.lit, 0);
    gl.uniformMatrix4fv(this.of.model, false, new Float32Array([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]));
    gl.drawArrays(apart ? gl.LINES : gl.LINE_STRIP, 0, points.length);
  }
}

const ballAt = (p, r) => new Float32Array([r, 0, 0, 0, 0, r, 0, 0, 0, 0, r, 0, ...p, 1]);

class Flat {
  constructor(canvas) {
    this.pen = canvas.getContext("2d");
  }

  draw(things, view, wide, high) {
    const { pen } = this;
    pen.clearRect(0, 0, wide, high);
    const seen = (p) => {
      const q = [0, 1, 2, 3].map((r) => view[r] * p[0] + view[4 + r] * p[1] + view[8 + r] * p[2] + view[12 + r]);
      return [((q[0] / q[3] + 1) / 2) * wide, ((1 - q[1] / q[3]) / 2) * high, q[3]];
    };
    for (const { a, b, radius, points, apart, colour } of things) {
      pen.strokeStyle = `rgba(${colour.slice(0, 3).map((v) => Math.round(v * 255)).join()},${colour[3]})`;
      pen.lineCap = "round";
      const path = (points ?? [a, b]).map(seen);
      pen.lineWidth = points ? 1.5 : Math.max(2, (radius * 2.4 * high) / path[0][2]);
      pen.beginPath();
      path.forEach(([x, y], k) => pen[k === 0 || (apart && k % 2 === 0) ? "moveTo" : "lineTo"](x, y));
      pen.stroke();
    }
  }
}

/** A picture that is turned by dragging or by the arrow keys, and comes nearer with + and −. */
export class Scene {
  constructor({ centre, distance, label, turn = -0.9, tilt = 0.45 }) {
    Object.assign(this, { centre, distance, turn, tilt });
    this.canvas = h("canvas", { class: "scene", tabindex: 0, role: "img", "aria-label": label });
    try {
      this.way = new Solid(this.canvas);
    } catch {
      this.way = new Flat(this.canvas);
    }
    this.flat = this.way instanceof Flat;
    this.#listen();
  }

  draw(things) {
    if (things) this.things = things;
    const { canvas } = this;
    const ratio = window.devicePixelRatio || 1;
    const [wide, high] = [canvas.clientWidth * ratio, canvas.clientHeight * ratio].map(Math.round);
    if (!wide || !this.things) return;
    if (canvas.width !== wide || canvas.height !== high) Object.assign(canvas, { width: wide, height: high });
    const round = Math.cos(this.tilt);
    const eye = [Math.sin(this.turn) * round, -Math.cos(this.turn) * round, Math.sin(this.tilt)].map((v, k) => v * this.distance + this.centre[k]);
    const view = multiply(perspective(0.7, wide / high, this.distance / 50, this.distance * 8), lookFrom(eye, this.centre, [0, 0, 1]));
    this.way.draw(this.things, view, wide, high);
  }

  #listen() {
    const { canvas } = this;
    let held = null;
    canvas.addEventListener("pointerdown", (e) => {
      held = [e.clientX, e.clientY];
      canvas.setPointerCapture(e.pointerId);
    });
    canvas.addEventListener("pointermove", (e) => {
      if (!held) return;
      this.#move((held[0] - e.clientX) * 0.01, (e.clientY - held[1]) * 0.01);
      held = [e.clientX, e.clientY];
    });
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => (held = null));
    canvas.addEventListener("keydown", (e) => {
      const [turn, tilt] = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] }[e.key] ?? [0, 0];
      if (e.key === "+" || e.key === "-") this.distance *= e.key === "+" ? 0.9 : 1.1;
      else if (!turn && !tilt) return;
      e.preventDefault();
      this.#move(turn, tilt);
    });
  }

  #move(turn, tilt) {
    this.turn += turn;
    this.tilt = Math.min(Math.max(this.tilt + tilt, 0.05), 1.55);
    this.draw();
  }
}

// ------------------------------------------------------------------ what machines look like

const MACHINE = [0.45, 0.5, 0.58, 1];
const GOOD = [0.12, 0.62, 0.35, 1];
const OFF = [0.85, 0.27, 0.13, 1];
export const GHOST = [0.95, 0.55, 0.05, 0.45];
const mix = (a, b, k) => a.map((v, j) => v + (b[j] - v) * k);

export function floor(size, step, centre = [0, 0]) {
  const points = [];
  for (let k = -size; k <= size + 1e-9; k += step) {
    points.push([centre[0] + k, centre[1] - size, 0], [centre[0] + k, centre[1] + size, 0]);
    points.push([centre[0] - size, centre[1] + k, 0], [centre[0] + size, centre[1] + k, 0]);
  }
  return { points, apart: true, colour: [0.5, 0.5, 0.5, 0.3] };
}

/** Where the joints of an arm are: frames from the base to the tip. */
export function frames(joints, q) {
  let frame = new Float32Array([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);
  return joints.map(({ rotation: r, position: p, slides }, k) => {
    const fixed = new Float32Array([r[0], r[3], r[6], 0, r[1], r[4], r[7], 0, r[2], r[5], r[8], 0, ...p, 1]);
    const [c, sn] = slides ? [1, 0] : [Math.cos(q[k]), Math.sin(q[k])];
    const turned = new Float32Array([c, sn, 0, 0, -sn, c, 0, 0, 0, 0, 1, 0, 0, 0, slides ? q[k] : 0, 1]);
    frame = multiply(multiply(frame, fixed), turned);
    return frame;
  });
}

/** An arm at its joints' angles; `off`: how far each joint is off, 0 as expected, 1 and more not. */
export function arm(joints, tool, q, off, ghost = false) {
  const found = frames(joints, q);
  const reach = Math.max(...joints.map((j) => Math.hypot(...j.position)), 0.1);
  const at = (f) => [f[12], f[13], f[14]];
  const t = [tool[3], tool[7], tool[11]];
  const last = found[found.length - 1];
  const tip = [0, 1, 2].map((r) => last[r] * t[0] + last[4 + r] * t[1] + last[8 + r] * t[2] + last[12 + r]);
  const places = [[0, 0, 0], ...found.map(at), tip];
  const thick = (k) => reach * (0.14 - 0.011 * k);
  const things = places.slice(1).map((b, k) => ({ a: places[k], b, radius: thick(k) * (ghost ? 1.12 : 1), colour: ghost ? GHOST : MACHINE }));
  if (ghost) return things;
  found.forEach((f, k) => {
    const [p, z] = [at(f), [f[8], f[9], f[10]].map((v) => v * thick(k) * 1.35)];
    const far = Math.min(Math.max(off[k] ?? 0, 0), 1);
    things.push({ a: sub(p, z), b: p.map((v, j) => v + z[j]), radius: thick(k) * 1.2, flat: true, colour: mix(GOOD, OFF, far) });
  });
  return things;
}

/** Rows that a difference is the mean of, radians of the ghost for all of a joint's usual torque, and the largest share. */
export const LEAN = { rows: 20, each: (50 * Math.PI) / 180, most: 0.6 };

/** By what share of its usual torque (rms of the rows that are here) each joint's measured torque exceeds the predicted one. */
export function exceeds(joints, outputs, k) {
  return joints.map(({ output }) => {
    const { residual, measured } = outputs[output] ?? { residual: [], measured: [] };
    const known = (column) => column.filter((v) => v !== null && v !== undefined);
    const newest = known(residual.slice(Math.max(0, k + 1 - LEAN.rows), k + 1));
    const all = known(measured);
    const usual = Math.sqrt(all.reduce((sum, v) => sum + v * v, 0) / all.length);
    return newest.length && usual > 0 ? newest.reduce((sum, v) => sum + v, 0) / newest.length / usual : 0;
  });
}

/**
 * Where a simulated arm goes that is let go from the measured pose and driven by the measured torques: in the direction
 * in which they exceed the predicted ones. How far depends on how long; here each joint turns by one degree for each 2 %
 * of its usual torque, so that the small joints, which little would turn round and round, are drawn as the large ones.
 */
export function leaning(joints, q, shares) {
  const reach = Math.max(...joints.map((j) => Math.hypot(...j.position)), 0.1);
  return joints.map(({ slides }, j) => q[j] + LEAN.each * Math.max(-LEAN.most, Math.min(LEAN.most, shares[j])) * (slides ? reach : 1));
}

/** A round robot seen from above, with its nose; `size` [m]. */
export function robot([x, y, heading], size, ghost = false) {
  const colour = ghost ? GHOST : MACHINE;
  const lift = ghost ? 0.01 * size : 0;
  const [c, sn] = [Math.cos(heading), Math.sin(heading)];
  return [
    { a: [x, y, lift], b: [x, y, size * 0.7 + lift], radius: size, flat: true, colour },
    { a: [x, y, size * 0.78], b: [x + c * size, y + sn * size, size * 0.78], radius: size * 0.13, colour: ghost ? GHOST : [0.2, 0.24, 0.3, 1] },
  ];
}

const WOOD = [0.62, 0.44, 0.26, 1];

/** Tables that stand in a model's places for them, which are inputs of it: four legs and the outline of a plate so high. */
export function tables(count, height, input) {
  const things = [];
  for (let k = 1; k <= count; k += 1) {
    const [x, y, heading, length, width, leg] = ["x", "y", "heading", "length", "width", "leg"].map((n) => input(`table${k}.${n}`) ?? 0);
    if (!(length > 0)) continue;
    const [c, sn] = [Math.cos(heading), Math.sin(heading)];
    const [u, v] = [length / 2 - leg, width / 2 - leg];
    const feet = [[u, v], [-u, v], [-u, -v], [u, -v]].map(([a, b]) => [x + a * c - b * sn, y + a * sn + b * c, 0]);
    const plate = feet.map(([a, b]) => [a, b, height]);
    feet.forEach((a, j) => things.push({ a, b: plate[j], radius: Math.max(leg, 0.01), flat: true, colour: WOOD }));
    things.push({ points: [...plate, plate[0]], colour: WOOD });
  }
  return things;
}
