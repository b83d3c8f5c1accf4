// What a search ranks first: titles, then words of the pages; Python names stand behind the pages that explain them.
var Scorer = {
  score: ([docname, , , , score]) => (docname.startsWith("api/made/") ? score - 12 : score),
  objNameMatch: 11,
  objPartialMatch: 1,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
