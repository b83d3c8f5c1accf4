"use strict";
// Files that are dropped or chosen are sent one after the other, and become a campaign.
(() => {
  const byId = (id) => document.getElementById(id);
  const form = byId("drop"), sending = byId("sending"), bar = byId("sent"), howFar = byId("how-far"), refused = byId("refused");
  let stopped = null;

  const refuse = (text) => { refused.textContent = text; refused.hidden = false; sending.hidden = true; };
  const send = async (named) => {
    const files = named.filter(([name]) => !name.split("/").some((part) => part.startsWith(".")));
    refused.hidden = true;
    if (!files.length) { refuse("There is no file to take."); return; }
    const size = files.reduce((sum, [, file]) => sum + file.size, 0);
    const first = files[0][0].split("/"), common = first.length > 1 && files.every(([name]) => name.split("/")[0] === first[0]);
    const name = byId("name").value.trim() || (common ? first[0] : "recordings");
    const inside = common ? files.map(([path, file]) => [path.split("/").slice(1).join("/"), file]) : files;
    let ticket = null, left = {}, done = 0;
    stopped = new AbortController();
    sending.hidden = false;
    bar.value = 0;
    try {
      ({ ticket, refused: left } = await app.send("/upload", { name, files: inside.map(([path, file]) => ({ name: path, size: file.size })) }));
      for (const [number, [path, file]] of inside.entries()) {
        if (number in left) continue;
        howFar.textContent = `${number + 1} of ${inside.length}: ${path}`;
        await app.call(`/upload/${ticket}/${number}`, { method: "PUT", body: file, signal: stopped.signal });
        done += file.size;
        bar.value = size ? done / size : (number + 1) / inside.length;
      }
      const { next } = await app.call(`/upload/${ticket}`, { method: "POST" });
      const texts = Object.values(left);
      if (!texts.length) { location.assign(next); return; }
      refuse(`Not taken: ${texts.join("; ")}. `);
      const link = document.createElement("a");
      link.href = next;
      link.textContent = "Go on with the other files";
      refused.append(link);
    } catch (error) {
      if (ticket) await app.call(`/upload/${ticket}`, { method: "DELETE" }).catch(() => {});
      refuse(error.name === "AbortError" ? "Stopped; nothing was kept." : `Not taken: ${error.message}`);
    }
  };

  // A dropped folder is read by the browser entry by entry.
  const read = async (entry, path = "") => {
    if (entry.isFile) return [[path + entry.name, await new Promise((good, bad) => entry.file(good, bad))]];
    const reader = entry.createReader(), found = [];
    for (;;) {
      const some = await new Promise((good, bad) => reader.readEntries(good, bad));
      if (!some.length) break;
      for (const one of some) found.push(...await read(one, `${path}${entry.name}/`));
    }
    return found;
  };
  form.addEventListener("submit", (event) => event.preventDefault());
  addEventListener("dragover", (event) => { event.preventDefault(); form.classList.add("over"); });
  addEventListener("dragleave", () => form.classList.remove("over"));
  addEventListener("drop", async (event) => {
    event.preventDefault();
    form.classList.remove("over");
    const entries = [...event.dataTransfer.items].map((item) => item.webkitGetAsEntry()).filter(Boolean);
    send((await Promise.all(entries.map((entry) => read(entry)))).flat());
  });
  for (const id of ["files", "folder"]) {
    byId(id).addEventListener("change", (event) => {
      send([...event.target.files].map((file) => [file.webkitRelativePath || file.name, file]));
      event.target.value = "";
    });
  }
  byId("demo").addEventListener("click", async () => {
    try {
      location.assign((await app.send("/demo", {})).next);
    } catch (error) { refuse(error.message); }
  });
  byId("cancel").addEventListener("click", () => stopped?.abort());
})();
