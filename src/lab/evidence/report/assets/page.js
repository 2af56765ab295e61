// --- the whole: tabs, keys, addresses, a run that goes on
const TABS = { answer: drawAnswer, front: drawFront, lineage: drawLineage, attempts: drawAttempts, mechanism: drawMechanism, scenes: drawScenes, world: drawWorld, cost: drawCost, records: drawRecords };
const KEYS = "1–9 tabs · j k next and previous attempt · / search · space plays the film · c copies the link · ? this help";
// The open tab is marked, and in sight where the window is narrow.
function mark() {
  for (const a of document.querySelectorAll("nav a")) {
    const open = (new URLSearchParams(a.hash.slice(1)).get("tab") || "answer") === state.tab;
    if (open) { a.setAttribute("aria-current", "page"); a.parentNode.scrollLeft = a.offsetLeft - a.parentNode.clientWidth / 2 + a.offsetWidth / 2; } else a.removeAttribute("aria-current");
  }
}
// Tabs fade where more of them lie beyond an edge.
function fade() {
  const nav = document.querySelector("nav"), beyond = { "fades-right": nav.scrollLeft + nav.clientWidth < nav.scrollWidth - 2, "fades-left": nav.scrollLeft > 2 };
  for (const [edge, is] of Object.entries(beyond)) nav.classList.toggle(edge, is);
}
function show() {
  const before = state.tab;
  readState();
  if (!TABS[state.tab]) state.tab = "answer";
  stopFilms(); charts = [];
  for (const name of Object.keys(TABS)) byId(name).hidden = name !== state.tab;
  mark(); fade();
  if (data.lineages.length || state.tab === "records" || state.tab === "answer") TABS[state.tab]();
  document.body.dataset.tab = state.tab;
  if (before !== state.tab) scrollTo(0, 0);
}
function keys() {
  addEventListener("keydown", (e) => {
    if (e.ctrlKey || e.metaKey || e.altKey || /^(INPUT|SELECT|TEXTAREA)$/.test(e.target.tagName) && e.key !== "Escape" || e.target.tagName === "CANVAS") return;
    const names = Object.keys(TABS), act = {
      j: () => state.tab === "attempts" ? step(1) : null, k: () => state.tab === "attempts" ? step(-1) : null,
      "/": () => { go({ tab: "attempts" }); byId("filter-q").focus(); }, "?": () => { byId("keys").hidden = !byId("keys").hidden; },
      c: () => navigator.clipboard && navigator.clipboard.writeText(location.href), Escape: () => { byId("keys").hidden = true; document.activeElement.blur(); },
      " ": () => films.length && !/^(BUTTON|A|SUMMARY)$/.test(e.target.tagName) ? films[0].toggle() : null,
    }[e.key] || (/^[1-9]$/.test(e.key) && names[e.key - 1] ? () => go({ tab: names[e.key - 1] }) : null);
    if (act && act() !== null) e.preventDefault();
  });
  byId("keys").textContent = KEYS;
}
// A run that goes on: its page loads itself again, and is then as the reader left it, because its state stands in the address.
function follow() {
  const stored = (action) => { try { return action(sessionStorage); } catch { return null; } }, left = stored((s) => s.getItem(`evodrive ${location.pathname}`));
  if (left) { stored((s) => s.removeItem(`evodrive ${location.pathname}`)); scrollTo(0, Number(left)); }
  if (!data.live) return;
  const { proposals, epochs, reload_s: seconds } = data.live, judged = data.attempts.length, settled = Math.min(epochs, ...data.lineages.map((l) => l.epochs.length));
  byId("live").hidden = false;
  byId("live-standing").textContent = `${judged} of ${proposals} proposals are finished, ${Math.min(100, Math.round(100 * judged / Math.max(1, proposals)))} %; ${settled} of ${epochs} epochs are finished. The page reloads every ${seconds} s; held-out scenes and the player come at the end.`;
  setInterval(() => {
    if (byId("live-hold").checked || document.hidden) return;
    stored((s) => s.setItem(`evodrive ${location.pathname}`, String(scrollY)));
    location.reload();
  }, 1000 * seconds);
}
(async () => {
  [data, stage, figures = []] = await EvoUnpack.whole(JSON.parse(byId("data").textContent));
  for (const a of data.attempts) if (a.solution === true) a.solution = a.id;
  addEventListener("hashchange", show); addEventListener("popstate", show);
  let width = innerWidth;
  addEventListener("resize", () => { if (innerWidth !== width) { width = innerWidth; mark(); fade(); charts.forEach((draw) => draw()); } });
  document.querySelectorAll("nav a").forEach((a) => a.addEventListener("click", (e) => { if (!e.ctrlKey && !e.metaKey) { e.preventDefault(); go({ tab: new URLSearchParams(a.hash.slice(1)).get("tab") || "answer" }); } }));
  document.querySelector("nav").addEventListener("scroll", fade, { passive: true });
  readState(); keys(); show(); follow();
  document.querySelectorAll("h2, th").forEach(explain);
  document.body.dataset.ready = "yes";
})().catch((error) => { byId("failed").hidden = false; byId("failed").textContent = `The page could not be drawn: ${error.message}`; });
