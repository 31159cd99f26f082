// One twin as it runs: the verdict, the machine beside its ghost, signals over time, the service's log.

import { Axis, Chart, fromPixels, fromRows } from "../chart.js";
import { h, put, renew, table } from "../dom.js";
import { arm, exceeds, floor, leaning, robot, Scene, tables } from "../scene.js";
import { verdict } from "../verdict.js";
import { age, clock, number, levelOf, parted, quantity, trimmed, unitOf } from "../words.js";
import { ask, asKnown, of } from "../wire.js";

const SPANS = [["30 s", 30], ["2 min", 120], ["10 min", 600], ["1 h", 3600], ["8 h", 28800]];
const FRAME = 100;
/** What became of a measurement (`update`): the simulation took it over. */
const TAKEN = [1, 3];
/** Share of its usual torque from which a joint is red. */
const RED = 0.2;
const kept = new Map();

export function open({ twin, context }) {
  const memory = kept.get(twin) ?? { axis: new Axis(), chosen: null };
  kept.set(twin, memory);
  return new Live(twin, context, memory);
}

class Live {
  constructor(twin, context, memory) {
    Object.assign(this, { twin, context, memory, axis: memory.axis, charts: [], past: null, about: null });
    this.head = h("div");
    this.choice = h("fieldset", { class: "choices" });
    this.pictures = h("div");
    this.pause = h("button", { type: "button", id: "pause", onclick: () => this.follow(!this.axis.follows) }, "Pause");
    this.at = h("span", { class: "quiet", id: "at" });
    this.solid = h("div", { class: "card" }, h("p", { class: "quiet" }, "…"));
    this.values = h("div", { class: "card newest" });
    this.log = new Log(twin);
    this.element = h("div", {}, this.head, h("div", { class: "columns" },
      h("section", { class: "card", "aria-label": "Signals over time" }, this.#controls(), this.choice, this.pictures,
        h("p", { class: "quiet" }, h("small", {}, "Drag: back in time. Click: cursor A; with Shift: B. Keys on a chart: arrows, + and −, Escape."))),
      h("div", {}, this.solid, this.values)), this.log.element);
    this.moved = () => this.#look();
    this.heard = () => (this.fresh = true);
    this.axis.addEventListener("change", this.moved);
    context.feed.addEventListener("rows", this.heard);
    context.feed.addEventListener("events", (this.said = () => this.#about()));
    this.timer = setInterval(() => this.#frame(), FRAME);
    this.#about();
    this.#scene();
  }

  close() {
    clearInterval(this.timer);
    this.log.close();
    this.axis.removeEventListener("change", this.moved);
    this.context.feed?.removeEventListener("rows", this.heard);
    this.context.feed?.removeEventListener("events", this.said);
  }

  redraw() {
    for (const chart of this.charts) chart.draw();
    this.scene?.draw();
  }

  update() {
    if (this.context.silent) this.#head();
    else if (Date.now() - (this.asked ?? 0) > 4000) this.#about();
    if (this.context.feed?.rows.t.length) this.#newest(this.context.feed.rows);
    if (!this.context.silent) this.log.update();
  }

  #controls() {
    const back = (share) => () => this.axis.show(this.axis.last - share * this.axis.span);
    const span = h("select", { id: "span", "aria-label": "Time that is shown", onchange: (e) => this.axis.show(this.axis.last, Number(e.target.value), this.axis.follows) },
      SPANS.map(([name, value]) => h("option", { value: String(value), selected: value === this.axis.span }, name)));
    return h("div", { class: "row" }, this.pause, h("button", { type: "button", id: "back", onclick: back(0.5) }, "◀ Back"),
      h("button", { type: "button", id: "on", onclick: back(-0.5) }, "Forward ▶"), span, this.at);
  }

  follow(follows) {
    this.axis.follows = follows;
    if (follows && this.axis.end !== undefined) this.axis.last = this.axis.end;
    this.axis.changed();
  }

  async #about() {
    if (this.asking) return;
    this.asking = true;
    this.asked = Date.now();
    try {
      this.about = await ask(of(this.twin));
      this.#head();
      if (this.about.outputs && !this.charts.length) {
        this.#choose();
        if (!this.looks) this.#scene(); // it was asked for while the twin was starting
      }
    } catch (error) {
      if (!this.about) put(this.head, h("p", {}, error.message));
    }
    this.asking = false;
  }

  /** What came of it, as far as it is known now. */
  #head() {
    if (!this.about) return;
    const about = asKnown(this.about);
    const drawn = JSON.stringify([about.state, about.headline, about.condition, about.why, about.champion, about.figures, about.trial, about.label, about.stale, about.judged, about.alarm, about.returned, about.refused, this.context.feed?.cursor]);
    const waits = this.context.feed?.cursor === null && about.state !== "starting";
    if (waits) this.asked = 0; // how it went live is not known yet
    else if (drawn !== this.drawn) put(this.head, verdict(about, this.context.feed?.events ?? []));
    if (this.context.feed?.cursor !== null) this.drawn = drawn;
  }

  #choose() {
    const names = this.about.outputs.map((one) => one.name);
    this.memory.chosen ??= names.slice(0, 3);
    const box = (name) => h("label", {}, h("input", { type: "checkbox", checked: this.memory.chosen.includes(name), onchange: (e) => {
      this.memory.chosen = names.filter((one) => (one === name ? e.target.checked : this.memory.chosen.includes(one)));
      this.#build();
    } }), name);
    put(this.choice, h("legend", { class: "quiet" }, "Signals"), names.map(box));
    this.#build();
  }

  #build() {
    const [unit, level] = [unitOf, levelOf].map((of) => Object.fromEntries(this.about.outputs.map((one) => [one.name, of(one)])));
    this.past = null;
    this.charts = this.memory.chosen.flatMap((name) => {
      const line = (key, look, title, more = {}) => ({ name: title, look, parts: () => this.#parts(name, key), ...more });
      return [
        new Chart(this.axis, { title: name, unit: level[name], lines: [
          line("band", "band", "band (±2 σ)"), line("measured", "measured", "measured"),
          line("predicted", "predicted", "predicted", { dashed: true }), line("refused", "refused", "refused")] }),
        new Chart(this.axis, { title: `${name}: off by`, unit: unit[name], zero: true, height: 80, lines: this.#off(name, line) }),
      ];
    });
    put(this.pictures, this.charts.map((one) => one.element));
    this.#look();
  }

  /** What predictions are off by when they reach the horizon, as the figures have it, and what is asked. */
  #off(name, line) {
    const { asked, horizon, judges } = this.about;
    const lead = horizon > 0 ? `predicted ${trimmed(horizon)} s ahead` : "measured less predicted";
    const edge = (side) => () => [{ t: [this.axis.first, this.axis.last], factor: 1, low: [side * asked, side * asked], high: [side * asked, side * asked], step: this.axis.span }];
    const edges = asked > 0 && judges?.includes(name) ? [{ name: "asked (rms)", look: "quiet", dashed: true, parts: edge(1) }, { look: "quiet", dashed: true, parts: edge(-1) }] : [];
    return [line("off", "residual", lead, { joined: true }), ...edges];
  }

  /** What a line is drawn from: the store's past, then the rows that are here. */
  #parts(name, key) {
    const rows = this.context.feed.rows;
    const held = rows.outputs[name];
    const oldest = rows.t.length ? rows.t[0] * 1e-9 : Infinity;
    const parts = [];
    const past = this.past?.signals[name];
    if (past?.[key]) parts.push(fromPixels(this.past, past[key], oldest));
    if (!held) return parts;
    if (key === "band") {
      const edge = (side) => held.predicted.map((p, k) => (p === null || held.sigma[k] === null ? null : p + side * 2 * held.sigma[k]));
      if (this.bandOf !== rows.newest) {
        this.bandOf = rows.newest;
        this.bands = {};
      }
      const [low, high] = (this.bands[name] ??= [edge(-1), edge(1)]);
      parts.push(fromRows(rows, low, high));
    } else if (key === "refused") {
      const marks = held.mark.some((m) => m >= 4) ? held.measured.map((v, k) => (held.mark[k] >= 4 ? v : null)) : [];
      parts.push(fromRows(rows, marks));
    } else parts.push(fromRows(rows, held[key]));
    return parts;
  }

  /** The past that is looked at and not here is asked for, once, with room to either side. */
  async #look() {
    this.redraw();
    put(this.pause, this.axis.follows ? "Pause" : "Follow again");
    this.pause.setAttribute("aria-pressed", String(!this.axis.follows));
    const rows = this.context.feed?.rows;
    if (!rows?.t.length || !this.memory.chosen?.length || this.axis.last === null) return;
    const oldest = rows.t[0] * 1e-9;
    const { first, span } = this.axis;
    const past = this.past;
    const covered = past && past.first <= first && past.last >= Math.min(this.axis.last, oldest - 1e-6) && past.scale <= span * 1.5 && past.scale >= span / 1.5;
    if (first >= oldest || covered || this.looking) return;
    this.looking = true;
    try {
      const [from, to] = [first - span, Math.min(this.axis.last + span, oldest)];
      const width = Math.min(4096, Math.max(Math.round(((to - from) / span) * this.pictures.clientWidth), 1));
      const signals = this.memory.chosen.map((name) => `&signal=${encodeURIComponent(name)}`).join("");
      const found = await ask(of(this.twin, `/history?first=${from}&last=${to}&width=${width}${signals}`));
      this.past = { ...found, scale: span };
    } catch (error) {
      put(this.at, error.message);
    }
    this.looking = false;
    this.redraw();
  }

  #frame() {
    if (!this.fresh || document.hidden) return;
    this.fresh = false;
    const rows = this.context.feed.rows;
    if (!rows.t.length) return;
    const newest = rows.t[rows.t.length - 1];
    this.axis.newest(newest * 1e-9);
    this.#newest(rows);
    if (this.axis.follows || !this.past) this.#look();
    this.#pose(rows);
  }

  #newest(rows) {
    const stale = this.context.silent || this.about?.stale;
    put(this.at, `${!this.axis.follows ? "stopped at" : stale ? "STALE, newest" : "live, machine's clock"} ${clock(this.axis.last * 1e9, true)}`);
    this.#values(rows);
  }

  #values(rows) {
    const k = rows.t.length - 1;
    const last = (column) => column?.[k] ?? null;
    const lines = (this.about?.outputs ?? []).map((output) => {
      const [name, unit, level] = [output.name, unitOf(output), levelOf(output)];
      const one = rows.outputs[name];
      const size = last(one?.measured) ?? last(one?.predicted) ?? 0;
      return [name, ...[quantity(last(one?.measured), level, size), quantity(last(one?.predicted), level, size), quantity(last(one?.residual), unit)].map(parted)];
    });
    const old = this.context.twins.find((one) => one.name === this.twin)?.age ?? null;
    renew(this.values, table(`Newest row (${rows.newest}), ${age(old)}${old >= 1 ? " old" : ""}`, ["", "measured", "predicted", "off by"], lines));
  }

  async #scene() {
    try {
      this.looks = await ask(of(this.twin, "/scene"));
    } catch (error) {
      return put(this.solid, h("p", { class: "quiet" }, error.message));
    }
    const said = {
      arm: "Solid: at the measured angles; a joint goes from green to red as its torque differs from the predicted one. Ghost: where the simulated arm goes from there with the measured torques, one degree for each 2 % of a joint's usual torque (mean of the newest 20 rows). While both agree it stands in the machine.",
      base: "Solid: as measured. Ghost: as simulated. Line: the path. Crosses: the simulation, by the live version, took over the measured pose.",
      line: "Solid: as measured. Ghost: as simulated. Line: the path. Crosses: the simulation, by the live version, took over the measured place.",
      none: "This model does not say what its machine looks like.",
    }[this.looks.kind];
    const stand = this.looks.tables ? " Tables: where the scans tell; the simulated machine meets them, too." : "";
    if (this.looks.kind === "none") return put(this.solid, h("p", { class: "quiet" }, said));
    const big = this.looks.kind === "arm";
    const reach = big ? this.looks.joints.reduce((sum, one) => sum + Math.hypot(...one.position), 0) : 0;
    this.scene = new Scene({ centre: [0, 0, 0.3 * reach], distance: big ? 1.5 * reach : 9, tilt: big ? 0.3 : 1.1, turn: big ? -0.7 : 0, label: `${this.twin}: the machine and its simulated ghost; arrow keys turn it` });
    this.leans = h("p", { class: "quiet", id: "leans" });
    put(this.solid, h("h2", {}, "Machine and ghost"), this.scene.canvas, big && this.leans, h("p", { class: "quiet" }, h("small", {}, said + stand)));
    this.fresh = true;
    return undefined;
  }

  #pose(rows) {
    if (!this.scene) return;
    const k = rows.t.length - 1;
    if (this.looks.kind === "arm") {
      const { joints, tool } = this.looks;
      const q = joints.map((one) => rows.inputs[one.input]?.[k] ?? 0);
      const shares = exceeds(joints, rows.outputs, k);
      const most = shares.reduce((a, b, j) => (Math.abs(b) > Math.abs(shares[a]) ? j : a), 0);
      const percent = `${number(Math.abs(100 * shares[most]))} % of its usual torque ${shares[most] > 0 ? "above" : "below"} what is predicted`;
      put(this.leans, Math.abs(shares[most]) < 0.02 ? "Ghost: in the machine; no torque differs by 2 %." : `Ghost: turned most by ${joints[most].output}: ${percent}.`);
      const off = shares.map((v) => Math.abs(v) / RED);
      const simulated = leaning(joints, q, shares);
      return this.scene.draw([floor(1, 0.25), ...arm(joints, tool, q, off), ...arm(joints, tool, simulated, [], true)]);
    }
    const pose = (key, j) => ["x", "y", "heading"].map((name) => (this.looks.pose.includes(name) ? rows.outputs[name]?.[key][j] : 0));
    const known = (p) => p.every((v) => v !== null && v !== undefined);
    const from = Math.max(0, k - 1500);
    const path = { points: [], colour: [0.3, 0.5, 0.9, 1] };
    const adopted = { points: [], apart: true, colour: [0.85, 0.2, 0.1, 1] };
    for (let j = from; j <= k; j += 1) {
      const [m, p] = [pose("measured", j), pose("predicted", j)];
      if (known(m)) path.points.push([m[0], m[1], 0.02]);
      if (!known(m) || !known(p) || rows.version[j] !== rows.version[k] || !TAKEN.includes(rows.outputs.x.update[j])) continue;
      const e = Math.max(0.06, 0.006 * this.scene.distance);
      adopted.points.push([m[0] - e, m[1] - e, 0.04], [m[0] + e, m[1] + e, 0.04], [m[0] - e, m[1] + e, 0.04], [m[0] + e, m[1] - e, 0.04]);
    }
    const [low, high] = [0, 1].map((axis) => path.points.map((p) => p[axis])).map((v) => [Math.min(...v), Math.max(...v)]);
    if (path.points.length) {
      this.scene.centre = [(low[0] + low[1]) / 2, (high[0] + high[1]) / 2, 0];
      this.scene.distance = Math.max(this.scene.distance, 1.9 * Math.max(low[1] - low[0], high[1] - high[0]), 3);
    }
    const step = 10 ** Math.floor(Math.log10(Math.max(this.scene.distance / 5, 1))); // a grid, not a grey plane
    const size = Math.max(0.25, 0.025 * this.scene.distance); // it is seen beside a long path, too
    const things = [floor(step * Math.ceil(this.scene.distance / 3 / step), step, this.scene.centre.map((v) => step * Math.round(v / step))), path, adopted,
      ...tables(this.looks.tables, this.looks.height, (name) => rows.inputs[name]?.[k])];
    const [m, p] = [pose("measured", k), pose("predicted", k)];
    if (known(m)) things.push(...robot(m, size));
    if (known(p)) things.push(...robot(p, 1.12 * size, true));
    this.scene.draw(things.filter((one) => !one.points || one.points.length));
    return undefined;
  }
}

/** The service's log, in a pane that is asked for only while it is open. */
class Log {
  constructor(twin) {
    this.newest = 0;
    this.twin = twin;
    this.text = h("div", { class: "log", role: "log", tabindex: 0, "aria-label": "Lines of the log" });
    this.box = h("details", { class: "card", open: true }, h("summary", {}, "Log of the service"), this.text);
    this.element = this.box;
    this.update();
  }

  close() {
    this.ended = true;
  }

  async update() {
    if (!this.box.open || this.asking || this.ended) return;
    this.asking = true;
    try {
      const lines = await ask(`/api/v1/log?after=${this.newest}`);
      const end = this.text.scrollTop + this.text.clientHeight > this.text.scrollHeight - 30;
      for (const line of lines.slice(-300)) {
        this.text.append(h("div", { class: line.level }, `${clock(line.time * 1e9)}  ${line.message}`));
      }
      if (lines.length) this.newest = lines[lines.length - 1].number;
      while (this.text.children.length > 300) this.text.firstChild.remove();
      if (end) this.text.scrollTop = this.text.scrollHeight;
    } catch {
      this.newest = 0; // another process: its log begins anew
      put(this.text);
    }
    this.asking = false;
  }
}

