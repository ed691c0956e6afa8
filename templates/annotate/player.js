// The clip: frames, speed, boxes of tracks over the picture, keyframes. Without a clip that plays, keyframes alone.
import { id, make } from "./dom.js";

const SVG = "http://www.w3.org/2000/svg";
const SPEEDS = [0.25, 0.5, 1, 1.5, 2];

// The box of a track at a frame: its own, or between its neighbours when these are at most `gap` frames apart.
export function boxAt(boxes, frame, gap) {
  let low = 0;
  let high = boxes.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (boxes[middle][0] < frame) low = middle + 1;
    else high = middle;
  }
  const after = boxes[low];
  if (after && after[0] === frame) return after.slice(1);
  const before = boxes[low - 1];
  if (!before || !after || after[0] - before[0] > gap) return null;
  const share = (frame - before[0]) / (after[0] - before[0]);
  return [1, 2, 3, 4].map((place) => before[place] + share * (after[place] - before[place]));
}

export class Player {
  // `pick(track_id)` is called when a box is clicked.
  constructor(pick) {
    this.pick = pick;
    this.video = id("clip");
    this.still = id("still-frame");
    this.svg = id("boxes");
    this.scrub = id("scrub");
    this.frame = 0;
    this.clip = { frame_count: 0, fps_hz: 0, keyframes: [], tracks: [] };
    this.hasClip = false;
    this.hazardTracks = new Set();
    this.listen();
  }

  listen() {
    this.scrub.addEventListener("input", () => this.seek(Number(this.scrub.value)));
    id("play").addEventListener("click", () => this.toggle());
    id("back").addEventListener("click", () => this.step(-1));
    id("on").addEventListener("click", () => this.step(1));
    id("speed").addEventListener("change", () => this.setSpeed(Number(id("speed").value)));
    id("show-boxes").addEventListener("change", () => this.draw());
    this.video.addEventListener("click", () => this.toggle());
    for (const kind of ["play", "pause", "ended"]) this.video.addEventListener(kind, () => this.showPlaying());
    this.video.addEventListener("error", () => this.useKeyframes());
    this.watch();
  }

  // Frames as they are shown; `timeupdate` is the coarse way of browsers that cannot tell.
  watch() {
    const follow = (time) => {
      if (!this.video.seeking) this.at(Math.floor(time * this.clip.fps_hz + 0.01));
    };
    if (!this.video.requestVideoFrameCallback) {
      this.video.addEventListener("timeupdate", () => follow(this.video.currentTime));
      return;
    }
    const next = (now, shown) => {
      if (!this.video.paused) follow(shown.mediaTime);
      this.video.requestVideoFrameCallback(next);
    };
    this.video.requestVideoFrameCallback(next);
  }

  load(clip) {
    this.clip = clip;
    const { width_px: width, height_px: height } = clip;
    this.scrub.max = Math.max(0, clip.frame_count - 1);
    id("stage").style.aspectRatio = width && height ? `${width} / ${height}` : "16 / 9";
    this.svg.setAttribute("viewBox", `0 0 ${width || 1} ${height || 1}`);
    this.hasClip = Boolean(clip.clip);
    if (clip.keyframes.length) this.video.poster = clip.keyframes[0].src;
    if (this.hasClip) this.video.src = clip.clip;
    else this.useKeyframes();
    id("strip").replaceChildren(
      ...clip.keyframes.map((frame, place) => {
        const picture = make("img", { src: frame.src, alt: "", loading: "lazy", decoding: "async" });
        const button = make(
          "button",
          { type: "button", "aria-label": `Keyframe at frame ${frame.index}`, onclick: () => this.seek(frame.index) },
          picture,
          make("span", {}, String(frame.index)),
        );
        return make("li", { "data-place": String(place) }, button);
      }),
    );
    this.at(0);
  }

  useKeyframes() {
    this.hasClip = false;
    this.video.hidden = true;
    this.still.hidden = this.clip.keyframes.length === 0;
    for (const name of ["play", "speed"]) id(name).disabled = true;
    this.at(this.frame);
  }

  // Which keyframe the frame belongs to, or -1.
  place() {
    return this.clip.keyframes.findLastIndex((frame) => frame.index <= this.frame);
  }

  at(frame) {
    this.frame = Math.min(Math.max(0, frame), Math.max(0, this.clip.frame_count - 1));
    this.scrub.value = this.frame;
    const seconds = this.clip.fps_hz ? ` · ${(this.frame / this.clip.fps_hz).toFixed(2)} s` : "";
    id("now").textContent = `Frame ${this.frame}${seconds}`;
    this.scrub.setAttribute("aria-valuetext", `frame ${this.frame}`);
    const place = this.place();
    for (const item of id("strip").children) {
      const isHere = Number(item.dataset.place) === place;
      if (isHere !== item.firstChild.hasAttribute("aria-current")) {
        item.firstChild.toggleAttribute("aria-current", isHere);
        if (isHere) item.firstChild.setAttribute("aria-current", "true");
        if (isHere) this.reveal(item);
      }
    }
    if (!this.hasClip && place >= 0) this.still.src = this.clip.keyframes[place].src;
    this.draw();
  }

  // The strip scrolls sideways on small windows; the page itself stays where it is.
  reveal(item) {
    const strip = id("strip");
    if (strip.scrollWidth <= strip.clientWidth) return;
    strip.scrollLeft = item.offsetLeft - (strip.clientWidth - item.clientWidth) / 2;
  }

  seek(frame) {
    if (this.hasClip && !this.video.paused) this.video.pause();
    this.at(frame);
    // The middle of a frame's time, so that rounding never shows its neighbour.
    if (this.hasClip && this.clip.fps_hz) this.video.currentTime = (this.frame + 0.5) / this.clip.fps_hz;
  }

  step(frames) {
    const place = this.place();
    const keyframes = this.clip.keyframes;
    if (this.hasClip || !keyframes.length) this.seek(this.frame + frames);
    else this.seek(keyframes[Math.min(Math.max(0, place + Math.sign(frames)), keyframes.length - 1)].index);
  }

  stepKeyframe(sign) {
    const keyframes = this.clip.keyframes;
    const target =
      sign > 0
        ? keyframes.find((frame) => frame.index > this.frame)
        : keyframes.findLast((frame) => frame.index < this.frame);
    if (target) this.seek(target.index);
  }

  toggle() {
    if (!this.hasClip) return;
    if (this.video.paused) this.video.play().catch(() => this.showPlaying());
    else {
      this.video.pause();
      this.seek(this.frame);
    }
  }

  showPlaying() {
    id("play").textContent = this.video.paused ? "Play" : "Stop";
  }

  setSpeed(speed) {
    this.video.playbackRate = speed;
    id("speed").value = String(speed);
  }

  // One speed up or down.
  shift(sign) {
    const place = SPEEDS.indexOf(Number(id("speed").value)) + sign;
    if (this.hasClip && SPEEDS[place]) this.setSpeed(SPEEDS[place]);
  }

  mark(hazardTracks) {
    this.hazardTracks = hazardTracks;
    this.draw();
  }

  draw() {
    const shown = id("show-boxes").checked ? this.clip.tracks : [];
    this.svg.replaceChildren(...shown.map((track) => this.group(track)).filter(Boolean));
  }

  group(track) {
    const box = boxAt(track.boxes, this.frame, this.clip.fps_hz || 1);
    if (!box) return null;
    const [x1, y1, x2, y2] = box;
    const group = document.createElementNS(SVG, "g");
    if (this.hazardTracks.has(track.track_id)) group.setAttribute("class", "hazard");
    const shape = (tag, values) => {
      const element = document.createElementNS(SVG, tag);
      for (const [name, value] of Object.entries(values)) element.setAttribute(name, String(value));
      group.append(element);
      return element;
    };
    shape("rect", { x: x1, y: y1, width: x2 - x1, height: y2 - y1 });
    const size = this.clip.width_px / (id("stage").clientWidth < 600 ? 22 : 36);
    const y = y1 > size * 1.2 ? y1 - size * 0.3 : y2 + size;
    shape("text", { x: x1, y, "font-size": size }).textContent = track.track_id;
    group.addEventListener("click", () => this.pick(track.track_id));
    return group;
  }
}
