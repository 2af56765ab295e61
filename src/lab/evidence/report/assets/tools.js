"use strict";
// What every part of the page uses: elements, numbers, words, signs. All text goes in as text nodes, never as markup.
let data, stage, figures; // set once, when the page has unpacked what it holds

const byId = (id) => document.getElementById(id);
function filled(node, attributes, children) {
  for (const [key, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (key.startsWith("on")) node.addEventListener(key.slice(2), value); else node.setAttribute(key, value === true ? "" : value);
  }
  for (const child of children.flat(2)) if (child !== null && child !== undefined && child !== false) node.append(child);
  return node;
}
function el(name, attributes = {}, ...children) {
  const node = filled(document.createElement(name), attributes, children);
  if (/^(th|h2|h3|span|b|dt)$/.test(name)) explain(node);
  return node;
}
const svg = (name, attributes = {}, ...children) => filled(document.createElementNS("http://www.w3.org/2000/svg", name), attributes, children);
// Only what is there: a list may hold nothings.
const put = (node, ...children) => node.replaceChildren(...children.flat(2).filter((child) => child !== null && child !== undefined && child !== false));
const list = (items) => el("ul", {}, items.map((item) => el("li", {}, item)));
const option = (value, label, chosen) => el("option", { value, selected: chosen }, label);
const note = (...words) => el("p", { class: "note" }, ...words);
const part = (title, ...children) => el("section", { class: "part" }, title ? el("h2", {}, title) : null, ...children);

// What a word means, from the glossary; "" where it has no entry.
const meaning = (text) => data.terms[text.trim().toLowerCase()] || "";
function explain(node) {
  const means = node.children.length ? "" : meaning(node.textContent);
  if (means) { node.title = means; node.classList.add("term"); }
}

// Half away from zero, as in every other text of the program: toFixed alone makes 0.037 of 0.0375.
const rounded = (value, digits) => Math.sign(value) * Math.round(Math.abs(value) * 10 ** digits) / 10 ** digits;
const fixed = (value, digits) => value === null || value === undefined ? "–" : rounded(value, digits).toFixed(digits);
const signed = (value, digits) => value === null || value === undefined ? "–" : (value >= 0 ? "+" : "−") + fixed(Math.abs(value), digits);
const estimate = (e, sign) => !e ? "–" : (sign ? signed(e.value, 3) : fixed(e.value, 3)) + (e.interval ? ` [${e.interval.map((x) => sign ? signed(x, 3) : fixed(x, 3)).join(", ")}]` : "");
const STRICT = () => data.safebench ? "ARS" : "strict realism"; // the realism among the objectives
const capital = (text) => text[0].toUpperCase() + text.slice(1);
const plain = (name) => name.replaceAll("_", " ");
const counted = (n, noun) => `${n} ${noun}${n === 1 ? "" : /(ch|sh|s|x)$/.test(noun) ? "es" : "s"}`;

// As the acceptor: one of three gates, enough coverage, and labels that are not the parent's.
const accepted = (a) => !!a.decision && a.decision.gates.coverage.holds && a.decision.gates.differing_scenes > 0 && [a.decision.gates.densification, a.decision.gates.local_push, a.decision.gates.parent_tradeoff].some((g) => g.holds);
const standing = (a) => a.decision && a.decision.promoted ? "promoted" : accepted(a) ? "accepted" : a.exit;
// A state is a shape before it is a colour.
const SIGNS = {
  promoted: ["diamond", "var(--promoted)"], accepted: ["triangle", "var(--accepted)"], evaluated: ["circle", "var(--evaluated)"],
  rejected: ["bar", "var(--rejected)"], invalid: ["cross", "var(--invalid)"], declined: ["ring", "var(--declined)"],
};
function sign(kind, x, y, r, colour, attributes = {}) {
  const filledIn = { fill: colour, ...attributes }, line = { fill: "none", stroke: colour, "stroke-width": 2, ...attributes };
  if (kind === "circle") return svg("circle", { cx: x, cy: y, r: 0.9 * r, ...filledIn });
  if (kind === "ring") return svg("circle", { cx: x, cy: y, r: 0.8 * r, ...line });
  if (kind === "square") return svg("rect", { x: x - 0.85 * r, y: y - 0.85 * r, width: 1.7 * r, height: 1.7 * r, ...filledIn });
  const path = { diamond: `M${x},${y - 1.25 * r}L${x + 1.25 * r},${y}L${x},${y + 1.25 * r}L${x - 1.25 * r},${y}Z`, triangle: `M${x},${y - 1.15 * r}L${x + 1.1 * r},${y + 0.85 * r}L${x - 1.1 * r},${y + 0.85 * r}Z`,
    cross: `M${x - 0.8 * r},${y - 0.8 * r}L${x + 0.8 * r},${y + 0.8 * r}M${x + 0.8 * r},${y - 0.8 * r}L${x - 0.8 * r},${y + 0.8 * r}`, bar: `M${x - r},${y}L${x + r},${y}`,
    star: `M${Array.from({ length: 10 }, (_, k) => { const q = k % 2 ? 0.6 * r : 1.45 * r, a = Math.PI * (k / 5 - 0.5); return `${x + q * Math.cos(a)},${y + q * Math.sin(a)}`; }).join("L")}Z` }[kind];
  return svg("path", { d: path, ...(kind === "cross" || kind === "bar" ? line : filledIn) });
}
const signOf = (a, x, y, r, attributes) => { const [kind, colour] = SIGNS[standing(a)]; return sign(kind, x, y, r, colour, attributes); };
const small = (kind, colour) => svg("svg", { viewBox: "0 0 16 16", class: "sign", "aria-hidden": "true" }, sign(kind, 8, 8, 5, colour));

const lineageOf = (id) => data.lineages.find((l) => l.id === id);
const attemptOf = (id) => data.attempts.find((a) => a.id === id);
const heldOut = (lineage, solution) => lineage.held_out.find((h) => h.measured.solution === solution);
const chosenOf = (lineage) => lineage.result ? lineage.result.evolved.solution : lineage.active;
const headlineOf = (lineage) => data.headlines.find((h) => h.lineage === lineage.id) || data.headlines.find((h) => h.group === lineage.group);
// The lineage that a reader meets first: the one that gained most.
const bestLineage = () => lineageOf((data.headlines[0] || {}).lineage) || data.lineages[0];

// --- state: what is looked at stands in the address, so that every state has a link
const state = { tab: "answer" };
const DEFAULTS = { tab: "answer" };
function readState() {
  for (const key of Object.keys(state)) delete state[key];
  Object.assign(state, DEFAULTS, Object.fromEntries(new URLSearchParams(location.hash.slice(1))));
}
const address = (changes) => {
  const whole = Object.entries({ ...state, ...changes }).filter(([key, value]) => value && value !== DEFAULTS[key]);
  return "#" + new URLSearchParams(whole).toString();
};
function go(changes, { quiet = false } = {}) {
  const to = address(changes);
  if (quiet) { history.replaceState(null, "", to); Object.assign(state, changes); return; }
  if (to === (location.hash || "#")) return show();
  history.pushState(null, "", to); show();
}
const link = (changes, ...words) => el("a", { href: address(changes), onclick: (e) => { if (!e.ctrlKey && !e.metaKey) { e.preventDefault(); go(changes); } } }, ...words);
const card = (value, label) => el("div", { class: "card" }, el("b", {}, String(value)), el("span", {}, label));
