// Lines over time on a canvas. Of many values in a pixel the least and the largest are drawn; what is
// absent is a gap. Two cursors tell values and their difference; all charts of a view share one time.

import { h } from "./dom.js";
import { clock, number, scale, trimmed } from "./words.js";

/** The time that several charts show: from `first` to `last` [s], following what is new or not. */
export class Axis extends EventTarget {
  constructor(span = 120) {
    super();
    this.span = span;
    this.last = null;
    this.follows = true;
    this.cursors = [null, null];
  }

  get first() {
    return this.last - this.span;
  }

  /** The newest time there is: shown, where the axis follows. */
  newest(t) {
    this.end = t;
    if (this.follows || this.last === null) this.last = t;
  }

  show(last, span = this.span, follows = false) {
    this.span = Math.min(Math.max(span, 0.5), 30 * 86400);
    this.last = this.end === undefined ? last : Math.min(last, this.end + this.span * 0.02);
    this.follows = follows;
    this.changed();
  }

  changed() {
    this.dispatchEvent(new Event("change"));
  }
}

/** Times and the least and largest values there, from columns of rows. */
export function fromRows(rows, column, high = column) {
  const low = column ?? [];
  return { t: rows.t, factor: 1e-9, low, high: high ?? low };
}

/** The same from pixels of a span of the past, before a time. */
export function fromPixels(span, part, before) {
  const step = (span.last - span.first) / span.width;
  const found = { t: [], factor: 1, low: [], high: [], step };
  part.pixel.forEach((pixel, k) => {
    const t = span.first + (pixel + 0.5) * step;
    if (t >= before) return;
    found.t.push(t);
    found.low.push(part.low[k]);
    found.high.push(part.high[k]);
  });
  return found;
}

/** Index of the first time that is not before `t` seconds. */
function place(times, factor, t) {
  let low = 0;
  let high = times.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] * factor < t) low = middle + 1;
    else high = middle;
  }
  return low;
}

const known = (value) => value !== null && value !== undefined && Number.isFinite(value);

/** One chart. `lines`: [{name, look, joined, parts() → [{t, factor, low, high, step}]}], drawn in order; `joined`: most rows have no value. */
export class Chart {
  constructor(axis, { title, unit, lines, zero = false, height = 150 }) {
    Object.assign(this, { axis, title, unit, lines, zero });
    this.canvas = h("canvas", { height, tabindex: 0, role: "img", "aria-label": `${title} over time` });
    this.legend = h("div", { class: "legend" });
    this.element = h("figure", { class: "chart" }, this.legend, this.canvas);
    this.canvas.style.height = `${height}px`;
    this.#listen();
  }

  get box() {
    return { left: 58, right: 8, top: 6, bottom: 18 };
  }

  draw() {
    const { canvas, axis, box } = this;
    const wide = canvas.clientWidth;
    const high = canvas.clientHeight;
    if (!wide || axis.last === null) return;
    const ratio = window.devicePixelRatio || 1;
    if (canvas.width !== Math.round(wide * ratio) || canvas.height !== Math.round(high * ratio)) {
      canvas.width = Math.round(wide * ratio);
      canvas.height = Math.round(high * ratio);
    }
    const pen = canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, wide, high);
    this.looks = getComputedStyle(canvas);
    const seen = this.lines.map((line) => this.#columns(line, wide - box.left - box.right));
    const [low, top] = this.#range(seen);
    this.x = (t) => box.left + ((t - axis.first) / axis.span) * (wide - box.left - box.right);
    this.y = (v) => box.top + ((top - v) / (top - low)) * (high - box.top - box.bottom);
    this.#grid(pen, wide, high, low, top);
    pen.save();
    pen.beginPath();
    pen.rect(box.left, 0, wide - box.left - box.right, high - box.bottom + 1);
    pen.clip();
    this.lines.forEach((line, k) => this.#line(pen, line, seen[k]));
    this.#cursors(pen, high);
    pen.restore();
    this.#tell(low, top);
  }

  /** Runs of [x, low, high] by pixel; a new run begins behind a gap. */
  #columns(line, width) {
    const { axis, box } = this;
    const runs = [];
    let run = null;
    let before = null;
    for (const part of line.parts()) {
      const { t, factor, low, high } = part;
      const from = Math.max(place(t, factor, axis.first) - 1, 0);
      const until = Math.min(place(t, factor, axis.last) + 1, t.length);
      const gap = 2.6 * Math.max(part.step ?? 0, (line.joined ? apart(low, t, from, until) : typical(t, from, until)) * factor);
      for (let k = from; k < until; k += 1) {
        if (!known(low[k]) || !known(high[k])) {
          if (!part.step && !line.joined) run = null;
          continue;
        }
        const at = t[k] * factor;
        if (run && (at - before > gap || this.#turns(run, low[k]))) run = null;
        before = at;
        const x = box.left + Math.round(((at - axis.first) / axis.span) * width * 2) / 2;
        const end = run && run[run.length - 1];
        if (end && end[0] === x) {
          end[1] = Math.min(end[1], low[k]);
          end[2] = Math.max(end[2], high[k]);
        } else {
          if (!run) runs.push((run = []));
          run.push([x, low[k], high[k]]);
        }
      }
    }
    return runs;
  }

  /** Does an angle begin anew? From +180° to −180° there is no line. */
  #turns(run, value) {
    return this.unit === "rad" && Math.abs(value - run[run.length - 1][2]) > Math.PI;
  }

  #range(seen) {
    let low = this.zero ? 0 : Infinity;
    let top = this.zero ? 0 : -Infinity;
    const span = (runs) => runs.forEach((run) => run.forEach(([, a, b]) => {
      low = Math.min(low, a);
      top = Math.max(top, b);
    }));
    this.lines.forEach((line, k) => line.look !== "band" && span(seen[k]));
    if (low > top) this.lines.forEach((line, k) => span(seen[k]));
    if (low > top) return [0, 1];
    const room = (top - low) * 0.08 || Math.abs(top) * 0.1 || 1e-9;
    return [low - room, top + room];
  }

  #grid(pen, wide, high, low, top) {
    const { axis, box, looks } = this;
    const [factor, name] = scale(this.unit, Math.max(Math.abs(low), Math.abs(top)));
    const from = this.unit?.from ?? 0;
    this.factor = factor;
    this.unitName = name;
    pen.font = "11px system-ui, sans-serif";
    pen.lineWidth = 1;
    pen.strokeStyle = looks.getPropertyValue("--line");
    pen.fillStyle = looks.getPropertyValue("--quiet");
    pen.textAlign = "right";
    for (const value of ticks((low - from) / factor, (top - from) / factor, Math.max(3, Math.floor(high / 26)))) {
      const y = Math.round(this.y(value * factor + from)) + 0.5;
      stroke(pen, [[box.left, y], [wide - box.right, y]]);
      pen.fillText(trimmed(value), box.left - 5, y + 4);
    }
    pen.textAlign = "center";
    const step = timeStep(axis.span / Math.max(3, wide / 110));
    for (let t = Math.ceil(axis.first / step) * step; t <= axis.last; t += step) {
      const x = this.x(t);
      if (x < box.left + 24 || x > wide - 26) continue;
      stroke(pen, [[Math.round(x) + 0.5, box.top], [Math.round(x) + 0.5, high - box.bottom]]);
      pen.fillText(clock(t * 1e9, step >= 86400), x, high - 5);
    }
  }

  #line(pen, line, runs) {
    const colour = this.looks.getPropertyValue(`--${line.look}`);
    pen.strokeStyle = pen.fillStyle = colour;
    if (line.look === "band") {
      for (const run of runs) {
        pen.beginPath();
        run.forEach(([x, , b], k) => pen[k ? "lineTo" : "moveTo"](x, this.y(b)));
        [...run].reverse().forEach(([x, a]) => pen.lineTo(x, this.y(a)));
        pen.fill();
      }
      return;
    }
    if (line.look === "refused") {
      for (const [x, , b] of runs.flat()) cross(pen, x, this.y(b));
      return;
    }
    pen.lineWidth = 1.5;
    pen.setLineDash(line.dashed ? [5, 3] : []);
    for (const run of runs) {
      pen.beginPath();
      run.forEach(([x, a, b], k) => {
        pen[k ? "lineTo" : "moveTo"](x, this.y(b));
        if (a !== b) pen.lineTo(x, this.y(a));
      });
      if (run.length === 1) pen.arc(run[0][0], this.y(run[0][1]), 1.5, 0, 7);
      pen.stroke();
    }
    pen.setLineDash([]);
  }

  #cursors(pen, high) {
    this.axis.cursors.forEach((t, k) => {
      if (t === null) return;
      pen.strokeStyle = pen.fillStyle = this.looks.getPropertyValue("--text");
      pen.setLineDash(k ? [2, 3] : []);
      const x = this.x(t);
      stroke(pen, [[x, 0], [x, high]]);
      pen.fillText("AB"[k], x + 8, 14);
      pen.setLineDash([]);
    });
  }

  /** The value of a line at a time: of the nearest that is known, within three steps. */
  at(line, t) {
    let best = null;
    for (const { t: times, factor, low, high, step } of line.parts()) {
      const k = place(times, factor, t);
      for (const j of [k - 1, k]) {
        if (j < 0 || j >= times.length || !known(low[j])) continue;
        const away = Math.abs(times[j] * factor - t);
        const near = 3 * Math.max(step ?? 0, typical(times, Math.max(j - 5, 0), j + 5) * factor);
        if (away <= near && (!best || away < best[0])) best = [away, (low[j] + high[j]) / 2];
      }
    }
    return best ? best[1] : null;
  }

  #tell() {
    const [a, b] = this.axis.cursors;
    const from = this.unit?.from ?? 0;
    const say = (v) => (v === null ? "–" : `${number((v - from) / this.factor)} ${this.unitName}`.trim());
    const parts = this.lines.filter((line) => line.name).map((line) => {
      const one = h("span", { class: `key ${line.look}${line.dashed ? " dashed" : ""}` }, line.name);
      if (a === null) return one;
      const [va, vb] = [this.at(line, a), b === null ? null : this.at(line, b)];
      const both = b === null ? say(va) : `A ${say(va)}  B ${say(vb)}  B−A ${va === null || vb === null ? "–" : say(vb - va + from)}`;
      return [one, h("output", {}, both)];
    });
    const text = [this.title, this.unitName, ...this.axis.cursors].join();
    const told = parts.flat().map((one) => one.textContent).join() + text;
    if (told === this.told) return;
    this.told = told;
    this.legend.replaceChildren(h("b", {}, this.title), h("span", { class: "quiet" }, this.unitName ? `[${this.unitName}]` : ""), ...parts.flat());
  }

  #listen() {
    const { canvas, axis } = this;
    const timeAt = (x) => axis.first + ((x - this.box.left) / (canvas.clientWidth - this.box.left - this.box.right)) * axis.span;
    let held = null;
    canvas.addEventListener("pointerdown", (e) => {
      held = { x: e.offsetX, last: axis.last, moved: false };
      canvas.setPointerCapture(e.pointerId);
    });
    canvas.addEventListener("pointermove", (e) => {
      if (!held || (Math.abs(e.offsetX - held.x) < 4 && !held.moved)) return;
      held.moved = true;
      axis.show(held.last - ((e.offsetX - held.x) / (canvas.clientWidth - 66)) * axis.span);
    });
    canvas.addEventListener("pointerup", (e) => {
      if (held && !held.moved) this.#set(e.shiftKey ? 1 : 0, timeAt(e.offsetX));
      held = null;
    });
    canvas.addEventListener("pointercancel", () => (held = null));
    canvas.addEventListener("wheel", (e) => {
      if (!e.ctrlKey && !e.altKey && document.activeElement !== canvas) return;
      e.preventDefault();
      const t = timeAt(e.offsetX);
      const span = axis.span * Math.exp(e.deltaY * 0.002);
      axis.show(t + (axis.last - t) * (span / axis.span), span);
    }, { passive: false });
    canvas.addEventListener("keydown", (e) => this.#key(e));
  }

  #set(which, t) {
    this.axis.cursors[which] = t;
    this.axis.changed();
  }

  #key(e) {
    const { axis } = this;
    const step = axis.span / (e.ctrlKey ? 20 : 200);
    const which = e.shiftKey ? 1 : 0;
    const move = { ArrowLeft: -1, ArrowRight: 1 }[e.key];
    if (move) this.#set(which, (axis.cursors[which] ?? axis.last - axis.span / 2) + move * step);
    else if (e.key === "Escape") {
      axis.cursors = [null, null];
      axis.changed();
    } else if (e.key === "+" || e.key === "-") axis.show(axis.last, axis.span * (e.key === "+" ? 0.7 : 1.4), axis.follows);
    else return;
    e.preventDefault();
  }
}

function typical(t, from, until) {
  const n = Math.min(until, t.length) - from;
  return n > 1 ? (t[from + n - 1] - t[from]) / (n - 1) : Infinity;
}

/** The same of the values that are known. */
function apart(column, t, from, until) {
  const times = [];
  for (let k = from; k < until; k += 1) if (known(column[k])) times.push(t[k]);
  return typical(times, 0, times.length);
}

function stroke(pen, points) {
  pen.beginPath();
  points.forEach(([x, y], k) => pen[k ? "lineTo" : "moveTo"](x, y));
  pen.stroke();
}

function cross(pen, x, y) {
  stroke(pen, [[x - 4, y - 4], [x + 4, y + 4]]);
  stroke(pen, [[x - 4, y + 4], [x + 4, y - 4]]);
}

function ticks(low, high, most) {
  const raw = (high - low) / most;
  const ten = 10 ** Math.floor(Math.log10(raw));
  const steps = [0.5, 1, 2, 5, 10].map((k) => k * ten);
  const at = (step) => {
    const found = [];
    for (let v = Math.ceil(low / step) * step; v <= high; v += step) found.push(Math.abs(v) < step / 1e6 ? 0 : v);
    return found;
  };
  const usual = steps.findIndex((one) => one >= raw);
  const found = at(steps[usual]);
  return found.length < 3 ? at(steps[usual - 1]) : found; // one line alone tells no scale
}

const STEPS = [0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 21600, 43200, 86400, 604800];
const timeStep = (least) => STEPS.find((step) => step >= least) ?? 2592000;
