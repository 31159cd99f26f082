// Embedded machines can be told to wear, to carry, to lie with a sensor.

import { action, field, h, put } from "../dom.js";
import { ask } from "../wire.js";

export function open({ context }) {
  const machines = context.page.machines.map((name) => machine(name, context));
  return { element: h("div", {}, h("h1", {}, "Inject a fault"), h("p", { class: "quiet" }, "Embedded machines only: nothing here reaches a real one."), machines) };
}

function machine(name, context) {
  const knows = h("pre", { class: "copy", tabindex: 0, "aria-label": `What ${name} knows` }, "…");
  const orders = h("input", { id: `orders-${name}`, placeholder: "friction.2=1.3 for=60", maxlength: 200 });
  const where = `/machines/${encodeURIComponent(name)}`;
  const look = () => ask(where).then(({ answer }) => put(knows, answer), (error) => put(knows, error.message));
  look();
  return h("section", { class: "card" }, h("h2", {}, name),
    h("div", { class: "row" }, field("Orders, as in evertwin machine tell", orders), action("Tell it", async () => {
      const { answer } = await ask(where, { orders: orders.value });
      look();
      return answer;
    }, { class: "main", disabled: !context.page.may_order, id: `tell-${name}` })), knows);
}
