// --- lists and figures to take away, and tables whose heads sort
const csv = (rows) => rows.map((row) => row.map((cell) => /[",\n]/.test(String(cell)) ? `"${String(cell).replaceAll('"', '""')}"` : String(cell)).join(",")).join("\n") + "\n";
function save(name, type, text) {
  const to = el("a", { href: URL.createObjectURL(new Blob([text], { type })), download: name });
  to.click(); setTimeout(() => URL.revokeObjectURL(to.href), 1000);
}
// The picture with the colours that it is shown in: it stands without the page's style.
function standalone(root) {
  const copy = root.cloneNode(true), shown = root.querySelectorAll("*");
  copy.querySelectorAll("*").forEach((node, i) => { const style = getComputedStyle(shown[i]); for (const key of ["fill", "stroke", "stroke-dasharray", "font-family", "font-size"]) if (node.tagName !== "title") node.setAttribute(key, style.getPropertyValue(key)); });
  copy.setAttribute("xmlns", "http://www.w3.org/2000/svg"); copy.removeAttribute("style");
  return new XMLSerializer().serializeToString(copy);
}
function downloads(root, name, rows) {
  const file = name.replace(/[^A-Za-z0-9_.-]+/g, "_"), button = (text, action) => el("button", { class: "save", onclick: action }, text);
  return el("p", { class: "saves" }, root ? button("SVG", () => save(`${file}.svg`, "image/svg+xml", standalone(root))) : null, root ? " " : null, button("CSV", () => save(`${file}.csv`, "text/csv", csv(rows))));
}
// A table whose heads sort, in pages. A cell is a text, { node, by } with what it sorts by, or a number as [value, digits, text] with what is shown in
// place of the digits; a missing value stands last. `groups` are heads above the heads with their widths, `pinned` rows stay on top, `file` are the CSV's heads.
function sortable(heads, rows, name, { rowsAPage = 50, groups = null, pinned = [], file = heads, onrow = null } = {}) {
  const number = (i) => rows.some((row) => Array.isArray(row[i])), value = (cell) => Array.isArray(cell) ? cell[0] : cell && cell.node ? cell.by : cell;
  let by = null, up = true, at = 0;
  const tbody = el("tbody"), count = el("span", { role: "status" }), before = el("button", { onclick: () => { at--; draw(); } }, "previous"), next = el("button", { onclick: () => { at++; draw(); } }, "next");
  const sort = (i) => { up = by === i ? !up : !number(i); by = i; at = 0; draw(); };
  const titles = heads.map((text, i) => el("th", { scope: "col", class: number(i) ? "num" : null }, el("button", { class: "sort", title: [meaning(text), `sort by ${text.toLowerCase()}`].filter(Boolean).join(" – "), onclick: () => sort(i) }, text)));
  const nothing = (v) => v === null || v === undefined || v === "";
  const ordered = () => rows.map((row, i) => [value(row[by]), i, row]).sort(([x, i], [y, j]) => nothing(x) - nothing(y) || (x < y ? -1 : x > y ? 1 : 0) * (up ? 1 : -1) || i - j).map(([, , row]) => row);
  const numberCell = ([x, digits, text]) => el("td", { class: "num" }, text ?? fixed(x, digits));
  const textCell = (cell, i) => el("td", { class: i === 0 && typeof cell === "string" && cell.length < 40 || /^[−+\d][\d.]* \[/.test(cell) ? "name" : null }, cell && cell.node ? cell.node : cell);
  const shown = (row, kind) => el("tr", { class: kind, onclick: onrow ? () => onrow(row) : null }, row.map((cell, i) => Array.isArray(cell) ? numberCell(cell) : textCell(cell, i)));
  function draw() {
    const pages = Math.max(1, Math.ceil(rows.length / rowsAPage));
    tbody.replaceChildren(...pinned.map((row) => shown(row, "replay")), ...(by === null ? rows : ordered()).slice(at * rowsAPage, (at + 1) * rowsAPage).map((row) => shown(row, onrow ? "row" : null)));
    titles.forEach((th, i) => by === i ? th.setAttribute("aria-sort", up ? "ascending" : "descending") : th.removeAttribute("aria-sort"));
    count.textContent = `page ${at + 1} of ${pages}`; before.disabled = at === 0; next.disabled = at + 1 >= pages;
  }
  draw();
  const text = (cell) => value(cell) ?? "", band = groups ? el("tr", {}, groups.map(([title, columns]) => el("th", { class: "group", colspan: columns }, title))) : null;
  return el("div", {}, scroller(el("table", {}, el("thead", {}, band, el("tr", {}, titles)), tbody)),
    el("div", { class: "controls below" }, rows.length > rowsAPage ? [before, count, next] : null, downloads(null, name, [file, ...[...pinned, ...rows].map((row) => row.map(text))])));
}
// What is wider than its place says so, and of a table how many columns stand beyond the edge.
function scroller(node) {
  const more = el("p", { class: "more", hidden: true }), wide = el("div", { class: "wide", tabindex: 0 }, node);
  const look = () => {
    const heads = [...node.querySelectorAll("thead tr:last-child th")], beyond = heads.filter((th) => th.offsetLeft + th.offsetWidth > wide.scrollLeft + wide.clientWidth + 2).length;
    more.hidden = heads.length ? !beyond : wide.scrollLeft + wide.clientWidth + 2 >= wide.scrollWidth;
    more.textContent = heads.length ? `${counted(beyond, "column")} more to the right →` : "more to the right →";
  };
  wide.addEventListener("scroll", look, { passive: true });
  new ResizeObserver(look).observe(wide);
  return el("div", { class: "scroller" }, more, wide);
}
// A list of which only the rows in sight exist. `row(item, i)` makes one of a fixed height.
function virtual(items, height, row, label) {
  const inner = el("div", { class: "virtual-inner" }), box = el("div", { class: "virtual", tabindex: 0, role: "listbox", "aria-label": label }, inner);
  let shown = items;
  function draw() {
    inner.style.height = `${shown.length * height}px`;
    const first = Math.max(0, Math.floor(box.scrollTop / height) - 4), last = Math.min(shown.length, first + Math.ceil((box.clientHeight || 600) / height) + 9);
    inner.replaceChildren(...shown.slice(first, last).map((item, k) => { const node = row(item, first + k); node.style.top = `${(first + k) * height}px`; node.style.height = `${height}px`; return node; }));
  }
  box.addEventListener("scroll", draw, { passive: true });
  new ResizeObserver(draw).observe(box);
  return {
    box, draw,
    put: (next) => { shown = next; if (box.scrollTop > shown.length * height) box.scrollTop = 0; draw(); },
    reveal: (i) => { if (i < 0) return; const top = i * height; if (top < box.scrollTop || top + height > box.scrollTop + box.clientHeight) box.scrollTop = Math.max(0, top - box.clientHeight / 3); draw(); },
  };
}
