// --- attempts: a list of which only the rows in sight exist, and the one that is open beside it
const ORDERS = { "": "in the order of the run", attack: "most attack first", realism: "most realism first", standing: "promoted first" };
const RANK = { promoted: 0, accepted: 1, evaluated: 2, rejected: 3, invalid: 4, declined: 5 };
function matches(a) {
  const text = (state.q || "").trim().toLowerCase();
  if (state.lineage && a.lineage !== state.lineage || state.exit && standing(a) !== state.exit && a.exit !== state.exit) return false;
  if (state.family && (lineageOf(a.lineage) || {}).family !== state.family) return false;
  if (state.met && !(a.met || []).some(([name]) => data.classes[name] === state.met)) return false;
  return !text || [a.id, a.hypothesis, a.reason, ...(a.tags || []), ...(a.categories || []), a.target].join(" ").toLowerCase().includes(text);
}
function shownAttempts() {
  const by = { attack: (a) => a.objectives ? -a.objectives.attack : null, realism: (a) => a.objectives ? -a.objectives.realism : null, standing: (a) => RANK[standing(a)] }[state.sort], shown = data.attempts.filter(matches);
  if (!by) return shown;
  const nothing = (v) => v === null || v === undefined;
  return shown.map((a, i) => [by(a), i, a]).sort(([x, i], [y, j]) => nothing(x) - nothing(y) || (x < y ? -1 : x > y ? 1 : i - j)).map(([, , a]) => a);
}
// What is open until the reader chooses: of attempts that are shown in short there is nothing to read.
const firstOf = (shown) => shown.find((a) => !a.in_short) || shown[0];
let attemptList = null;
function drawAttempts() {
  const page = byId("attempts"), narrow = matchMedia("(max-width: 860px)").matches;
  if (!attemptList) {
    const choose = (key, label, entries) => el("label", {}, `${label} `, el("select", { id: `filter-${key}`, oninput: (e) => go({ [key]: e.target.value }) }, option("", "all"), entries.map(([value, words]) => option(value, words))));
    const families = [...new Set(data.lineages.map((l) => l.family))], met = [...new Set(data.attempts.flatMap((a) => (a.met || []).map(([name]) => data.classes[name])))].sort();
    const inShort = data.attempts.filter((a) => a.in_short).length;
    attemptList = virtual([], 54, attemptRow, "Attempts");
    attemptList.box.id = "attempt-list";
    put(page, el("section", { class: "part" }, el("h2", {}, "Attempts"), el("div", { class: "controls" },
      el("label", {}, "Search ", el("input", { id: "filter-q", type: "search", placeholder: "hypothesis, tag, id", oninput: (e) => { go({ q: e.target.value }, { quiet: true }); updateAttempts(); } })),
      data.lineages.length > 1 ? choose("lineage", "Lineage", data.lineages.map((l) => [l.id, l.id])) : null, families.length > 1 ? choose("family", "Family", families.map((f) => [f, f])) : null,
      choose("exit", "State", Object.keys(SIGNS).map((s) => [s, s])), met.length ? choose("met", "Contact", met.map((m) => [m, plain(m)])) : null,
      el("label", {}, "Order ", el("select", { id: "filter-sort", oninput: (e) => go({ sort: e.target.value }) }, Object.entries(ORDERS).map(([value, words]) => option(value, words)))),
      el("span", { id: "filter-count", role: "status" })),
      inShort ? note(`${counted(inShort, "attempt")} that were not accepted are shown in short and can be searched by id only.`) : null,
      signLegend(), el("div", { class: "split" }, el("div", { class: "split-list" }, attemptList.box), el("div", { id: "attempt-detail", class: "split-detail", tabindex: -1 }))));
  }
  updateAttempts();
  if (narrow && state.attempt) byId("attempt-detail").scrollIntoView({ block: "start" });
}
function updateAttempts() {
  for (const key of ["q", "lineage", "family", "exit", "met", "sort"]) { const field = byId(`filter-${key}`); if (field && field.value !== (state[key] || "")) field.value = state[key] || ""; }
  const shown = shownAttempts(), open = attemptOf(state.attempt) || firstOf(shown);
  byId("filter-count").textContent = `${shown.length} of ${data.attempts.length}`;
  attemptList.put(shown);
  attemptList.reveal(shown.findIndex((a) => open && a.id === open.id));
  byId("attempt-detail").replaceChildren(open ? detail(open) : note("No attempt is like that."));
}
function attemptRow(a) {
  const [kind, colour] = SIGNS[standing(a)], open = a.id === (attemptOf(state.attempt) || firstOf(shownAttempts()) || {}).id;
  return el("a", { class: open ? "row open" : "row", role: "option", "aria-selected": String(open), href: address({ attempt: a.id }), onclick: (e) => { if (!e.ctrlKey && !e.metaKey) { e.preventDefault(); go({ attempt: a.id }); } } },
    small(kind, colour), el("span", { class: "row-head" }, el("code", {}, a.id), " ", el("span", { class: "row-state" }, standing(a)), a.objectives ? el("span", { class: "row-numbers" }, `A ${fixed(a.objectives.attack, 3)}  R ${fixed(a.objectives.realism, 3)}`) : null), el("span", { class: "row-words" }, a.hypothesis || a.reason || (a.in_short ? "in short" : "")));
}
// The next or the one before in the list, by keys.
function step(by) {
  const shown = shownAttempts(), at = shown.findIndex((a) => a.id === state.attempt), next = shown[Math.max(0, Math.min(shown.length - 1, (at < 0 ? 0 : at) + by))];
  if (next) go({ attempt: next.id });
}
function detail(a) {
  const [kind, colour] = SIGNS[standing(a)], head = el("h3", { class: "detail-head" }, small(kind, colour), el("code", {}, a.id), ` ${standing(a)} `, a.solution ? playButton(a.solution) : null);
  if (a.in_short) return el("div", { class: "detail" }, head, el("p", {}, "Shown in short, because the run is large. ", el("code", {}, `evodrive show ${a.id}`), " tells the whole: prompts, replies, reviews, gates, route, labels."));
  const nodes = [head], add = (title, ...more) => nodes.push(el("h3", {}, title), ...more);
  if (a.objectives) nodes.push(el("p", {}, `attack ${fixed(a.objectives.attack, 3)}, ${STRICT()} ${fixed(a.objectives.realism, 4)}`, a.met ? ` – contacts: ${a.met.map(([name, n]) => `${n} × ${plain(data.classes[name])}`).join(", ")}` : "", `; edits `, link({ attempt: a.parent }, a.parent)));
  if (a.hypothesis) add("Hypothesis", el("p", {}, a.hypothesis));
  if (a.reason) add("Declined", el("p", {}, a.reason));
  if (a.diff) add("Change of the program", diffText(a.diff));
  else if (a.operations) add("Patch", el("pre", { class: "diff" }, JSON.stringify(a.operations, null, 2)));
  if (a.gates) add("Gates", el("p", {}, a.gates.map(([gate, problems]) => el("span", { class: problems.length ? "gate fail" : "gate pass" }, `${problems.length ? "✗" : "✓"} ${gate} `))), ...a.gates.filter(([, problems]) => problems.length).map(([, problems]) => list(problems)));
  if (a.decision) {
    const g = a.decision.gates, d = g.densification, l = g.local_push, t = g.parent_tradeoff, error = (value, digits) => value === null || value === undefined ? "" : ` ± ${value.toFixed(digits)}`;
    add("Archive", list([`over ${g.scenes} paired scenes, ${g.differing_scenes} of them with other labels than the parent's`,
      `coverage floor ${g.coverage.holds ? "holds" : "no"}: acts in ${fixed(g.coverage.coverage, 3)}, at least ${fixed(g.coverage.floor, 3)}`,
      `densification ${d.holds ? "holds" : "no"}: non-dominated ${d.non_dominated}, hypervolume ${fixed(d.hypervolume_before, 5)} ${signed(d.hypervolume_gain, 5)}${error(d.uncertainty, 5)}`,
      `local push ${l.holds ? "holds" : "no"}: best attack at r0 ${fixed(l.best_attack_at_r0, 3)}, best ${STRICT()} at a0 ${fixed(l.best_realism_at_a0, 4)}`,
      `parent trade-off ${t.holds ? "holds" : "no"}: attack ${signed(t.attack_change, 3)}${error(t.attack_uncertainty, 3)}, ${STRICT()} ${signed(t.realism_change, 4)}${error(t.realism_uncertainty, 4)}`]));
  }
  add("Asked for", el("p", {}, a.target));
  if (a.memory && a.memory.length) add("Memory shown", el("p", { class: "mono" }, a.memory.join(", ")));
  const reviews = (a.reviews || []).flatMap((round, i) => round.flatMap(([role, decision, blockers]) => [el("p", {}, `round ${i} · ${plain(data.roles[role])}: `, el("b", { class: decision === "approve" ? "pass" : "fail" }, `${decision === "approve" ? "✓" : "✗"} ${decision}`)), blockers.length ? list(blockers) : null]));
  if (reviews.length) add("Reviews", ...reviews.filter(Boolean));
  if (a.tuned) add("Numbers", el("p", {}, a.tuned));
  if (a.route) add("Route", el("p", {}, `${a.route.reason.startsWith(a.route.decision) ? "" : `${a.route.decision}: `}${a.route.reason}; predicted attack ${fixed(a.route.predicted.attack, 2)}, realism ${fixed(a.route.predicted.realism, 3)}, uncertainty ${fixed(a.route.uncertainty, 3)}`));
  if (a.scenes) add("Scenes", sortable(["Scene", "Attack", "Realism", ...data.metrics, "Below 1"], a.scenes.map(([scene, attack, realism, applied, below, measured = []]) => [{ by: data.scenes[scene], node: el("span", {}, data.scenes[scene] + (applied ? " " : " (not applied) "), playButton(a.solution, data.scenes[scene])) }, [attack, 2], [realism, 4], ...measured.map((value) => [value, 3]), below.map(([n, d]) => `${plain(data.diagnostics[n])} ${d.toFixed(3)}`).join(", ")]), `scenes-${a.id}`, { rowsAPage: 20 }));
  if (a.failures && a.failures.length) add("Scenes without a label", list(a.failures.map((f) => `${f.scene}: ${f.reason}`)));
  if (a.exchanges) add("Exchanges", list(a.exchanges.map(([role, round, model, request, response, refusal]) => `${plain(data.roles[role])} round ${round} (${data.model_names[model]}) request ${request} response ${response}${refusal ? ` – refused: ${refusal}` : ""}`)));
  return el("div", { class: "detail" }, ...nodes);
}
