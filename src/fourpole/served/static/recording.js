"use strict";
// The whole recording: the server reduces any part of it so that peaks stay; and the card of the report.
(() => {
  const byId = (id) => document.getElementById(id);
  const box = byId("signals"), height = 170;
  let part = null, whole = null, asked = 0;

  const picture = (channel, shown, width) => {
    const ends = channel.high ? [channel.low, channel.high] : [channel.low];
    const values = ends.map((list) => list.map((value) => value ?? NaN));
    const across = draw.axis(shown.timed ? "time" : "sample", shown.timed ? "s" : "", [[shown.from, shown.to]], { pad: 0, prefixed: false });
    const up = draw.axis(channel.name, channel.unit, values, { prefixed: false });
    const series = values.length === 1
      ? [{ kind: "line", xs: channel.t, ys: values[0] }]
      : [{ kind: "line", xs: channel.t.flatMap((t) => [t, t]), ys: channel.t.flatMap((_, i) => [values[0][i], values[1][i]]) }];
    return draw.plot("", across, up, series, { width, height });
  };
  const show = (shown, width) => {
    part = [shown.from, shown.to];
    const ends = `${Number(shown.from.toPrecision(6))} to ${Number(shown.to.toPrecision(6))}${shown.timed ? " s" : ", counted in samples"}`;
    whole = shown.whole;
    box.replaceChildren(...shown.channels.map((channel) => {
      const figure = document.createElement("figure");
      const svg = picture(channel, shown, width);
      svg.setAttribute("aria-label", `${channel.name}, ${ends}`);
      figure.append(svg);
      return figure;
    }));
    byId("part").textContent = ends;
  };
  const ask = async (from, to) => {
    const number = ++asked, width = Math.max(320, Math.round(box.clientWidth));
    box.setAttribute("aria-busy", "true");
    try {
      const query = new URLSearchParams({ width });
      if (from !== undefined) { query.set("from", from); query.set("to", to); }
      let shown = await app.call(`${box.dataset.address}?${query}`);
      while (shown.read !== undefined && number === asked) { // a long recording is read in the background
        const text = document.createElement("p"), bar = document.createElement("progress");
        text.textContent = `Reading: ${Math.round(100 * shown.read)} % `;
        bar.value = shown.read;
        bar.setAttribute("aria-label", "Read");
        text.append(bar);
        box.replaceChildren(text);
        shown = await app.call(`${box.dataset.address}?${query}`);
      }
      if (number === asked) show(shown, width);
    } catch (error) {
      const text = document.createElement("p");
      text.className = "misfit";
      text.textContent = error.message;
      byId("zoom").hidden = part === null;
      box.replaceChildren(text);
    }
    box.setAttribute("aria-busy", "false");
  };
  const move = (low, high) => {
    const span = Math.min(high - low, whole[1] - whole[0]), start = Math.min(Math.max(low, whole[0]), whole[1] - span);
    ask(start, start + span);
  };
  const zooms = {
    in: ([low, high]) => [low + (high - low) / 4, high - (high - low) / 4],
    out: ([low, high]) => [low - (high - low) / 2, high + (high - low) / 2],
    left: ([low, high]) => [low - (high - low) / 2, high - (high - low) / 2],
    right: ([low, high]) => [low + (high - low) / 2, high + (high - low) / 2],
    all: () => whole,
  };
  for (const button of document.querySelectorAll("[data-zoom]")) {
    button.addEventListener("click", () => { if (part) move(...zooms[button.dataset.zoom](part)); });
  }

  // Dragging across a picture chooses a part.
  let from = null;
  const timeAt = (event) => {
    const svg = event.target.closest("svg"), place = svg.getBoundingClientRect(), scale = place.width / svg.viewBox.baseVal.width;
    const left = place.left + 46 * scale, right = place.right - 8 * scale; // as draw.plot leaves free
    const share = Math.min(Math.max((event.clientX - left) / (right - left), 0), 1);
    return part[0] + share * (part[1] - part[0]);
  };
  box.addEventListener("pointerdown", (event) => { if (part && event.target.closest("svg")) from = timeAt(event); });
  box.addEventListener("pointerup", (event) => {
    if (from === null || !event.target.closest("svg")) { from = null; return; }
    const ends = [from, timeAt(event)].sort((a, b) => a - b);
    from = null;
    if (ends[1] - ends[0] > (part[1] - part[0]) / 200) move(...ends);
  });

  const residual = byId("residual");
  if (residual) {
    app.call(residual.dataset.address).then((found) => {
      const room = residual.clientWidth + 16, beside = Math.max(1, Math.min(found.channels.length, Math.floor(room / 368)));
      const width = room / beside - 16;
      residual.replaceChildren(...found.channels.map((one) => {
        const across = draw.axis("frequency", "Hz", [one.frequency], { prefixed: false, pad: 0, prefixed: false });
        const up = draw.axis(one.name, one.unit, [one.amplitude], { from: [0, Math.max(...one.amplitude)] });
        return draw.plot(`${one.name} beside ${found.fundamental.toPrecision(4)} Hz`, across, up,
          [{ kind: "line", xs: one.frequency, ys: one.amplitude }], { width, height: 180 });
      }));
    }).catch((error) => { residual.textContent = error.message; });
  }

  const form = byId("exclude");
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    try {
      await app.send(form.dataset.address, { reason: form.elements.reason.value.trim() }, "PUT");
      location.reload();
    } catch (error) {
      byId("refused").textContent = `Not saved: ${error.message}`;
      byId("refused").hidden = false;
    }
  });

  addEventListener("keydown", (event) => {
    if (event.target.closest("input, select, textarea, [role=group]") || event.ctrlKey || event.altKey || event.metaKey) return;
    const link = { ArrowLeft: byId("before"), ArrowRight: byId("after") }[event.key];
    if (link) link.click();
  });
  const data = byId("card-data");
  if (data) {
    const place = byId("card");
    place.append(draw.card(JSON.parse(data.textContent), place.clientWidth));
  }
  ask();
})();
