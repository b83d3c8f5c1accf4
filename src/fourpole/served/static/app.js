"use strict";
// What all pages share: answers of the server, and a line that is read aloud.
const app = (() => {
  const say = (text) => { document.getElementById("said").textContent = text; };
  const ask = async (address, options = {}) => {
    try {
      return await fetch(address, { ...options, headers: { "X-Asked-By": "script", ...options.headers } });
    } catch (error) {
      if (error.name === "AbortError") throw error;
      throw new Error("the server does not answer: start fourpole app again, or look at the network");
    }
  };
  const call = async (address, options = {}) => {
    const answer = await ask(address, options);
    const document = answer.status === 204 ? {} : await answer.json().catch(() => ({}));
    if (!answer.ok || document.error) throw new Error(document.error || `the server answered with ${answer.status}`);
    return document;
  };
  const send = (address, document, method = "POST", options = {}) => call(address, {
    ...options, method, body: JSON.stringify(document), headers: { "Content-Type": "application/json" },
  });
  return { say, ask, call, send };
})();
