// Numbers, times and states as a person says them.

import { s } from "./dom.js";

const SCALES = {
  m: [[1, "m"], [0.01, "cm", 0.1], [0.001, "mm"]],
  "m/s": [[1, "m/s"], [0.01, "cm/s"], [0.001, "mm/s"]],
  rad: [[Math.PI / 180, "°"]],
  "rad/s": [[Math.PI / 180, "°/s"]],
};

const named = (unit) => unit.replace(/^deg(?=[CF]$)/, "°");

/** The unit of an output: that of the twin file, where it names another than SI and its parts. */
export const unitOf = (output) => output.shown ?? output.unit;

/** The same for values themselves, which may be counted from another zero (°C); what lies apart is not. */
export const levelOf = (output) => (output.shown?.zero ? { ...output.shown, apart: output.shown.unit, from: output.shown.zero } : unitOf(output));

/** Factor and name of the unit in which so large a value is told; a third says from which size on. */
export function scale(unit, size) {
  if (unit?.factor) return [unit.factor, named(unit.apart ?? unit.unit)];
  const known = SCALES[unit];
  if (!known) return [1, unit === "1" ? "" : unit];
  return known.find(([factor, , least = factor]) => Math.abs(size) >= least) ?? known[known.length - 1];
}

/** Three digits that count. */
export function number(value, digits = 3) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e5 || size < 1e-4) return value.toExponential(digits - 1);
  return value.toFixed(Math.max(0, digits - 1 - Math.floor(Math.log10(size)))).replace("-", "−");
}

/** A number of an axis. */
export const trimmed = (v) => String(Number(v.toPrecision(6))).replace("-", "−");

/** A value with its unit. */
export function quantity(value, unit, size = value) {
  if (value === null || value === undefined) return "–";
  const [factor, name] = scale(unit, size ?? 0);
  return `${number((value - (unit?.from ?? 0)) / factor)}${name && !name.startsWith("°") ? "\u00a0" : ""}${name}`;
}

/** The same where there is little room: the unit may stand below its number. */
export const parted = (text) => text.replace("\u00a0", " ");

/** How long ago. */
export function age(seconds) {
  if (seconds === null || seconds === undefined) return "never";
  if (seconds < 1) return "now";
  if (seconds < 120) return `${Math.round(seconds)} s`;
  if (seconds < 7200) return `${Math.round(seconds / 60)} min`;
  if (seconds < 172800) return `${Math.round(seconds / 3600)} h`;
  return `${Math.round(seconds / 86400)} days`;
}

/** The machine's clock, from nanoseconds. */
export function clock(ns, withDay = false) {
  if (ns === null || ns === undefined) return "–";
  const date = new Date(ns / 1e6);
  const time = date.toLocaleTimeString("en-GB");
  return withDay ? `${date.toLocaleDateString("en-GB", { day: "numeric", month: "short" })} ${time}` : time;
}

export const count = (n, one, more = `${one}s`) => `${n} ${n === 1 ? one : more}`;

/** NAMUR NE 107 and what is said beside it; the first needs attention first. */
export const CONDITIONS = {
  failure: ["Failure", "failure"],
  out_of_specification: ["Out of specification", "out"],
  maintenance_required: ["Maintenance required", "maintenance"],
  stale: ["Stale", "stale"],
  check: ["Function check", "check"],
  unjudged: ["Not judged", "check"],
  good: ["Good", "good"],
};

/** Which of these a twin is in. */
export function conditionOf(twin) {
  if (twin.state === "quarantined") return "failure";
  if (twin.silent || (twin.stale && twin.age !== null && twin.state !== "ended")) return "stale";
  return twin.condition in CONDITIONS ? twin.condition : "check";
}

const SHAPES = {
  failure: () => [s("circle", { cx: 12, cy: 12, r: 10 }), s("path", { class: "ink", d: "M8 8l8 8M16 8l-8 8" })],
  out: () => [s("path", { d: "M12 2L23 21H1z" }), s("path", { class: "ink", d: "M12 9v6M12 17.5v1.5" })],
  maintenance: () => [s("path", { d: "M12 1l11 11-11 11L1 12z" }), s("path", { class: "ink", d: "M8 16l5-5M13 11a2.5 2.5 0 1 0 2-4" })],
  check: () => [s("path", { d: "M12 22L1 3h22z" }), s("path", { class: "ink", d: "M12 6v6M12 14v2" })],
  stale: () => [s("rect", { x: 2, y: 2, width: 20, height: 20, rx: 3 }), s("path", { class: "ink", d: "M12 6v6l4 3" })],
  good: () => [s("circle", { cx: 12, cy: 12, r: 10 }), s("path", { class: "ink", d: "M7 12.5l3.5 3.5L17 9" })],
};

/** The sign of a condition: a shape and a colour of its own, with a name for those who see neither. */
export function sign(condition) {
  const [name, look] = CONDITIONS[condition] ?? CONDITIONS.check;
  return s("svg", { viewBox: "0 0 24 24", class: `sign ${look}`, role: "img", "aria-label": name }, SHAPES[look]());
}

/** What a kind of event means to somebody in the hall. */
export const KINDS = {
  promoted: "improved", rolled_back: "taken back", suspected: "suspected", normal: "explained", abnormal: "form is wrong",
  tuned: "tuned", corrected: "corrected", rejected: "no better", drift: "drift", measurement_error: "sensor error",
  measurement_restored: "sensor restored", at_limit: "at a limit", external: "pushed", alarm: "alarm", alarm_cleared: "alarm over",
  labelled: "labelled", heeded: "label acted", pinned: "pinned", configured: "configured", started: "started", changed: "machine changed",
  not_identifiable: "cannot be told", not_valid: "no trusted sample", valid: "trusted again", overruled: "measurement believed",
  silent: "no samples", back: "samples again",
  not_calibrated: "limits not known yet", gate_widened: "gate widened", superseded: "overtaken", recovered: "store recovered",
};
export const kind = ({ kind: name, evidence }) =>
  name === "abnormal" && evidence?.number !== undefined ? "sensor in doubt" : KINDS[name] ?? name.replaceAll("_", " ");
