"use strict";
// The question is sent, and its command followed as it goes on; the answer is part of the page.
(() => {
  const byId = (id) => document.getElementById(id), form = byId("ask"), part = byId("answer");
  form?.addEventListener("submit", async (event) => {
    event.preventDefault();
    const stated = Object.fromEntries([...new FormData(form)].filter(([, value]) => value));
    try {
      await app.send(form.getAttribute("action"), stated);
      location.assign(`${form.getAttribute("action")}?${new URLSearchParams(stated)}`);
    } catch (error) {
      byId("fault").textContent = error.message;
      byId("fault").hidden = false;
    }
  });
  if (!part?.dataset.running) return;
  const bar = byId("bar"), howFar = byId("how-far");
  const events = new EventSource(`${form.getAttribute("action")}/events`);
  events.addEventListener("error", () => { howFar.textContent = "the server does not answer; trying again …"; });
  events.addEventListener("message", (event) => {
    const { phase, task } = JSON.parse(event.data);
    if (phase !== "waiting" && phase !== "running") {
      events.close();
      location.reload();
    } else if (task.total) {
      bar.max = task.total;
      bar.value = task.done;
      howFar.textContent = `${task.task}: ${task.done} of ${task.total}`;
    }
  });
  byId("stop").addEventListener("click", () => app.call(form.getAttribute("action"), { method: "DELETE" }));
})();
