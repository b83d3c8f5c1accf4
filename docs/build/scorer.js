// What a search ranks first: headings that have the words looked for, titles, words of the pages; Python names come last.
var asked = (new URLSearchParams(window.location.search).get("q") || "").toLowerCase();
var wanted = asked
  .split(/[\s,.;:?!()]+/)
  .map((word) => word.replace(/(?<=..)e?s$/, "")) // masses, mass
  .filter((word) => word);

// Share of the words looked for that a heading has, by their letters: long words say more [1].
function held(heading) {
  const text = heading.toLowerCase();
  return wanted.filter((word) => text.includes(word)).join("").length / Math.max(wanted.join("").length, 1);
}

// How far Python names, unless one is asked for, and the changelog stand behind the pages that explain them.
function behind(docname) {
  if (docname.startsWith("api/made/")) return /\w[_.]\w/.test(asked) ? 0 : 32;
  return docname === "changelog" ? 3 : 0;
}

var Scorer = {
  score: ([docname, heading, , , score]) => score + Math.round(20 * held(heading)) - behind(docname),
  objNameMatch: 11,
  objPartialMatch: 1,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
