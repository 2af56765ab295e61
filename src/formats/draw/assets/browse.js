"use strict";
// Cards of scenes: filtered, sorted, drawn. Cards come a screenful at a time, so that thousands of scenes open at once.
const SCENES = JSON.parse(document.getElementById("scenes").textContent), AT_ONCE = 120;
const byId = (id) => document.getElementById(id);
const COLOURS = { v: "--other", s: "--other", p: "#a8447f", c: "#00805c" };
const colour = (name) => name.startsWith("--") ? getComputedStyle(document.documentElement).getPropertyValue(name).trim() : name;

function line(pen, numbers, scale, height) {
  pen.beginPath();
  for (let i = 0; i < numbers.length; i += 2) pen.lineTo(numbers[i] * scale, height - numbers[i + 1] * scale);
  pen.stroke();
}

function dot(pen, x, y, radius) { pen.beginPath(); pen.arc(x, y, radius, 0, 7); pen.fill(); }

function draw(canvas, plan, pixels) {
  canvas.width = canvas.height = pixels;
  const pen = canvas.getContext("2d"), scale = pixels / plan.size;
  pen.lineCap = pen.lineJoin = "round";
  pen.strokeStyle = colour("--road");
  pen.lineWidth = Math.max(2, 34 * scale);
  for (const lane of plan.lanes) line(pen, lane, scale, pixels);
  const way = (numbers, name, width) => {
    pen.strokeStyle = pen.fillStyle = colour(name);
    pen.lineWidth = width;
    if (numbers.length > 2) line(pen, numbers, scale, pixels);
    // The dot is where it starts.
    if (numbers.length) dot(pen, numbers[0] * scale, pixels - numbers[1] * scale, width * 1.5);
  };
  for (const [kind, numbers] of plan.others) way(numbers, COLOURS[kind], pixels / 130);
  way(plan.ego, "--ego", pixels / 70);
}

const facts = (scene) => `${scene.users} road users, ego ${scene.speed_mps.toFixed(1)} m/s, ${scene.duration_s.toFixed(1)} s`;

function text(tag, words) { const node = document.createElement(tag); node.textContent = words; return node; }

const seen = "IntersectionObserver" in window
  ? new IntersectionObserver((entries) => entries.forEach((entry) => { if (entry.isIntersecting) { seen.unobserve(entry.target); entry.target.paint(); } }), { rootMargin: "400px" })
  : null;

function card(scene, at) {
  const node = document.createElement("button"), canvas = document.createElement("canvas");
  node.className = "card";
  node.type = "button";
  canvas.setAttribute("aria-label", `plan view of ${scene.name}`);
  canvas.paint = () => draw(canvas, scene.plan, 320);
  node.append(canvas, text("b", scene.name), text("small", facts(scene)));
  if (scene.class) node.append(text("small", scene.class));
  if (scene.id !== scene.name) node.append(text("small", scene.id));
  if (at < 12 || !seen) canvas.paint(); else seen.observe(canvas);
  node.addEventListener("click", () => open(scene));
  return node;
}

function open(scene) {
  const dialog = byId("one"), canvas = document.createElement("canvas"), close = text("button", "close");
  dialog.replaceChildren(text("b", scene.name), canvas, text("small", scene.id),
    text("p", [scene.place, scene.source, scene.class, facts(scene)].filter(Boolean).join("; ")), text("code", scene.command), close);
  close.addEventListener("click", () => dialog.close());
  draw(canvas, scene.plan, 900);
  dialog.showModal();
}

for (const key of ["place", "source", "class"]) {
  const counts = new Map();
  for (const scene of SCENES) if (scene[key]) counts.set(scene[key], (counts.get(scene[key]) || 0) + 1);
  const select = byId(key);
  [...counts].sort(([a], [b]) => a.localeCompare(b)).forEach(([name, count]) => select.append(new Option(`${name} (${count})`, name)));
  if (counts.size < 2) select.closest("label").hidden = true;
}

function within(value, id) {
  const [least, most] = [byId(`${id}-min`).value, byId(`${id}-max`).value];
  return (least === "" || value >= Number(least)) && (most === "" || value <= Number(most));
}

const ORDERS = {
  users: (a, b) => b.users - a.users,
  speed: (a, b) => b.speed_mps - a.speed_mps,
  class: (a, b) => (a.class ? 0 : 1) - (b.class ? 0 : 1) || a.class.localeCompare(b.class),
};
let kept = [], shown = 0;

function more() {
  const next = kept.slice(shown, shown + AT_ONCE);
  byId("cards").append(...next.map((scene, k) => card(scene, shown + k)));
  shown += next.length;
  byId("more").hidden = shown >= kept.length;
}

function choose() {
  const words = byId("text").value.trim().toLowerCase();
  kept = SCENES.filter((scene) => ["place", "source", "class"].every((key) => !byId(key).value || scene[key] === byId(key).value)
    && within(scene.users, "users") && within(scene.speed_mps, "speed")
    && (!words || `${scene.name} ${scene.id}`.toLowerCase().includes(words)));
  const order = ORDERS[byId("order").value];
  if (order) kept.sort(order);
  byId("count").textContent = `${kept.length} of ${SCENES.length} scenes`;
  byId("cards").replaceChildren();
  shown = 0;
  more();
}

byId("filters").addEventListener("input", choose);
byId("filters").addEventListener("submit", (event) => event.preventDefault());
byId("more").addEventListener("click", more);
choose();
