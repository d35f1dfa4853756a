"use strict";
// Interactive envelopes: choose study and output, move α, zoom with the wheel or by dragging, double click to see everything again.
(() => {
  const data = JSON.parse(document.getElementById("envelopes").textContent);
  const svg = document.getElementById("plot");
  if (!svg || !data.length) return;
  const [width, height] = [900, 420];
  const margin = { left: 64, right: 16, top: 14, bottom: 44 };
  const study = document.getElementById("study");
  const output = document.getElementById("output");
  const slider = document.getElementById("alpha");
  const shown = document.getElementById("alpha-shown");
  const readout = document.getElementById("readout");
  const shades = ["#c7e9b4", "#7fcdbb", "#41b6c4", "#2c7fb8", "#253494"];
  const name = "http://www.w3.org/2000/svg";
  let view = null;
  let drag = null;

  function decode(text) {
    const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    return new Float32Array(bytes.buffer);
  }
  for (const entry of data) {
    entry.lower = entry.lower.map((rows) => rows.map(decode));
    entry.upper = entry.upper.map((rows) => rows.map(decode));
    entry.error = entry.error.map((rows) => rows.map(decode));
    study.add(new Option(entry.title, entry.name));
  }
  study.value = data.reduce((most, entry) => (entry.fuzzy > most.fuzzy ? entry : most)).name;
  const chosen = () => data.find((entry) => entry.name === study.value);

  function cut(entry, side, index, alpha) {
    // Between computed levels the ends are interpolated linearly.
    const levels = entry.alpha;
    let above = levels.findIndex((level) => level >= alpha);
    if (above < 0) above = levels.length - 1;
    if (above === 0 || levels[above] === alpha) return entry[side][above][index];
    const share = (alpha - levels[above - 1]) / (levels[above] - levels[above - 1]);
    const [from, to] = [entry[side][above - 1][index], entry[side][above][index]];
    return from.map((value, k) => value + share * (to[k] - value));
  }
  function whole(entry, index) {
    const [low, high] = [Math.min(...entry.lower[0][index]), Math.max(...entry.upper[0][index])];
    const room = 0.06 * (high - low || 1);
    return { left: 0, right: entry.step * (entry.lower[0][index].length - 1), bottom: low - room, top: high + room };
  }
  const x = (t) => margin.left + ((t - view.left) / (view.right - view.left)) * (width - margin.left - margin.right);
  const y = (q) => height - margin.bottom - ((q - view.bottom) / (view.top - view.bottom)) * (height - margin.top - margin.bottom);
  const time = (px) => view.left + ((px - margin.left) / (width - margin.left - margin.right)) * (view.right - view.left);
  const value = (py) => view.bottom + ((height - margin.bottom - py) / (height - margin.top - margin.bottom)) * (view.top - view.bottom);

  function element(tag, attributes, parent) {
    const made = document.createElementNS(name, tag);
    for (const [key, entry] of Object.entries(attributes)) made.setAttribute(key, entry);
    parent.appendChild(made);
    return made;
  }
  function ticks(low, high) {
    const raw = (high - low) / 6;
    const power = 10 ** Math.floor(Math.log10(raw));
    const step = [1, 2, 5, 10].map((k) => k * power).find((k) => k >= raw);
    const found = [];
    for (let k = Math.ceil(low / step); k * step <= high + 1e-12; k += 1) found.push(+(k * step).toPrecision(12));
    return found;
  }
  function band(entry, lower, upper) {
    const first = Math.max(0, Math.floor(view.left / entry.step) - 1);
    const last = Math.min(lower.length - 1, Math.ceil(view.right / entry.step) + 1);
    const points = [];
    for (let k = first; k <= last; k += 1) points.push(`${x(k * entry.step).toFixed(1)},${y(upper[k]).toFixed(1)}`);
    for (let k = last; k >= first; k -= 1) points.push(`${x(k * entry.step).toFixed(1)},${y(lower[k]).toFixed(1)}`);
    return `M${points.join("L")}Z`;
  }
  function axes(entry) {
    const index = entry.outputs.indexOf(output.value);
    const [factor, unit] = [entry.factors[index], entry.units[index]];
    for (const t of ticks(view.left, view.right)) {
      element("line", { x1: x(t), x2: x(t), y1: margin.top, y2: height - margin.bottom, stroke: "#e6e6e6" }, svg);
      element("text", { x: x(t), y: height - margin.bottom + 18, "text-anchor": "middle" }, svg).textContent = String(t);
    }
    for (const q of ticks(view.bottom, view.top)) {
      element("line", { x1: margin.left, x2: width - margin.right, y1: y(q), y2: y(q), stroke: "#e6e6e6" }, svg);
      element("text", { x: margin.left - 8, y: y(q) + 4, "text-anchor": "end" }, svg).textContent = String(+(q * factor).toPrecision(10)).replace(/-/g, "\u2212");
    }
    element("text", { x: (margin.left + width - margin.right) / 2, y: height - 8, "text-anchor": "middle" }, svg).textContent = "time t, s";
    const label = element("text", { x: 0, y: 0, "text-anchor": "middle", transform: `translate(16 ${(height - margin.bottom) / 2}) rotate(-90)` }, svg);
    label.textContent = `${output.value}, ${unit} (${entry.nature})`;
  }
  function draw() {
    const entry = chosen();
    const index = entry.outputs.indexOf(output.value);
    view = view || whole(entry, index);
    svg.replaceChildren();
    axes(entry);
    const clip = element("clipPath", { id: "inside" }, svg);
    element("rect", { x: margin.left, y: margin.top, width: width - margin.left - margin.right, height: height - margin.top - margin.bottom }, clip);
    const inside = element("g", { "clip-path": "url(#inside)" }, svg);
    entry.alpha.forEach((level, k) => {
      const fill = shades[Math.round((k * (shades.length - 1)) / Math.max(1, entry.alpha.length - 1))];
      const last = k === entry.alpha.length - 1;
      const path = band(entry, entry.lower[k][index], entry.upper[k][index]);
      element("path", { d: path, fill, "fill-opacity": 0.55, stroke: last ? "#1a1a1a" : "none", class: "level" }, inside);
    });
    const off = entry.error[0][index];
    for (const [side, sign] of [["lower", -1], ["upper", 1]]) {
      const line = entry[side][0][index].map((value, k) => value + sign * off[k]);
      element("path", { d: band(entry, line, line), fill: "none", stroke: "#8c8c8c", "stroke-width": 0.8, "stroke-dasharray": "4 3", class: "error" }, inside);
    }
    const alpha = +slider.value;
    const [lower, upper] = ["lower", "upper"].map((side) => cut(entry, side, index, alpha));
    element("path", { id: "band", "data-alpha": alpha, d: band(entry, lower, upper), fill: "none", stroke: "#d55e00", "stroke-width": 1.6 }, inside);
    shown.textContent = alpha.toFixed(2);
    if (drag && drag.now) {
      const [left, right] = [Math.min(drag.x, drag.now.x), Math.max(drag.x, drag.now.x)];
      element("rect", { x: left, y: margin.top, width: right - left, height: height - margin.top - margin.bottom, fill: "#0072b2", "fill-opacity": 0.12 }, svg);
    }
  }
  function place(event) {
    const box = svg.getBoundingClientRect();
    return { x: ((event.clientX - box.left) / box.width) * width, y: ((event.clientY - box.top) / box.height) * height };
  }
  function fit(left, right) {
    const entry = chosen();
    const index = entry.outputs.indexOf(output.value);
    const all = whole(entry, index);
    const [from, to] = [Math.max(all.left, left), Math.min(all.right, right)];
    if (to - from < 4 * entry.step) return;
    const [first, last] = [Math.floor(from / entry.step), Math.ceil(to / entry.step)];
    const low = Math.min(...entry.lower[0][index].slice(first, last + 1));
    const high = Math.max(...entry.upper[0][index].slice(first, last + 1));
    const room = 0.06 * (high - low || 1);
    view = { left: from, right: to, bottom: low - room, top: high + room };
    draw();
  }
  function fillOutputs() {
    const before = output.value;
    output.replaceChildren(...chosen().outputs.map((label) => new Option(label, label)));
    output.value = chosen().outputs.includes(before) ? before : chosen().outputs[0];
  }
  study.addEventListener("change", () => { fillOutputs(); view = null; draw(); });
  output.addEventListener("change", () => { view = null; draw(); });
  slider.addEventListener("input", draw);
  document.getElementById("reset").addEventListener("click", () => { view = null; draw(); });
  svg.addEventListener("dblclick", () => { view = null; draw(); });
  svg.addEventListener("wheel", (event) => {
    event.preventDefault();
    const at = time(place(event).x);
    const factor = event.deltaY > 0 ? 1.25 : 0.8;
    fit(at - (at - view.left) * factor, at + (view.right - at) * factor);
  }, { passive: false });
  svg.addEventListener("pointerdown", (event) => { drag = { ...place(event), now: null }; svg.setPointerCapture(event.pointerId); });
  svg.addEventListener("pointerup", () => {
    const done = drag;
    drag = null;
    if (done && done.now && Math.abs(done.now.x - done.x) > 8) fit(...[time(done.x), time(done.now.x)].sort((a, b) => a - b));
    else draw();
  });
  svg.addEventListener("pointermove", (event) => {
    const at = place(event);
    if (drag) { drag.now = at; draw(); }
    const entry = chosen();
    const index = entry.outputs.indexOf(output.value);
    const k = Math.round(time(at.x) / entry.step);
    if (k < 0 || k >= entry.lower[0][index].length) return;
    const [low, high] = ["lower", "upper"].map((side) => cut(entry, side, index, +slider.value)[k]);
    readout.textContent = `t = ${(k * entry.step).toFixed(2)} s: ${[low, high].map((x) => (x * entry.factors[index]).toPrecision(4).replace(/-/g, "\u2212")).join(" … ")} ${entry.units[index]} at α = ${(+slider.value).toFixed(2)}`;
  });
  svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
  fillOutputs();
  draw();
})();
