// What was decided and what was said to it.

import { action, field, h, put } from "../dom.js";
import { clock, kind } from "../words.js";
import { ask, of } from "../wire.js";

const VERDICTS = [["acknowledged", "Acknowledge"], ["shelved", "Shelve"], ["false alarm", "False alarm"], ["true", "It is true"]];
/** What acts on fits, and what it does there. */
const ACTS = {
  "false alarm": "A false alarm counts in the rate of its detector, and is no evidence again.",
  cause: "A cause that is named is tried first at the next tuning.",
  faulty: "Rows that are faulty leave the window of every fit.",
};
const ALARMS = ["suspected", "abnormal", "drift", "alarm", "measurement_error", "not_valid", "external"];

export function open({ twin, context }) {
  const list = h("ol", { class: "events" });
  const search = h("input", { type: "search", id: "search", oninput: () => show() });
  const only = h("input", { type: "checkbox", id: "alarms", onchange: () => show() });
  const said = h("section", { class: "card", hidden: true, id: "label" });
  const reason = h("input", { id: "reason", maxlength: 500 });
  const person = h("input", { id: "person", maxlength: 100, value: context.person, onchange: (e) => (context.person = e.target.value) });

  /** First and last row that an event is about, as far as its evidence says. */
  function rowsOf({ row, evidence: e }) {
    const first = e?.first ?? e?.onset ?? e?.row;
    return Number.isInteger(first) ? [first, e.last ?? e.end ?? row - 1] : ["", ""];
  }

  async function choose(event) {
    const may = context.page.may_order;
    const about = await ask(of(twin));
    const cause = h("select", { id: "cause" }, (about.causes ?? []).map((one) => h("option", { value: one }, one)));
    const [first, last] = rowsOf(event).map((row, k) => h("input", { id: ["first", "last"][k], inputmode: "numeric", value: String(row), size: 8 }));
    const say = (verdict, more = () => ({})) => async () => {
      if (!reason.value.trim() || !person.value.trim()) throw new Error("say who and why first");
      const before = (await ask(of(twin))).condition;
      await ask(of(twin, "/labels"), { event: event.number, verdict, reason: reason.value, person: person.value, ...more() });
      const after = (await ask(of(twin))).condition;
      if (verdict in ACTS) return "kept; what it changes is told below at the next beat";
      return before === after ? `kept; the condition stays ${after.replaceAll("_", " ")}` : `kept; the condition went from ${before.replaceAll("_", " ")} to ${after.replaceAll("_", " ")}`;
    };
    said.hidden = false;
    put(said, h("h2", {}, `${kind(event)}: ${event.reason}`), !may && h("p", { class: "quiet" }, "To look only: open the link that 'evertwin page' printed to label."),
      h("div", { class: "row" }, field("Who", person), field("Because", reason)),
      h("div", { class: "row" }, VERDICTS.map(([verdict, label]) => action(label, say(verdict), { disabled: !may, id: `say-${verdict.replace(" ", "-")}` }))),
      h("div", { class: "row" }, about.causes?.length > 0 && [field("Its cause", cause), action("This is the cause", say("cause", () => ({ cause: cause.value })), { disabled: !may, id: "say-cause" })],
        field("Faulty from row", first), field("to row", last), action("Rows are faulty", say("faulty", rowsSaid), { disabled: !may, id: "say-faulty" })),
      Object.values(ACTS).map((line) => h("div", {}, h("small", {}, line))));
    said.scrollIntoView({ block: "nearest" });
    reason.focus();

    function rowsSaid() {
      const rows = [first, last].map((one) => (one.value.trim() ? Number(one.value) : NaN));
      if (!rows.every(Number.isInteger)) throw new Error("name the first and the last row");
      return { rows };
    }
  }

  /** Is what an event told over: [tag]; nothing of an event that stands, or is none of an alarm. */
  function over(event, all) {
    const now = context.twins.find((one) => one.name === twin);
    if (!now || !ALARMS.includes(event.kind)) return "";
    const after = (kind) => all.some((e) => e.kind === kind && e.signal === event.signal && e.number > event.number);
    if (event.kind === "measurement_error") return after("measurement_restored") || !now.refused?.includes(event.signal) ? "over" : "";
    if (["alarm", "external"].includes(event.kind)) return event.kind === "alarm" && after("alarm_cleared") ? "over" : "";
    if (now.alarm?.event && event.number >= now.alarm.event) return "";
    return now.returned?.event === event.number ? `over since ${clock(now.returned.over, true)}` : "over";
  }

  function show() {
    const asked = search.value.trim().toLowerCase();
    const all = context.feed?.events ?? [];
    const labels = new Map(all.filter((e) => e.kind === "labelled").map((e) => [e.evidence?.event, e]));
    const did = new Map(all.filter((e) => e.kind === "heeded" && e.evidence?.event).map((e) => [e.evidence.event, e]));
    const seen = all.filter((e) => (!only.checked || ALARMS.includes(e.kind)) && (!asked || `${e.kind} ${kind(e)} ${e.signal} ${e.reason}`.toLowerCase().includes(asked)));
    put(list, seen.slice(-400).reverse().map((e) => {
      const label = labels.get(e.number);
      const ended = over(e, all);
      return h("li", {}, h("time", {}, e.time ? clock(e.time, true) : `row ${e.row}`), h("b", {}, kind(e)), e.signal && !e.reason.startsWith(e.signal) && ` ${e.signal}`, ` ${e.reason}`, e.evidence?.person && h("span", { class: "quiet" }, ` (${e.evidence.person})`), " ",
        label && h("span", { class: "tag" }, `${label.evidence.verdict}, ${label.evidence.person ?? "somebody"}`), ended && h("span", { class: "tag" }, ended), " ",
        e.kind !== "labelled" && h("button", { type: "button", id: `event-${e.number}`, "aria-label": `Label event ${e.number}`, onclick: () => choose(e).catch((error) => { said.hidden = false; put(said, error.message); }) }, "Label"),
        did.has(e.number) && h("div", { class: "did" }, h("b", {}, "What the label changed: "), did.get(e.number).reason));
    }), !seen.length && h("li", { class: "quiet" }, "No events."));
  }

  const heard = () => show();
  const standing = () => JSON.stringify(context.twins.filter((one) => one.name === twin).map((one) => [one.alarm, one.returned, one.refused]));
  let stood = standing();
  context.feed?.addEventListener("events", heard);
  show();
  return {
    element: h("div", {}, h("div", { class: "row" }, h("h1", {}, `Events of ${twin}`), h("span", { class: "grow" }), h("label", {}, only, " only alarms"), h("label", {}, "Search ", search)), said, h("section", { class: "card" }, list)),
    update: () => {
      if (stood === standing()) return;
      stood = standing();
      show();
    },
    close: () => context.feed?.removeEventListener("events", heard),
  };
}
