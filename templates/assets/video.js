// The viewer: keyframes by click and arrow keys, neighbours by j and k, boxes by b.
(function () {
  "use strict";
  function go(id) {
    var link = document.getElementById(id);
    if (link) location.href = link.href;
  }

  var frames = Array.from(document.querySelectorAll("#strip a"));
  var stage = document.getElementById("stage");
  var picture = document.getElementById("stage-picture");
  var text = document.getElementById("stage-text");
  var current = Math.max(0, frames.findIndex(function (link) {
    return link.hasAttribute("aria-current");
  }));

  function show(place) {
    if (!stage || place < 0 || place >= frames.length) return;
    frames[current].removeAttribute("aria-current");
    current = place;
    var link = frames[current];
    var thumb = link.querySelector("img");
    link.setAttribute("aria-current", "true");
    // The small picture fills in until the large one is there, so that the boxes never lie.
    picture.src = thumb.src;
    picture.alt = thumb.alt;
    var large = new Image();
    large.onload = function () {
      if (frames[current] === link) picture.src = large.src;
    };
    large.src = link.href;
    var old = stage.querySelector("svg");
    if (old) old.remove();
    var boxes = link.querySelector("svg");
    if (boxes) stage.appendChild(boxes.cloneNode(true));
    var words = link.querySelector(".strip-text");
    text.textContent = "Frame " + words.firstChild.textContent.trim() + " · " + words.lastElementChild.textContent;
    centre(link.parentNode);
  }

  // On a phone the strip scrolls sideways.
  function centre(item) {
    var strip = item.parentNode;
    if (strip.scrollWidth > strip.clientWidth) {
      strip.scrollLeft = item.offsetLeft - (strip.clientWidth - item.offsetWidth) / 2;
    }
  }
  if (frames.length) centre(frames[current].parentNode);

  frames.forEach(function (link, place) {
    link.addEventListener("click", function (event) {
      if (event.ctrlKey || event.metaKey || event.shiftKey || event.button) return;
      event.preventDefault();
      show(place);
      var view = stage.getBoundingClientRect();
      if (view.top < 0) stage.scrollIntoView({ block: "start" });
    });
  });

  function on(id, step) {
    var button = document.getElementById(id);
    if (button) {
      button.addEventListener("click", function () {
        show(current + step);
      });
    }
  }
  on("frame-back", -1);
  on("frame-on", 1);

  document.addEventListener("keydown", function (event) {
    if (event.defaultPrevented || event.ctrlKey || event.metaKey || event.altKey || event.shiftKey) return;
    if (document.getElementById("keys").open) return;
    var target = event.target instanceof Element ? event.target : document.body;
    if (target.closest("input:not([type=checkbox]), select, textarea, video")) return;
    if (event.key === "j") go("following");
    if (event.key === "k") go("previous");
    if (event.key === "b") {
      var box = document.getElementById("show-boxes");
      if (box) box.click();
    }
    if (event.key === "ArrowLeft" || event.key === "ArrowRight") {
      if (target.closest(".table-scroll")) return;
      event.preventDefault();
      show(current + (event.key === "ArrowLeft" ? -1 : 1));
    }
  });

  // A link to one system's transcript opens it.
  function openTarget() {
    var target = location.hash && document.getElementById(decodeURIComponent(location.hash.slice(1)));
    if (target && target.tagName === "DETAILS") target.open = true;
  }
  window.addEventListener("hashchange", openTarget);
  openTarget();
})();
