// Draws the charts of a forceid page from the numbers in it: zoom, values under the pointer, axes on and off,
// a path that turns. Nothing is loaded. Where scripts do not run, pictures stand in place of the charts.
"use strict";
(() => {
  const charts = JSON.parse(document.getElementById("charts").textContent);
  const ranges = {}; // what is zoomed to, by the name of the x axis: panels of one axis zoom together
  const redraws = []; // [name of the x axis, function]
  const EDGE = { left: 62, right: 10, top: 6, bottom: 34 }; // px round the plot

  const minus = text => String(text).replace(/-/g, "−");
  const show = (v, digits = 3) => v === null || v === undefined ? "not known" : minus(Number(v.toPrecision(digits)));
  const escape = text => text.replace(/[&<>"]/g, c => `&#${c.charCodeAt(0)};`);
  const raised = n => minus(n).replace(/[−\d]/g, c => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["−0123456789".indexOf(c)]);
  const make = (parent, tag, attributes = {}, text = "") => {
    const made = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
    made.textContent = text;
    parent.append(made);
    return made;
  };

  // ticks between two values: [value, label], and the power of ten that the labels leave out
  function ticks(low, high, count, log) {
    if (log) {
      const first = Math.ceil(low - 1e-9), last = Math.floor(high + 1e-9);
      const step = Math.max(1, Math.ceil((last - first + 1) / count)), found = [];
      for (let k = first; k <= last; k += step) found.push([k, k < -2 || k > 3 ? `10${raised(k)}` : 10 ** k]);
      return [found, 0];
    }
    const rough = (high - low) / count, ten = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 5, 10].find(s => s * ten >= rough * 0.999) * ten;
    const most = Math.max(Math.abs(low), Math.abs(high));
    const power = most < 0.01 || most >= 1e4 ? 3 * Math.floor(Math.log10(most) / 3) : 0;
    const digits = Math.min(12, Math.max(0, power - Math.floor(Math.log10(step) + 1e-9))), found = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++)
      found.push([k * step, minus((k * step / 10 ** power).toFixed(digits))]);
    return [found, power];
  }

  const colored = (curve, order) =>
    `var(--${["x", "y", "z", "ink"].includes(curve.color) ? curve.color : `c${order.indexOf(curve.name) % 6}`})`;

  function hydrate(figure, name) {
    const chart = charts[name], host = document.createElement("div");
    figure.querySelector("noscript").replaceWith(host);
    if (chart.path) return drawPath(host, chart, figure.dataset.alternative);
    host.className = "chart";
    const names = [...new Set(chart.panels.flatMap(p => p.curves.map(c => c.name)))];
    const layers = [...new Set(chart.panels.flatMap(p => p.curves.map(c => c.layer)))];
    const off = new Set(chart.hidden.filter(l => layers.includes(l)));
    if (chart.panels.some(p => p.curves.some(c => c.half))) layers.push("band");
    const seen = curve => !off.has(curve.name) && !off.has(curve.layer);
    const bar = make(host, "div", { class: "bar", role: "group", "aria-label": `Controls of ${figure.dataset.title}` });
    const panels = [];

    function toggle(what, color) {
      const button = make(bar, "button", { type: "button", class: what === "band" ? "band" : "", "aria-pressed": !off.has(what) });
      if (color) make(button, "span", { class: "swatch", style: `background:${color}` });
      button.append(what);
      button.onclick = () => {
        off.has(what) ? off.delete(what) : off.add(what);
        button.setAttribute("aria-pressed", !off.has(what));
        panels.forEach(p => p.draw());
      };
    }
    if (names.length > 1)
      for (const n of names) {
        const curve = chart.panels.flatMap(p => p.curves).find(c => c.name === n);
        toggle(n, colored(curve, names));
      }
    if (layers.length > 1) for (const l of layers) if (l !== "estimate") toggle(l);
    const zooms = make(bar, "span", { class: "zooms" });
    for (const [sign, label, act] of [
      ["+", "Zoom in", p => p.zoom(0.5)], ["−", "Zoom out", p => p.zoom(2)], ["All", "Show all", p => p.zoom(0)],
    ]) make(zooms, "button", { type: "button", "aria-label": `${label}, ${figure.dataset.title}` }, sign).onclick =
      () => act(panels[0]);

    const grid = make(host, "div", { class: "panels" });
    for (const panel of chart.panels) panels.push(drawPanel(grid, panel, { seen, off, names, panels, figure }));
  }

  function drawPanel(grid, panel, { seen, off, names, panels, figure }) {
    const box = make(grid, "div", { class: "panel" });
    make(box, "div", { class: "head" }, panel.title);
    const plot = make(box, "div", {
      class: "plot", tabindex: 0, role: "group",
      "aria-label": `${panel.title || panel.y}: arrow keys read values, plus and minus zoom, 0 shows all`,
    });
    const image = make(plot, "div", { role: "img", "aria-label": `${panel.title}: ${panel.y} over ${panel.x}` });
    const tip = make(plot, "output", { class: "tip", hidden: "" });
    const logx = panel.log.includes("x"), logy = panel.log.includes("y");
    const at = logx ? panel.at.map(Math.log10) : panel.at;
    const whole = [at[0] ?? 0, at[at.length - 1] ?? 1];
    if (!(whole[1] > whole[0])) { whole[0] -= 0.5; whole[1] += 0.5; }
    let place = {}, cursor = null, from = null;
    const range = () => ranges[panel.x] ?? whole;
    const high = v => logy ? (v > 0 ? Math.log10(v) : null) : v;

    // ends of the y axis, and whether a rare peak is cut off that would leave all else flat
    function extent([a, b]) {
      const values = [];
      const take = v => { if (v !== null && Number.isFinite(v)) values.push(v); };
      for (const c of panel.curves.filter(seen))
        c.y.forEach((v, k) => {
          if (v === null || at[k] < a || at[k] > b) return;
          const half = c.half && !off.has("band") ? c.half[k] ?? 0 : 0;
          take(high(v - half)); take(high(v + half));
          if (c.kind === "bars") take(0);
        });
      values.sort((p, q) => p - q);
      const count = values.length, most = [values[0], values[count - 1]];
      const usual = [values[Math.floor(0.01 * count)], values[Math.ceil(0.99 * count) - 1]];
      const cut = count > 200 && most[1] - most[0] > 12 * (usual[1] - usual[0]) && usual[1] > usual[0];
      let [low, top] = cut ? usual.map((v, k) => v + (k ? 1 : -1) * (usual[1] - usual[0])) : count ? most : [0, 1];
      if (count && !cut) [low, top] = [Math.min(low, ...panel.levels), Math.max(top, ...panel.levels)];
      const pad = (top - low || Math.abs(top) || 1) * 0.06;
      return [low - pad, top + pad, cut ? `cut off: peaks to ${show(Math.abs(most[0]) > most[1] ? most[0] : most[1])}` : ""];
    }

    function draw() {
      const width = plot.clientWidth, height = plot.clientHeight;
      if (!width || !height) return;
      const w = width - EDGE.left - EDGE.right, h = height - EDGE.top - EDGE.bottom;
      const [a, b] = range(), [low, top, cut] = extent([a, b]);
      const X = v => (v - a) / (b - a) * w, Y = v => (top - v) / (top - low) * h;
      place = { a, b, w, h, X, Y };
      const [ys, power] = ticks(low, top, Math.max(2, Math.floor(h / 24)), logy);
      const [xs] = ticks(a, b, Math.max(2, Math.floor(w / 80)), logx);
      const inside = [], outside = [];
      for (const [v, label] of ys) {
        inside.push(`<path class="grid" d="M0 ${Y(v)}H${w}"/>`);
        outside.push(`<text x="-6" y="${Y(v) + 4}" text-anchor="end">${label}</text>`);
      }
      for (const [v, label] of xs) {
        inside.push(`<path class="grid" d="M${X(v)} 0V${h}"/>`);
        outside.push(`<text x="${X(v)}" y="${h + 15}" text-anchor="middle">${label}</text>`);
      }
      for (const [l, r] of panel.shaded) {
        const ends = [l, r].map(v => X(logx ? Math.log10(v) : v));
        inside.push(`<rect class="shade" x="${ends[0]}" y="0" width="${Math.max(0, ends[1] - ends[0])}" height="${h}"/>`);
      }
      for (const v of panel.edges) inside.push(`<path class="level" d="M${X(logx ? Math.log10(v) : v)} 0V${h}"/>`);
      for (const v of panel.levels) inside.push(`<path class="level" d="M0 ${Y(v)}H${w}"/>`);
      const drawn = panel.curves.filter(seen);
      for (const c of drawn) if (c.half && !off.has("band")) inside.push(band(c));
      for (const c of drawn) inside.push(stroke(c));
      const peaks = cut && `<text class="cut" x="${w - 4}" y="14" text-anchor="end">${cut}</text>`;
      const remark = panel.say ? `<text class="say" x="${w / 2}" y="${h / 2}" text-anchor="middle">${panel.say}</text>` : "";
      let unit = power ? panel.y.replace(/\((?:1(?=\)))?/, `(10${raised(power)} `).replace(" )", ")") : panel.y;
      if (unit.length * 7 > h) unit = unit.replace(/^.*\((.*)\)$/, "$1"); // the title says what it is
      image.innerHTML = `<svg width="${width}" height="${height}" aria-hidden="true" focusable="false">
        <g transform="translate(${EDGE.left} ${EDGE.top})"><svg width="${w}" height="${h}">${inside.join("")}</svg>
        <path class="axis" d="M0 0V${h}H${w}"/>${outside.join("")}${remark}${peaks}
        <text class="name" x="${w}" y="${h + 29}" text-anchor="end">${escape(panel.x)}</text>
        <text class="name" transform="translate(-50 ${h / 2}) rotate(-90)" text-anchor="middle">${escape(unit)}</text>
        <g class="cursor"></g></g></svg>`;
      mark();

      function pieces(c, point) { // runs of samples that are known
        const found = [];
        let run = [];
        c.y.forEach((v, k) => {
          const y = v === null ? null : high(v);
          if (y === null) { if (run.length) found.push(run); run = []; } else run.push(point(k, v));
        });
        if (run.length) found.push(run);
        return found;
      }
      function band(c) {
        const side = sign => (k, v) => {
          const y = high(v + sign * (c.half[k] ?? 0));
          return `${X(at[k]).toFixed(1)} ${(y === null ? h : Y(y)).toFixed(1)}`;
        };
        const above = pieces(c, side(1)), below = pieces(c, side(-1));
        const d = above.map((run, k) => `M${run.join("L")}L${below[k].reverse().join("L")}Z`).join("");
        return `<path d="${d}" style="fill:${colored(c, names)}" class="band"/>`;
      }
      function stroke(c) {
        const color = colored(c, names);
        if (c.kind === "bars") {
          const half = (X(at[1]) - X(at[0])) / 2;
          const d = c.y.map((v, k) => v === null ? "" :
            `M${X(at[k]) - half} ${Y(0)}V${Y(v)}h${2 * half}V${Y(0)}Z`).join("");
          return `<path d="${d}" style="fill:${color}" class="band"/>`;
        }
        const runs = pieces(c, (k, v) => `${X(at[k]).toFixed(1)} ${Y(high(v)).toFixed(1)}`);
        if (c.kind === "dots")
          return `<path d="${runs.flat().map(p => `M${p}h.01`).join("")}" style="stroke:${color}" class="dots"/>`;
        const d = runs.map(run => run.length > 1 ? `M${run.join("L")}` : `M${run[0]}h.01`).join("");
        return `<path d="${d}" style="stroke:${color}" class="line ${c.layer.replace(" ", "-")}"/>`;
      }
    }

    function mark(selection) {
      const layer = image.querySelector(".cursor");
      if (!layer || !place.w) return;
      if (cursor === null || !panel.curves.length) { layer.innerHTML = ""; tip.hidden = true; return; }
      const { a, b, w, h, X, Y } = place, x = X(at[cursor]);
      let inner = selection ? `<rect class="shade" x="${Math.min(...selection)}" y="0" height="${h}"
        width="${Math.abs(selection[1] - selection[0])}"/>` : "";
      const rows = [];
      for (const c of panel.curves.filter(c => seen(c) && c.kind !== "dots")) {
        const v = c.y[cursor], half = c.half?.[cursor];
        const label = [names.length > 1 ? c.name : "", c.layer === "estimate" ? "" : c.layer].join(" ").trim();
        rows.push(`${label} ${show(v)}${half === undefined || half === null ? "" : ` ± ${show(half, 2)}`}`.trim());
        if (v !== null && high(v) !== null && at[cursor] >= a && at[cursor] <= b)
          inner += `<circle cx="${x}" cy="${Y(high(v))}" r="3.5" style="fill:${colored(c, names)}"/>`;
      }
      layer.innerHTML = at[cursor] < a || at[cursor] > b ? "" : `<path d="M${x} 0V${h}"/>${inner}`;
      const unit = panel.x.replace(/.*\((.*)\)/, "$1"), own = panel.y.replace(/.*\((.*)\)/, "$1");
      tip.textContent = [`${minus(panel.at[cursor])} ${unit}${own === "1" ? "" : `, in ${own}`}`, ...rows].join("\n");
      tip.hidden = false;
      tip.style.left = x > w / 2 ? "" : `${EDGE.left + x + 10}px`;
      tip.style.right = x > w / 2 ? `${EDGE.right + w - x + 10}px` : "";
    }

    function point(index) { // also in the panels beside it that have the same x axis
      for (const other of panels) if (other.panel.x === panel.x) other.set(index === null ? null : panel.at[index]);
    }
    function set(x) {
      cursor = x === null ? null : nearest(panel.at, x);
      mark();
    }
    function nearest(values, x) {
      let low = 0, up = values.length - 1;
      while (up - low > 1) { const mid = (low + up) >> 1; values[mid] < x ? low = mid : up = mid; }
      return Math.abs(values[low] - x) <= Math.abs(values[up] - x) ? low : up;
    }
    function zoom(factor) {
      const [a, b] = range();
      let middle = (a + b) / 2;
      if (cursor !== null && at[cursor] > a && at[cursor] < b) middle = at[cursor];
      const half = Math.max((b - a) * factor / 2, (whole[1] - whole[0]) * 1e-4);
      narrow(factor ? [middle - half, middle + half] : whole);
    }
    function narrow([a, b]) {
      const wide = b - a >= whole[1] - whole[0];
      if (a < whole[0]) [a, b] = [whole[0], b + whole[0] - a];
      if (b > whole[1]) [a, b] = [a + whole[1] - b, whole[1]];
      if (wide) delete ranges[panel.x]; else ranges[panel.x] = [a, b];
      for (const [x, redraw] of redraws) if (x === panel.x) redraw();
    }
    const across = event => Math.min(Math.max(event.clientX - plot.getBoundingClientRect().left - EDGE.left, 0), place.w);
    const value = x => place.a + x / place.w * (place.b - place.a);
    plot.onpointermove = event => {
      if (!at.length || !place.w) return;
      const x = across(event);
      point(nearest(at, value(x)));
      if (from !== null) mark([from, x]);
    };
    plot.onpointerdown = event => {
      if (event.pointerType !== "mouse" || event.button) return plot.onpointermove(event);
      from = across(event);
      plot.setPointerCapture(event.pointerId);
    };
    plot.onpointerup = event => {
      if (from === null) return;
      const ends = [value(from), value(across(event))].sort((p, q) => p - q), far = Math.abs(across(event) - from) > 6;
      from = null;
      if (far) narrow(ends); else mark();
    };
    plot.onpointercancel = () => { from = null; };
    plot.onpointerleave = () => { if (document.activeElement !== plot) point(null); };
    plot.ondblclick = () => zoom(0);
    plot.onblur = () => point(null);
    plot.onkeydown = event => {
      const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key], last = at.length - 1;
      if (step) {
        const [a, b] = range(), start = cursor ?? nearest(at, (a + b) / 2) - step;
        const next = Math.min(Math.max(start + step * (event.shiftKey ? 20 : 1), 0), last);
        if (at[next] < a || at[next] > b) narrow([a + at[next] - at[start], b + at[next] - at[start]]);
        point(next);
      } else if (event.key === "Home" || event.key === "End") point(event.key === "Home" ? 0 : last);
      else if (event.key === "+" || event.key === "=") zoom(0.5);
      else if (event.key === "-") zoom(2);
      else if (event.key === "0" || event.key === "Escape") zoom(0);
      else return;
      event.preventDefault();
    };
    redraws.push([panel.x, draw]);
    new ResizeObserver(draw).observe(plot);
    return { panel, draw, set, zoom };
  }

  // the path in space: orthographic, turned by dragging or by arrow keys
  function drawPath(host, chart, alternative) {
    host.className = "chart";
    const plot = make(host, "div", {
      class: "plot space", tabindex: 0, role: "group", "aria-label": "Path in space: arrow keys turn it, 0 turns it back",
    });
    const image = make(plot, "div", { role: "img", "aria-label": alternative }), tip = make(plot, "output", { class: "tip", hidden: "" });
    const key = make(host, "p", { class: "key" });
    const v = chart.vertical, order = chart.up > 0 ? [(v + 1) % 3, (v + 2) % 3, v] : [(v + 2) % 3, (v + 1) % 3, v];
    const upright = p => p.includes(null) ? null : [p[order[0]], p[order[1]], chart.up * p[v]];
    const path = chart.path.map(upright), foot = chart.foot.map(upright), seen = path.filter(p => p);
    const low = [0, 1, 2].map(k => Math.min(...seen.map(p => p[k]))), high = [0, 1, 2].map(k => Math.max(...seen.map(p => p[k])));
    const span = Math.max(...low.map((l, k) => high[k] - l), 1e-9);
    const tips = chart.force.map((f, k) => upright(f).map((x, i) => foot[k][i] + x * 0.22 * span / (chart.longest || 1)));
    const START = [-0.55, 0.42];
    let [turn, rise] = START, last = null, feet = [];

    function draw() {
      const width = plot.clientWidth, height = plot.clientHeight;
      if (!width || !height) return;
      const flat = ([a, b, c]) => {
        const [cos, sin] = [Math.cos(turn), Math.sin(turn)], deep = -a * sin + b * cos;
        return [a * cos + b * sin, -(c * Math.cos(rise) + deep * Math.sin(rise))];
      };
      const ten = 10 ** Math.floor(Math.log10(span / 3)), step = ten * [5, 2, 1].find(s => s * ten <= span / 3 * 1.001);
      const floor = low[2] - 0.05 * span, from = k => Math.floor(low[k] / step) * step, to = k => Math.max(Math.ceil(high[k] / step), Math.floor(low[k] / step) + 1) * step;
      const corners = [[from(0), from(1)], [to(0), from(1)], [to(0), to(1)], [from(0), to(1)]].map(p => [...p, floor]);
      const all = [...seen, ...tips, ...corners].map(flat);
      const box = [0, 1].map(k => [Math.min(...all.map(p => p[k])), Math.max(...all.map(p => p[k]))]);
      const scale = Math.min((width - 70) / (box[0][1] - box[0][0]), (height - 50) / (box[1][1] - box[1][0]));
      const at = p => flat(p).map((q, k) => ((k ? height : width) / 2 + (q - (box[k][0] + box[k][1]) / 2) * scale).toFixed(1));
      const line = points => points.reduce((d, p) => p ? [d[0] + (d[1] ? "L" : "M") + at(p).join(" "), true] : [d[0], false], ["", false])[0];
      const parts = [];
      for (let x = from(0); x <= to(0) + step / 9; x += step) parts.push(`<path class="grid" d="${line([[x, from(1), floor], [x, to(1), floor]])}"/>`);
      for (let y = from(1); y <= to(1) + step / 9; y += step) parts.push(`<path class="grid" d="${line([[from(0), y, floor], [to(0), y, floor]])}"/>`);
      parts.push(`<path class="line shadow" d="${line(path.map(p => p && [p[0], p[1], floor]))}"/>`, `<path class="line ink" d="${line(path)}"/>`);
      const arm = 0.14 * span, origin = corners[0], names = "xyz";
      order.forEach((axis, k) => {
        const end = origin.slice(), sign = k === 2 ? chart.up : 1;
        end[k] += arm * sign;
        const label = at(end.map((e, i) => i === k ? e + 0.05 * span * sign : e));
        parts.push(`<path class="line" style="stroke:var(--${names[axis]})" d="${line([origin, end])}"/><text x="${label[0]}" y="${label[1]}" text-anchor="middle" dy="4">${names[axis]}</text>`);
      });
      feet = foot.map(p => at(p).map(Number));
      tips.forEach((end, k) => {
        const [x, y] = feet[k], [p, q] = at(end).map(Number), long = Math.hypot(p - x, q - y), head = Math.min(9, long / 2);
        const [i, j] = long ? [(p - x) / long, (q - y) / long] : [0, 0];
        parts.push(`<path class="arrow" d="M${x} ${y}L${p} ${q}M${p - head * (i + j / 2)} ${q - head * (j - i / 2)}L${p} ${q}L${p - head * (i - j / 2)} ${q - head * (j + i / 2)}"/>`);
      });
      const [[sx, sy], [ex, ey]] = [seen[0], seen[seen.length - 1]].map(p => at(p).map(Number));
      parts.push(`<circle class="end" cx="${sx}" cy="${sy}" r="5"/><rect class="end" x="${ex - 4.5}" y="${ey - 4.5}" width="9" height="9"/>`);
      image.innerHTML = `<svg width="${width}" height="${height}" aria-hidden="true" focusable="false">${parts.join("")}</svg>`;
      key.textContent = `${chart.longest ? `Arrows: applied force, the longest ${show(chart.longest)} N. ` : "No force beyond two sigma. "}Grid: ${show(step)} m. Disc: start; square: end. Drag or use arrow keys to turn.`;
    }
    plot.onpointermove = event => {
      if (last) {
        turn -= (event.clientX - last[0]) / 150;
        rise = Math.min(Math.max(rise + (event.clientY - last[1]) / 150, 0), Math.PI / 2);
        last = [event.clientX, event.clientY];
        return draw();
      }
      const edge = plot.getBoundingClientRect(), [x, y] = [event.clientX - edge.left, event.clientY - edge.top];
      const off = feet.map(p => Math.hypot(p[0] - x, p[1] - y)), k = off.indexOf(Math.min(...off));
      tip.hidden = !(off[k] < 25);
      if (tip.hidden) return;
      tip.textContent = [`${show(chart.time[k])} s, in N`, ...chart.force[k].map((f, i) => `${"xyz"[i]} ${show(f)}`)].join("\n");
      tip.style.left = `${x + 14}px`;
    };
    plot.onpointerdown = event => { last = [event.clientX, event.clientY]; plot.setPointerCapture(event.pointerId); };
    plot.onpointerup = plot.onpointercancel = () => { last = null; };
    plot.onpointerleave = () => { tip.hidden = true; };
    plot.onkeydown = event => {
      const by = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
      if (by) { turn += by[0] / 12; rise = Math.min(Math.max(rise + by[1] / 12, 0), Math.PI / 2); }
      else if (event.key === "0" || event.key === "Escape") [turn, rise] = START;
      else return;
      event.preventDefault();
      draw();
    };
    redraws.push(["", draw]);
    new ResizeObserver(draw).observe(plot);
  }

  const figures = [...document.querySelectorAll("figure[data-chart]")];
  for (const figure of figures) hydrate(figure, figure.dataset.chart);
  const folded = [...document.querySelectorAll("details")];
  const closed = [];
  const unfold = () => {
    closed.push(...folded.filter(d => !d.open));
    closed.forEach(d => { d.open = true; });
    redraws.forEach(([, redraw]) => redraw());
  };
  const fold = () => closed.splice(0).forEach(d => { d.open = false; });
  addEventListener("beforeprint", unfold);
  addEventListener("afterprint", fold);
  matchMedia("print").addEventListener("change", media => media.matches ? unfold() : fold());
  addEventListener("hashchange", aim);
  aim();
  function aim() { // a link to what is folded unfolds it
    const target = location.hash && document.getElementById(location.hash.slice(1));
    if (target?.tagName === "DETAILS") { target.open = true; target.scrollIntoView(); }
  }
})();
