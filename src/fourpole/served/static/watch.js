"use strict";
// The judgements of a watch, the last one large.
(() => {
  const byId = (id) => document.getElementById(id);
  const last = byId("last"), before = byId("before"), start = byId("start"), stop = byId("stop");
  const made = (name, text = "", className = "") => {
    const element = document.createElement(name);
    if (text) element.textContent = text;
    if (className) element.className = className;
    return element;
  };
  const link = (one) => { // a file that cannot be read is no test
    const name = made(one.address ? "a" : "b", one.test);
    if (one.address) name.href = one.address;
    return name;
  };
  const badge = (verdict) => made("span", verdict, `v ${verdict}`);
  const large = (one) => {
    const head = made("p", "", "name-large");
    head.append(badge(one.verdict), " ", link(one));
    const list = made("ul");
    list.append(...one.remarks.map((text) => made("li", text)));
    const small = made("p", [one.condition, ...one.results].filter(Boolean).join(" · "), "note");
    const guessed = one.doubts.length ? [made("p", `Guessed: ${one.doubts.join("; ")}`, "note")] : [];
    last.className = `verdict-large ${one.verdict}`;
    last.replaceChildren(head, ...(one.remarks.length ? [list] : []), small, ...guessed);
  };
  let shown = "";
  const show = (watch) => {
    const running = watch.phase === "waiting" || watch.phase === "running";
    start.hidden = running;
    stop.hidden = !running;
    byId("phase").textContent = running ? (watch.ready ? "watching" : "getting ready …") : watch.phase;
    byId("messages").replaceChildren(...watch.messages.map((text) => made("li", text)));
    const mark = JSON.stringify(watch.judged);
    if (mark === shown || !watch.judged.length) return;
    shown = mark;
    large(watch.judged[0]);
    byId("former").hidden = watch.judged.length < 2;
    before.replaceChildren(...watch.judged.slice(1).map((one) => {
      const item = made("li");
      item.append(badge(one.verdict), " ", link(one), " ", made("span", one.remarks[0] || one.condition, "about"));
      return item;
    }));
  };
  let events = null;
  const follow = () => {
    events?.close();
    events = new EventSource(`${last.dataset.address}/events`);
    events.addEventListener("error", () => { byId("phase").textContent = "the server does not answer; trying again …"; });
    events.addEventListener("message", (event) => {
      const watch = JSON.parse(event.data);
      show(watch);
      if (watch.phase !== "waiting" && watch.phase !== "running") events.close();
    });
  };
  const tell = (error) => { byId("phase").textContent = error.message; };
  start.addEventListener("click", () => app.call(last.dataset.address, { method: "POST" }).then(follow).catch(tell));
  stop.addEventListener("click", () => app.call(last.dataset.address, { method: "DELETE" }).catch(tell));
  const watch = JSON.parse(byId("watch-data").textContent);
  show(watch);
  if (watch.phase === "waiting" || watch.phase === "running") follow();
})();
