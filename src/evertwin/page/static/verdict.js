// Within ten seconds: what was wrong, what was changed, how much better it is, whether to trust it.

import { h } from "./dom.js";
import { age, CONDITIONS, conditionOf, count, number, quantity, sign } from "./words.js";

const CLEAR = 0.03;

/** The newest event of some kinds before another, if there is one. */
const newest = (events, kinds, before = Infinity) => events.findLast((e) => kinds.includes(e.kind) && e.number < before);

/** What was off before the live version came, or is off now. */
function wrong(about, events, promoted) {
  const found = (promoted && newest(events, ["suspected"], promoted.number)) || newest(events, ["suspected", "abnormal", "drift"], promoted?.number);
  if (found) return promoted ? found.reason.replace(" is off by ", " was off by ") : found.reason;
  const lies = newest(events, ["measurement_error"]);
  if (lies && !newest(events.filter((e) => e.number > lies.number), ["measurement_restored"])) return `A measurement was refused: ${lies.reason}`;
  return about.condition === "out_of_specification" ? about.why : WRONG[about.judged] ?? WRONG.held;
}

const WRONG = {
  held: "Nothing: predictions stay within what is asked.", "not yet": "Nothing is known yet: more rows that move have to come.",
  "nothing asked": "Nothing is asked: the twin file names no [anomaly] requirement.",
};
const UNJUDGED = { "not yet": "Too few rows that move have come to judge it.", "nothing asked": "No largest deviation is asked, so none is judged." };

function changed(about) {
  const champion = about.versions?.find((one) => one.number === about.champion);
  if (!champion || !champion.number) return "Nothing: it runs as configured.";
  return champion.reason;
}

/** [text, share] of each output that is clearly better or worse. */
export function gains(figures) {
  return Object.entries(figures ?? {})
    .map(([name, f]) => [name, f.unit, ...(f.rms_moving_before > 0 ? [f.rms_moving_before, f.rms_moving_after] : [f.rms_before, f.rms_after])])
    .filter(([, , was, is]) => was > 0 && Math.abs(1 - is / was) > CLEAR)
    .map(([name, unit, was, is]) => ({ name, share: 1 - is / was, text: `${name} ${quantity(was, unit, is)} → ${quantity(is, unit)}` }))
    .sort((a, b) => b.share - a.share);
}

function better(about) {
  const found = gains(about.figures);
  const good = found.filter((one) => one.share > 0);
  const bad = found.filter((one) => one.share < 0);
  if (!about.champion) return about.trial ? `On trial: ${less(about.trial.gain)}.` : "No better version has been found yet.";
  if (!good.length && !bad.length) return "No clear difference on what it had not seen.";
  const said = good.slice(0, 3).map((one) => h("div", {}, h("b", {}, `${Math.round(100 * one.share)} % less: `), one.text));
  if (good.length > 3) said.push(h("div", { class: "quiet" }, `and ${good.length - 3} more outputs`));
  if (bad.length) said.push(h("div", {}, h("b", {}, "Worse: "), bad.map((one) => one.text).join("; ")));
  return said;
}

/** Whether to trust it: [tag, look, why]. */
export function trust(about, promoted) {
  const condition = conditionOf(about);
  const weak = (about.parameters ?? []).filter((one) => one.verdict && one.verdict !== "identifiable").map((one) => one.name);
  if (condition === "failure") return ["No", "weak", `it does not run: ${about.reason}`];
  if (condition === "stale" || condition === "check") return ["Not now", "weak", about.age === null ? "no samples have come yet" : `no samples for ${age(about.age)}: nothing is checked now`];
  const rows = Math.max(0, ...Object.values(about.figures ?? {}).map((f) => f.rows));
  const over = condition === "out_of_specification" ? `It is off ${about.champion ? "again" : "now"}: ${about.why}. ` : "";
  const unsure = weak.length ? ` Weakly known: ${weak.join(", ")}.` : "";
  if (!promoted) return about.champion
    ? ["With care", "weak", `${over}How it went live lies further back than the events that are shown.${unsure}`]
    : over || !rows || (about.judged ?? "held") !== "held"
      ? ["Not yet", "weak", over || (!rows ? "Nothing has been compared yet." : UNJUDGED[about.judged])]
      : ["Yes", "good", `As configured it stays within what is asked, over ${count(rows, "row")}.`];
  const { gain, segments } = promoted.evidence ?? {};
  const evidence = gain > 0 ? `${Math.round(100 * gain)} % less deviation over ${segments} stretches that neither had seen` : promoted.reason;
  if (promoted.evidence?.person) return ["By hand", "weak", `${over}Promoted by ${promoted.evidence.person}, not by its trial.${unsure}`];
  return [over ? "With care" : "Yes", over ? "weak" : "good", `${over}Proved against the version before: ${evidence}.${unsure}`];
}

/** What a trial has gained, in words. */
export const less = (gain) => (gain > 0 ? `${number(100 * gain)} % less so far` : `no less so far (${number(-100 * gain)} % more)`);

/** The card. `about`: of GET /twins/NAME; `events`: those that are known. */
export function verdict(about, events) {
  const promoted = events.findLast((e) => e.kind === "promoted" && e.evidence?.version === about.champion);
  const condition = conditionOf(about);
  const [tag, look, why] = trust(about, promoted);
  const part = (name, said) => h("div", {}, h("dt", {}, name), h("dd", {}, said));
  return h("section", { class: "card", id: "verdict", "aria-label": "What came of it" },
    h("div", { class: "row" }, sign(condition), h("h1", {}, about.name), h("span", {}, CONDITIONS[condition][0], about.why && condition !== "good" ? `: ${about.why}` : ""),
      h("span", { class: "quiet" }, `version ${about.champion ?? "–"}${about.pinned ? ", pinned" : ""}`), about.label && h("span", { class: "tag" }, about.label)),
    h("dl", { class: "verdict" }, part("What was wrong", wrong(about, events, promoted)), part("What was changed", changed(about)),
      part("How much better", better(about)), part("Can it be trusted?", [h("span", { class: `tag ${look}` }, tag), " ", why])));
}
