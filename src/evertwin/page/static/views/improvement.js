// What was learned: the sentence, before and after on one axis, parameters, versions, the open trial.

import { Axis, Chart, fromPixels } from "../chart.js";
import { action, field, h, put, s, table } from "../dom.js";
import { gains, less, verdict } from "../verdict.js";
import { clock, number, quantity } from "../words.js";
import { ask, of } from "../wire.js";

const SPAN = 120;

export function open({ twin, context }) {
  const parts = { head: h("div"), picture: h("section", { class: "card" }), trial: h("section", { class: "card" }), found: h("section", { class: "card" }), versions: h("section", { class: "card" }) };
  const lived = h("div");
  const form = orders(twin, context);
  let drawn = "";
  let asked = 0;
  let charts = [];

  async function look() {
    asked = Date.now();
    let about;
    try {
      about = await ask(of(twin));
    } catch (error) {
      return put(parts.head, h("p", {}, error.message));
    }
    const events = context.feed?.events ?? [];
    if (context.feed?.cursor === null) return setTimeout(look, 300); // how it went live is not known yet
    const key = JSON.stringify([about.champion, about.pinned, about.versions?.length, about.trial, about.figures, events.length, about.condition, about.stale]);
    if (key === drawn) return undefined;
    drawn = key;
    put(parts.head, verdict(about, events), about.headline && h("p", { class: "card lead", id: "headline" }, about.headline));
    put(parts.trial, trial(about));
    put(parts.found, parameters(about), translation(about, events));
    put(lived, versions(events));
    form.show(about);
    if (!parts.versions.childElementCount) put(parts.versions, lived, what(about, twin), form.element);
    if (!charts.length) await picture(about);
    return undefined;
  }

  /** Measured, by the first version and by the live one, on the same rows. */
  async function picture(about) {
    const name = (gains(about.figures)[0] ?? {}).name ?? about.outputs?.[0]?.name;
    const newest = context.feed?.rows.t.at(-1);
    if (!name || !newest) return;
    const axis = new Axis(SPAN);
    axis.newest(newest * 1e-9);
    const past = await ask(of(twin, `/history?first=${axis.first}&last=${axis.last}&width=1200&signal=${encodeURIComponent(name)}`));
    const part = (key) => () => [fromPixels(past, past.signals[name][key], Infinity)];
    const unit = about.figures?.[name]?.unit ?? "1";
    const before = difference(past, name, "before");
    const lines = [{ name: "measured", look: "measured", parts: part("measured") }];
    if (about.champion) lines.push({ name: "before: by the first version", look: "before", parts: part("before") });
    lines.push({ name: "now: by the live version", look: "predicted", dashed: true, parts: part("predicted") });
    const off = [{ name: "now", look: "predicted", parts: part("residual") }];
    if (about.champion) off.unshift({ name: "before", look: "before", parts: () => [before] });
    charts = [new Chart(axis, { title: name, unit, lines, height: 190 }), new Chart(axis, { title: `${name}: off by`, unit, zero: true, height: 120, lines: off })];
    axis.addEventListener("change", redraw);
    put(parts.picture, h("h2", {}, "Before and now, on the same rows"), charts.map((one) => one.element));
    redraw();
  }

  const redraw = () => charts.forEach((one) => one.draw());
  const rows = () => !charts.length && look();
  context.feed?.addEventListener("rows", rows);
  look();
  return {
    element: h("div", {}, parts.head, parts.picture, h("div", { class: "columns" }, parts.found, h("div", {}, parts.trial, parts.versions))),
    update: () => Date.now() - asked > 2000 && look(), redraw, close: () => context.feed?.removeEventListener("rows", rows),
  };
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
  const known = (about.parameters ?? []).filter((one) => one.interval95 || one.verdict);
  const rest = (about.parameters ?? []).filter((one) => !known.includes(one));
  const cells = (one) => {
    const [low, high] = one.interval95 ?? [null, null];
    const weak = one.verdict && one.verdict !== "identifiable";
    return [one.name, quantity(one.value, one.unit), low === null ? "–" : `${quantity(low, one.unit, one.value)} to ${quantity(high, one.unit, one.value)}`,
      interval(one, weak), h("span", { class: `tag ${weak ? "weak" : "good"}` }, one.verdict === "identifiable" ? "well known" : (one.verdict ?? "as configured"))];
  };
  return [h("h2", {}, "What was found"), known.length ? table("Parameters that were tuned, with 95 % intervals", ["", "value", "between", "", "known how well"], known.map(cells)) : h("p", {}, "Nothing was tuned yet."),
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

/** The table of what the machine makes of what it is told, as it was learned. */
function translation(about, events) {
  const champion = about.versions?.find((one) => one.number === about.champion);
  const event = events.findLast((e) => e.kind === "corrected" && champion && e.reason === champion.reason);
  const told = event?.evidence?.table;
  if (!told?.levels) return null;
  const unit = about.inputs?.find((one) => one.name === told.channel)?.unit ?? "1";
  const size = Math.max(...told.levels.map(Math.abs));
  const rows = told.levels.map((level, k) => [quantity(level, unit, size), told.learned[k] ? quantity(told.values[k], unit, size) : "not seen", told.visits?.[k] ?? ""]);
  return h("details", {}, h("summary", {}, `Translation table of ${told.channel}: what was commanded, what the machine does`), table("Learned level by level", ["commanded", "done", "times seen"], rows));
}

function trial(about) {
  const one = about.trial;
  if (!one) return [h("h2", {}, "On trial"), h("p", { class: "quiet" }, "No version is on trial.")];
  const lacks = one.missing.map((check) => h("li", {}, `${check.name}: ${number(check.value)} of ${number(check.limit)}`, " ", h("progress", { value: String(Math.max(0, Math.min(1, check.value / check.limit || 0))), max: "1", "aria-label": check.name })));
  return [h("h2", {}, `On trial: version ${one.version}`), h("p", {}, one.reason), h("p", {}, h("b", {}, less(one.gain)), `, over ${one.segments} segments that neither had seen`),
    h("h3", {}, lacks.length ? "It still needs" : "It lacks nothing"), h("ul", { class: "missing" }, lacks),
    h("p", { class: "quiet" }, one.more === null ? `How long that takes cannot be told: ${one.untold}` : `At this pace ${one.more} more segments, ${number(one.seconds)} s of the machine's time`)];
}

/** Who orders what and why; made once, so that nothing that was typed is lost. */
function orders(twin, context) {
  const reason = h("input", { id: "reason", required: true, maxlength: 500 });
  const person = h("input", { id: "person", maxlength: 100, value: context.person, onchange: (e) => (context.person = e.target.value) });
  const chosen = h("select", { id: "version" });
  const may = context.page.may_order;
  const order = (name) => async () => {
    if (!reason.value.trim() || !person.value.trim()) throw new Error("say who and why first");
    const version = name === "rollback" || name === "unpin" ? null : Number(chosen.value);
    const event = await ask(of(twin, "/orders"), { order: name, version, reason: reason.value, person: person.value });
    return `${event.kind}: ${event.reason}`;
  };
  const button = (label, name, more) => action(label, order(name), { disabled: !may, id: `order-${name}`, ...more });
  const [pin, unpin] = [button("Pin", "pin"), button("Unpin", "unpin")];
  const element = h("div", {}, h("h3", {}, "Order"), !may && h("p", { class: "quiet" }, "To look only: open the link that 'evertwin page' printed to order."),
    h("div", { class: "row" }, field("Version", chosen), field("Who", person), field("Why", reason)),
    h("div", { class: "row" }, button("Promote", "promote", { class: "main" }), button("Roll back", "rollback"), pin, unpin));
  const show = (about) => {
    pin.hidden = Boolean(about.pinned);
    unpin.hidden = !about.pinned;
    for (const one of (about.versions ?? []).slice(chosen.options.length)) {
      chosen.prepend(h("option", { value: String(one.number), selected: true }, `version ${one.number}: ${one.reason.slice(0, 60)}`));
    }
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
