// Blind votes: which comparison comes when, and what is kept of the votes. vote.js shows it.
(function () {
  "use strict";
  const data = window.COOOLER_VOTES;
  if (!data) return;

  const pairs = data.systems.flatMap((_, a) => data.systems.slice(a + 1).map((__, b) => [a, a + 1 + b]));
  const videos = data.videos.length;
  const total = pairs.length * videos;
  const divisor = (a, b) => (b ? divisor(b, a % b) : a);
  const lap = total / divisor(pairs.length, videos); // after so many, the same would meet again

  const KEY = `coooler-votes:${data.benchmark}:${data.truth}`;
  const shown = (system) => `${data.systems[system][0]} ${data.systems[system][2]}`;
  const BOARD = [videos, ...data.systems.map((_, system) => shown(system))].join(",");

  let state = null;
  const done = new Set(); // the keys of all acts
  const ofVideo = new Map(); // video id -> its acts
  let pairOrder = [];
  let videoOrder = [];
  let run = 0;

  // A counter through MurmurHash3's finaliser: one seed gives one order, in every browser.
  function mixed(value) {
    let x = value >>> 0;
    x = Math.imul(x ^ (x >>> 16), 0x85ebca6b);
    x = Math.imul(x ^ (x >>> 13), 0xc2b2ae35);
    return (x ^ (x >>> 16)) >>> 0;
  }
  const drawn = (stream, count) => mixed(mixed(state.seed + Math.imul(stream, 0x9e3779b1)) + count);

  function shuffled(count, stream) {
    const order = Array.from({ length: count }, (_, place) => place);
    for (let place = count - 1; place > 0; place -= 1) {
      const other = drawn(stream, place) % (place + 1);
      [order[place], order[other]] = [order[other], order[place]];
    }
    return order;
  }

  // Every pair of systems comes once before any comes again, every video too, and in the end all with all.
  // In two turns of a pair each of its systems is left once; chance says in which.
  function task(n) {
    const number = pairOrder[n % pairs.length];
    const turn = Math.floor(n / pairs.length);
    const video = videoOrder[(n + Math.floor(n / lap)) % videos];
    const flip = ((drawn(3 + number, turn >> 1) ^ turn) & 1) === 1;
    const [left, right] = flip ? [...pairs[number]].reverse() : pairs[number];
    return { n, video, left, right };
  }

  const keyOf = (video, one, other) => [video, ...[one, other].sort()].join("\n");
  const keyOfAct = (act) =>
    keyOf(act.video, `${act.left} ${act.left_sha256}`, `${act.right} ${act.right_sha256}`);
  const keyOfTask = (one) => keyOf(data.videos[one.video], shown(one.left), shown(one.right));

  function note(act) {
    done.add(keyOfAct(act));
    ofVideo.set(act.video, [...(ofVideo.get(act.video) || []), act]);
  }

  function index() {
    done.clear();
    ofVideo.clear();
    state.acts.forEach(note);
  }

  // Whether the two say the same, or what they say was compared before, maybe as the words of others.
  function isIdle(one, entry) {
    const sides = (left, right) => [entry.side_of[left], entry.side_of[right]].sort().join();
    const place = (slug, hash) => data.systems.findIndex((one) => one[0] === slug && one[2] === hash);
    const before = (ofVideo.get(data.videos[one.video]) || []).map((act) =>
      sides(place(act.left, act.left_sha256), place(act.right, act.right_sha256)),
    );
    const same = entry.side_of[one.left] === entry.side_of[one.right];
    return same || before.includes(sides(one.left, one.right));
  }

  // What is kept: the seed, the voter's wishes, and every act, a skip too.
  function fresh() {
    const seed = window.crypto.getRandomValues(new Uint32Array(1))[0];
    return { seed, voter: "", revision: 0, reveal: false, play: false, next: 0, board: BOARD, acts: [] };
  }

  function usable(kept) {
    if (kept === null || typeof kept !== "object") return false;
    const whole = (value) => Number.isInteger(value) && value >= 0;
    const texts = ["video", "left", "right", "choice", "left_sha256", "right_sha256"];
    const isAct = (act) =>
      act && Number.isInteger(act.n) && texts.every((name) => typeof act[name] === "string");
    return (
      Object.entries(fresh()).every(([name, value]) => typeof kept[name] === typeof value) &&
      [kept.seed, kept.revision, kept.next].every(whole) &&
      kept.seed < 2 ** 32 &&
      Array.isArray(kept.acts) &&
      kept.acts.every(isAct)
    );
  }

  function begin(with_) {
    state = with_;
    if (state.board !== BOARD) {
      // Other systems or captions: the order is another, and places in the old one mean nothing.
      state.board = BOARD;
      state.next = 0;
      state.acts.forEach((act) => {
        act.n = -1;
      });
    }
    index();
    pairOrder = shuffled(pairs.length, 1);
    videoOrder = shuffled(videos, 2);
  }

  function recall() {
    let kept = null;
    try {
      kept = JSON.parse(localStorage.getItem(KEY));
    } catch (error) {
      // Forbidden or spoilt: a new start.
    }
    begin(usable(kept) ? kept : fresh());
  }

  // Whether the browser keeps the votes.
  function keep() {
    try {
      localStorage.setItem(KEY, JSON.stringify(state));
      return true;
    } catch (error) {
      return false;
    }
  }

  // Shards: scripts that hand their videos over, so that double-clicked pages can load them too.
  const shards = new Map();
  window.COOOLER_VOTE_SHARD = (number, entries) => shards.set(number, entries);

  function loaded(number) {
    return new Promise((resolve, reject) => {
      if (shards.has(number)) {
        resolve();
        return;
      }
      const script = document.createElement("script");
      script.src = `data/votes/${number}.js`;
      script.onload = () => (shards.has(number) ? resolve() : reject(new Error(script.src)));
      script.onerror = () => reject(new Error(script.src));
      document.head.appendChild(script);
    });
  }

  async function entryOf(video) {
    let number = data.first.length - 1;
    while (data.first[number] > video) number -= 1;
    await loaded(number);
    return shards.get(number)[video - data.first[number]];
  }

  // The next comparison with its video, null after the last; undefined when another call came in between.
  async function next() {
    run += 1;
    const mine = run;
    for (let n = state.next; n < total; n += 1) {
      const one = task(n);
      if (done.has(keyOfTask(one))) continue;
      const entry = await entryOf(one.video);
      if (mine !== run) return undefined;
      if (isIdle(one, entry)) continue;
      state.next = n;
      return { ...one, entry };
    }
    state.next = total;
    return null;
  }

  function add(one, choice) {
    const [left, , leftHash] = data.systems[one.left];
    const [right, , rightHash] = data.systems[one.right];
    const video = data.videos[one.video];
    const act = { n: one.n, video, left, right, choice, left_sha256: leftHash, right_sha256: rightHash };
    state.acts.push(act);
    note(act);
    state.revision += 1;
    state.next = one.n + 1;
  }

  // Take the last act back, so that it comes again; gives it, or nothing when there is none.
  function undo() {
    const act = state.acts.pop();
    if (!act) return undefined;
    index();
    state.revision += 1;
    state.next = Math.max(0, act.n);
    return act;
  }

  const votes = () => state.acts.filter((act) => act.choice !== "skip");

  // What an export holds.
  function file() {
    return {
      format: "coooler-votes",
      version: 1,
      benchmark: data.benchmark,
      truth_sha256: data.truth,
      voter: state.voter.replace(/\p{Cs}/gu, ""),
      seed: state.seed,
      revision: state.revision,
      votes: votes().map((act) => ({
        video_id: act.video,
        left: act.left,
        right: act.right,
        choice: act.choice,
        left_predictions_sha256: act.left_sha256,
        right_predictions_sha256: act.right_sha256,
      })),
    };
  }

  window.COOOLER_BALLOT = {
    add,
    file,
    keep,
    next,
    recall,
    undo,
    votes,
    key: KEY,
    pairs: pairs.length,
    state: () => state,
    restart: () => begin({ ...fresh(), voter: state.voter, reveal: state.reveal, play: state.play }),
  };
})();
