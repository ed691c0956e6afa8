// Which failures fit, in which order, and how many would remain by each value of each facet.
(function () {
  "use strict";
  const data = window.COOOLER_FAILURE_DATA;
  const SPAN = 2 ** 24; // above the number of failures: a key and a place fit into one number
  const KEPT = 30;
  const orders = new Map();
  const heard = new Map(); // word -> for each text whether it has it: typing looks for the new word only
  let searched = -1;
  let ordered = -1;

  // A number by which each sort goes up; failures that are equal by it keep their places.
  const KEYS = {
    high: (c, at) => 65535 - c.units[at],
    low: (c, at) => c.units[at],
    video: (c, at) => c.video[at],
    system: (c, at) => c.system[at],
    kind: (c, at) => c.kind[at],
  };

  // The places of all failures that are loaded. `version` tells whether more came since.
  function order(sort, version) {
    if (version !== ordered) orders.clear();
    ordered = version;
    if (!orders.has(sort)) {
      const columns = data.columns();
      const keys = new Float64Array(columns.length);
      let count = 0;
      for (let at = 0; at < columns.length; at += 1) {
        if (columns.ready[at]) {
          keys[count] = KEYS[sort](columns, at) * SPAN + at;
          count += 1;
        }
      }
      const sorted = keys.subarray(0, count).sort();
      orders.set(sort, Uint32Array.from(sorted, (key) => key % SPAN));
    }
    return orders.get(sort);
  }

  // A byte for each failure: are all words in its truth, caption, evidence or video id? Without words: null.
  function search(query, version) {
    const words = query.toLowerCase().split(/\s+/).filter(Boolean);
    if (!words.length) return null;
    const columns = data.columns();
    const lower = data.lower();
    const found = new Uint8Array(columns.length).fill(1);
    if (version !== searched || heard.size > KEPT) heard.clear();
    searched = version;
    words.forEach((word) => {
      const has = (text) => (text.includes(word) ? 1 : 0);
      if (!heard.has(word)) heard.set(word, Uint8Array.from(lower, has));
      const inText = heard.get(word);
      const truth = (row) => (row ? has(`${row[3]}\n${row[4]}`.toLowerCase()) : 0);
      const inHazard = Uint8Array.from(data.hazards, truth);
      const inVideo = Uint8Array.from(data.videos, ([, shown]) => has(shown.toLowerCase()));
      const inTruth = new Uint8Array(data.videos.length);
      data.hazards.forEach((row, number) => {
        if (row && inHazard[number]) inTruth[row[0]] = 1;
      });
      for (let at = 0; at < columns.length; at += 1) {
        const hazard = columns.hazard[at];
        found[at] &= inText[columns.said[at]] | inText[columns.evidence[at]] | inVideo[columns.video[at]]
          | (hazard ? inHazard[hazard] : inTruth[columns.video[at]]);
      }
    });
    return found;
  }

  // `facets` are [{column, size, chosen: Set of values}]. Several values of one facet widen, facets narrow:
  // a failure that only one facet keeps out counts for the values of that facet.
  function run(facets, found, places) {
    const columns = facets.map(({ column }) => column);
    const masks = facets.map(({ size, chosen }) => {
      if (!chosen.size) return null;
      const mask = new Uint8Array(size);
      chosen.forEach((value) => {
        mask[value] = 1;
      });
      return mask;
    });
    const counts = facets.map(({ size }) => new Uint32Array(size));
    const result = new Uint32Array(places.length);
    let length = 0;
    for (let n = 0; n < places.length; n += 1) {
      const at = places[n];
      if (found && !found[at]) continue;
      let out = 0;
      let which = 0;
      for (let facet = 0; facet < masks.length && out < 2; facet += 1) {
        if (masks[facet] && !masks[facet][columns[facet][at]]) {
          out += 1;
          which = facet;
        }
      }
      if (out === 1) counts[which][columns[which][at]] += 1;
      if (out) continue;
      result[length] = at;
      length += 1;
      for (let facet = 0; facet < columns.length; facet += 1) counts[facet][columns[facet][at]] += 1;
    }
    return { places: result.subarray(0, length), counts };
  }

  window.COOOLER_FAILURE_FILTER = { SORTS: Object.keys(KEYS), order, search, run };
})();
