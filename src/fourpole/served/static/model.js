"use strict";
// The map with sliders: the server answers, the state stands in the address; and jobs.
(() => {
  const byId = (id) => document.getElementById(id);
  const point = byId("point"), doing = byId("doing");

  // ---- sliders
  const curves = (shown) => {
    const box = byId("curves");
    if (!shown) { box.replaceChildren(); return; }
    const wide = Math.max(260, Math.min(460, (box.clientWidth - 16) / (box.clientWidth > 600 ? 2 : 1)));
    const { frequency, at, panels } = shown;
    const along = shown.log ? Math.log10 : Number, xs = frequency.map(along);
    const across = { ...draw.axis("frequency", "Hz", [xs], { pad: 0.02, prefixed: false }), log: shown.log };
    box.replaceChildren(...panels.map(({ symbol, unit, y, half }) => {
      const values = y.map((value) => value ?? NaN), low = values.map((v, i) => v - half[i]), high = values.map((v, i) => v + half[i]);
      const here = values.map((v, i) => [Math.abs(frequency[i] - at), i]).sort((a, b) => a[0] - b[0])[0][1];
      const next = frequency[here] < at ? here + 1 : here - 1;
      const share = next in values && at !== frequency[here] ? (at - frequency[here]) / (frequency[next] - frequency[here]) : 0;
      const level = share ? values[here] + share * (values[next] - values[here]) : values[here];
      const known = values.map((_, i) => i).filter((i) => !Number.isNaN(values[i]));
      const around = [...known, ...[...known].reverse()];
      return draw.plot(symbol, across, draw.axis(symbol, unit, [low, high], { prefixed: false }), [
        { kind: "area", xs: around.map((i) => xs[i]), ys: around.map((i, n) => (n < known.length ? high[i] : low[i])) },
        { kind: "line", xs, ys: values },
        { kind: "at", xs: [along(at)], ys: [level] },
      ], { width: wide, height: 190 });
    }));
  };
  const show = (found) => {
    byId("fault").hidden = !found.fault;
    byId("fault").textContent = found.fault;
    const remarks = byId("remarks");
    remarks.hidden = !found.remarks.length;
    remarks.replaceChildren(...found.remarks.map((text) => draw.html("li", "", text)));
    byId("answers").hidden = !found.rows.length;
    byId("answers").tBodies[0].replaceChildren(...found.rows.map(({ name, symbol, text, unit }) => {
      const row = draw.html("tr"), head = draw.html("th", "", symbol);
      head.scope = "row";
      head.title = name;
      row.append(head, draw.html("td", "n", text), draw.html("td", "", unit));
      return row;
    }));
    curves(found.curves);
  };
  if (point) {
    const ranges = [...point.querySelectorAll("[data-for]")], condition = byId("condition");
    const numberOf = (range) => point.elements[range.dataset.for];
    const to = (range, value) => ("log" in range.dataset ? Math.log10(value) : value);
    const from = (range) => ("log" in range.dataset ? 10 ** Number(range.value) : Number(range.value));
    const place = (range) => {
      range.value = to(range, Number(numberOf(range).value));
      range.setAttribute("aria-valuetext", `${numberOf(range).value} ${numberOf(range).dataset.unit}`);
    };
    for (const range of ranges) {
      range.min = to(range, Number(range.dataset.low));
      range.max = to(range, Number(range.dataset.high));
      range.step = (range.max - range.min) / 1000 || 1;
      place(range);
    }
    const stated = () => {
      const query = new URLSearchParams({ tyre: point.elements.tyre.value });
      if (condition) for (const [name, text] of Object.entries(JSON.parse(condition.selectedOptions[0].dataset.stated))) query.set(name, text);
      for (const range of ranges) {
        const one = numberOf(range);
        if (one.value !== "") query.set(one.name, `${one.value} ${one.dataset.unit}`.trim());
      }
      if (point.elements.beyond.checked) query.set("beyond", "1");
      if (point.elements.for) query.set("for", point.elements.for.value);
      return query;
    };
    let asked = 0, waiting = false, again = false;
    const ask = async () => {
      if (waiting) { again = true; return; }
      waiting = true;
      byId("answers").setAttribute("aria-busy", "true");
      const number = ++asked, query = stated();
      history.replaceState(null, "", `${point.getAttribute("action")}?${query}`);
      try {
        const found = await app.call(`${point.dataset.answer}?${query}`);
        if (number === asked) show(found);
      } catch (error) { show({ fault: error.message, remarks: [], rows: [], curves: null }); }
      waiting = false;
      if (again) { again = false; ask(); } else byId("answers").setAttribute("aria-busy", "false");
    };
    point.querySelector("[type=submit]").hidden = true;
    point.addEventListener("submit", (event) => event.preventDefault());
    point.addEventListener("input", (event) => {
      if (event.target.dataset.for) {
        const range = event.target, low = Number(range.dataset.low), high = Number(range.dataset.high);
        numberOf(range).value = Number(Math.min(Math.max(from(range), low), high).toPrecision(4)) < low ? low
          : Math.min(Number(Math.max(from(range), low).toPrecision(4)), high);
        range.setAttribute("aria-valuetext", `${numberOf(range).value} ${numberOf(range).dataset.unit}`);
      } else for (const range of ranges) if (numberOf(range) === event.target) place(range);
      if (event.target.name === "tyre") location.assign(`${point.getAttribute("action")}?${new URLSearchParams({ tyre: event.target.value })}`);
      else ask();
    });
    point.addEventListener("change", (event) => {
      if (event.target.dataset.for) app.say([...byId("answers").rows].slice(1, 5).map((row) => row.textContent).join(", "));
    });
    curves(JSON.parse(byId("curves-data").textContent));
    let width = innerWidth;
    addEventListener("resize", () => { if (innerWidth !== width) { width = innerWidth; ask(); } });
  }

  // ---- jobs
  const jobs = byId("jobs");
  for (const button of jobs.querySelectorAll("[data-command]")) {
    button.addEventListener("click", async () => {
      const { command } = button.dataset, options = [];
      if (jobs.elements.model.value !== "auto") options.push(`--model=${jobs.elements.model.value}`);
      if (command === "fit") {
        for (const one of jobs.elements.share.value.split(/[\s,]+/).filter(Boolean)) options.push(`--share=${one}`);
        if (jobs.elements.static.value) options.push(`--static=${jobs.elements.static.value}`);
      }
      try {
        await app.send(jobs.dataset.run, { command, options });
        location.assign(jobs.dataset.run);
      } catch (error) { doing.textContent = error.message; }
    });
  }
})();
