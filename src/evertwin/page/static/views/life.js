// How long components last, where the twin file says what tells wear; alarms; the plan in dates.

import { h, put, s, table } from "../dom.js";
import { clock, number, quantity } from "../words.js";
import { ask, of } from "../wire.js";

const EVERY = 30000;

export function open({ twin, context }) {
  const body = h("div", {}, h("p", { class: "quiet" }, "Asking …"));
  let asked = 0;

  async function update() {
    if (context.silent || Date.now() - asked < EVERY) return;
    asked = Date.now();
    try {
      put(body, shown(await ask(of(twin, "/life"))));
    } catch (error) {
      put(body, h("section", { class: "card" }, h("p", {}, h("b", {}, "Cannot be told. "), error.message)));
    }
  }

  update();
  return { element: h("div", {}, h("h1", {}, `Life of ${twin}`), body), update };
}

function shown(told) {
  const parts = Object.entries(told.components);
  const worst = parts.filter(([, one]) => one.life.median !== undefined && one.life.median !== null).sort(([, a], [, b]) => a.life.median - b.life.median)[0];
  const lead = worst ? [h("b", {}, worst[0]), ` comes first: ${worst[1].sentence}.`] : "How long any component lasts cannot be told yet.";
  const rows = parts.map(([name, one]) => [name, wear(one), `${value(one.value, one.unit)} of ${value(one.limit, one.unit)}`, lasts(one.life), one.life.dates ? day(one.life.dates.not_before) : "–",
    h("span", { class: one.life.verdict ? "quiet" : "" }, one.sentence)]);
  return [
    h("p", { class: "card lead" }, lead),
    h("section", { class: "card" }, h("h2", {}, "Wear"), table(`Now and at the end of life; life is counted in ${told.clock}`, ["component", "worn", "now", "lasts (80 %)", "not before (95 %)", "in words"], rows)),
    h("section", { class: "card" }, h("h2", {}, "Alarms"), told.alarms?.length ? h("ul", {}, told.alarms.map((one) => h("li", {}, typeof one === "string" ? one : (one.reason ?? JSON.stringify(one))))) : h("p", {}, "None.")),
    h("section", { class: "card" }, h("h2", {}, "Plan"), plan(told.plan)),
    (told.notes ?? []).map((one) => h("p", { class: "quiet" }, one)),
  ];
}

const value = (v, unit) => (typeof v === "number" ? quantity(v, unit) : "unknown");
const day = (text) => (text ? String(text).slice(0, 10) : "–");
const lasts = ({ verdict, interval80, unit }) => (verdict ? verdict : `${number(interval80[0])} to ${interval80[1] === null ? "for ever" : number(interval80[1])} ${unit}`);

/** How far the indicator has come on its way to the limit. */
function wear({ value: now, limit, direction }) {
  if (typeof now !== "number" || typeof limit !== "number" || !limit || !now) return "–";
  const share = direction === "below" ? limit / now : now / limit;
  const wide = 100 * Math.max(0, Math.min(1, share));
  return h("span", { class: "measure" }, s("svg", { class: `share ${share >= 1 ? "critical" : ""}`, viewBox: "0 0 100 10", preserveAspectRatio: "none", "aria-hidden": "true" }, s("rect", { width: 100, height: 10, class: "all" }), s("rect", { width: wide, height: 10 })), `${number(100 * share, 2)} %`);
}

function plan(told) {
  if (!told) return h("p", {}, "No plan: costs of failure and maintenance are not stated ([prognosis.components] of the twin file).");
  const rows = told.items.map((one) => [one.component, one.date ?? (one.after === null ? "run to failure" : `in ${number(one.after)} ${told.unit}`), `${number(100 * one.probability_before, 2)} %`, one.decision, [one.reason, one.note].filter(Boolean).join("; ")]);
  return [rows.length > 0 && table("Cheapest dates of maintenance, with what was decided", ["component", "when", "fails before", "decision", ""], rows),
    Object.entries(told.without_date).map(([name, why]) => h("p", { class: "quiet" }, `${name}: no date: ${why}`))];
}
