// The compare page's data: shards that are loaded once, by script tags, so that file:// works too.
(function () {
  "use strict";
  const waiting = new Map();
  const asked = new Map();
  let index = null;

  // Every data file calls this with its name and its value.
  window.COOOLER_DATA = (name, value) => {
    if (name === "compare") index = value;
    const give = waiting.get(name);
    if (give) give(value);
  };

  function load(name) {
    const full = `compare/${name}`;
    if (!asked.has(full)) {
      const promise = new Promise((resolve, reject) => {
        const script = document.createElement("script");
        waiting.set(full, resolve);
        script.onload = script.onerror = () => reject(new Error(full)); // no effect when the value came
        script.src = `data/${full}.js`;
        document.head.append(script);
      });
      asked.set(full, promise);
      promise.catch(() => asked.delete(full)); // so that it is asked for again
    }
    return asked.get(full);
  }

  const blocks = () => Math.ceil(index.videos / index.block);

  // All scores of a system: best, besm, sam and detection of every video, in parts of index.scale.
  async function scores(slug) {
    const shards = Array.from({ length: blocks() }, (_, number) => load(`scores/${slug}/${number}`));
    const found = await Promise.all(shards);
    const column = (name) => Int32Array.from(found.flatMap((shard) => shard[name]));
    const bits = found.flatMap((shard) => Array.from(shard.detection, Number));
    const detection = bits.map((bit) => bit * index.scale);
    return { best: column("best"), besm: column("besm"), sam: column("sam"), detection };
  }

  // The last of the ascending `starts` that is not beyond `place`.
  function part(starts, place) {
    let low = 0;
    let high = starts.length - 1;
    while (low < high) {
      const middle = Math.ceil((low + high) / 2);
      if (starts[middle] <= place) low = middle;
      else high = middle - 1;
    }
    return low;
  }

  // What a system says of a video: [the closest caption, how many there are]; 0 for nothing.
  async function caption(slug, place) {
    const number = Math.floor(place / index.block);
    const { cuts } = await load(`scores/${slug}/${number}`);
    const cut = part(cuts, place);
    const shard = await load(`captions/${slug}/${number}-${cut}`);
    return shard[place - cuts[cut]];
  }

  async function video(place) {
    const number = part(index.first, place);
    const shard = await load(`videos/${number}`);
    const [name, shown, labels, card, id] = shard[place - index.first[number]];
    return { href: `videos/${name}.html`, shown, labels, card, id: id === undefined ? shown : id };
  }

  // Which videos a system detects: a byte a video, 0 or 1.
  async function found(slug) {
    const digits = await load(`found/${slug}`);
    return Uint8Array.from({ length: index.videos }, (_, place) =>
      (parseInt(digits[place >> 2], 16) >> (3 - (place & 3))) & 1);
  }

  // The tests of system number a against number b as Python's compare gives them; null when untested.
  async function tests(a, b) {
    if (Math.max(a, b) >= index.tested) return null;
    const rows = (await load(`tests/${index.systems[a][0]}`))[b];
    const result = {};
    index.metrics.forEach((key, metric) => {
      if (!rows[key]) return; // without a hazard there is no recall
      const [low, high, bootstrap, randomisation, wins, losses] = rows[key];
      const [ofA, ofB] = [index.systems[a][2][metric], index.systems[b][2][metric]];
      result[key] = {
        a: ofA,
        b: ofB,
        difference: ofA - ofB,
        interval: { low, high },
        p_bootstrap: bootstrap / (index.resamples + 1),
        p_randomisation: randomisation / (index.resamples + 1),
        wins,
        losses,
        ties: index.videos - wins - losses,
      };
    });
    return result;
  }

  window.COOOLER_COMPARE = { index: () => index, scores, caption, video, found, tests };
})();
