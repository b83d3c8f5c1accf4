"use strict";
(() => {
  const byId = (id) => document.getElementById(id);
  const cards = new Map([...document.querySelectorAll(".cards details")].map((card) => [card.id, card]));

  addEventListener("filtered", ({ detail }) => { for (const [id, card] of cards) card.hidden = !detail.has(id); });
  byId("card-note").textContent = cards.size
    ? "Open a card for its signals, loop and numbers. The filter above applies here too; open cards are printed." : "There are none.";

  const folded = [...document.querySelectorAll(".part, .files, .model details")]; // all of it is printed
  let shut = [];
  addEventListener("beforeprint", () => { shut = folded.filter((part) => !part.open); shut.forEach((part) => { part.open = true; }); });
  addEventListener("afterprint", () => shut.forEach((part) => { part.open = false; }));

  // ---- cards: made when they are first opened
  let data = null;
  const build = (card) => {
    if (card.dataset.made) return;
    card.dataset.made = "yes";
    data ??= JSON.parse(byId("card-data").textContent);
    card.append(draw.card(data[card.id], card.clientWidth));
  };
  for (const card of cards.values()) card.addEventListener("toggle", () => { if (card.open) build(card); });
  const follow = () => {
    const name = decodeURIComponent(location.hash.slice(1)), place = name && byId(name), card = cards.get(name);
    const part = place && (place.closest(".part") ?? place.querySelector(":scope > .part"));
    if (part) part.open = true;
    if (!card) { if (part) place.scrollIntoView({ block: "start" }); return; }
    if (card.hidden) byId("filter").reset();
    card.hidden = false;
    card.open = true;
    build(card);
    card.scrollIntoView({ block: "start" });
    card.firstElementChild.focus({ preventScroll: true });
  };
  document.addEventListener("click", (event) => { // also when the address has that card already
    const link = event.target.closest('a[href^="#"]');
    if (link && link.hash === location.hash) follow();
  });
  addEventListener("hashchange", follow);
  follow();
})();
