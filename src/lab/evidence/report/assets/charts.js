// What is drawn as wide as its place, to be drawn again when the window is another one.
let charts = [];
function fitting(draw) { charts.push(draw); draw(); }
// --- axes, and labels that keep out of each other's way
function niceStep(raw) { const power = 10 ** Math.floor(Math.log10(raw)); const r = raw / power; return (r > 5 ? 10 : r > 2 ? 5 : r > 1 ? 2 : 1) * power; }
function padded(values, least, low = -Infinity, high = Infinity) { const lo = Math.min(...values), hi = Math.max(...values), pad = Math.max((hi - lo) * 0.1, least); return [Math.max(low, lo - pad), Math.min(high, hi + pad)]; }
function axes(width, height, xRange, yRange, xLabel, yLabel) {
  const m = { left: 58, right: 16, top: 14, bottom: 42 };
  const x = (v) => m.left + (v - xRange[0]) / (xRange[1] - xRange[0]) * (width - m.left - m.right);
  const y = (v) => height - m.bottom - (v - yRange[0]) / (yRange[1] - yRange[0]) * (height - m.top - m.bottom);
  const root = svg("svg", { viewBox: `0 0 ${width} ${height}`, style: `max-width:${width}px`, role: "img", "aria-label": `${yLabel} over ${xLabel}` });
  const step = (range, n) => niceStep((range[1] - range[0]) / n);
  const ticks = (range, n) => { const s = step(range, n), out = []; for (let k = Math.ceil(range[0] / s - 1e-9); k * s <= range[1] + s * 1e-9; k++) out.push(k * s); return out; };
  const decimals = (range, n) => Math.max(0, Math.min(4, -Math.floor(Math.log10(step(range, n)) + 1e-9)));
  const across = Math.max(2, Math.floor((width - m.left - m.right) / 70)), up = Math.max(2, Math.floor((height - m.top - m.bottom) / 55));
  for (const t of ticks(xRange, across)) root.append(svg("line", { class: "grid", x1: x(t), x2: x(t), y1: m.top, y2: height - m.bottom }), svg("text", { class: "dim", x: x(t), y: height - m.bottom + 16, "text-anchor": "middle" }, t.toFixed(decimals(xRange, across))));
  for (const t of ticks(yRange, up)) root.append(svg("line", { class: "grid", x1: m.left, x2: width - m.right, y1: y(t), y2: y(t) }), svg("text", { class: "dim", x: m.left - 8, y: y(t) + 4, "text-anchor": "end" }, t.toFixed(decimals(yRange, up))));
  root.append(svg("text", { x: (m.left + width - m.right) / 2, y: height - 6, "text-anchor": "middle" }, xLabel), svg("text", { x: 14, y: (height - m.bottom) / 2, "text-anchor": "middle", transform: `rotate(-90 14 ${(height - m.bottom) / 2})` }, yLabel));
  return { root, x, y, xRange, yRange, box: [m.left, m.top, width - m.right, height - m.bottom] };
}
// As wide as its place, so that labels keep their size.
const room = (node, most, least = 280) => Math.max(least, Math.min(most, node.clientWidth || most));
// The part of the axis where the programs are that decide: one far outlier does not squeeze the rest. `key` values are always inside.
function robust(values, key, least, low, high) {
  const sorted = [...values].sort((a, b) => a - b), at = (q) => sorted[Math.max(0, Math.min(sorted.length - 1, Math.round(q * (sorted.length - 1))))];
  const span = Math.max(at(0.9) - at(0.25), least), floor = at(0.25) - 3 * span;
  return padded([...values.filter((v) => v >= floor), ...key], least, low, high);
}
// Puts words beside points: the first place of eight around each that is free and inside. `taken` are boxes [x0, y0, x1, y1].
function labelled(chart, labels, taken) {
  const [left, top, right, bottom] = chart.box;
  for (const { x, y, text, bold } of labels) {
    const w = 6.9 * text.length + 6, h = 15;
    const places = [[10, -9], [10, 18], [-w - 8, -9], [-w - 8, 18], [-w / 2, -14], [-w / 2, 26], [12, 5], [-w - 10, 5], [14, -26], [-w - 8, -26], [14, 34], [-w - 8, 34], [-w - 8, 51], [14, 51], [-w - 8, -43], [14, -43]];
    const boxes = places.map(([dx, dy]) => [x + dx, y + dy - h + 3, x + dx + w, y + dy + 3]);
    const free = (b) => b[0] >= left - 2 && b[2] <= right + 8 && b[1] >= top - 8 && b[3] <= bottom && !taken.some((t) => b[0] < t[2] && t[0] < b[2] && b[1] < t[3] && t[1] < b[3]);
    // Where nothing is free, what covers least.
    const covers = (b) => (b[0] < left - 2 || b[2] > right + 8 || b[1] < top - 8 ? 1e6 : 0) + taken.reduce((sum, t) => sum + Math.max(0, Math.min(b[2], t[2]) - Math.max(b[0], t[0])) * Math.max(0, Math.min(b[3], t[3]) - Math.max(b[1], t[1])), 0);
    const box = boxes.find(free) || boxes.reduce((best, b) => covers(b) < covers(best) ? b : best);
    taken.push([box[0], box[1], box[0] + w, box[1] + h]);
    chart.root.append(svg("text", { class: bold ? "label bold" : "label", x: box[0], y: box[1] + h - 3 }, text));
  }
}
