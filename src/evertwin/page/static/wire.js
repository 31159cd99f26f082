// The way to the service: questions, one socket for the twin that is looked at, and what came by it.
// A socket that broke is opened again by itself, from the same cursor; rows that came meanwhile are
// asked for, so that nothing lacks and nothing is there twice.

import { age } from "./words.js";

const FIRST = 300;
const LONGEST = 2000;
const AGAIN = 4096;
/** Seconds without a word from the service, from which on what is shown is stale. */
const SILENT = 3;

/** What the service said of its twins, and when, by the clock of this page: a service that hangs says nothing. */
export const service = {
  heard: null,
  lost: "",
  get silent() {
    const since = this.heard === null ? 0 : (Date.now() - this.heard) / 1000;
    return since > SILENT || (this.lost && since > 0) ? Math.max(since, 1) : 0;
  },
};

/** A twin as it is known now: of one that nothing was heard of for a while nobody knows that it is good. */
export function asKnown(twin) {
  const { silent } = service;
  if (!silent) return twin;
  return { ...twin, silent, stale: true, age: twin.age === null ? null : twin.age + silent, why: `the service has not answered for ${age(silent)}` };
}

/** The answer to a question, or an error that says why there is none; after so many ms none is waited for. */
export async function ask(path, body, patience) {
  let answer;
  try {
    const signal = patience && AbortSignal.timeout(patience);
    answer = await fetch(path, body === undefined ? { signal } : { method: "POST", body: JSON.stringify(body), signal });
  } catch (error) {
    throw new Error(error.name === "TimeoutError" ? "the service does not answer" : "the page's own server does not answer");
  }
  const told = await answer.json().catch(() => ({}));
  if (answer.ok) return told;
  const detail = typeof told.detail === "string" ? told.detail : (told.detail?.[0]?.msg ?? answer.statusText);
  throw new Error(told.error ?? detail);
}

export const of = (twin, rest = "") => `/api/v1/twins/${encodeURIComponent(twin)}${rest}`;

/** The newest rows of a twin, each once, in order of their numbers. */
export class Rows {
  constructor(most = 10000) {
    this.most = most;
    this.clear();
  }

  clear() {
    this.row = [];
    this.t = [];
    this.version = [];
    this.outputs = {};
    this.inputs = {};
  }

  get newest() {
    return this.row.length ? this.row[this.row.length - 1] : -1;
  }

  /** More rows; false where some lack between what is here and these. */
  add(rows) {
    let from = 0;
    while (from < rows.row.length && rows.row[from] <= this.newest) from += 1;
    if (from === rows.row.length) return true;
    const whole = this.newest < 0 || rows.row[from] === this.newest + 1;
    if (!whole) return false;
    this.#append(rows, from);
    return true;
  }

  /** Rows that replace what is here where something lacks between. */
  take(rows) {
    if (this.add(rows)) return;
    this.clear();
    this.#append(rows, 0);
  }

  #append(rows, from) {
    const over = this.row.length + rows.row.length - from > this.most * 1.25;
    const cut = over ? this.row.length - this.most : 0;
    const join = (held, more) => {
      if (cut > 0) held.splice(0, cut);
      for (let k = from; k < more.length; k += 1) held.push(more[k]);
      return held;
    };
    join(this.row, rows.row);
    join(this.t, rows.t);
    join(this.version, rows.version);
    for (const [name, columns] of Object.entries(rows.outputs)) {
      const held = (this.outputs[name] ??= {});
      for (const [key, column] of Object.entries(columns)) join((held[key] ??= []), column);
    }
    for (const [name, column] of Object.entries(rows.inputs ?? {})) join((this.inputs[name] ??= []), column);
  }
}

/** One twin, as it comes. Listeners are told: rows, events, line. */
export class Feed extends EventTarget {
  constructor(twin) {
    super();
    this.twin = twin;
    this.rows = new Rows();
    this.events = [];
    this.cursor = null;
    this.up = false;
    this.since = Date.now();
    this.heard = null;
    this.missed = 0;
    this.repeated = 0;
    this.ended = false;
    this.pause = FIRST;
    this.#open();
  }

  close() {
    this.ended = true;
    clearTimeout(this.timer);
    this.socket?.close();
  }

  /** Seconds since anything was heard; null: never. */
  get age() {
    return this.heard === null ? null : (Date.now() - this.heard) / 1000;
  }

  async #open() {
    if (this.ended) return;
    const after = this.cursor === null ? "" : `&after=${encodeURIComponent(`${this.twin}:${this.cursor}`)}`;
    const place = location.origin.replace(/^http/, "ws");
    const socket = new WebSocket(`${place}/api/v1/stream?twin=${encodeURIComponent(this.twin)}${after}`);
    this.socket = socket;
    this.waiting = [];
    socket.onmessage = (message) => {
      this.heard = Date.now();
      if (!this.up && this.waiting) this.#begin();
      this.#hear(JSON.parse(message.data));
    };
    socket.onclose = () => this.#broke(socket);
  }

  #begin() {
    this.up = true;
    this.pause = FIRST;
    this.#tell("line");
    this.#fill();
  }

  /** Asks for what is not here, while new rows wait. */
  async #fill() {
    this.waiting ??= [];
    const socket = this.socket;
    try {
      const asks = [ask(of(this.twin, `/rows?last=${AGAIN}&points=${AGAIN}`))];
      if (this.cursor === null) asks.push(ask(of(this.twin, "/events?last=500")));
      const [rows, events] = await Promise.all(asks);
      if (socket !== this.socket) return;
      if (rows.row.length && rows.row[rows.row.length - 1] < this.rows.newest) return this.#anew();
      if (events) this.#heardEvents(events);
      if (rows.row.length) this.rows.take(rows);
    } catch {
      if (socket === this.socket && !this.ended) this.timer = setTimeout(() => this.#fill(), 1000);
      return;
    }
    const waiting = this.waiting;
    this.waiting = null;
    for (const rows of waiting) if (!this.rows.add(rows)) return this.#fill();
    this.#tell("rows");
  }

  /** The twin has another store: what is here is of another history. */
  #anew() {
    this.rows.clear();
    this.events = [];
    this.cursor = null;
    this.socket.close();
  }

  #hear(message) {
    if (message.type === "events") return this.#heardEvents(message);
    if (message.type !== "rows") return;
    if (message.missed) this.missed += message.missed;
    if (this.waiting) this.waiting.push(message.rows);
    else if (!this.rows.add(message.rows)) {
      this.waiting = [];
      this.#fill();
    } else this.#tell("rows");
  }

  #heardEvents({ events, cursor }) {
    // the past is asked for while the socket tells what is new: either may come first
    const [first, last] = this.events.length ? [this.events[0].number, this.events[this.events.length - 1].number] : [Infinity, 0];
    const fresh = events.filter((event) => event.number > last || event.number < first);
    this.repeated += events.length - fresh.length;
    this.events = [...fresh.filter((event) => event.number < first && event.number <= last), ...this.events, ...fresh.filter((event) => event.number > last)];
    if (this.events.length > 3000) this.events.splice(0, 1000);
    this.cursor = Math.max(cursor, this.cursor ?? 0);
    this.#tell("events");
  }

  #broke(socket) {
    if (socket !== this.socket || this.ended) return;
    if (this.up) this.since = Date.now();
    this.up = false;
    this.#tell("line");
    this.timer = setTimeout(() => this.#open(), this.pause);
    this.pause = Math.min(this.pause * 1.5, LONGEST);
  }

  #tell(what) {
    this.dispatchEvent(new Event(what));
  }
}
