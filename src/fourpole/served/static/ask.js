"use strict";
// A question is sent, and its command followed as it goes on; its answer is a part of the page Ask, and shown here.
(() => {
  const byId = (id) => document.getElementById(id), forms = document.querySelectorAll("form.ask"), fault = byId("fault");
  const address = forms[0]?.getAttribute("action");
  const refuse = (error) => {
    fault.textContent = error.message;
    fault.hidden = false;
  };
  const show = async (query) => {
    const page = new DOMParser().parseFromString(await (await app.ask(`${address}?${query}`, { headers: { Accept: "text/html" } })).text(), "text/html");
    const part = page.getElementById("answer");
    byId("answer").replaceWith(part);
    part.scrollIntoView({ block: "nearest" });
    if (part.dataset.running) follow(query);
    else {
      app.say(part.textContent.trim().slice(0, 300));
      part.querySelector("a[download]")?.focus();
    }
  };
  const follow = (query) => {
    const bar = byId("bar"), howFar = byId("how-far"), events = new EventSource(`${address}/events`);
    events.addEventListener("error", () => { howFar.textContent = "the server does not answer; trying again …"; });
    events.addEventListener("message", (event) => {
      const { phase, task } = JSON.parse(event.data);
      if (phase !== "waiting" && phase !== "running") {
        events.close();
        show(query).catch(refuse);
      } else if (task.total) {
        bar.max = task.total;
        bar.value = task.done;
        howFar.textContent = `${task.task}: ${task.done} of ${task.total}`;
      }
    });
    byId("stop").addEventListener("click", () => app.call(address, { method: "DELETE" }).catch(refuse));
  };
  for (const form of forms) {
    form.addEventListener("submit", async (event) => {
      event.preventDefault();
      const stated = Object.fromEntries([...new FormData(form)].filter(([, value]) => value)), query = new URLSearchParams(stated);
      fault.hidden = true;
      try {
        await app.send(address, stated);
        if (location.pathname === address) history.replaceState(null, "", `${address}?${query}`);
        await show(query);
      } catch (error) { refuse(error); }
    });
  }
  const part = byId("answer");
  if (part?.dataset.running) follow(part.dataset.query);
})();
