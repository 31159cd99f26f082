// What was learned: the sentence, before and after on one axis, parameters, versions, the open trial.

import { Axis, Chart, fromPixels, fromRows } from "../chart.js";
import { action, field, h, put, s, table } from "../dom.js";
import { gains, less, verdict } from "../verdict.js";
import { clock, count, number, levelOf, quantity, scale, trimmed, unitOf } from "../words.js";
import { ask, asKnown, of } from "../wire.js";

const SPAN = 120;

export function open({ twin, context }) {
  const parts = { head: h("div"), picture: h("section", { class: "card" }), rivals: h("section", { class: "card", id: "rivals" }), trial: h("section", { class: "card" }), found: h("section", { class: "card" }), versions: h("section", { class: "card" }) };
  const lived = h("div");
  const form = orders(twin, context);
  const beside = rivals(twin);
  let drawn = "";
  let asked = 0;
  let charts = [];
  let newest = null;

  async function look() {
    asked = Date.now();
    try {
      newest = await ask(of(twin));
    } catch (error) {
      return newest ?? put(parts.head, h("p", {}, error.message));
    }
    return show();
  }

  const head = (about, events) => put(parts.head, verdict(about, events), about.headline && h("p", { class: "card lead", id: "headline" }, about.headline));

  /** While the service says nothing, what it said last is stale. */
  function aged() {
    drawn = "";
    if (newest) head(asKnown(newest), context.feed?.events ?? []);
  }

  async function show() {
    const about = newest;
    const events = context.feed?.events ?? [];
    if (context.feed?.cursor === null) return setTimeout(look, 300); // how it went live is not known yet
    const key = JSON.stringify([about.champion, about.pinned, about.versions?.length, about.trial, about.figures, events.length, about.condition, about.stale, about.why, about.judged, about.alarm, about.returned, about.refused]);
    if (key === drawn) return undefined;
    drawn = key;
    head(about, events);
    put(parts.trial, trial(about));
    put(parts.found, parameters(about), translation(about, events));
    put(lived, versions(events));
    form.show(about, events);
    beside.show(about);
    if (!parts.rivals.childElementCount && about.versions.length > 1) put(parts.rivals, beside.element);
    parts.rivals.hidden = about.versions.length < 2;
    if (!parts.versions.childElementCount) put(parts.versions, lived, what(about, twin), form.element);
    if (!charts.length) await picture(about);
    return undefined;
  }

  /** Measured, by the first version and by the live one, on the same rows. */
  async function picture(about) {
    const name = (gains(about)[0] ?? {}).name ?? about.outputs?.[0]?.name;
    const newest = context.feed?.rows.t.at(-1);
    if (!name || !newest) return;
    const axis = new Axis(SPAN);
    axis.newest(newest * 1e-9);
    const past = await ask(of(twin, `/history?first=${axis.first}&last=${axis.last}&width=1200&signal=${encodeURIComponent(name)}`));
    const part = (key) => () => [fromPixels(past, past.signals[name][key], Infinity)];
    const output = about.outputs?.find((one) => one.name === name) ?? { unit: "1" };
    const before = difference(past, name, "before");
    const lines = [{ name: "measured", look: "measured", parts: part("measured") }];
    if (about.champion) lines.push({ name: "before: by the first version", look: "before", parts: part("before") });
    lines.push({ name: "now: by the live version", look: "predicted", dashed: true, parts: part("predicted") });
    const off = [{ name: "now", look: "predicted", parts: part("residual") }];
    if (about.champion) off.unshift({ name: "before", look: "before", parts: () => [before] });
    charts = [new Chart(axis, { title: name, unit: levelOf(output), lines, height: 190 }), new Chart(axis, { title: `${name}: off by`, unit: unitOf(output), zero: true, height: 120, lines: off })];
    axis.addEventListener("change", redraw);
    put(parts.picture, h("h2", {}, "Before and now, on the same rows"), charts.map((one) => one.element));
    redraw();
  }

  const redraw = () => {
    charts.forEach((one) => one.draw());
    beside.redraw();
  };
  const rows = () => !charts.length && look();
  context.feed?.addEventListener("rows", rows);
  look();
  return {
    element: h("div", {}, parts.head, parts.picture, parts.rivals, h("div", { class: "columns" }, parts.found, h("div", {}, parts.trial, parts.versions))),
    update: () => (context.silent ? aged() : Date.now() - asked > 2000 && look()), redraw, close: () => context.feed?.removeEventListener("rows", rows),
  };
}

/** Any two versions over the newest rows: on one axis, and run against run. */
function rivals(twin) {
  const [one, other, output] = ["a", "b", "output"].map((id) => h("select", { id: `rival-${id}` }));
  const body = h("div");
  let charts = [];
  let outputs = [];
  let asked = false;

  async function compare() {
    const found = await ask(of(twin, `/compare?a=${one.value}&b=${other.value}&signal=${encodeURIComponent(output.value)}`));
    const shown = outputs.find((each) => each.name === found.signal) ?? { unit: found.units[found.signal] };
    const unit = unitOf(shown);
    const axis = new Axis(Math.min(SPAN, (found.t.at(-1) - found.t[0]) * 1e-9));
    axis.newest(found.t.at(-1) * 1e-9);
    const line = (name, look, column, more = {}) => ({ name, look, parts: () => [fromRows(found, column)], ...more });
    const [a, b] = [`version ${found.a}`, `version ${found.b}`];
    charts = [
      new Chart(axis, { title: found.signal, unit: levelOf(shown), height: 170, lines: [line("measured", "measured", found.measured), line(a, "before", found.predicted[0]), line(b, "predicted", found.predicted[1], { dashed: true })] }),
      new Chart(axis, { title: `${found.signal}: off by`, unit, zero: true, height: 130, lines: [line(a, "before", found.residual[0]), line(b, "predicted", found.residual[1])] }),
    ];
    axis.addEventListener("change", () => charts.forEach((each) => each.draw()));
    put(body, charts.map((each) => each.element), h("p", {}, `Version ${found.b} is nearer at ${number(100 * found.better)} % of ${count(found.t.length, "row")}, each over the same rows.`), runs(found, unit));
    charts.forEach((each) => each.draw());
    return `until ${clock(found.t.at(-1), true)}`;
  }

  const button = action("Compare", compare, { id: "compare" });
  const element = h("div", {}, h("h2", {}, "Version against version"), h("div", { class: "row" }, field("Version", one), field("against version", other), field("Output", output), button), body);
  return { element, redraw: () => charts.forEach((each) => each.draw()), show: (about) => {
    outputs = about.outputs;
    const numbers = about.versions.map((each) => each.number);
    for (const [box, mine] of [[one, about.trial ? about.champion : 0], [other, about.trial?.version ?? (about.champion || numbers.at(-1))]]) {
      for (const number of numbers.slice(box.options.length)) box.append(h("option", { value: String(number) }, `${number}${number === 0 ? ", as configured" : ""}`));
      if (!asked) box.value = String(mine);
    }
    for (const each of about.outputs.slice(output.options.length)) output.append(h("option", { value: each.name }, each.name));
    asked = numbers.length > 1;
  } };
}

/** What each run was off by, by both versions. */
function runs(found, unit) {
  const name = found.signal;
  const size = Math.max(...found.runs.flatMap((run) => run.rms[name].filter((v) => v !== null)), 0) || 1;
  const said = (v) => (v === null ? "not measured" : h("span", { class: "measure" }, s("svg", { class: "share", viewBox: "0 0 100 10", preserveAspectRatio: "none", "aria-hidden": "true" }, s("rect", { width: 100, height: 10, class: "all" }), s("rect", { width: (100 * v) / size, height: 10 })), quantity(v, unit, size)));
  return table(`Run against run, ${clock(found.t[0], true)} to ${clock(found.t.at(-1), true)}: rms of what ${name} is off by`, ["run", `version ${found.a}`, `version ${found.b}`, "change", "rows"], found.runs.map((run) => {
    const [a, b] = run.rms[name];
    const less = a && b !== null ? 100 * (1 - b / a) : null;
    return [`${clock(run.first, new Date(run.first / 1e6).toDateString() !== new Date(run.last / 1e6).toDateString())} to ${clock(run.last)}`, said(a), said(b), less === null ? "–" : `${number(Math.abs(less), 2)} % ${less >= 0 ? "less" : "more"}`, String(run.rows)];
  }));
}

/** Measured less predicted, pixel by pixel where both are known. */
function difference(past, name, key) {
  const { measured, [key]: told } = past.signals[name];
  const at = new Map(told.pixel.map((pixel, k) => [pixel, (told.low[k] + told.high[k]) / 2]));
  const both = { pixel: [], low: [], high: [] };
  measured.pixel.forEach((pixel, k) => {
    if (!at.has(pixel)) return;
    both.pixel.push(pixel);
    both.low.push(measured.low[k] - at.get(pixel));
    both.high.push(measured.high[k] - at.get(pixel));
  });
  return fromPixels(past, both, Infinity);
}

function parameters(about) {
  const known = (about.parameters ?? []).filter((one) => one.interval95 || one.verdict || one.learned);
  const rest = (about.parameters ?? []).filter((one) => !known.includes(one));
  const cells = (one) => {
    const [low, high] = one.interval95 ?? [null, null];
    const weak = one.verdict && one.verdict !== "identifiable";
    return [one.name, quantity(one.value, one.unit), low === null ? "–" : `${quantity(low, one.unit, one.value)} to ${quantity(high, one.unit, one.value)}`,
      interval(one, weak), h("span", { class: `tag ${weak ? "weak" : one.verdict ? "good" : ""}` }, one.verdict === "identifiable" ? "well known" : (one.verdict ?? "not weighed"))];
  };
  return [h("h2", {}, "What was found"), known.length ? table("Numbers that were learned, with 95 % intervals", ["", "value", "between", "", "known how well"], known.map(cells)) : h("p", {}, "Nothing was tuned yet."),
    rest.length > 0 && h("details", {}, h("summary", {}, `${rest.length} as configured`), table("As configured", ["", "value"], rest.map((one) => [one.name, quantity(one.value, one.unit)])))];
}

function interval({ value, interval95 }, weak) {
  const [low, high] = interval95 ?? [];
  if (!Number.isFinite(low) || !Number.isFinite(high)) return "";
  const reach = Math.max(Math.abs(low), Math.abs(high), Math.abs(value)) * 1.1 || 1;
  const from = Math.min(0, low * 1.1);
  const x = (v) => 4 + ((v - from) / (reach - from)) * 132;
  return s("svg", { class: `interval${weak ? " weak" : ""}`, viewBox: "0 0 140 16", "aria-hidden": "true" },
    s("line", { x1: x(low), x2: x(high), y1: 8, y2: 8 }), s("line", { x1: x(low), x2: x(low), y1: 3, y2: 13 }), s("line", { x1: x(high), x2: x(high), y1: 3, y2: 13 }), s("circle", { cx: x(value), cy: 8, r: 3 }));
}

/** Commanded along, done upwards, beside the line of a machine that does as it is told. */
function pattern(told, unit, size) {
  const known = told.levels.map((level, k) => [level, told.values[k], told.learned[k]]);
  const [factor, name] = scale(unit, size);
  const all = known.flatMap(([level, done, learned]) => (learned ? [level, done] : [level]));
  const [low, high] = [Math.min(...all), Math.max(...all)];
  const place = (v) => (v - low) / (high - low || 1);
  const [x, y] = [(v) => 46 + 244 * place(v), (v) => 208 - 196 * place(v)];
  const text = (v) => trimmed(v / factor);
  const edges = [low, (low + high) / 2, high];
  return h("figure", { class: "pattern" }, s("svg", { viewBox: "0 0 300 250", role: "img", "aria-label": `Translation table of ${told.channel}: done over commanded` },
    edges.map((v) => [s("line", { class: "rule", x1: 46, x2: 290, y1: y(v), y2: y(v) }), s("text", { x: 42, y: y(v) + 4, "text-anchor": "end" }, text(v)), s("line", { class: "rule", x1: x(v), x2: x(v), y1: 12, y2: 208 }), s("text", { x: x(v), y: 223, "text-anchor": "middle" }, text(v))]),
    s("line", { class: "told", x1: x(low), y1: y(low), x2: x(high), y2: y(high) }),
    known.map(([level, done, learned]) => (learned ? s("circle", { class: "done", cx: x(level), cy: y(done), r: 4 }) : s("path", { class: "unseen", d: `M${x(level) - 4} ${y(low) - 4}l8 8M${x(level) - 4} ${y(low) + 4}l8 -8` }))),
    s("text", { x: 168, y: 243, "text-anchor": "middle" }, `commanded [${name}]`), s("text", { x: -110, y: 12, transform: "rotate(-90)", "text-anchor": "middle" }, `done [${name}]`)),
  h("figcaption", { class: "quiet" }, "Line: done as commanded. Dots: what was learned. Crosses: never commanded, so not known."));
}

/** The table of what the machine makes of what it is told, as it was learned. */
function translation(about, events) {
  const champion = about.versions?.find((one) => one.number === about.champion);
  const event = events.findLast((e) => e.kind === "corrected" && champion && e.reason === champion.reason);
  const told = event?.evidence?.table;
  if (!told?.levels) return null;
  const unit = about.inputs?.find((one) => one.name === told.channel)?.unit ?? "1";
  const size = Math.max(...told.levels.map(Math.abs));
  const rows = told.levels.map((level, k) => [quantity(level, unit, size), told.learned[k] ? quantity(told.values[k], unit, size) : "not seen", told.visits?.[k] ?? ""]);
  return h("div", { id: "translation" }, h("h3", {}, `Translation table of ${told.channel}: what is commanded, what the machine does`), pattern(told, unit, size),
    h("details", {}, h("summary", {}, "Level by level"), table("Learned level by level", ["commanded", "done", "times seen"], rows)));
}

/** A check of the trial in words. */
const needs = ({ name, value, limit }) => ({
  gain: `a gain of ${number(100 * limit, 2)} %: ${number(100 * value, 2)} % so far`,
  evidence: `evidence of ${number(limit)} to 1 that it is no chance: ${number(value, 2)} to 1 so far`,
}[name] ?? `${name.replaceAll("_", " ")}: ${number(value)} of ${number(limit)}`);

function trial(about) {
  const one = about.trial;
  if (!one) return [h("h2", {}, "On trial"), h("p", { class: "quiet" }, "No version is on trial.")];
  const lacks = one.missing.map((check) => h("li", {}, needs(check), " ", h("progress", { value: String(Math.max(0, Math.min(1, check.value / check.limit || 0))), max: "1", "aria-label": check.name })));
  return [h("h2", {}, `On trial: version ${one.version}`), h("p", {}, one.reason), h("p", {}, h("b", {}, less(one.gain)), `, over ${one.segments} segments that neither had seen`),
    h("h3", {}, lacks.length ? "It still needs" : "It lacks nothing"), h("ul", { class: "missing" }, lacks),
    h("p", { class: "quiet" }, one.more === null ? `How long that takes cannot be told: ${one.untold}` : `At this pace ${one.more} more segments, ${number(one.seconds)} s of the machine's time`)];
}

/** Who orders what and why; made once, so that nothing that was typed is lost. */
function orders(twin, context) {
  const reason = h("input", { id: "reason", required: true, maxlength: 500 });
  const person = h("input", { id: "person", maxlength: 100, value: context.person, onchange: (e) => (context.person = e.target.value) });
  const chosen = h("select", { id: "version", onchange: () => (touched = true) });
  let [touched, live, drawn] = [false, null, ""];
  let back = new Map();
  const may = context.page.may_order;
  const order = (name) => async () => {
    if (!reason.value.trim() || !person.value.trim()) throw new Error("say who and why first");
    const version = name === "rollback" || name === "unpin" ? null : Number(chosen.value);
    if (version !== null && !sure(name, version)) return "nothing was changed";
    const event = await ask(of(twin, "/orders"), { order: name, version, reason: reason.value, person: person.value });
    return `${event.kind}: ${event.reason}`;
  };
  const button = (label, name, more) => action(label, order(name), { disabled: !may, id: `order-${name}`, ...more });
  const [pin, unpin] = [button("Pin", "pin"), button("Unpin", "unpin")];
  const element = h("div", {}, h("h3", {}, "Order"), !may && h("p", { class: "quiet" }, "To look only: open the link that 'evertwin page' printed to order."),
    h("div", { class: "row" }, field("Version", chosen), field("Who", person), field("Why", reason)),
    h("div", { class: "row" }, button("Promote", "promote", { class: "main" }), button("Roll back", "rollback"), pin, unpin));
  /** Whoever pins means what runs now; whatever else goes live by it is asked for. */
  const sure = (name, version) => {
    const taken = back.has(version) ? ` It was taken back: ${back.get(version)}.` : "";
    const other = version !== live && (name === "pin" || taken);
    return !other || confirm(`Version ${version} goes live in place of ${live}.${taken}`);
  };
  const show = (about, events) => {
    pin.hidden = Boolean(about.pinned);
    unpin.hidden = !about.pinned;
    back = new Map(events.filter((e) => e.kind === "rolled_back").map((e) => [e.evidence?.replaced, e.reason]));
    const how = (number) => (number === about.champion ? ", live" : back.has(number) ? ", taken back" : "");
    const said = (about.versions ?? []).toReversed().map((one) => [one.number, `version ${one.number}${how(one.number)}: ${one.reason.slice(0, 60)}`]);
    const kept = chosen.value;
    if (JSON.stringify(said) !== drawn) put(chosen, said.map(([number, text]) => h("option", { value: String(number) }, text)));
    drawn = JSON.stringify(said);
    live = about.champion;
    chosen.value = touched ? kept : String(live);
  };
  return { element, show };
}

/** Which versions went live, how, and by whom. */
function versions(events) {
  const lived = events.filter((e) => ["promoted", "rolled_back", "configured", "pinned"].includes(e.kind)).slice(-12).reverse();
  return [h("h2", {}, "Versions"),
    h("ul", { class: "events" }, lived.map((e) => h("li", {}, h("time", {}, e.time ? clock(e.time, true) : `row ${e.row}`), e.reason, e.evidence?.person && ` (${e.evidence.person})`)))];
}

/** What ran at a time of the machine's clock. */
function what(about, twin) {
  const when = h("input", { type: "datetime-local", id: "when", step: "1" });
  return h("div", { class: "row" }, field("What ran at (machine's clock)", when), action("Tell", async () => {
    const t = new Date(when.value).getTime() / 1000;
    if (!Number.isFinite(t)) throw new Error("choose a time first");
    const found = await ask(of(twin, `/history?first=${t - 30}&last=${t + 30}&width=1&signal=${encodeURIComponent(about.outputs[0].name)}`));
    const { low, high } = found.version;
    return low.length ? (low[0] === high[0] ? `version ${low[0]}` : `versions ${low[0]} to ${high[0]}`) : "nothing ran then";
  }));
}
