// The frame of the page: where one is, what the service says of its twins, and whether it is there.

import { h, put } from "./dom.js";
import { age, conditionOf } from "./words.js";
import { ask, asKnown, Feed, service } from "./wire.js";
import * as fleet from "./views/fleet.js";
import * as live from "./views/live.js";
import * as improvement from "./views/improvement.js";
import * as events from "./views/events.js";
import * as signals from "./views/signals.js";
import * as life from "./views/life.js";
import * as engineering from "./views/engineering.js";
import * as faults from "./views/faults.js";
import * as add from "./views/add.js";

const VIEWS = {
  live: ["Live", live], improvement: ["Improvement", improvement], events: ["Events", events], signals: ["Signals", signals],
  life: ["Life", life], engineering: ["Engineering", engineering], faults: ["Inject a fault", faults],
};
const EVERY = 1000;
/** Milliseconds after which a question that hangs is asked anew. */
const PATIENCE = 10000;
const top = document.getElementById("top");
const main = document.getElementById("main");
const banner = document.getElementById("banner");

const context = { said: [], page: { machines: [], may_order: false }, feed: null, site: "", person: "", get twins() { return this.said.map(asKnown); }, get silent() { return service.silent; } };
let here = null;
let shown = "";

/** What the address says: {view, twin}. */
function place() {
  const [first, twin, view] = location.hash.replace(/^#\/?/, "").split("/").map(decodeURIComponent);
  if (first === "twin" && twin) return { twin, view: view in VIEWS ? view : "live" };
  return { view: first === "add" ? "add" : "fleet" };
}

export const address = (twin, view = "live") => `#/twin/${encodeURIComponent(twin)}/${view}`;

function header(at) {
  const link = (to, text, current) => h("a", { href: to, "aria-current": current && "page" }, text);
  const tabs = at.twin
    ? Object.entries(VIEWS).filter(([key]) => key !== "faults" || context.page.machines.length).map(([key, [name]]) => link(address(at.twin, key), name, key === at.view))
    : [link("#/add", "Add a machine", at.view === "add")];
  put(top, h("a", { class: "brand", href: "#/" }, `evertwin${context.site && ` · ${context.site}`}`),
    h("nav", { "aria-label": "Views" }, link("#/", "Fleet", at.view === "fleet"), tabs),
    h("span", { class: "space" }),
    h("span", { class: "quiet who" }, context.page.may_order ? "operator" : "read only"),
    h("button", { type: "button", id: "theme", onclick: () => theme(dark() ? "light" : "dark") }, "Light / dark"));
}

function follow() {
  const at = place();
  const now = JSON.stringify(at);
  if (now === shown) return;
  shown = now;
  here?.close?.();
  if (context.feed && context.feed.twin !== at.twin) {
    context.feed.close();
    context.feed = null;
  }
  if (at.twin && !context.feed) {
    context.feed = new Feed(at.twin);
    context.feed.addEventListener("line", told);
  }
  header(at);
  const [name, view] = at.twin ? VIEWS[at.view] : ["", at.view === "add" ? add : fleet];
  document.title = [at.twin, name, "evertwin"].filter(Boolean).join(" · ");
  here = view.open({ ...at, context });
  put(main, here.element);
  here.update?.(context);
  main.scrollTop = 0;
}

/** What the service says of itself, once a second, whether it is looked at or not. */
async function poll() {
  try {
    const status = await ask("/api/v1/status", undefined, PATIENCE);
    context.said = status.twins;
    context.shared = status.fleet;
    if (context.site !== status.site) {
      context.site = status.site;
      header(place());
    }
    service.heard = Date.now();
    service.lost = "";
  } catch (error) {
    service.lost = error.message;
  }
  now();
  setTimeout(poll, EVERY);
}

/** Once a second, whether an answer came or not. */
function now() {
  document.documentElement.dataset.up = service.silent || service.lost || service.heard === null ? "no" : "yes";
  told();
  here?.update?.(context);
}

/** The banner: what is not there, and how old what is shown is. */
function told() {
  const feed = context.feed;
  const twin = feed && context.twins.find((one) => one.name === feed.twin);
  const old = (since) => age(since === null ? null : Math.max((Date.now() - since) / 1000, 1));
  let text = "";
  const { heard, lost, silent } = service;
  if (lost || silent) text = `No connection: ${lost || "the service does not answer"}. What is shown is ${heard === null ? "nothing yet" : `${old(heard)} old`}. It is tried again by itself.`;
  else if (twin && conditionOf(twin) === "failure") text = `This twin does not run: ${twin.reason || "its model or its store failed"}. What is shown is ${age(twin.age)} old.`;
  else if (twin && conditionOf(twin) === "stale") text = `STALE: no samples for ${age(twin.age)}. What is shown is that old.`;
  else if (feed && !feed.up && Date.now() - feed.since > 1500) text = `The live line is down since ${old(feed.since)}. It is tried again by itself.`;
  if (banner.textContent !== text) banner.textContent = text;
  banner.classList.toggle("on", text !== "");
}

const dark = () => document.documentElement.classList.contains("dark");

function theme(name) {
  const wanted = name ?? localStorage.getItem("theme") ?? (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
  if (name) localStorage.setItem("theme", name);
  document.documentElement.classList.remove("dark", "light");
  document.documentElement.classList.add(wanted);
  here?.redraw?.();
}

theme();
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => theme());
addEventListener("hashchange", () => {
  follow();
  main.focus({ preventScroll: true });
  scrollTo(0, 0);
});
addEventListener("resize", () => here?.redraw?.());
ask("/page").then((page) => (context.page = page), () => {}).then(() => {
  shown = ""; // what was opened meanwhile did not know what may be ordered here
  follow();
  poll();
  setInterval(now, EVERY);
});
window.evertwin = context;
