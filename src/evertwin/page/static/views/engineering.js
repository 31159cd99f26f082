// What the machine is made of, what of it matters, what is tuned, how often, and why.

import { action, h, put, s, table } from "../dom.js";
import { count, number } from "../words.js";
import { ask, of } from "../wire.js";

const LEVELS = { white: "white box", grey: "grey box", black: "black box" };
const SHADES = 5;

export function open({ twin, context }) {
  const body = h("div", {}, h("p", { class: "quiet" }, "Asking: the model is differentiated over the newest rows …"));
  let rows = null;

  async function look() {
    const found = await ask(of(twin, "/engineering"));
    rows = found.rows;
    put(body, pictures(found));
    return `from ${count(rows, "row")}`;
  }

  const first = () => look().catch((error) => put(body, h("p", { class: "card" }, error.message)));
  first();
  return {
    element: h("div", {}, h("div", { class: "row" }, h("h1", {}, `Engineering of ${twin}`), h("span", { class: "grow" }), action("Ask anew", look, { id: "anew" })), body),
    update: () => rows === null && context.twins.some((one) => one.name === twin && one.rows > 0) && !body.querySelector("p.quiet") && first(),
  };
}

function pictures(found) {
  const { components, parameters = [], links, tuned, notes } = found;
  const critical = components.filter((one) => one.role === "critical");
  const kept = Object.keys(tuned.parameters);
  const lead = [
    components.length ? `${critical.length} of ${count(components.length, "component is", "components are")} critical; ${kept.length} of ${count(links.length, "parameter is", "parameters are")} tuned.` : `${count(kept.length, "parameter is", "parameters are")} tuned.`,
    ` Asked of ${count(found.rows, "row")} (${number(found.span)} s of the machine's time) with version ${found.version}.`,
  ];
  const chosen = found.editable ?? kept;
  const [more, less] = [chosen.filter((one) => !kept.includes(one)), kept.filter((one) => !chosen.includes(one))];
  const differs = [more.length && `on these rows ${more.join(", ")} would be tuned too`, less.length && `${less.join(", ")} would not`].filter(Boolean).join(", ");
  return [
    h("p", { class: "card lead" }, lead, differs && h("b", {}, ` The twin file and these rows differ: ${differs}.`), (notes ?? []).map((one) => h("span", { class: "quiet" }, ` ${one[0].toUpperCase()}${one.slice(1)}.`))),
    components.length > 0 && breakdown(components, found),
    parameters.length > 0 && sensitivity(parameters, tuned),
    mapping(links),
    schedule(tuned, found.schedule),
  ];
}

/** A bar from 0 to 1, with the figure beside it. */
function bar(share, text, look = "") {
  const wide = Math.max(0, Math.min(1, share)) * 100;
  return h("span", { class: "measure" }, s("svg", { class: `share ${look}`, viewBox: "0 0 100 10", preserveAspectRatio: "none", "aria-hidden": "true" }, s("rect", { width: 100, height: 10, class: "all" }), s("rect", { width: wide, height: 10 })), h("span", {}, text));
}

function breakdown(components, found) {
  let before = "";
  const rows = [...components].sort((a, b) => a.system.localeCompare(b.system) || b.score - a.score).map((one) => {
    const place = [one.system, one.subsystem].filter(Boolean).join(" / ");
    const shown = place === before ? "" : place;
    before = place;
    const about = found.of?.[one.component];
    return [[h("span", { class: `box ${one.level.level}` }, one.component), about && h("small", {}, ` ${about}`)], shown,
      bar(one.score / 25, number(one.score, 3), one.role === "critical" ? "critical" : ""), one.role, LEVELS[one.level.level],
      h("details", {}, h("summary", {}, "why"), h("p", {}, one.reasons.join("; ")), h("p", {}, one.level.reason), one.level.missing.map((lack) => h("p", {}, h("b", {}, "Missing: "), `${lack.what}. How to get it: ${lack.how}.`)))];
  });
  return h("section", { class: "card", id: "breakdown" }, h("h2", {}, `What it is made of${found.about ? `: ${found.about}` : ""}`),
    table("Effect of a failure × how often it fails, from 1 to 25; critical from 10 on unless the breakdown says otherwise", ["component", "where", "criticality", "role", "modelled as", ""], rows));
}

function sensitivity(parameters, tuned) {
  const order = [...parameters].sort((a, b) => Number(b.editable) - Number(a.editable) || (b.share ?? -1) - (a.share ?? -1));
  const rows = order.map((one) => [one.name, h("span", { class: `tag ${one.name in tuned.parameters ? "good" : ""}` }, one.name in tuned.parameters ? "tuned" : "kept"),
    one.share === null ? "not asked" : bar(one.share, `${number(100 * one.share, 2)} ± ${number(100 * one.share_half, 2)} % of ${one.output || "the outputs"}`), one.reason]);
  return h("section", { class: "card", id: "sensitivity" }, h("h2", {}, "Which parameters matter"),
    table("Sobol: share of an output's variance that a parameter makes over its range, with its 95 % interval", ["parameter", "", "share", "why"], rows));
}

/** How dark: 0 below 0.1 % of a signal, all of it the darkest. */
const shade = (effect) => Math.max(0, Math.min(SHADES - 1, Math.round((SHADES - 1) * (1 + Math.log10(Math.max(effect, 1e-9)) / 3))));

function mapping(links) {
  const signals = [...new Set(links.flatMap((one) => one.signals.map((seen) => seen.signal)))].sort();
  const rows = links.map((one) => {
    const seen = new Map(one.signals.map((found) => [found.signal, found.effect]));
    const cells = signals.map((name) => (seen.has(name) ? h("span", { class: `heat heat${shade(seen.get(name))}` }, `${number(100 * seen.get(name), 2)} %`) : ""));
    return [one.parameter, ...(one.signals.length ? cells : [h("b", {}, "no signal sees it: it cannot be tuned")])];
  });
  return h("section", { class: "card", id: "mapping" }, h("h2", {}, "Which signal tells which parameter"),
    table("By how much a signal changes, of its rms, when the parameter changes by its own size", ["parameter", ...signals], rows));
}

const ordinal = (n) => `${n}${{ 1: "st", 2: "nd", 3: "rd" }[n > 3 && n < 21 ? 0 : n % 10] ?? "th"}`;
const turn = (weight) => (weight >= 1 ? "every tuning" : weight > 0 ? `every ${ordinal(Math.round(1 / weight))} tuning` : "never");

function schedule(tuned, proposed) {
  const rows = Object.entries(tuned.parameters).map(([name, weight]) => [name, turn(weight), proposed?.weights[name] === undefined ? "–" : turn(proposed.weights[name]), proposed?.reasons[name] ?? "not weighed: no drift is stated for it"]);
  const often = tuned.every === null ? "Tuned when a deviation is suspected." : `Tuned every ${number(tuned.every)} s of the machine's time, and when a deviation is suspected.`;
  return h("section", { class: "card", id: "schedule" }, h("h2", {}, "How often"), h("p", {}, often),
    table("Each parameter's turn", ["parameter", "as the twin file says", "enough by its drift", "why"], rows));
}
