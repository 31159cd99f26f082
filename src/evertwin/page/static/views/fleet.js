// All twins: what needs attention first.

import { h, put, table } from "../dom.js";
import { returned } from "../verdict.js";
import { age, CONDITIONS, conditionOf, count, sign } from "../words.js";
import { ask } from "../wire.js";

const ORDER = Object.keys(CONDITIONS);

/** Did somebody acknowledge or shelve what it is out by? Then others need attention first. */
const said = (twin) => ["acknowledged", "shelved"].includes(twin.label);

export function open() {
  const tiles = new Map();
  const list = h("ul", { class: "tiles" });
  const summary = h("p", { class: "lead", role: "status" });
  const search = h("input", { type: "search", id: "search", placeholder: "name or reason", oninput: () => update(last) });
  let last = { twins: [] };

  const nodes = h("section", { class: "card", id: "nodes", hidden: true });
  let asked = 0;

  /** Who runs which twin, where several machines share them; every other second. */
  async function share(context) {
    nodes.hidden = !context.shared;
    if (!context.shared || context.silent || Date.now() - asked < 2000) return;
    asked = Date.now();
    try {
      put(nodes, shared(await ask("/api/v1/fleet")));
    } catch (error) {
      put(nodes, h("p", {}, `Who runs which twin is not known: ${error.message}`));
    }
  }

  function update(context) {
    last = context;
    share(context);
    const wish = search.value.trim().toLowerCase();
    const known = context.twins.map((twin) => [twin, conditionOf(twin)]);
    known.sort(([a, x], [b, y]) => ORDER.indexOf(x) - ORDER.indexOf(y) || said(a) - said(b) || a.name.localeCompare(b.name));
    const seen = known.filter(([twin]) => !wish || `${twin.name} ${twin.why} ${twin.headline}`.toLowerCase().includes(wish));
    put(summary, summed(known.map(([, condition]) => condition)));
    for (const name of tiles.keys()) if (!seen.some(([twin]) => twin.name === name)) tiles.delete(name);
    const wanted = seen.map(([twin, condition]) => {
      if (!tiles.has(twin.name)) tiles.set(twin.name, tile(twin));
      tiles.get(twin.name).show(twin, condition);
      return tiles.get(twin.name).element;
    });
    wanted.forEach((one, k) => list.children[k] !== one && list.insertBefore(one, list.children[k] ?? null));
    while (list.children.length > wanted.length) list.lastChild.remove();
  }

  const element = h("section", {}, h("div", { class: "row" }, h("h1", {}, "Fleet"), h("div", { class: "grow" }, summary), h("label", {}, "Search ", search)), list, nodes);
  return { element, update };
}

/** How many are how: good is only who was judged. */
export function summed(conditions) {
  const [good, unjudged] = ["good", "unjudged"].map((one) => conditions.filter((known) => known === one).length);
  const bad = conditions.length - good - unjudged;
  if (!conditions.length) return "No twins yet.";
  if (good === conditions.length) return `All ${good} good.`;
  const said = [bad && `${count(bad, "twin needs", "twins need")} attention`, unjudged && `${unjudged} not judged`, `${good} good`];
  return `${said.filter(Boolean).join(", ")}.`;
}

/** Twins and nodes of a fleet: what runs nowhere comes first, then what is furthest behind. */
function shared(told) {
  const old = (seconds) => (seconds === null || seconds === undefined ? "–" : seconds < 10 ? `${seconds.toFixed(1)} s` : age(seconds));
  const twins = [...told.twins].sort((a, b) => (a.state === "owned") - (b.state === "owned") || (b.lag ?? 0) - (a.lag ?? 0) || a.twin.localeCompare(b.twin));
  const where = (one) => (one.state === "owned" ? one.node : one.state === "waits" ? "nowhere: it waits" : "nowhere: it is free");
  return [h("h2", {}, `${count(told.twins.length, "twin")} on ${count(told.nodes.length, "node")}`),
    table("Twins", ["Twin", "Runs on", "Lease age", "Behind by", "Row", "Reason"], twins.map((one) => [one.twin, where(one), one.age === null ? "–" : `${one.age.toFixed(1)} of ${age(told.lease)}`, old(one.lag), one.row ?? "–", one.reason || (one.wanted ? `is to go to ${one.wanted}` : "")])),
    table("Nodes", ["Node", "State", "Twins", "Share of a core"], told.nodes.map((one) => [one.node, !one.alive ? "does not answer" : one.drains ? "gives its twins away" : "alive", one.twins, `${(100 * one.cost).toFixed(1)} %`]))];
}

function tile(twin) {
  const parts = { head: h("header"), why: h("p"), told: h("p"), meta: h("p", { class: "meta" }) };
  const link = h("a", { href: `#/twin/${encodeURIComponent(twin.name)}/live` }, parts.head, parts.why, parts.told, parts.meta);
  let drawn = "";
  const show = (now, condition) => {
    const [name, look] = CONDITIONS[condition];
    const old = condition === "stale" ? `STALE for ${age(now.age ?? now.silent)}` : name;
    const why = now.reason || now.why || (now.state === "ended" ? "its sources have ended" : returned(now));
    const meta = `newest sample ${now.age !== null && now.age >= 1 ? `${age(now.age)} ago` : age(now.age)} · version ${now.champion ?? "–"}${now.pinned ? " pinned" : ""} · ${count(now.rows, "row")}`;
    const key = [old, why, now.headline, meta, now.label].join("|");
    if (key === drawn) return;
    drawn = key;
    link.className = `tile ${look}`;
    put(parts.head, sign(condition), h("b", {}, now.name), h("span", {}, old), now.label && h("span", { class: "tag" }, now.label));
    put(parts.why, why);
    put(parts.told, now.headline ?? "");
    put(parts.meta, meta);
  };
  return { element: h("li", {}, link), show };
}
