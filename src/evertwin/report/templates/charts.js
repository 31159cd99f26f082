for (const plot of document.querySelectorAll(".plot")) {
  const svg = plot.querySelector("svg"), said = plot.querySelector("output");
  const all = JSON.parse(plot.dataset.values), whole = svg.getAttribute("viewBox"), size = whole.split(" ").map(Number);
  let box = size.slice(), held = null, first = null;
  const mark = document.createElementNS(svg.namespaceURI, "path");
  mark.setAttribute("class", "cursor");
  svg.append(mark);
  const shown = (v) => (Math.abs(v) >= 1e5 || (v && Math.abs(v) < 1e-3) ? v.toExponential(2) : String(Number(v.toPrecision(4))));
  const place = (e) => { const p = new DOMPoint(e.clientX, e.clientY).matrixTransform(svg.getScreenCTM().inverse()); return [p.x, p.y]; };
  const near = (line, x) => {
    let low = 0, high = line.x.length - 1;
    while (high - low > 1) { const middle = (low + high) >> 1; if (line.x[middle] < x) low = middle; else high = middle; }
    return Math.abs(line.x[low] - x) < Math.abs(line.x[high] - x) ? low : high;
  };
  const axesAt = ([x, y]) => all.find(({ box: b }) => x >= b[0] && x <= b[2] && y >= b[1] && y <= b[3]);
  const at = (axes, x) => axes.x[0] + (x - axes.box[0]) / (axes.box[2] - axes.box[0]) * (axes.x[1] - axes.x[0]);
  const tell = (point) => {
    const axes = axesAt(point);
    if (!axes) return;
    const x = at(axes, point[0]), before = first && first.axes === axes ? first.x : null;
    const along = axes.along || all.map((one) => one.along).find(Boolean) || "";
    const rows = axes.lines.map((line) => {
      const v = line.y[near(line, x)];
      const other = before === null ? "" : `, since the mark ${shown(v - line.y[near(line, before)])} ${axes.unit}`;
      return `${line.name} ${shown(v)} ${axes.unit}${other}`;
    });
    said.textContent = `${along.replace(/ \[.*/, "")} ${shown(x)} ${(along.match(/\[(.*)\]/) || ["", ""])[1]}: ${rows.join("; ")}`;
    const lines = all.filter((one) => one.box[0] === axes.box[0]).map(({ box: b }) => `M${point[0]} ${b[1]}V${b[3]}`);
    mark.setAttribute("d", lines.join("") + (first ? `M${first.px} ${first.axes.box[1]}V${first.axes.box[3]}` : ""));
  };
  const look = () => svg.setAttribute("viewBox", box.join(" "));
  const zoom = (factor, [x, y]) => {
    const wide = Math.min(size[2], Math.max(size[2] / 40, box[2] * factor)), k = wide / box[2];
    box = [x - (x - box[0]) * k, y - (y - box[1]) * k, wide, box[3] * k];
    box[0] = Math.min(Math.max(box[0], 0), size[2] - box[2]);
    box[1] = Math.min(Math.max(box[1], 0), size[3] - box[3]);
    look();
  };
  svg.addEventListener("wheel", (e) => { if (!e.ctrlKey && !e.shiftKey) return; e.preventDefault(); zoom(Math.exp((e.deltaY || e.deltaX) * .002), place(e)); }, { passive: false });
  svg.addEventListener("pointerdown", (e) => { held = { at: place(e), moved: false }; });
  svg.addEventListener("pointermove", (e) => {
    if (!held || !e.buttons || box[2] === size[2]) return tell(place(e));
    const [x, y] = place(e);
    held.moved = true;
    box[0] = Math.min(Math.max(box[0] + held.at[0] - x, 0), size[2] - box[2]);
    box[1] = Math.min(Math.max(box[1] + held.at[1] - y, 0), size[3] - box[3]);
    look();
  });
  svg.addEventListener("pointerup", (e) => {
    const point = place(e), axes = axesAt(point);
    if (held && !held.moved && axes) first = { axes, x: at(axes, point[0]), px: point[0] };
    held = null;
    tell(point);
  });
  svg.addEventListener("dblclick", () => { box = size.slice(); first = null; look(); mark.removeAttribute("d"); said.textContent = ""; });
  svg.tabIndex = 0;
  let key = null;
  svg.addEventListener("keydown", (e) => {
    const axes = all[0];
    if (!axes) return;
    const step = { ArrowLeft: -1, ArrowRight: 1 }[e.key];
    if (step) { key = Math.min(Math.max((key ?? (axes.box[0] + axes.box[2]) / 2) + step * (axes.box[2] - axes.box[0]) / 100, axes.box[0]), axes.box[2]); tell([key, (axes.box[1] + axes.box[3]) / 2]); }
    else if (e.key === "+" || e.key === "-") zoom(e.key === "+" ? .7 : 1.4, [key ?? box[0] + box[2] / 2, box[1] + box[3] / 2]);
    else if (e.key === "Escape") svg.dispatchEvent(new Event("dblclick"));
    else return;
    e.preventDefault();
  });
}
addEventListener("beforeprint", () => document.querySelectorAll("details").forEach((one) => { one.open = true; }));
