// Before and after, one over the other: the slider, or a finger on the picture, says where they meet.
(function () {
  "use strict";
  for (const both of document.querySelectorAll("[data-compare]")) {
    const slider = both.querySelector("input[type=range]");
    const pictures = both.querySelector(".both-pictures");

    const show = () => both.style.setProperty("--at", `${slider.value}%`);

    function follow(event) {
      const area = pictures.getBoundingClientRect();
      slider.value = String(Math.round((100 * (event.clientX - area.left)) / area.width));
      show();
    }

    slider.addEventListener("input", show);
    pictures.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      pictures.setPointerCapture(event.pointerId);
      follow(event);
    });
    pictures.addEventListener("pointermove", (event) => {
      if (pictures.hasPointerCapture(event.pointerId)) follow(event);
    });
    show(); // a browser may have kept the slider's place
  }
})();
