// Within ten seconds: what was wrong, what was changed, how much better it is, whether to trust it.

import { h } from "./dom.js";
import { clock, CONDITIONS, conditionOf, count, number, quantity, sign, unitOf } from "./words.js";

const CLEAR = 0.03;

/** The unit in which an output is told. */
const unitIn = (about, name) => unitOf(about.outputs?.find((one) => one.name === name) ?? { unit: about.figures?.[name]?.unit });

/** The newest event of some kinds before another, if there is one. */
const newest = (events, kinds, before = Infinity) => events.findLast((e) => kinds.includes(e.kind) && e.number < before);

/** What is off now, or was before the live version came, or until it was over by itself. */
function wrong(about, events, promoted) {
  const silent = ["stale", "check"].includes(conditionOf(about)) ? `${about.age === null ? "No samples have come yet" : "No samples come any more"}. ` : "";
  const off = about.alarm && about.alarm.kind !== "not_valid";
  const lies = off ? null : about.refused?.map((signal) => newest(events.filter((e) => e.signal === signal), ["measurement_error"])).find(Boolean);
  if (lies) {
    const often = events.filter((e) => e.kind === "measurement_error" && e.signal === lies.signal).length;
    return `${silent}The sensor of ${lies.signal} gives what cannot be, ${count(often, "time")} so far; it is refused. Newest: ${lies.reason}`;
  }
  if (about.alarm && !silent) return about.why || about.headline;
  const found = promoted && newest(events, ["suspected"], promoted.number);
  if (found) return silent + wasOff(about, found);
  if (about.returned) return silent + about.returned.reason;
  return silent + (silent ? "" : WRONG[about.judged] ?? WRONG.held);
}

/** An alarm whose cause is over has returned to normal, acknowledged or not. */
export function returned({ returned: over, alarm }) {
  if (!over || alarm) return "";
  return `Over since ${clock(over.over, true)}, ${over.label || "not acknowledged"}: ${over.reason}`;
}

/** How far off the twin was before the live version: by the figure that tells how much better it is. */
function wasOff(about, event) {
  const one = about.figures?.[event.signal];
  const unit = unitIn(about, event.signal);
  const was = one && (one.rms_moving_before > 0 ? one.rms_moving_before : one.rms_before);
  if (!(was > 0)) return event.reason.replace(" is off by ", " was off by ");
  const limit = about.asked === null || about.asked === undefined ? "more than is asked" : `${quantity(was, unit)}, ${quantity(about.asked, unit)} is asked`;
  return `${event.signal} was off by ${limit}`;
}

const WRONG = {
  held: "Nothing: predictions stay within what is asked.", off: "Predictions are off by more than is asked.", "not yet": "Nothing is known yet: more rows that move have to come.",
  "nothing asked": "Nothing is asked: the twin file names no [anomaly] requirement.",
};
const UNJUDGED = { "not yet": "What moved has not been enough to judge it yet.", off: "It is off by more than is asked.", "nothing asked": "No largest deviation is asked, so none is judged." };

function changed(about, promoted) {
  const champion = about.versions?.find((one) => one.number === about.champion);
  if (!champion || !champion.number) return "Nothing: it runs as configured.";
  return `${about.changed || champion.reason}${promoted ? `, by ${promoted.evidence.person ?? "itself, after a trial"}` : ""}`;
}

/** [text, share] of each output that is clearly better or worse. */
export function gains(about) {
  return Object.entries(about.figures ?? {})
    .map(([name, f]) => [name, unitIn(about, name), ...(f.rms_moving_before > 0 ? [f.rms_moving_before, f.rms_moving_after] : [f.rms_before, f.rms_after])])
    .filter(([, , was, is]) => was > 0 && Math.abs(1 - is / was) > CLEAR)
    .map(([name, unit, was, is]) => ({ name, share: 1 - is / was, text: `${name} ${quantity(was, unit, is)} → ${quantity(is, unit)}` }))
    .sort((a, b) => b.share - a.share);
}

function better(about) {
  const found = gains(about);
  const good = found.filter((one) => one.share > 0);
  const bad = found.filter((one) => one.share < 0);
  if (!about.champion) return about.trial ? `On trial: ${less(about.trial.gain)}.` : (about.judged ?? "held") === "held" && about.condition === "good" ? "Nothing had to be improved." : "No better version has been found yet.";
  if (!good.length && !bad.length) return "No clear difference on what it had not seen.";
  const said = good.slice(0, 3).map((one) => h("div", {}, h("b", {}, `${Math.round(100 * one.share)} % less: `), one.text));
  if (good.length > 3) said.push(h("div", { class: "quiet" }, `and ${good.length - 3} more outputs`));
  if (bad.length) said.push(h("div", {}, h("b", {}, "Worse: "), bad.map((one) => one.text).join("; ")));
  return said;
}

/** What is asked, with its size where it is one of every output. */
function limit(about) {
  const units = Object.keys(about.figures ?? {}).map((name) => unitIn(about, name));
  const alike = new Set(units.map((one) => JSON.stringify(one))).size === 1;
  return about.asked > 0 && alike ? `the ${quantity(about.asked, units[0])} that is asked` : "what is asked";
}

/** Whether to trust it: [tag, look, why]. */
export function trust(about, promoted) {
  const condition = conditionOf(about);
  const weak = (about.parameters ?? []).filter((one) => one.verdict && one.verdict !== "identifiable").map((one) => one.name);
  if (condition === "failure") return ["No", "weak", `it does not run: ${about.reason}`];
  if (about.state === "starting") return ["Not now", "weak", "it does not run yet"];
  if (condition === "stale" || condition === "check") return ["Not now", "weak", about.age === null ? "no samples have come yet" : "no samples come: nothing is checked now"];
  if (about.refused?.length) return ["Not now", "weak", `the sensor of ${about.refused.join(", ")} is not believed: nothing is checked there`];
  const rows = Math.max(0, ...Object.values(about.figures ?? {}).map((f) => f.rows));
  const off = condition === "out_of_specification" || about.judged === "off";
  const trial = about.trial ? ` ${about.trial.gain > 0 ? "A better" : "Another"} version is on trial.` : "";
  const over = off ? `It is off ${about.champion ? "again" : "now"}: ${about.why || UNJUDGED.off.toLowerCase().replace(/\.$/, "")}.${trial} ` : "";
  const unsure = weak.length ? ` Weakly known: ${weak.join(", ")}.` : "";
  if (!promoted) return about.champion
    ? ["With care", "care", `${over}How it went live lies further back than the events that are shown.${unsure}`]
    : over || !rows || (about.judged ?? "held") !== "held"
      ? ["Not yet", "weak", over || (!rows ? "Nothing has been compared yet." : UNJUDGED[about.judged])]
      : ["Yes", "good", `As configured it stays within ${limit(about)}, over ${count(rows, "row")}.`];
  const { segments } = promoted.evidence ?? {};
  if (promoted.evidence?.person) return ["With care", "care", `${over}${promoted.evidence.person} put it live by hand; no trial has proved it.${unsure}`];
  const proved = `It proved better on ${count(segments ?? 0, "stretch", "stretches")} that no version had seen`;
  if (over) return ["With care", "care", `${over}${proved}.${unsure}`];
  if ((about.judged ?? "held") !== "held") return ["Not yet", "weak", `${proved}. ${UNJUDGED[about.judged]}${unsure}`];
  return ["Yes", "good", `${proved}, and its newest rows are within ${limit(about)}.${unsure}`];
}

/** The pin that put the live version there in place of another, if one did. */
export function pinnedLive(events, champion) {
  let [live, by] = [undefined, undefined];
  for (const event of events.filter((e) => ["promoted", "rolled_back", "pinned"].includes(e.kind))) {
    const { version } = event.evidence ?? {};
    if (version !== live) by = live !== undefined && event.kind === "pinned" ? event : undefined;
    live = version;
  }
  return live === champion ? by : undefined;
}

/** What a trial has gained, in words. */
export const less = (gain) => (gain > 0 ? `${number(100 * gain)} % less so far` : gain < 0 ? `worse so far (${number(-100 * gain)} % more deviation)` : "no less so far");

/** The card. `about`: of GET /twins/NAME; `events`: those that are known. */
export function verdict(about, events) {
  const promoted = pinnedLive(events, about.champion) ?? events.findLast((e) => e.kind === "promoted" && e.evidence?.version === about.champion);
  const condition = conditionOf(about);
  const [tag, look, why] = trust(about, promoted);
  const part = (name, said) => h("div", {}, h("dt", {}, name), h("dd", {}, said));
  return h("section", { class: "card", id: "verdict", "aria-label": "What came of it" },
    h("div", { class: "row" }, sign(condition), h("h1", {}, about.name), h("span", {}, CONDITIONS[condition][0], about.why && condition !== "good" ? `: ${about.why}` : ""),
      h("span", { class: "quiet" }, `version ${about.champion ?? "–"}${about.pinned ? ", pinned" : ""}`), about.label && h("span", { class: "tag" }, about.label)),
    returned(about) && h("p", { class: "quiet", id: "returned" }, returned(about)),
    h("dl", { class: "verdict" }, part("What was wrong", wrong(about, events, promoted)), part("What was changed", changed(about, promoted)),
      part("How much better", better(about)), part("Can it be trusted?", [h("span", { class: `tag ${look}` }, tag), " ", why])));
}
