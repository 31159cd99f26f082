// From what a machine says to a twin file to copy: look, name, try.

import { action, field, h, put, table } from "../dom.js";
import { number, quantity } from "../words.js";
import { ask } from "../wire.js";

const PORTS = { modbus: 502, mqtt: 1883, opcua: 4840 };
const PLACES = { modbus: "8:float32 swapped", mqtt: "state.v", opcua: "nsu=…;s=Axis.Speed" };
const AGAIN = 3000;

export function open({ context }) {
  const may = context.page.may_order;
  const protocol = h("select", { id: "protocol", onchange: () => {
    port.value = String(PORTS[protocol.value]);
    topic.parentElement.hidden = protocol.value !== "mqtt";
    written.hidden = protocol.value !== "modbus";
    device.parentElement.hidden = protocol.value !== "modbus";
    for (const one of lines.querySelectorAll(".place")) one.placeholder = PLACES[protocol.value];
  } }, Object.keys(PORTS).map((one) => h("option", { value: one }, one)));
  const host = h("input", { id: "host", value: "127.0.0.1" });
  const port = h("input", { id: "port", value: "502", inputmode: "numeric" });
  const topic = h("input", { id: "topic" });
  const device = h("input", { id: "device", value: "1", inputmode: "numeric" });
  const heard = h("pre", { class: "copy heard", tabindex: 0, hidden: true, "aria-label": "What it says, decoded side by side" });
  const stop = h("button", { type: "button", hidden: true, id: "stop", onclick: () => watch(false) }, "Stop looking");
  const kind = h("select", { id: "kind", onchange: () => rolesOf() });
  const called = h("input", { id: "called", value: "machine" });
  const seconds = h("input", { id: "seconds", value: "5", inputmode: "decimal" });
  const names = h("datalist", { id: "roles" });
  const wanted = h("p", { class: "quiet", id: "wanted" });
  const written = h("p", { class: "quiet" }, "A register: 8:float32, with its words swapped 8:float32 swapped, a tenth input 3:int16 *0.1, and where −32768 means no value 3:int16 !-32768.");
  const lines = h("tbody");
  const found = h("div", { id: "found" });
  let [kinds, timer, ended, asking] = [{}, null, false, false];

  const where = () => ({ protocol: protocol.value, ...(protocol.value === "opcua" ? { url: `opc.tcp://${host.value}:${port.value}` } : { host: host.value, port: Number(port.value) }), ...(protocol.value === "modbus" ? { device: Number(device.value) } : {}) });

  async function look() {
    if (asking) return "";
    asking = true;
    try {
      const { lines: told } = await ask("/api/v1/look", where());
      heard.hidden = false;
      put(heard, told.join("\n"));
      if (!ended) watch(true);
      return `${told.length} lines, asked again every ${AGAIN / 1000} s`;
    } finally {
      asking = false;
    }
  }

  function watch(on) {
    clearInterval(timer);
    timer = on ? setInterval(() => !document.hidden && look().catch((error) => { watch(false); put(heard, error.message); }), AGAIN) : null;
    stop.hidden = !on;
  }

  function line() {
    let proposed = "";
    const place = h("input", { class: "place", "aria-label": "Place", placeholder: PLACES[protocol.value] });
    const unit = h("input", { class: "unit", "aria-label": "Unit", size: 8 });
    const name = h("input", { class: "name", "aria-label": "Name", list: "roles", oninput: () => {
      const role = (kinds[kind.value] ?? []).find((one) => one.name === name.value);
      if (role && (!unit.value || unit.value === proposed)) unit.value = proposed = role.unit;
    } });
    const row = h("tr", {}, h("td", {}, place), h("td", {}, name), h("td", {}, unit), h("td", { class: "value" }, "–"),
      h("td", {}, h("button", { type: "button", "aria-label": "Remove this column", onclick: () => row.remove() }, "×")));
    return row;
  }

  const columns = () => [...lines.rows].map((row) => ["place", "name", "unit"].map((key) => row.querySelector(`.${key}`).value.trim())).filter((words) => words.some(Boolean));

  function rolesOf() {
    const of = kinds[kind.value] ?? [];
    put(names, of.map((one) => h("option", { value: one.name }, `${one.side}, ${one.unit}`)), h("option", { value: "t" }, "time, s"));
    const side = (which) => of.filter((one) => one.side === which).map((one) => `${one.name} [${one.unit}]`).join(", ");
    put(wanted, `It takes ${side("input")} and predicts ${side("output")}. A derivative that no column has is proposed from its position.`);
  }

  async function attempt() {
    const told = columns();
    if (!told.length || told.some((words) => words.some((word) => !word))) throw new Error("each column: a place, a name and a unit");
    const body = { ...where(), kind: kind.value, name: called.value, seconds: Number(seconds.value), columns: told.map(([place, name, unit]) => ({ place, name, unit })), ...(protocol.value === "mqtt" ? { topic: topic.value } : {}) };
    watch(false);
    const draft = await ask("/api/v1/draft", body);
    for (const row of lines.rows) {
      const [name, unit] = ["name", "unit"].map((key) => row.querySelector(`.${key}`).value.trim());
      put(row.querySelector(".value"), name in draft.newest ? quantity(draft.newest[name], unit) : "–");
    }
    show(draft, body);
    return `${draft.rows} samples in ${number(draft.seconds)} s`;
  }

  function show(draft, body) {
    const said = draft.problem ? h("p", {}, `The twin does not run yet: ${draft.problem}`) : null;
    put(found, h("h3", {}, "First residual"),
      draft.residual.length > 0 ? table(`As it is proposed, nothing tuned, over ${draft.rows} samples`, ["output", "off by (rms)", "rows"], draft.residual.map((one) => [one.output, quantity(one.rms, one.unit), String(one.rows)]))
        : said ?? h("p", {}, draft.questions.length ? "Not yet: something has to be said first." : "Nothing moved that it could be told by."),
      draft.questions.length > 0 && [h("h3", {}, "What is left to say"), h("ul", { id: "questions" }, draft.questions.map((one) => h("li", {}, one)))],
      draft.twin && [file(`${body.name}.toml`, draft.twin, "twin-file"), file("site.toml: add this entry", draft.site, "site-file"),
        h("p", { class: "quiet" }, `Then: evertwin doctor site.toml, evertwin serve site.toml. A new site file begins with: schema = 1, name = "hall".`)]);
  }

  function file(title, text, id) {
    return h("section", {}, h("div", { class: "row" }, h("h3", {}, title), action("Copy", async () => {
      await navigator.clipboard.writeText(text);
      return "copied";
    })), h("pre", { class: "copy", tabindex: 0, id, "aria-label": title }, text));
  }

  lines.append(line(), line());
  topic.disabled = !may;
  const element = h("div", {}, h("h1", {}, "Add a machine"), !may && h("p", { class: "quiet" }, "To look only: open the link that 'evertwin page' printed."),
    h("section", { class: "card" }, h("h2", {}, "1. What does it say?"),
      h("div", { class: "row" }, field("Protocol", protocol), field("Host", host), field("Port", port), field("Topic", topic), field("Unit (Modbus)", device)),
      h("div", { class: "row" }, action("Look", look, { class: "main", disabled: !may, id: "look" }), stop), heard),
    h("section", { class: "card" }, h("h2", {}, "2. What is what?"),
      h("div", { class: "row" }, field("Kind of machine", kind), field("Name", called)), wanted, written, names,
      h("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": "Columns" }, h("table", { class: "columns-of" }, h("thead", {}, h("tr", {}, ["place", "role or name", "unit", "value", ""].map((one) => h("th", {}, one)))), lines)),
      h("button", { type: "button", id: "more", onclick: () => lines.append(line()) }, "One more column")),
    h("section", { class: "card" }, h("h2", {}, "3. Try it"), h("p", { class: "quiet" }, "The machine is read for some seconds, as a twin would read it. Nothing is kept, here or there."),
      h("div", { class: "row" }, field("Seconds", seconds, "at most 20: let it move"), action("Try", attempt, { class: "main", disabled: !may, id: "try" })), found));
  topic.parentElement.hidden = true;
  ask("/api/v1/kinds").then((told) => {
    kinds = told;
    put(kind, Object.keys(kinds).map((one) => h("option", { value: one, selected: one === "drive" }, one)));
    rolesOf();
  }).catch((error) => put(wanted, error.message));
  return { element, close: () => {
    ended = true;
    watch(false);
  } };
}
