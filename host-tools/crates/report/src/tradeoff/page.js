// Draws the points of #data into #chart: one axis chosen, sweeps shown or not, the Pareto
// front of what is shown. Hovering or the arrow keys say a point's numbers.
"use strict";
const data = JSON.parse(document.getElementById("data").textContent);
const chart = document.getElementById("chart");
const card = document.getElementById("point");
const [xs, ys] = ["x", "y"].map((id) => document.getElementById(id));
const boxes = [...document.querySelectorAll("input[name=sweep]")];
const own = Object.fromEntries(
  boxes.map((box) => [box.value, box.parentElement.querySelector(".swatch").style.getPropertyValue("--own")]));
const room = { left: 78, right: 24, top: 20, bottom: 54, width: 940, height: 520 };
const axes = {
  instructions: "instructions a frame", microseconds: "microseconds a frame, one core of this machine",
  bytes: "bytes of the table", solve_seconds: "seconds of the solve", photographs: "photographs",
  predicted_error: "predicted error", true_error: "true error",
};
let shown = [];
let current = null;

const element = (name, attributes, parent = chart) => {
  const made = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  parent.append(made);
  return made;
};
const write = (text, attributes) => { element("text", attributes).textContent = text; };
const whole = (value) => Math.round(value).toLocaleString("en").replaceAll(",", "\u202f");
const percent = (error) => (error == null ? "\u2013" : `${(100 * error).toPrecision(3)} %`);
const short = (value) => {
  if (value >= 1e6) return `${+(value / 1e6).toPrecision(3)} M`;
  if (value >= 1e4) return `${+(value / 1e3).toPrecision(3)} k`;
  return `${+value.toPrecision(3)}`;
};

// A logarithmic scale from data to places, with its ticks.
function scale(values, from, to) {
  const [low, high] = [Math.min(...values) / 1.15, Math.max(...values) * 1.15];
  const place = (value) => from + (to - from) * Math.log(value / low) / Math.log(high / low);
  const all = (steps) => {
    const ticks = [];
    for (let power = Math.floor(Math.log10(low)); power <= Math.log10(high); power += 1)
      for (const step of steps) ticks.push(step * 10 ** power);
    return ticks.filter((tick) => tick >= low && tick <= high);
  };
  const choices = [[1], [1, 3], [1, 2, 5], [1, 1.5, 2, 3, 4, 5, 7], [1, 1.2, 1.4, 1.6, 1.8, 2, 2.5, 3, 3.5, 4, 4.5, 5, 6, 7, 8, 9]].map(all);
  return { low, high, place, ticks: choices.find((ticks) => ticks.length > 3) ?? choices[4] };
}

// Points that no other one beats in both, from cheap to dear.
function front(points, x, y) {
  const order = points.filter((p) => !p.hypothetical).sort((a, b) => a[x] - b[x] || a[y] - b[y]);
  let least = Infinity;
  return order.filter((p) => p[y] < least && ((least = p[y]), true));
}

function draw() {
  const [x, y] = [xs.value, ys.value];
  const on = new Set(boxes.filter((box) => box.checked).map((box) => box.value));
  shown = data.points.filter((p) => on.has(p.sweep) && p[x] > 0 && p[y] > 0);
  shown.sort((a, b) => a[x] - b[x] || b[y] - a[y]);
  chart.replaceChildren();
  if (shown.length === 0) {
    write("Nothing to show: choose another cost, or show more.", { class: "axis", x: 470, y: 260, "text-anchor": "middle" });
    return;
  }
  const right = room.width - room.right, bottom = room.height - room.bottom;
  const across = scale(shown.map((p) => p[x]), room.left, right);
  const up = scale(shown.map((p) => p[y]), bottom, room.top);
  const at = (p) => [across.place(p[x]).toFixed(1), up.place(p[y]).toFixed(1)];
  for (const tick of up.ticks) {
    const place = up.place(tick);
    element("line", { class: "grid", x1: room.left, x2: right, y1: place, y2: place });
    write(percent(tick).replace(/\.?0+ /, " "), { class: "tick", x: room.left - 8, y: place + 4, "text-anchor": "end" });
  }
  for (const tick of across.ticks) {
    const place = across.place(tick);
    element("line", { class: "grid", x1: place, x2: place, y1: room.top, y2: bottom });
    write(short(tick), { class: "tick", x: place, y: bottom + 18, "text-anchor": "middle" });
  }
  write(axes[x], { class: "axis", x: (room.left + right) / 2, y: room.height - 12, "text-anchor": "middle" });
  write(axes[y], { class: "axis", transform: `translate(16 ${(room.top + bottom) / 2}) rotate(-90)`, "text-anchor": "middle" });
  const step = 1 / 255;
  if (step > up.low && step < up.high) {
    const place = up.place(step);
    element("line", { class: "limit", x1: room.left, x2: right, y1: place, y2: place });
    write("1/255", { class: "note", x: right - 6, y: place - 6, "text-anchor": "end" });
  }
  const stairs = front(shown, x, y).map((p, index) => {
    const [px, py] = at(p);
    return index ? `H${px}V${py}` : `M${px},${py}`;
  });
  element("path", { class: "front", d: stairs.join("") || "M0,0" });
  const curves = new Map();
  for (const p of [...shown].sort((a, b) => a.tier - b.tier)) {
    if (p.sweep === "tiers") continue;
    const key = `${p.sweep}/${p.setting}`;
    curves.set(key, [...(curves.get(key) ?? []), p]);
  }
  for (const curve of curves.values())
    element("polyline", { class: `curve ${curve[0].sweep}`, style: `--own:${own[curve[0].sweep]}`, points: curve.map(at).join(" ") });
  for (const p of [...shown].sort((a, b) => a.current - b.current)) {
    const [cx, cy] = at(p);
    element("circle", { class: p.hypothetical ? "dot hollow" : "dot", style: `--own:${own[p.sweep]}`, cx, cy, r: p.current ? 6 : 4 });
    if (p.current) write(p.tier, { class: "name", x: +cx + 9, y: cy - 8 });
  }
  for (const p of shown) {
    const [cx, cy] = at(p);
    const hit = element("circle", { class: "hit", cx, cy, r: 9 });
    hit.addEventListener("pointerenter", () => tell(p));
    hit.addEventListener("click", () => tell(p));
  }
  const start = shown.includes(current) ? current : null;
  current = null;
  if (start) tell(start);
}

function tell(p) {
  current = p;
  chart.querySelectorAll(".here").forEach((ring) => ring.remove());
  const hit = chart.querySelectorAll(".hit")[shown.indexOf(p)];
  element("circle", { class: "here", cx: hit.getAttribute("cx"), cy: hit.getAttribute("cy"), r: 10 });
  const numbers = [
    [`${p.current ? "the table" : p.setting}, tier ${p.tier}`, [p.method, p.photographs && `${p.photographs} photographs`, `${p.rows} \u00d7 ${p.cols}`, `${p.bits} bits`].filter(Boolean).join(", ")],
    [percent(p.predicted_error), "predicted error"],
    p.true_error != null && [percent(p.true_error), "true error"],
    [percent(p.left_out), "left out"],
    [whole(p.instructions), `instructions, ${percent(p.share)} of a frame`],
    p.microseconds != null && [p.microseconds.toPrecision(3), "\u00b5s here"],
    [whole(p.bytes), p.hypothetical ? "bytes, hypothetical" : "bytes"],
    p.solve_seconds != null && [p.solve_seconds.toPrecision(3), "seconds of the solve"],
  ];
  card.replaceChildren(...numbers.filter(Boolean).map(([value, what]) => {
    const [cell, bold, small] = ["div", "b", "small"].map((name) => document.createElement(name));
    [bold.textContent, small.textContent] = [value, what];
    cell.append(bold, small);
    return cell;
  }));
}

chart.addEventListener("keydown", (event) => {
  if (shown.length === 0) return;
  const here = shown.indexOf(current);
  const along = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
  const tier = { ArrowUp: -1, ArrowDown: 1 }[event.key];
  if (along) tell(shown[(here + along + shown.length) % shown.length]);
  else if (tier) {
    const table = shown.filter((p) => p.current).sort((a, b) => a.tier - b.tier);
    const next = table[Math.max(0, Math.min(table.length - 1, table.indexOf(current) + tier))];
    if (next) tell(next);
  } else return;
  event.preventDefault();
});
for (const control of [xs, ys, ...boxes]) control.addEventListener("change", draw);
draw();
