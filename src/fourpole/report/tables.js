"use strict";
// Tables of results: a click on a head sorts, the first time rising, then falling; blanks stay last. A form filters the
// rows, and the event "filtered" has the keys of those that are left.
(() => {
  const collator = new Intl.Collator(undefined, { numeric: true });
  const key = (cell, numeric) => {
    if (!numeric) return cell.textContent.trim() || null;
    return cell.dataset.v === undefined ? null : Number(cell.dataset.v);
  };
  const sort = (table, head) => {
    const numeric = head.dataset.n !== undefined;
    const falling = head.getAttribute("aria-sort") === "ascending";
    for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
    head.setAttribute("aria-sort", falling ? "descending" : "ascending");
    const body = table.tBodies[0];
    const keyed = [...body.rows].map((row) => [key(row.cells[head.cellIndex], numeric), row]);
    keyed.sort(([a], [b]) => {
      if (a === null || b === null) return (a === null) - (b === null);
      const order = numeric ? a - b : collator.compare(a, b);
      return falling ? -order : order;
    });
    body.append(...keyed.map(([, row]) => row));
  };
  for (const table of document.querySelectorAll(".results")) {
    for (const head of table.tHead.rows[0].cells) {
      const button = document.createElement("button");
      button.type = "button";
      button.append(head.firstElementChild);
      head.prepend(button);
      button.addEventListener("click", () => sort(table, head));
    }
    table.addEventListener("pointerover", (event) => { // all digits of a number, where one asks for them
      const cell = event.target.closest("td.n");
      if (cell && !cell.title) cell.title = `${cell.dataset.v} ${table.tHead.rows[0].cells[cell.cellIndex].dataset.n}`;
    });
  }

  const byId = (id) => document.getElementById(id);
  const rows = [...document.querySelectorAll(".results tbody tr")], tests = new Set(rows.map((row) => row.dataset.card));
  const find = byId("find"), tyre = byId("tyre"), verdict = byId("verdict"), form = byId("filter");
  let haystacks = null;
  const filter = () => {
    haystacks ??= rows.map((row) => [row.textContent, ...[...row.querySelectorAll("[title]")].map((cell) => cell.title)]
      .join(" ").toLowerCase());
    const words = find.value.toLowerCase().split(/\s+/).filter(Boolean);
    const shown = new Set();
    rows.forEach((row, at) => {
      const fits = (!tyre.value || row.dataset.tyre === tyre.value)
        && (!verdict.value || row.dataset.verdict === verdict.value)
        && words.every((word) => haystacks[at].includes(word));
      row.hidden = !fits;
      if (fits) shown.add(row.dataset.card);
    });
    byId("shown").textContent = `${shown.size} of ${tests.size} tests`;
    dispatchEvent(new CustomEvent("filtered", { detail: shown }));
  };
  form.addEventListener("submit", (event) => event.preventDefault());
  form.addEventListener("input", filter);
  form.addEventListener("reset", () => setTimeout(filter));
  form.hidden = rows.length === 0;
  if (rows.length) filter();
})();
