"use strict";
// A choice shows its figure at once, and stands in the address.
(() => {
  const form = document.getElementById("choose"), doing = document.getElementById("doing");
  let asked = 0;
  form.querySelector("[type=submit]").hidden = true;
  const adjust = () => {
    for (const name of ["quantity", "over"]) form.elements[name].disabled = form.elements.figure.value !== "";
  };
  const show = async (address, keep) => {
    const number = ++asked, part = document.getElementById("shown");
    part.setAttribute("aria-busy", "true");
    doing.textContent = "Drawing …";
    try {
      const answer = await fetch(address, { headers: { Accept: "text/html" } });
      const page = new DOMParser().parseFromString(await answer.text(), "text/html"), made = page.getElementById("shown");
      if (number !== asked) return;
      if (!made) { location.assign(address); return; }
      const open = part.querySelector("details")?.open;
      part.replaceWith(made);
      if (open && made.querySelector("details")) made.querySelector("details").open = true;
      if (keep) history.pushState(null, "", address);
      doing.textContent = "";
      app.say(made.querySelector("figcaption b, .misfit")?.textContent ?? "");
    } catch {
      if (number === asked) doing.textContent = "The server does not answer.";
      part.removeAttribute("aria-busy");
    }
  };
  form.addEventListener("change", () => {
    adjust();
    const chosen = [...new FormData(form)].filter(([, value]) => value !== "");
    show(`${form.action}?${new URLSearchParams(chosen)}`, true);
  });
  addEventListener("popstate", () => location.reload());
})();
