// How long components last, where the twin file says what tells wear.

import { h, put, table } from "../dom.js";
import { number } from "../words.js";
import { ask, of } from "../wire.js";

const EVERY = 30000;

export function open({ twin }) {
  const body = h("div", {}, h("p", { class: "quiet" }, "Asking …"));
  let asked = 0;

  async function update() {
    if (Date.now() - asked < EVERY) return;
    asked = Date.now();
    try {
      const told = await ask(of(twin, "/life"));
      const rows = Object.entries(told.components).map(([name, one]) => [name, one.indicator ?? "–", said(one.value, one.unit), said(one.limit, one.unit), one.sentence]);
      put(body, table(`By ${told.clock}`, ["component", "what tells wear", "now", "limit", "how long"], rows),
        h("h2", {}, "Alarms"), told.alarms?.length ? h("ul", {}, told.alarms.map((one) => h("li", {}, typeof one === "string" ? one : (one.reason ?? JSON.stringify(one))))) : h("p", {}, "None."),
        (told.notes ?? []).map((one) => h("p", { class: "quiet" }, one)));
    } catch (error) {
      put(body, h("p", {}, error.message));
    }
  }

  update();
  return { element: h("section", { class: "card" }, h("h1", {}, `Life of ${twin}`), body), update };
}

const said = (value, unit) => (typeof value === "number" ? `${number(value)} ${unit ?? ""}` : (value?.value !== undefined ? said(value.value, value.unit ?? unit) : "–"));
