// From what a machine says to a twin file to copy.

import { action, field, h, put } from "../dom.js";
import { ask } from "../wire.js";

const PORTS = { modbus: 502, mqtt: 1883, opcua: 4840 };

export function open({ context }) {
  const protocol = h("select", { id: "protocol", onchange: () => (port.value = String(PORTS[protocol.value])) }, Object.keys(PORTS).map((one) => h("option", { value: one }, one)));
  const host = h("input", { id: "host", value: "127.0.0.1" });
  const port = h("input", { id: "port", value: "502", inputmode: "numeric" });
  const heard = h("pre", { class: "copy", tabindex: 0, hidden: true, "aria-label": "What it says" });
  const lines = h("textarea", { id: "columns", rows: "8", spellcheck: "false", "aria-describedby": "form" }, "");
  const file = h("pre", { class: "copy", tabindex: 0, hidden: true, id: "twin-file", "aria-label": "Files to copy" });
  const may = context.page.may_order;

  async function look() {
    const where = protocol.value === "opcua" ? { url: `opc.tcp://${host.value}:${port.value}` } : { host: host.value, port: Number(port.value) };
    const { lines: told } = await ask("/api/v1/look", { protocol: protocol.value, ...where });
    heard.hidden = false;
    put(heard, told.join("\n"));
    return `${told.length} lines`;
  }

  function write() {
    const columns = lines.value.split("\n").map((line) => line.trim().split(/\s+/)).filter((words) => words.length >= 3);
    if (!columns.length) throw new Error("name at least one column: place, name, unit");
    file.hidden = false;
    put(file, files(protocol.value, host.value, port.value, columns));
    return "copy each part into the file that its first line names";
  }

  return { element: h("div", {}, h("h1", {}, "Add a machine"),
    h("section", { class: "card" }, h("h2", {}, "1. What does it say?"), !may && h("p", { class: "quiet" }, "To look only: open the link that 'evertwin page' printed."),
      h("div", { class: "row" }, field("Protocol", protocol), field("Host", host), field("Port", port)), action("Look", look, { class: "main", disabled: !may, id: "look" }), heard),
    h("section", { class: "card" }, h("h2", {}, "2. What is what?"), h("p", { class: "quiet", id: "form" }, "One column a line: its place (register and type such as 8:float32, path in a message, or node id), a name, a unit; and for the column of time the name t."),
      field("Columns", lines), action("Write the files", async () => write(), { id: "write" })),
    h("section", { class: "card" }, h("h2", {}, "3. Copy, check, run"), h("p", {}, "Say in [model] what kind of machine it is; then: evertwin doctor site.toml, evertwin serve site.toml."), file)) };
}

const quoted = (text) => JSON.stringify(String(text));

function files(protocol, host, port, columns) {
  const channels = columns.filter(([, name]) => name !== "t").map(([, name, unit]) => `${quoted(name)} = { column = ${quoted(name)}, unit = ${quoted(unit)} }`);
  const time = columns.find(([, name]) => name === "t");
  const places = columns.map(([place, name]) => {
    const [address, type = "uint16"] = place.split(":");
    return `${quoted(name)} = ${protocol === "modbus" ? `{ address = ${Number(address)}, type = ${quoted(type)} }` : quoted(place)}`;
  });
  const table = { modbus: "registers", mqtt: "columns", opcua: "nodes" }[protocol];
  const reached = protocol === "opcua" ? [`url = ${quoted(`opc.tcp://${host}:${port}`)}`] : [`host = ${quoted(host)}`, `port = ${Number(port)}`];
  return [
    "# machine.toml", "schema = 1", 'name = "machine"', "", "[model]", 'kind = "…"  # arm, differential, robot1d, …: docs, "The twin file"', "",
    "[[source]]", 'name = "controller"', `time = { column = "t", unit = ${quoted(time ? time[2] : "s")} }`, "", "[source.channels]", ...channels, "",
    "# site.toml", "schema = 1", 'name = "hall"', "", "[[twin]]", 'file = "machine.toml"', "", "[[twin.source]]", 'source = "controller"', `protocol = ${quoted(protocol)}`, ...reached,
    ...(time ? [] : ['stamp = "arrival"']), ...(protocol === "mqtt" ? ['topic = "…"'] : []), "", `[twin.source.${table}]`, ...places, "",
  ].join("\n");
}
