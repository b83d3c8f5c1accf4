"use strict";
// Curves as SVG: what the cards of a report show, from the data of a card.
const draw = (() => {
  const ns = "http://www.w3.org/2000/svg";
  const element = (name, attributes = {}, text = "") => {
    const made = document.createElementNS(ns, name);
    for (const [attribute, value] of Object.entries(attributes)) made.setAttribute(attribute, value);
    if (text) made.textContent = text;
    return made;
  };
  const html = (name, className = "", text = "") => {
    const made = document.createElement(name);
    if (className) made.className = className;
    if (text) made.textContent = text;
    return made;
  };
  const alphabet = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_";
  const code = new Map([...alphabet].map((character, at) => [character, at]));
  const unpack = ([low, step, text]) => {
    const values = new Float64Array(text.length / 2);
    for (let i = 0; i < values.length; i++) {
      const level = 64 * code.get(text[2 * i]) + code.get(text[2 * i + 1]);
      values[i] = level === 4095 ? NaN : low + step * level;
    }
    return values;
  };
  const prefixes = [[1e6, "M"], [1e3, "k"], [1, ""], [1e-3, "m"], [1e-6, "µ"], [1e-9, "n"]];
  const scaled = (unit, size) => prefixes.find(([factor]) => size >= factor) || [1, ""];
  const extremes = (...lists) => {
    let low = Infinity, high = -Infinity;
    for (const list of lists) for (const value of list) {
      if (value < low) low = value;
      if (value > high) high = value;
    }
    return low <= high ? [low, high] : [0, 1];
  };
  const ticks = (low, high, least) => {
    const power = 10 ** Math.floor(Math.log10(high - low)), first = (step) => Math.ceil(low / step - 1e-9);
    const count = (step) => Math.floor(high / step + 1e-9) - first(step) + 1;
    const step = [1, 0.5, 0.2, 0.1, 0.05].map((m) => m * power).find((m) => count(m) >= least);
    const found = Array.from({ length: count(step) }, (_, at) => (first(step) + at) * step);
    return [found, Math.max(0, -Math.floor(Math.log10(step) + 1e-9))];
  };
  const decades = (low, high) => {
    const found = [];
    for (let power = Math.floor(low); power <= high; power++) for (const m of high - low > 2.5 ? [1] : [1, 2, 5]) {
      const at = power + Math.log10(m);
      if (at >= low && at <= high) found.push(at);
    }
    return found.length ? found : [0.5 * (low + high)];
  };
  const said = (value, decimals) => {
    const text = value.toFixed(decimals).replace("-", "−");
    return /[1-9]/.test(text) ? text : text.replace("−", "");
  };

  // An axis: values, a name, and a unit, which is prefixed if it is one of SI.
  const axis = (name, unit, values, { from = null, pad = 0.05, prefixed = true } = {}) => {
    let [low, high] = from || extremes(...values);
    if (low === high) [low, high] = low ? [low - Math.abs(low), high + Math.abs(high)] : [-1, 1];
    const gap = pad * (high - low);
    const [factor, prefix] = prefixed ? scaled(unit, Math.max(Math.abs(low), Math.abs(high))) : [1, ""];
    return { label: unit ? `${name} [${prefix}${unit}]` : name, factor, low: (low - gap) / factor, high: (high + gap) / factor };
  };
  const plot = (title, x, y, series, { width, height }) => {
    const left = 46, right = width - 8, top = 18, bottom = height - 30;
    const svg = element("svg", { class: "plot", viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": title });
    const px = (value) => left + (value / x.factor - x.low) / (x.high - x.low) * (right - left);
    const clip = (where) => y.clip && !isNaN(where) ? Math.max(top, Math.min(bottom, where)) : where;
    const py = (value) => clip(bottom - (value / y.factor - y.low) / (y.high - y.low) * (bottom - top));
    const [xs, xDecimals] = x.log ? [decades(x.low, x.high), 0] : ticks(x.low, x.high, 4), [ys, yDecimals] = ticks(y.low, y.high, height > 200 ? 4 : 3);
    let grid = "";
    for (const at of xs) {
      const where = px(at * x.factor).toFixed(1);
      grid += `M${where} ${top}V${bottom}`;
      svg.append(element("text", { class: "tick", x: where, y: bottom + 12, "text-anchor": "middle" }, x.log ? `${+(10 ** at).toPrecision(1)}` : said(at, xDecimals)));
    }
    for (const at of ys) {
      const where = py(at * y.factor);
      grid += `M${left} ${where.toFixed(1)}H${right}`;
      svg.append(element("text", { class: "tick", x: left - 4, y: (where + 3.5).toFixed(1), "text-anchor": "end" }, said(at, yDecimals)));
    }
    svg.prepend(element("path", { class: "grid", d: grid }));
    for (const { kind, xs: across, ys: up } of series) {
      let path = "", pen = false;
      for (let i = 0; i < across.length; i++) {
        const point = `${px(across[i]).toFixed(1)} ${py(up[i]).toFixed(1)}`;
        if (point.includes("NaN")) pen = false;
        else if (kind === "dot" || kind === "at") path += `M${point}h0`;
        else { path += (pen ? "L" : "M") + point; pen = true; }
      }
      svg.append(element("path", { class: kind, d: kind === "area" && path ? `${path}Z` : path }));
    }
    svg.append(
      element("rect", { class: "frame", x: left, y: top, width: right - left, height: bottom - top }),
      element("text", { x: left, y: 12 }, title),
      element("text", { class: "tick", x: right, y: height - 5, "text-anchor": "end" }, x.label),
      element("text", { class: "tick", x: right, y: 12, "text-anchor": "end" }, y.label),
    );
    return svg;
  };

  const signals = (body, width) => {
    const box = html("div", "signals");
    const time = unpack(body.t), blocks = unpack(body.rt);
    for (const signal of body.signals) {
      if (!signal.f) { box.append(...raw(signal, time, blocks, width)); continue; }
      const measured = unpack(signal.s), fit = unpack(signal.f), residual = unpack(signal.r);
      box.append(plot(
        `${signal.name}: signal (dots) and fit`, axis("time", "s", [time], { pad: 0.01 }), axis(signal.name, signal.unit, [measured, fit]),
        [{ kind: "line", xs: time, ys: fit }, { kind: "dot", xs: time, ys: measured }],
        { width, height: 150 },
      ));
      if (residual.length < 2) { box.append(html("div")); continue; }
      const [low, high] = extremes(fit), [least, largest] = extremes(residual);
      const share = 200 * Math.max(-least, largest) / (high - low);
      const even = [], odd = [];
      for (let i = 0; i < residual.length; i += 2) { even.push(i); odd.unshift(i + 1); }
      const around = [...even, ...odd];
      box.append(plot(
        `residual, at most ${share.toPrecision(2)} %`, axis("time", "s", [blocks], { pad: 0.01 }), axis(signal.name, signal.unit, [residual]),
        [{ kind: "area", xs: around.map((i) => blocks[i]), ys: around.map((i) => residual[i]) }],
        { width, height: 150 },
      ));
    }
    return box;
  };
  // A signal without a fit: some samples, and its extremes over the whole record.
  const raw = (signal, time, blocks, width) => {
    const measured = unpack(signal.s), ends = unpack(signal.r);
    const even = [], odd = [];
    for (let i = 0; i < ends.length; i += 2) { even.push(i); odd.unshift(i + 1); }
    const turn = [...even, ...odd], found = [plot(
      `${signal.name}: samples from the middle`, axis("time", "s", [time], { pad: 0.01 }), axis(signal.name, signal.unit, [measured]),
      [{ kind: "line", xs: time, ys: measured }], { width, height: 150 },
    )];
    if (ends.length > 1) found.push(plot(
      `${signal.name}: least and largest over the record`, axis("time", "s", [blocks], { pad: 0.01 }), axis(signal.name, signal.unit, [ends]),
      [{ kind: "area", xs: turn.map((i) => blocks[i]), ys: turn.map((i) => ends[i]) }], { width, height: 150 },
    ));
    return found;
  };
  const loop = (body, width) => {
    const { d, f, lag, w, p, across } = body.loop;
    const turns = Array.from({ length: 121 }, (_, i) => i * Math.PI / 60);
    const xs = turns.map((turn) => d * Math.cos(turn)), ys = turns.map((turn) => f * Math.cos(turn + lag));
    const series = [{ kind: "line", xs, ys }], seen = [ys];
    const signal = body.signals && body.signals.find((one) => one.name === "F1");
    if (signal && p !== undefined) {
      const measured = unpack(signal.s), time = unpack(body.t);
      series.push({ kind: "dot", xs: [...time].map((t) => d * Math.cos(w * t + p)), ys: measured });
      seen.push(measured);
    }
    const title = across ? "F1 against the deflection across the tyre" : "F1 against the deflection at the contact";
    return plot(title, axis("deflection", "m", [xs]), axis("F1", "N", seen), series, { width, height: 0.85 * width });
  };
  const curve = (curve, width) => {
    const x = unpack(curve.x), y = unpack(curve.y);
    const series = [{ kind: "thin", xs: x, ys: y }];
    const [low, high] = extremes(x);
    if (curve.mx) series.push({ kind: "line", xs: unpack(curve.mx), ys: unpack(curve.my) });
    for (const [at, load, slope] of curve.tangents || []) {
      const half = 0.12 * (high - low);
      series.push({ kind: "tangent", xs: [at - half, at + half], ys: [load - slope * half, load + slope * half] });
      series.push({ kind: "at", xs: [at], ys: [load] });
    }
    const title = "load loop, its mean, tangents K1";
    return plot(title, axis("deflection", "m", [x]), axis("load", "N", [y]), series, { width, height: Math.min(360, 0.75 * width) });
  };
  const lines = (body, width) => {
    const box = html("div", "whole spectra"), xs = unpack(body.lines.f);
    const x = { ...axis("frequency", "Hz", [xs], { pad: 0.02 }), label: "frequency [Hz]", factor: 1, log: true };
    [x.low, x.high] = extremes(xs);
    if (x.low === x.high) { x.low -= 0.1; x.high += 0.1; }
    for (const panel of body.lines.panels) {
      const series = [];
      if (panel.v) {
        const value = unpack(panel.v), reach = unpack(panel.u), there = [...value.keys()].filter((i) => !isNaN(value[i] + reach[i]));
        const middle = (i) => panel.zero ? 0 : value[i];
        const back = [...there].reverse();
        series.push({
          kind: "area", xs: [...there, ...back].map((i) => xs[i]),
          ys: [...there.map((i) => middle(i) - reach[i]), ...back.map((i) => middle(i) + reach[i])],
        });
        series.push({ kind: panel.zero ? "dot" : "line", xs, ys: value });
      }
      const names = [];
      for (const [at, curve] of (panel.curves || []).entries()) {
        series.push({ kind: `curve c${at}`, xs, ys: unpack(curve.v) });
        names.push(curve.name);
      }
      const [low, high] = panel.room, gap = 0.06 * (high - low) || 1;
      const y = { label: `[${panel.unit}]`, factor: 1, low: low - gap, high: high + gap, clip: true };
      const svg = plot(names.length ? "" : panel.title, x, y, series, { width, height: 190 });
      if (names.length) svg.append(...legend(panel.title, names));
      box.append(svg);
    }
    return box;
  };
  const legend = (title, names) => {
    const text = element("text", { x: 46, y: 12 }, `${title}: `);
    for (const [at, name] of names.entries()) text.append(element("tspan", { class: `name c${at}` }, `${at ? ", " : ""}${name}`));
    return [text];
  };
  const table = (found) => {
    const box = html("div", "whole scroll"), made = html("table", "results"), head = html("tr");
    for (const name of found.heads) head.append(html("th", "n", name));
    made.append(html("thead"), html("tbody"));
    made.firstChild.append(head);
    for (const row of found.rows) {
      const line = html("tr");
      for (const cell of row) line.append(html("td", "n", cell));
      made.lastChild.append(line);
    }
    box.append(made, html("p", "note", found.rows.length < found.of ? `${found.rows.length} of ${found.of} lines; dynamic.csv and lines.csv have all.` : ""));
    return box;
  };
  const facts = (facts, wide) => {
    const list = html("dl", wide ? "wide" : "");
    for (const [name, value] of facts) {
      const pair = wide ? html("div") : list;
      pair.append(html("dt", "", name), html("dd", "", value));
      if (wide) list.append(pair);
    }
    return list;
  };
  const card = (body, wide) => {
    const inside = html("div", "card");
    const room = Math.max(280, wide - 20), three = room > 760, width = three ? room / 3 - 16 : room; // as in the style
    for (const remark of body.remarks) inside.append(html("p", "whole", remark));
    if (body.lines) inside.append(lines(body, three ? room / 2 - 8 : width), table(body.table));
    if (body.curve) inside.append(curve(body.curve, three ? 2 * width : width));
    if (body.signals) {
      const box = signals(body, body.lines && three ? room / 2 - 8 : width);
      if (body.lines) box.classList.add("whole");
      inside.append(box);
    }
    if (body.loop) {
      const side = html("div", "side");
      side.append(loop(body, width));
      if (body.loop.p !== undefined) side.append(html("p", "note", "Line: the fundamental. Dots: samples of F1 at the fundamental of the deflection."));
      inside.append(side);
    }
    if (!body.curve && !body.signals && !body.lines) inside.append(html("p", "whole note", "No recording of it could be used, or no preview is kept."));
    inside.append(facts(body.facts, !body.curve));
    return inside;
  };
  return { card, html, unpack, axis, plot, signals, loop, curve, facts };
})();
