// The viewer: keyframes by click, drag, slider and arrow keys, neighbours by j and k, boxes by b.
(function () {
  "use strict";
  const { _ } = window.COOOLER_I18N;
  const TEXT = {
    frame: (number, time) => _("Frame {number} · {time}", { number, time }),
    copied: _("The link is copied."),
    notCopied: (link) => _("It could not be copied; this is the link: {link}", { link }),
  };
  const SETTLE_MS = 90; // large pictures are asked for when the strip rests, not for every frame passed
  const address = window.COOOLER_ADDRESS;
  const id = (name) => document.getElementById(name);
  const frames = Array.from(document.querySelectorAll("#strip a"));
  const strip = id("strip");
  const stage = id("stage");
  const picture = id("stage-picture");
  const scrub = id("scrub");
  let current = Math.max(0, frames.findIndex((link) => link.hasAttribute("aria-current")));
  let timer = 0;

  const numberOf = (link) => Number(link.dataset.frame);

  // The keyframe that is nearest to a frame of the clip.
  function nearest(frame) {
    const distance = (link) => Math.abs(numberOf(link) - frame);
    return frames.reduce((best, link, place) => (distance(link) < distance(frames[best]) ? place : best), 0);
  }

  function preload(place) {
    if (frames[place]) new Image().src = frames[place].href;
  }

  function large(link, neighbours) {
    const image = new Image();
    image.onload = () => {
      if (frames[current] === link) picture.src = image.src;
    };
    image.src = link.href;
    if (neighbours) [current - 1, current + 1].forEach(preload);
  }

  const textOf = (link) => {
    const words = link.querySelector(".strip-text");
    return TEXT.frame(link.dataset.frame, words.lastElementChild.textContent);
  };

  function show(place, neighbours = true) {
    if (!stage || place < 0 || place >= frames.length) return;
    frames[current].removeAttribute("aria-current");
    current = place;
    const link = frames[current];
    const thumb = link.querySelector("img");
    link.setAttribute("aria-current", "true");
    // The small picture fills in until the large one is there, so that the boxes never lie.
    picture.src = thumb.src;
    picture.alt = thumb.alt;
    clearTimeout(timer);
    timer = setTimeout(() => large(link, neighbours), SETTLE_MS);
    const old = stage.querySelector("svg");
    if (old) old.remove();
    const boxes = link.querySelector("svg");
    if (boxes) stage.appendChild(boxes.cloneNode(true));
    id("stage-text").textContent = textOf(link);
    setScrub();
    address.write("frame", [link.dataset.frame]);
    centre(link.parentNode);
  }

  function setScrub() {
    scrub.value = current;
    scrub.setAttribute("aria-valuetext", textOf(frames[current]));
  }

  // On a phone the strip scrolls sideways.
  function centre(item) {
    if (strip.scrollWidth <= strip.clientWidth) return;
    const left = item.offsetLeft - (strip.clientWidth - item.offsetWidth) / 2;
    strip.scrollTo({ left, behavior: "instant" });
  }

  function toStage() {
    if (stage.getBoundingClientRect().top < 0) stage.scrollIntoView({ block: "start" });
  }

  const modified = (event) => event.ctrlKey || event.metaKey || event.shiftKey || event.altKey;
  const plain = (event) => !modified(event) && !event.button;

  function follow(links, placeOf) {
    links.forEach((link, place) => {
      link.addEventListener("click", (event) => {
        if (!stage || !plain(event)) return;
        event.preventDefault();
        show(placeOf(link, place));
        toStage();
      });
    });
  }
  follow(frames, (link, place) => place);
  follow(Array.from(document.querySelectorAll(".crops a[data-frame]")), (link) => nearest(numberOf(link)));

  // Press and drag over the strip with mouse or pen; a finger scrolls it, and has the slider.
  let dragging = false;
  function under(event) {
    const found = document.elementFromPoint(event.clientX, event.clientY);
    const link = found && found.closest("#strip a");
    if (link && link !== frames[current]) show(frames.indexOf(link));
  }
  if (stage) {
    centre(frames[current].parentNode);
    scrub.addEventListener("input", () => show(Number(scrub.value)));
    strip.addEventListener("pointerdown", (event) => {
      dragging = event.pointerType !== "touch" && plain(event);
      if (dragging) under(event);
    });
    strip.addEventListener("dragstart", (event) => event.preventDefault());
    document.addEventListener("pointermove", (event) => {
      if (dragging) under(event);
    });
    ["pointerup", "pointercancel"].forEach((name) => {
      document.addEventListener(name, () => {
        dragging = false;
      });
    });
    const asked = Number((address.read("frame") || [NaN])[0]);
    if (Number.isFinite(asked)) show(nearest(asked), false);
    else setScrub();
  }

  const steps = {
    ArrowLeft: () => current - 1,
    ArrowRight: () => current + 1,
    Home: () => 0,
    End: () => frames.length - 1,
  };
  const onClick = (name, act) => {
    if (id(name)) id(name).addEventListener("click", act);
  };
  onClick("frame-back", () => show(steps.ArrowLeft()));
  onClick("frame-on", () => show(steps.ArrowRight()));
  onClick("copy-link", async () => {
    const link = address.address();
    try {
      await navigator.clipboard.writeText(link);
      id("copied").textContent = TEXT.copied;
    } catch (error) {
      id("copied").textContent = TEXT.notCopied(link);
    }
  });

  const go = (name) => {
    if (id(name)) location.href = id(name).href;
  };
  document.addEventListener("keydown", (event) => {
    if (event.defaultPrevented || event.ctrlKey || event.metaKey || event.altKey || event.shiftKey) return;
    if (id("keys").open) return;
    const target = event.target instanceof Element ? event.target : document.body;
    if (target.closest("input:not([type=checkbox]), select, textarea, video")) return;
    if (event.key === "j") go("following");
    if (event.key === "k") go("previous");
    if (event.key === "b" && id("show-boxes")) id("show-boxes").click();
    if (!Object.hasOwn(steps, event.key) || !stage || target.closest(".table-scroll")) return;
    // Home and End go to the ends of the page, but on the viewer and the strip to those of the clip.
    if (!event.key.startsWith("Arrow") && !target.closest("#viewer, #strip, #tracks")) return;
    event.preventDefault();
    show(steps[event.key]());
    if (target.closest("#strip")) frames[current].focus({ preventScroll: !event.key.startsWith("Arrow") });
  });

  // A link to a stage opens the transcript that it is in.
  function openTarget() {
    let name = location.hash.slice(1);
    try {
      name = decodeURIComponent(name);
    } catch (error) {
      return;
    }
    const target = name && id(name);
    const details = target && target.closest("details");
    if (!details || details.open) return;
    details.open = true;
    target.scrollIntoView({ block: "start" });
  }
  window.addEventListener("hashchange", openTarget);
  openTarget();
})();
