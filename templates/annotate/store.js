// What was written stays in this browser until the server has it on disk, through crashes of either.
const { author, key } = document.body.dataset;
const PREFIX = `coooler-draft:${key}:`;
const SOON_MS = 350;
const RETRY_MS = [500, 1000, 2000, 4000];

function addressOf(video, merge, by) {
  return `/api/video/${encodeURIComponent(video)}?author=${encodeURIComponent(by)}${merge ? "&merge=1" : ""}`;
}

// Gives {status, data}; status 0 when the server does not answer.
async function ask(address, options) {
  try {
    const response = await fetch(address, options);
    return { status: response.status, data: await response.json() };
  } catch (error) {
    return { status: 0, data: { error: "the server does not answer" } };
  }
}

export function sendDraft(draft, keepalive) {
  return ask(addressOf(draft.video, draft.merge, draft.author), {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify(draft.save),
    keepalive: Boolean(keepalive),
  });
}

function keep(name, draft) {
  try {
    localStorage.setItem(name, JSON.stringify(draft));
    return true;
  } catch (error) {
    return false;
  }
}

function kept(name) {
  try {
    return JSON.parse(localStorage.getItem(name));
  } catch (error) {
    return null;
  }
}

function forget(name, sequence) {
  const draft = kept(name);
  if (draft && draft.save.sequence <= sequence) localStorage.removeItem(name);
}

function keptNames() {
  try {
    return Object.keys(localStorage).filter((name) => name.startsWith(PREFIX));
  } catch (error) {
    return [];
  }
}

// Sends what other pages of this browser left behind. Gives how many were taken, and the drafts that were not.
export async function sendLeftovers() {
  let taken = 0;
  const left = [];
  for (const name of keptNames()) {
    const draft = kept(name);
    if (!draft || !draft.save) continue;
    const { status, data } = await sendDraft(draft);
    if (status === 200) {
      forget(name, draft.save.sequence);
      taken += 1;
    } else {
      left.push({ name, draft, status, error: data.error || "" });
    }
  }
  return { taken, left };
}

export function dropDraft(name) {
  localStorage.removeItem(name);
}

export function loadState(video, merge, by = author) {
  return ask(addressOf(video, merge, by), {});
}

export function loadClip(video) {
  return ask(`/api/clip/${encodeURIComponent(video)}`, {});
}

// One video's way to the disk. `tell(kind, data)`: kind is waiting, saved, failed, refused or conflict.
export class Outbox {
  constructor(video, merge, tell) {
    this.video = video;
    this.merge = merge;
    this.tell = tell;
    this.session = crypto.randomUUID();
    this.name = `${PREFIX}${author}:${merge ? "merge" : "video"}:${video}:${this.session}`;
    this.base = 0;
    this.sequence = 0;
    this.sent = 0;
    this.failures = 0;
    this.draft = null;
    this.running = null;
    this.timer = 0;
    this.isStuck = false;
    this.isKept = true;
    addEventListener("pagehide", () => this.leave());
    addEventListener("online", () => this.send());
    document.addEventListener("visibilitychange", () => {
      if (document.visibilityState === "hidden") this.send();
    });
    addEventListener("beforeunload", (event) => {
      if (this.isOpen() && !this.isKept) event.preventDefault();
    });
  }

  isOpen() {
    return this.sequence > this.sent;
  }

  // Keeps the state here at once, and sends it soon.
  change(state, seen) {
    this.sequence += 1;
    const save = { ...state, base: this.base, session: this.session, sequence: this.sequence, seen };
    this.draft = { video: this.video, merge: this.merge, author, save };
    this.isKept = keep(this.name, this.draft);
    this.tell("waiting", {});
    if (!this.isStuck) this.later(SOON_MS);
  }

  later(delay) {
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.send(), delay);
  }

  send() {
    clearTimeout(this.timer);
    if (!this.isOpen() || this.isStuck) return Promise.resolve();
    if (!this.running) {
      this.running = this.sendNow().finally(() => {
        this.running = null;
      });
    }
    return this.running;
  }

  async sendNow() {
    const draft = this.draft;
    const { status, data } = await sendDraft(draft);
    if (status === 200) {
      this.base = data.revision;
      this.sent = draft.save.sequence;
      this.failures = 0;
      forget(this.name, this.sent);
      if (this.isOpen()) this.later(0);
      else this.tell("saved", data);
    } else if (status === 409) {
      this.isStuck = true;
      this.tell("conflict", data.current);
    } else if (status === 400 || status === 404 || status === 413) {
      this.tell("refused", data);
    } else {
      this.tell("failed", { ...data, status });
      this.later(RETRY_MS[Math.min(this.failures, RETRY_MS.length - 1)]);
      this.failures += 1;
    }
  }

  // The disk's newer state is known now; the next change is made from it.
  settleOn(revision) {
    this.base = revision;
    this.isStuck = false;
  }

  // Nothing of here is wanted any more.
  drop() {
    this.sent = this.sequence;
    localStorage.removeItem(this.name);
  }

  // Whether all is on the disk, after a try.
  async settled() {
    for (let round = 0; round < 3 && this.isOpen() && !this.isStuck; round += 1) await this.send();
    return !this.isOpen();
  }

  leave() {
    if (this.isOpen() && !this.isStuck) sendDraft(this.draft, true);
  }
}
