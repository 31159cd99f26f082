// What each source brings, and what was kept out and why.

import { h, put, table } from "../dom.js";
import { age, clock, count, number } from "../words.js";

const TOLD = ["state", "rate here", "newest stamp", "received", "came twice", "kept out, why", "lost, why", "remarkable", "reconnects"];

export function open({ twin, context }) {
  const body = h("div");
  const rates = new Map();

  const counts = (found) => Object.entries(found ?? {}).map(([why, n]) => h("div", {}, `${n} × ${why}`));

  function rate(name, received) {
    const before = rates.get(name);
    const now = Date.now() / 1000;
    if (!before || now - before.at > 10) rates.set(name, { at: now, received, rate: before?.now ?? null });
    const one = rates.get(name);
    if (now - one.at > 1) one.now = (received - one.received) / (now - one.at);
    return one.now ?? one.rate;
  }

  function update() {
    const found = context.twins.find((one) => one.name === twin);
    if (!found) return;
    const names = Object.keys(found.sources);
    const told = Object.entries(found.sources).map(([name, one]) => {
      const often = rate(name, one.received);
      return [found.silent ? "not known" : one.state, often === null || often === undefined ? "…" : `${number(often)} 1/s`, clock(one.newest, true), String(one.received), String(one.repeated), counts(one.rejected), counts(one.lost), counts(one.noted), `${one.reconnects}${one.reason ? `: ${one.reason}` : ""}`];
    });
    put(body, h("p", { class: "lead" }, `Newest sample ${age(found.age)}${found.age >= 1 ? " ago" : ""}; ${count(found.waiting, "piece waits", "pieces wait")}; ${found.dropped} samples dropped because too many waited.`),
      table("Sources", ["", ...names], TOLD.map((name, k) => [name, ...told.map((one) => one[k])])),
      quality());
  }

  /** Share of each mark among the newest rows. */
  function quality() {
    const outputs = Object.entries(context.feed?.rows.outputs ?? {});
    const names = ["trusted", "absent", "held", "late", "contested", "overruled", "error", "pushed from outside"];
    const rows = outputs.map(([name, one]) => {
      const marks = one.mark.slice(-1000);
      const share = names.map((label, k) => [label, marks.filter((m) => m === k).length]).filter(([, n]) => n);
      return [name, share.map(([label, n]) => `${label} ${number((100 * n) / marks.length)} %`).join(", ")];
    });
    return table("Quality of the newest 1000 rows", ["signal", "marks"], rows);
  }

  update();
  return { element: h("section", { class: "card" }, h("h1", {}, `Signals of ${twin}`), body), update };
}
