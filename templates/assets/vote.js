// Blind votes: a clip and the captions of two systems, which are named only when the voter asks.
(function () {
  "use strict";
  const { _, plural, whole } = window.COOOLER_I18N;
  const TEXT = {
    number: (n) => _("Comparison {n}", { n }),
    count: (votes, choices) =>
      plural(votes, "{n} vote of {total}", "{n} votes of {total}", { total: whole(choices) }),
    countTo: (votes, choices, goal) => plural(
      votes,
      "{n} vote of {total} · summary at {goal}",
      "{n} votes of {total} · summary at {goal}",
      { total: whole(choices), goal },
    ),
    voted: { left: _("A is better."), right: _("B is better."), tie: _("Tie."), skip: _("Skipped.") },
    undone: _("Taken back; choose again."),
    nothing: _("There is nothing to take back."),
    reveal: (video, left, right) => _("In {video}, A was {left}, B was {right}.", { video, left, right }),
    saysNothing: _("(says nothing)"),
    more: (n) => plural(n, "and {n} more caption", "and {n} more captions"),
    clip: (video) => _("The clip of {video}, without sound", { video }),
    frame: (video, time) => _("{video} at {time}", { video, time }),
    finished: _("Finished"),
    finishedHow: _("Export your votes."),
    exported: (votes) => plural(votes, "{n} vote exported.", "{n} votes exported."),
    empty: _("There is no vote to export yet."),
    restart: (votes) =>
      plural(votes, "Forget {n} vote and begin anew?", "Forget {n} votes and begin anew?"),
    restarted: _("A new start."),
    unloaded: _("The data of this page could not be loaded. Reload it, or get the site's whole folder "
      + "again."),
    facts: [
      _("Votes"),
      _("A better"),
      _("B better"),
      _("Ties"),
      _("Skipped"),
      _("Pairs of systems met"),
      _("Videos seen"),
    ],
    of: (n, total) => _("{n} of {total}", { n, total }),
  };
  const SET = 20; // votes until the summary opens

  const page = (id) => document.getElementById(id);
  const main = page("vote");
  const clip = page("vote-clip");
  const data = window.COOOLER_VOTES;
  const ballot = window.COOOLER_BALLOT;
  let current = null;
  let frames = [];
  let frame = 0;

  function fail() {
    page("vote-problem").textContent = TEXT.unloaded;
    page("vote-problem").hidden = false;
    main.hidden = true;
  }
  if (!data || !ballot) {
    fail();
    return;
  }

  function add(parent, kind, words = "", className = "") {
    const made = document.createElement(kind);
    made.textContent = words;
    if (className) made.className = className;
    return parent.appendChild(made);
  }
  const say = (words) => {
    page("vote-said").textContent = words;
  };
  const keep = () => {
    page("vote-forbidden").hidden = ballot.keep();
  };

  async function advance() {
    current = null;
    allow(false);
    let found = null;
    try {
      found = await ballot.next();
    } catch (error) {
      fail();
      return;
    }
    if (found === undefined) return;
    keep();
    main.classList.toggle("vote-finished", !found);
    current = found;
    if (found) {
      page("vote-number").textContent = TEXT.number(ballot.state().acts.length + 1);
      page("vote-video").textContent = found.entry.name;
      showScene(found.entry);
      showSide(page("vote-left"), found.entry.sides[found.entry.side_of[found.left]]);
      showSide(page("vote-right"), found.entry.sides[found.entry.side_of[found.right]]);
    } else {
      clip.pause();
      page("vote-number").textContent = TEXT.finished;
      page("vote-video").textContent = TEXT.finishedHow;
      if (ballot.votes().length) page("vote-summary").open = true;
      if (document.activeElement.matches("[data-choice]")) page("vote-undo").focus(); // the others are gone
    }
    allow(true);
    showVotes();
  }

  // A disabled button would lose the focus, so these only say that they rest.
  function allow(possible) {
    main.querySelectorAll("[data-choice]").forEach((button) => {
      button.setAttribute("aria-disabled", String(!(possible && current)));
    });
    page("vote-undo").setAttribute("aria-disabled", String(!ballot.state().acts.length));
  }

  function showSide(place, [captions, more]) {
    place.textContent = "";
    if (captions.length > 1) {
      const list = add(place, "ol");
      captions.forEach((words) => add(list, "li", words));
    } else if (captions.length) add(place, "p", captions[0]);
    else add(place, "p", TEXT.saysNothing, "says-nothing");
    if (more) add(place, "p", TEXT.more(more), "sub");
  }

  function showScene(entry) {
    clip.pause();
    page("vote-clip-problem").hidden = true;
    clip.hidden = !entry.clip;
    page("vote-frame").hidden = Boolean(entry.clip);
    page("vote-strip").hidden = Boolean(entry.clip);
    page("vote-plays").hidden = !entry.clip;
    frames = entry.clip ? [] : entry.frames;
    page("vote-strip").textContent = "";
    if (entry.clip) {
      clip.setAttribute("aria-label", TEXT.clip(entry.name));
      [clip.width, clip.height] = entry.size;
      clip.poster = entry.poster;
      clip.src = entry.clip;
      page("vote-clip-link").href = entry.clip;
      if (ballot.state().play) play();
      return;
    }
    frames.forEach(([thumb, , time], place) => {
      const button = add(add(page("vote-strip"), "li"), "button");
      const picture = add(button, "img");
      button.type = "button";
      picture.src = thumb;
      picture.alt = TEXT.frame(entry.name, time);
      add(button, "span", time).setAttribute("aria-hidden", "true");
      button.addEventListener("click", () => showFrame(place));
    });
    showFrame(Math.floor(frames.length / 2));
  }

  function showFrame(place) {
    if (place < 0 || place >= frames.length) return;
    frame = place;
    page("vote-strip").querySelectorAll("button").forEach((button, other) => {
      if (other === place) button.setAttribute("aria-current", "true");
      else button.removeAttribute("aria-current");
    });
    const strip = page("vote-strip"); // on a phone it scrolls sideways
    const item = strip.children[place];
    strip.scrollLeft = item.offsetLeft - (strip.clientWidth - item.offsetWidth) / 2;
    page("vote-frame").src = frames[place][1];
    page("vote-frame").alt = TEXT.frame(current.entry.name, frames[place][2]);
  }

  // Playing may be cut short by the next clip, or not be possible: the error event tells of the latter.
  const play = () => clip.play().catch(() => {});
  clip.addEventListener("error", () => {
    page("vote-clip-problem").hidden = false;
  });

  function vote(choice) {
    if (!current) return;
    const { left, right, entry } = current;
    ballot.add(current, choice);
    const name = (system) => data.systems[system][1];
    const reveal = ballot.state().reveal && choice !== "skip";
    say(TEXT.voted[choice] + (reveal ? ` ${TEXT.reveal(entry.name, name(left), name(right))}` : ""));
    const votes = ballot.votes().length;
    if (votes && votes % SET === 0 && choice !== "skip") page("vote-summary").open = true;
    page("vote-won").hidden = true;
    if (page("vote-scene").getBoundingClientRect().top < 0) main.scrollIntoView({ block: "start" });
    advance();
  }

  function undo() {
    say(ballot.undo() ? TEXT.undone : TEXT.nothing);
    advance();
  }

  // The count, the summary, and what the controls stand on.
  function showVotes() {
    const state = ballot.state();
    const votes = ballot.votes();
    const goal = Math.min(data.choices, (Math.floor(votes.length / SET) + 1) * SET);
    const count = current ? TEXT.countTo : TEXT.count;
    page("vote-count").textContent = count(votes.length, data.choices, goal);
    page("vote-bar").max = goal;
    page("vote-bar").value = votes.length;
    page("vote-reveal").checked = state.reveal;
    page("vote-play").checked = state.play;
    if (document.activeElement !== page("vote-voter")) page("vote-voter").value = state.voter;
    page("vote-summary").hidden = !votes.length;
    const of = (choice) => votes.filter((act) => act.choice === choice).length;
    const met = new Set(votes.map((act) => [act.left, act.right].sort().join(" "))).size;
    const seen = new Set(votes.map((act) => act.video)).size;
    const values = [votes.length, of("left"), of("right"), of("tie"), state.acts.length - votes.length];
    values.push(TEXT.of(met, ballot.pairs), TEXT.of(seen, data.videos.length));
    page("vote-facts").textContent = "";
    TEXT.facts.forEach((name, place) => {
      const fact = add(page("vote-facts"), "div");
      add(fact, "dt", name);
      add(fact, "dd", String(values[place]));
    });
    showWinners(votes);
  }

  function showWinners(votes) {
    const body = page("vote-won").querySelector("tbody");
    body.textContent = "";
    if (page("vote-won").hidden) return;
    data.systems.forEach(([slug, name]) => {
      const count = (choose) => String(votes.filter(choose).length);
      const row = add(body, "tr");
      add(row, "th", name).scope = "row";
      add(row, "td", count((act) => act.choice !== "tie" && act[act.choice] === slug), "n");
      add(row, "td", count((act) => act[{ left: "right", right: "left" }[act.choice]] === slug), "n");
      add(row, "td", count((act) => act.choice === "tie" && [act.left, act.right].includes(slug)), "n");
    });
  }

  function save() {
    const votes = ballot.votes().length;
    if (!votes) {
      say(TEXT.empty);
      return;
    }
    const content = JSON.stringify(ballot.file(), null, 1);
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([`${content}\n`], { type: "application/json" }));
    link.download = `votes-${ballot.state().seed}-${ballot.state().revision}.json`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
    say(TEXT.exported(votes));
  }

  function restart() {
    const votes = ballot.votes().length;
    if (votes && !window.confirm(TEXT.restart(votes))) return;
    ballot.restart();
    page("vote-summary").open = false;
    say(TEXT.restarted);
    advance();
  }

  main.querySelectorAll("[data-choice]").forEach((button) => {
    button.addEventListener("click", () => vote(button.dataset.choice));
  });
  const on = (id, kind, then) => page(id).addEventListener(kind, then);
  on("vote-undo", "click", undo);
  on("vote-export", "click", save);
  on("vote-restart", "click", restart);
  on("vote-names", "click", () => {
    page("vote-won").hidden = false;
    showWinners(ballot.votes());
  });
  const wish = (id, kind, name, value) =>
    on(id, kind, () => {
      ballot.state()[name] = page(id)[value];
      keep();
    });
  wish("vote-reveal", "change", "reveal", "checked");
  wish("vote-play", "change", "play", "checked");
  wish("vote-voter", "input", "voter", "value");

  // Another tab of this page may have voted.
  window.addEventListener("storage", (event) => {
    if (event.key !== ballot.key) return;
    ballot.recall();
    advance();
  });

  const KEYS = { 1: "left", a: "left", 2: "right", b: "right", 0: "tie", t: "tie", s: "skip" };
  // Captured, because `t` is the theme's key elsewhere.
  document.addEventListener(
    "keydown",
    (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey || page("keys").open) return;
      const target = event.target instanceof Element ? event.target : document.body;
      if (target.closest("input:not([type=checkbox]), select, textarea")) return;
      const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
      if (step && frames.length && !target.closest(".table-scroll")) showFrame(frame + step);
      else if (event.key in KEYS && !event.repeat) vote(KEYS[event.key]);
      else if (event.key === "u" && !event.repeat) undo();
      else if (event.key === "p" && current && current.entry.clip) {
        if (clip.paused) play();
        else clip.pause();
      } else if (!(event.key in KEYS)) return;
      event.preventDefault();
    },
    true,
  );

  ballot.recall();
  advance();
})();
