"use strict";
// What all pages share: answers of the server, and a line that is read aloud.
const app = (() => {
  const say = (text) => { document.getElementById("said").textContent = text; };
  const call = async (address, options = {}) => {
    const answer = await fetch(address, options);
    const document = answer.status === 204 ? {} : await answer.json().catch(() => ({}));
    if (!answer.ok) throw new Error(document.error || `the server answered with ${answer.status}`);
    return document;
  };
  const send = (address, document, method = "POST") => call(address, {
    method, body: JSON.stringify(document), headers: { "Content-Type": "application/json" },
  });
  return { say, call, send };
})();
