// --- agreement: the same rollouts in another simulator
const CAUSES = {
  start: "the contact lies within the first step: boxes overlapped from the start", ended_before: "the other rollout was over by then: the ego had arrived or left its route",
  partner_absent: "the road user that the ego touched is not on the road in the other rollout at that time", ego_elsewhere: "the egos were more than 1 m apart",
  near_miss: "the other came nearer than 0.3 m", untold: "none of the other causes",
};
const KINDS = { all: "", program: "By program", family: "By family", cluster: "By scene cluster", proposal: "Programs proposed in the run that no other row counts" };
const percent = (i) => `${fixed(100 * i.value, 1)} [${fixed(100 * i.low, 1)}, ${fixed(100 * i.high, 1)}]`;
const td = (text, number = true) => el("td", number ? { class: "num" } : {}, String(text));
const heads = (names, texts = 1) => el("tr", {}, names.map((name, i) => el("th", i >= texts ? { class: "num" } : {}, name)));
function agreementRows(rows) {
  const below = (text) => el("span", { class: "range" }, text);
  const apart = (a) => el("td", { class: "num" }, a.median_m === null ? "–" : [fixed(a.median_m, 2), below(fixed(a.p90_m, 2))]);
  const names = ["Rollouts of", "n", "both", "first only", "second only", "neither", "agree %", "kappa", "same partner", "apart s", "ego m, 1 s", "3 s", "5 s"];
  const ranged = (i, digits, scale) => el("td", { class: "num" }, i ? [fixed(scale * i.value, digits), below(`${fixed(scale * i.low, digits)} to ${fixed(scale * i.high, digits)}`)] : "–");
  const line = (r) => el("tr", {}, el("td", { class: "name" }, r.row), td(r.rollouts), r.confusion.map((n) => td(n)), ranged(r.agreement, 1, 100), ranged(r.kappa, 2, 1),
    td(r.confusion[0] ? `${r.same_partner} of ${r.confusion[0]}` : "–"), td(fixed(r.contact_time_apart_s, 2)), r.ego_apart.map(apart));
  const body = rows.flatMap((r, i) => i && rows[i - 1].of !== r.of ? [el("tr", { class: "head" }, el("th", { colspan: names.length }, KINDS[r.of])), line(r)] : [line(r)]);
  return el("table", {}, el("thead", {}, heads(names)), el("tbody", {}, body));
}
function agreementLabels(rows) {
  const names = ["Rollouts of", "published", "agree %", "kappa", "preventable", "agree %", "kappa", "same class", "same striker", "same avoidability", "speed more m/s"];
  const judged = (j) => { const [both, first, second] = j.confusion; return [td(`${both + first}; ${both + second}`), td(fixed(100 * j.agreement.value, 1)), td(j.kappa ? fixed(j.kappa.value, 2) : "–")]; };
  const share = (n, all) => td(all ? `${n} of ${all}` : "–");
  return el("table", {}, el("thead", {}, heads(names)), el("tbody", {}, rows.map(({ row, labels: l }) => el("tr", {}, el("td", { class: "name" }, row), judged(l.published), judged(l.preventable),
    share(l.same_class, l.contacts), share(l.same_striker, l.contacts), share(l.same_avoidability, l.assessed), td(l.relative_speed_more_mps === null ? "–" : fixed(l.relative_speed_more_mps, 2))))));
}
function agreementChanges(changes) {
  return el("table", {}, el("thead", {}, heads(["Changed", "mended", "broken", "agree %", "kappa"])),
    el("tbody", {}, changes.map((c) => el("tr", {}, td(c.change, false), td(c.mended), td(c.broken), td(fixed(100 * c.agreement, 1)), td(c.kappa === null ? "–" : fixed(c.kappa, 2))))));
}
function agreementTransfers(rows) {
  const gain = (d) => el("td", { class: "num" }, [`${d.parent} → ${d.evolved}`, el("span", { class: "range" }, `${signed(d.gain.value)} [${signed(d.gain.low)}, ${signed(d.gain.high)}]`)]);
  const signed = (share) => (share >= 0 ? "+" : "−") + fixed(Math.abs(100 * share), 1), labels = rows[0] ? rows[0].gains.map((g) => g.label) : [];
  return el("table", {}, el("thead", {}, heads(["Evolved program", "n", ...labels.flatMap((label) => [`${label}: first`, "second"])])),
    el("tbody", {}, rows.map((r) => el("tr", {}, el("td", { class: "name" }, r.evolved), td(r.rollouts), r.gains.flatMap((g) => [gain(g.first), gain(g.second)])))));
}
function agreementChart(rows) {
  const shown = rows.filter((r) => r.of === "program" || r.of === "family" || r.of === "cluster"), dy = 22, width = 620, right = 20, top = 8;
  const left = 24 + 7 * Math.min(48, Math.max(0, ...shown.map((r) => r.row.length + (r.of === "program" ? 0 : r.of.length + 1))));
  const least = Math.floor(10 * Math.min(0.9, ...shown.map((r) => r.agreement.low))) / 10, height = top + dy * shown.length + 34;
  const x = (v) => left + (v - least) / (1 - least) * (width - left - right), bottom = height - 26;
  const root = svg("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": "agreement by program, family and cluster" });
  for (let t = Math.ceil(10 * least); t <= 10; t++) root.append(svg("line", { class: "grid", x1: x(t / 10), x2: x(t / 10), y1: top, y2: bottom }), svg("text", { class: "dim", x: x(t / 10), y: bottom + 18, "text-anchor": "middle" }, `${10 * t} %`));
  root.append(svg("line", { class: "goal", x1: x(rows[0].agreement.value), x2: x(rows[0].agreement.value), y1: top, y2: bottom }));
  shown.forEach((r, i) => {
    const y = top + dy * (i + 0.5), { value, low, high } = r.agreement, prefix = r.of === "program" ? "" : `${r.of} `;
    const mark = svg("g", {}, svg("line", { x1: x(low), x2: x(high), y1: y, y2: y, stroke: "var(--accent)", "stroke-width": 2 }), svg("circle", { cx: x(value), cy: y, r: 4.5, fill: "var(--accent)" }));
    mark.append(svg("title", {}, `${prefix}${r.row}: ${percent(r.agreement)} %, n = ${r.rollouts}`));
    root.append(svg("text", { x: left - 10, y: y + 4, "text-anchor": "end" }, `${prefix}${r.row}`), mark);
  });
  return root;
}
function drawDisagreements() {
  const cause = byId("agreement-cause").value, program = byId("agreement-program").value;
  const all = data.agreement.disagreements, shown = all.filter((d) => (!cause || d.cause === cause) && (!program || d.program === program));
  byId("agreement-count").textContent = `${shown.length} of ${all.length}`;
  byId("agreement-cause-note").textContent = cause ? `${cause.replace("_", " ")}: ${CAUSES[cause]}.` : "The cause shown is the first of six that fits the recorded motion.";
  const name = ["first", "second"], metres = (value) => fixed(value, 2);
  byId("agreement-list").replaceChildren(el("table", {},
    el("thead", {}, heads(["Program", "Scene", "Contact in", "With", "Seen", "Mended by", "The other ended", "At s", "Nearest m", "Egos apart m"], 7)),
    el("tbody", {}, shown.map((d) => el("tr", {}, td(d.program, false), td(d.scene, false), td(data.agreement.backends[name.indexOf(d.contact_in)], false), td(d.with.with + (d.with.adversary ? " (adversary)" : ""), false),
      td(d.cause.replace("_", " "), false), td(d.mended_by.join(", ") || "–", false), td(d.other_end.replace("_", " "), false), td(fixed(d.with.at_cs / 100, 2)), td(metres(d.other_distance_m_min)), td(metres(d.ego_apart_m)))))));
}
function openAgreement() {
  const agreement = data.agreement;
  if (!agreement) return;
  byId("agreement").hidden = false;
  const [first, second] = agreement.backends, all = agreement.rows[0], [both, one, other, neither] = all.confusion;
  byId("agreement-note").textContent = `First: ${first}. Second: ${second}. The same ${agreement.same_commands ? "rollouts in both" : "programs in both; each plans with its own simulation of the ego, so the commands differ"}.` +
    (agreement.left_out.length ? ` ${agreement.left_out.length} rollouts are left out, because only one of the two runs has them.` : "");
  byId("agreement-cards").append(card(`${fixed(100 * all.agreement.value, 1)} %`, `agree, of ${all.rollouts} rollouts`), card(all.kappa ? fixed(all.kappa.value, 2) : "–", "Cohen's kappa" + (all.kappa ? `, ${fixed(all.kappa.low, 2)} to ${fixed(all.kappa.high, 2)}` : "")),
    card(`${all.same_partner} of ${both}`, "contacts with the same partner"), card(`${fixed(all.contact_time_apart_s, 2)} s`, "between contacts, median"));
  byId("agreement-chart").append(agreementChart(agreement.rows));
  const cell = (n, same) => el("td", { class: same ? "num same" : "num" }, String(n)), side = (text) => el("th", {}, text);
  byId("agreement-confusion").append(el("table", {}, el("thead", {}, heads(["", "second: contact", "none"])),
    el("tbody", {}, el("tr", {}, side("first: contact"), cell(both, true), cell(one, false)), el("tr", {}, side("none"), cell(other, false), cell(neither, true)))));
  byId("agreement-apart").append(el("table", {}, el("thead", {}, heads(["Before", "median m", "90 % below m", "n"])),
    el("tbody", {}, all.ego_apart.map((a) => el("tr", {}, td(`${a.before_s} s`, false), td(fixed(a.median_m, 2)), td(fixed(a.p90_m, 2)), td(a.rollouts))))));
  byId("agreement-rows").append(agreementRows(agreement.rows));
  byId("agreement-labels").append(agreementLabels(agreement.rows));
  byId("agreement-transferred").hidden = !agreement.transfers.length;
  byId("agreement-transfers").append(agreementTransfers(agreement.transfers));
  byId("agreement-changed").hidden = !agreement.changes.length;
  byId("agreement-changes").append(agreementChanges(agreement.changes));
  const times = (key) => [...agreement.disagreements.reduce((m, d) => m.set(d[key], (m.get(d[key]) || 0) + 1), new Map())].sort((a, b) => b[1] - a[1]);
  byId("agreement-cause").append(option("", "all"), ...times("cause").map(([cause, n]) => option(cause, `${cause.replace("_", " ")} (${n})`)));
  byId("agreement-program").append(option("", "all"), ...times("program").map(([program, n]) => option(program, `${program} (${n})`)));
  for (const id of ["agreement-cause", "agreement-program"]) byId(id).addEventListener("input", drawDisagreements);
  drawDisagreements();
}
