"use strict";
// The job of a campaign as it goes on.
(() => {
  const byId = (id) => document.getElementById(id);
  const part = byId("job"), bar = byId("bar"), howFar = byId("how-far"), rows = byId("tests").querySelector("tbody");
  const start = byId("start"), stop = byId("stop"), following = byId("following");
  const said = { waiting: "waiting for its turn", running: "at work", done: "done", stopped: "stopped; what is done is kept", failed: "ended with an error" };

  const duration = (seconds) => (seconds < 100 ? `${Math.round(seconds)} s` : `${Math.round(seconds / 60)} min`);
  const row = ({ test, address, verdict, remarks }) => {
    const made = document.createElement("tr"), name = document.createElement("th"), link = document.createElement("a");
    name.scope = "row";
    link.href = address;
    link.textContent = test;
    name.append(link);
    const badge = document.createElement("span");
    badge.className = `v ${verdict}`;
    badge.textContent = verdict;
    const cells = [document.createElement("td"), document.createElement("td")];
    cells[0].append(badge);
    cells[1].className = "free";
    cells[1].textContent = remarks.join(" ");
    made.append(name, ...cells);
    return made;
  };
  let events = null;
  const show = (job) => {
    part.hidden = false;
    const { task, phase } = job, running = phase === "waiting" || phase === "running";
    if (running && task.total) { bar.max = task.total; bar.value = task.done; } else if (running) bar.removeAttribute("value");
    else { bar.max = 1; bar.value = phase === "done" ? 1 : 0; }
    const left = running && task.left ? `, about ${duration(task.left)} left` : "";
    howFar.textContent = running && task.task ? `${task.task}: ${task.done} of ${task.total}${left}`
      : phase === "waiting" && job.before ? `waiting: ${job.before} before this` : said[phase];
    rows.prepend(...job.tests.map(row).reverse());
    byId("tests").hidden = !rows.children.length;
    byId("messages").replaceChildren(...job.messages.map((text) => { const one = document.createElement("li"); one.textContent = text; return one; }));
    start.hidden = running;
    stop.hidden = !running;
    following.hidden = !job.next;
    if (job.next) {
      byId("next").href = job.next;
      byId("next").textContent = job.called;
      if (events && job.command === start.dataset.command) { // it ended here: what the page said before is over
        byId("about").hidden = true;
        if (job.command === "init") start.hidden = true; else start.textContent = "Analyse again";
      }
    }
    if (!running) app.say(said[phase]);
  };
  const follow = () => {
    events?.close();
    rows.replaceChildren();
    events = new EventSource(`${part.dataset.address}/events`);
    events.addEventListener("error", () => { howFar.textContent = "the server does not answer; trying again …"; });
    events.addEventListener("message", (event) => {
      const job = JSON.parse(event.data);
      show(job);
      if (job.phase !== "waiting" && job.phase !== "running") events.close();
    });
  };
  const tell = (error) => { part.hidden = false; howFar.textContent = error.message; };
  start.addEventListener("click", async () => {
    following.hidden = true;
    try {
      await app.send(part.dataset.address, { command: start.dataset.command });
      follow();
    } catch (error) { tell(error); }
  });
  stop.addEventListener("click", () => app.call(part.dataset.address, { method: "DELETE" }).catch(tell));
  const job = JSON.parse(byId("job-data").textContent);
  if (job && (job.phase === "waiting" || job.phase === "running")) follow();
  else if (job) show(job);
})();
