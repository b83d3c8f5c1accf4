"use strict";
// What to expect is computed after the page is there.
(async () => {
  const part = document.getElementById("expected");
  try {
    const answer = await fetch(`${part.dataset.address}${location.search}`, { headers: { Accept: "text/html" } });
    const page = new DOMParser().parseFromString(await answer.text(), "text/html");
    part.replaceChildren(...page.body.children);
    if (part.querySelector("[role=alert]")) document.querySelector("#asked details").open = true;
  } catch {
    part.textContent = "The server does not answer.";
  }
  part.removeAttribute("aria-busy");
})();
