"use strict";
// The form of a campaign's statement. What is wrong is said by the server, in the words of the command line, while it
// is filled in; a doubt is settled by a change of what it is about.
(() => {
  const byId = (id) => document.getElementById(id);
  const form = byId("form"), table = byId("tests"), problems = byId("problems"), kept = byId("kept");
  const data = JSON.parse(byId("statement-data").textContent);
  let { version } = data, changed = false;
  const made = (name, text = "", attributes = {}) => {
    const element = document.createElement(name);
    if (text) element.textContent = text;
    for (const [attribute, value] of Object.entries(attributes)) element.setAttribute(attribute, value);
    return element;
  };

  // ---- the table of tests
  const heads = () => [...table.tHead.rows[0].cells].map((cell) => cell.dataset.head);
  const nameOf = (head) => head.replace(/\s*\[[^\]]*\]\s*$/, "");
  const cell = (value, head, row) => {
    const box = made("td"), input = made("input", "", { type: "text", value, "aria-label": `${head}, row ${row}` });
    box.append(input);
    return box;
  };
  const addRow = (values) => {
    const row = made("tr"), number = table.tBodies[0].rows.length + 1;
    row.append(...heads().map((head, at) => cell(values[at] ?? "", head, number)));
    table.tBodies[0].append(row);
    return row;
  };
  const head = (name) => made("th", name, { scope: "col", "data-head": name });
  const widen = () => { // a column is as wide as its longest entry
    const rows = cells();
    [...table.tHead.rows[0].cells].forEach((one, at) => {
      one.style.minWidth = `${Math.min(32, Math.max(6, ...rows.map((row) => row[at].length)) + 3)}ch`;
    });
  };
  const fill = () => {
    const line = made("tr");
    line.append(...data.heads.map(head));
    table.tHead.replaceChildren(line);
    table.tBodies[0].replaceChildren();
    for (const row of data.rows) addRow(row);
    widen();
  };
  const cells = () => [...table.tBodies[0].rows].map((row) => [...row.cells].map(({ firstElementChild: one }) => (one.dataset.doubts ?? one.value).trim()));
  table.addEventListener("paste", (event) => {
    const text = event.clipboardData.getData("text/plain"), input = event.target.closest("input");
    if (!input || !/[\t\n]/.test(text.trim())) return;
    event.preventDefault();
    const box = input.parentElement, first = box.parentElement.sectionRowIndex, left = box.cellIndex;
    text.replace(/\r?\n$/, "").split(/\r?\n/).forEach((line, down) => {
      const row = table.tBodies[0].rows[first + down] ?? addRow([]);
      line.split("\t").forEach((value, across) => {
        const target = row.cells[left + across]?.firstElementChild;
        if (target) target.value = value.trim();
      });
    });
    widen();
    table.dispatchEvent(new Event("input", { bubbles: true }));
  });
  table.addEventListener("keydown", (event) => { // up and down go through a column, as in a spreadsheet
    const step = { ArrowUp: -1, ArrowDown: 1, Enter: 1 }[event.key], box = event.target.closest("td");
    if (!step || !box) return;
    event.preventDefault();
    table.tBodies[0].rows[box.parentElement.sectionRowIndex + step]?.cells[box.cellIndex].firstElementChild.focus();
  });
  table.addEventListener("change", widen);
  byId("more-row").addEventListener("click", () => addRow([]).cells[0].firstElementChild.focus());
  byId("more-column").addEventListener("click", () => {
    const name = byId("new-column").value.trim();
    if (!name || heads().includes(name)) return;
    table.tHead.rows[0].append(head(name));
    [...table.tBodies[0].rows].forEach((row, at) => row.append(cell("", name, at + 1)));
    widen();
    byId("new-column").value = "";
    table.dispatchEvent(new Event("input", { bubbles: true }));
  });

  // ---- what is wrong, at its place
  const filled = () => { // rows that are saved
    const all = cells();
    return [...table.tBodies[0].rows].filter((_, at) => all[at].some(Boolean));
  };
  const marked = (problem, rows) => {
    if (problem.row !== null) {
      const row = rows[problem.row - 2];
      const at = heads().findIndex((one) => nameOf(one).toLowerCase() === problem.column.toLowerCase());
      return row?.cells[Math.max(at, 0)]?.firstElementChild;
    }
    const fields = [...form.querySelectorAll("[data-path]")];
    if (form.hidden) return byId("text");
    return fields.find((one) => one.dataset.path === problem.path) ?? fields.find((one) => problem.path && one.dataset.path.startsWith(`${problem.path}.`));
  };
  let shown = "[]";
  const show = (list) => {
    if (JSON.stringify(list) === shown) return; // or else the same would be read aloud again
    shown = JSON.stringify(list);
    for (const one of document.querySelectorAll("[aria-invalid]")) { one.removeAttribute("aria-invalid"); one.removeAttribute("aria-describedby"); }
    for (const one of document.querySelectorAll(".wrong")) one.remove();
    const rows = filled(), items = list.map((problem, number) => {
      const item = made("li"), field = marked(problem, rows);
      if (!field) { item.textContent = problem.text; return item; }
      field.setAttribute("aria-invalid", "true");
      if (field.id !== "text") {
        field.after(made("small", problem.text.replace(/^(tests\.csv row \d+: |campaign\.toml: (\[\w+\] )?[\w.]+: )/, ""), { class: "wrong", id: `wrong-${number}` }));
        field.setAttribute("aria-describedby", `${field.getAttribute("aria-describedby") ?? ""} wrong-${number}`.trim());
      }
      const link = made("button", problem.text, { type: "button", class: "link" });
      link.addEventListener("click", () => { field.scrollIntoView({ block: "center" }); field.focus(); });
      item.append(link);
      return item;
    });
    const text = made("ul");
    text.append(...items);
    problems.replaceChildren(made("p", list.length === 1 ? "One thing is not right yet:" : `${list.length} things are not right yet:`), text);
    problems.hidden = !list.length;
  };

  const doubts = (left) => { // of each row; what the page had is kept, for a change may be taken back
    const at = heads().indexOf("doubts");
    left.forEach((text, row) => {
      const input = table.tBodies[0].rows[row]?.cells[at].firstElementChild;
      if (!input || input.value === text) return;
      input.dataset.doubts ??= input.value;
      input.value = text;
    });
  };

  // ---- saving
  const value = (row, name) => {
    const input = row.querySelector(`[name="${name}"]`);
    return input.type === "checkbox" ? (input.checked ? "yes" : "") : input.value.trim();
  };
  const stated = () => {
    const channels = {}, rig = {};
    let clock = {};
    for (const row of form.querySelectorAll("[data-role]")) {
      const keys = Object.fromEntries([...row.querySelectorAll("[name]")].map((one) => [one.name, value(row, one.name)]));
      if (row.dataset.role === "time") clock = keys; else channels[row.dataset.role] = keys;
    }
    for (const row of form.querySelectorAll("[data-rig]")) rig[row.dataset.rig] = ["value", "unit", "std"].map((name) => value(row, name));
    const simple = form.querySelector("[name=blocked]");
    const settled = [...document.querySelectorAll("[name=settled]:checked")].map((one) => one.value);
    return { title: form.elements.title.value.trim(), channels, clock, rig, blocked: simple ? simple.checked : false, settled };
  };
  let waiting = 0, asked = new AbortController();
  const save = async (content) => {
    clearTimeout(waiting);
    asked.abort();
    kept.textContent = "Saving …";
    try {
      const answer = await app.send(form.dataset.address, { version, heads: heads(), rows: cells(), ...content }, "PUT");
      ({ version } = answer);
      changed = false;
      show(answer.problems);
      doubts(answer.doubts);
      kept.textContent = answer.problems.length ? "Saved; see below." : "Saved.";
      for (const one of document.querySelectorAll("[name=settled]:checked")) { const list = one.closest("ul"); one.closest("li").remove(); if (!list.children.length) list.closest("section").remove(); }
      return answer.problems.length === 0;
    } catch (error) {
      kept.textContent = "";
      show([{ text: `Not saved: ${error.message}`, row: null, path: "", column: "" }]);
      return false;
    }
  };
  const check = (content) => { // a moment after the last change
    clearTimeout(waiting);
    asked.abort();
    waiting = setTimeout(async () => {
      const { signal } = asked = new AbortController();
      try {
        const answer = await app.send(form.dataset.address, { heads: heads(), rows: cells(), ...content() }, "POST", { signal });
        if (signal.aborted) return;
        show(answer.problems);
        doubts(answer.doubts);
      } catch (error) {
        if (!signal.aborted) kept.textContent = error.message;
      }
    }, 400);
  };
  const about = (path) => { // the fields that answer a doubt
    const [name, role] = path.split(".");
    if (role) return ["column", "unit", "sensitivity", "gain", "invert", "sample_rate"].flatMap((key) => [...form.querySelectorAll(`[data-role="${role}"] [name=${key}]`)]);
    const at = name === "tyres" ? heads().findIndex((one) => ["tyre", "specimen"].includes(nameOf(one))) : -1;
    return at < 0 ? [...form.querySelectorAll(`[data-path^="${name}."]`)] : [...table.tBodies[0].rows].map((row) => row.cells[at].firstElementChild);
  };
  const settle = () => {
    for (const one of document.querySelectorAll("[name=settled]:not([data-by=hand])")) {
      one.checked = one.dataset.about !== "" && about(one.dataset.about).some((field) => (field.type === "checkbox" ? field.checked !== field.defaultChecked : field.value !== field.defaultValue));
    }
  };
  byId("save").addEventListener("click", () => save(stated()));
  byId("save-text").addEventListener("click", async () => { if (await save({ text: byId("text").value })) location.reload(); });
  byId("save-run").addEventListener("click", async () => {
    if (!await save(stated())) return;
    try {
      await app.send(form.dataset.run, { command: "analyse" });
      location.assign(form.dataset.run);
    } catch (error) { show([{ text: error.message, row: null, path: "", column: "" }]); }
  });
  form.addEventListener("submit", (event) => event.preventDefault());
  document.addEventListener("input", ({ target }) => {
    changed = true;
    kept.textContent = "";
    chain();
    delete target.dataset.doubts;
    if (target.name === "settled") target.dataset.by = "hand"; else settle();
    check(target.id === "text" ? () => ({ text: target.value }) : stated);
  });
  addEventListener("beforeunload", (event) => { if (changed) event.preventDefault(); });

  // ---- the columns of a recording, with their outlines
  const number = (value) => String(Number(value.toPrecision(3))).replace("-", "−");
  const extent = (column, unit) => `${number(column.least)} to ${number(column.greatest)} ${unit}`.trim();
  const outline = (column, unit, width = 150, height = 34) => {
    const ns = "http://www.w3.org/2000/svg", svg = document.createElementNS(ns, "svg"), path = document.createElementNS(ns, "path");
    svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    svg.setAttribute("class", "plot small");
    svg.setAttribute("role", "img");
    svg.setAttribute("aria-label", `${column.name}: ${extent(column, unit)}`);
    const [low, high] = [column.least, column.greatest], span = high - low || 1, count = column.low.length;
    const y = (v) => (2 + (height - 4) * (1 - (v - low) / span)).toFixed(1);
    let line = "";
    column.low.forEach((v, at) => { if (v !== null) { const x = (at / Math.max(count - 1, 1) * width).toFixed(1); line += `${line ? "L" : "M"}${x} ${y(v)}L${x} ${y(column.high[at])}`; } });
    path.setAttribute("d", line);
    path.setAttribute("class", "line");
    svg.append(path);
    return svg;
  };
  let columns = [];
  const outlines = () => {
    for (const row of form.querySelectorAll("[data-role]")) {
      const box = row.querySelector(".outline"), name = value(row, "column"), still = ["load", "deflection"].includes(row.dataset.role);
      const found = (still ? columns.findLast((one) => one.name === name) : columns.find((one) => one.name === name));
      if (!box) continue;
      box.replaceChildren();
      if (found && !found.why) {
        const unit = found.unit || value(row, "unit"), line = found.frequency ? `, ${Number(found.frequency.toPrecision(4))} Hz` : "";
        box.append(outline(found, unit), made("small", extent(found, unit) + line));
      }
    }
  };
  form.addEventListener("change", outlines);
  app.call(form.dataset.columns).then((found) => {
    ({ columns } = found);
    const names = [...new Map(columns.map((one) => [one.name, one])).values()];
    byId("columns").replaceChildren(...names.map((one) => made("option", "", { value: one.name, label: one.unit })));
    byId("columns-note").textContent = `As recorded in ${found.files.join(" and ")}: columns ${names.map((one) => one.name).join(", ")}.`;
    outlines();
  }).catch((error) => { byId("columns-note").textContent = error.message; });

  // ---- the chain of the rig as it is stated
  const chain = () => {
    const svg = byId("chain");
    if (!svg) return;
    const ns = "http://www.w3.org/2000/svg";
    const draw = (name, attributes, text = "") => {
      const one = document.createElementNS(ns, name);
      for (const [key, setting] of Object.entries(attributes)) one.setAttribute(key, setting);
      one.textContent = text;
      return one;
    };
    const said = (name) => { const row = form.querySelector(`[data-rig="${name}"]`); const v = value(row, "value"); return v ? `${v} ${value(row, "unit")}` : "not stated"; };
    const blocked = form.querySelector("[name=blocked]").checked;
    const parts = [
      draw("path", { d: "M20 95H60", class: "rod" }), draw("text", { x: 20, y: 84 }, "F1, V1"),
      draw("rect", { x: 60, y: 70, width: 90, height: 50, class: "box" }), draw("text", { x: 105, y: 99, "text-anchor": "middle" }, "specimen"),
      draw("path", { d: "M150 95H200", class: "rod" }),
    ];
    if (blocked) parts.push(draw("path", { d: "M200 50V140M200 60l10 -10M200 80l10 -10M200 100l10 -10M200 120l10 -10M200 140l10 -10", class: "rod" }), draw("text", { x: 220, y: 99 }, "held"));
    else {
      parts.push(
        draw("text", { x: 162, y: 84 }, "V2"),
        draw("rect", { x: 200, y: 70, width: 70, height: 50, class: "box" }), draw("text", { x: 235, y: 140, "text-anchor": "middle" }, said("moving_mass")),
        draw("path", { d: "M270 82H290l5 -8 8 16 8 -16 8 16 8 -16 8 16 5 -8H390", class: "rod" }), draw("text", { x: 330, y: 62, "text-anchor": "middle" }, said("preload_stiffness")),
        draw("path", { d: "M270 108H318M318 98V118H345M318 98H345M332 101V115M332 108H390", class: "rod" }), draw("text", { x: 330, y: 140, "text-anchor": "middle" }, said("preload_damping")),
        draw("path", { d: "M390 60V130M390 70l10 -10M390 90l10 -10M390 110l10 -10M390 130l10 -10", class: "rod" }),
      );
    }
    svg.replaceChildren(...parts);
  };
  fill();
  show(data.problems);
  chain();
})();
