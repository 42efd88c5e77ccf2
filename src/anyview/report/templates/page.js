// Plays clips in step: each is one tall image of frames; the style sheet shows frame --frame of --count.
"use strict";
for (const box of document.querySelectorAll(".player")) {
  const clips = [...box.querySelectorAll(".clip img")];
  const choices = [...box.querySelectorAll(".choice")];
  const [button, slider, choice] = ["button", "input", "select"].map((name) => box.querySelector(name));
  const count = Number(slider.max) + 1;
  let frame = 0;
  let timer = null;

  const show = (next) => {
    frame = next;
    slider.value = frame;
    for (const clip of clips) {
      clip.style.setProperty("--frame", Math.min(frame, clip.style.getPropertyValue("--count") - 1));
    }
  };
  // The last frame shows where things end: it stays for a second.
  const tick = () => {
    show((frame + 1) % count);
    timer = setTimeout(tick, frame === count - 1 ? 1200 : 160);
  };
  const play = (on) => {
    clearTimeout(timer);
    timer = on ? setTimeout(tick, 160) : null;
    button.textContent = on ? "Pause" : "Play";
  };
  const choose = () => choices.forEach((shown, index) => { shown.hidden = index !== Number(choice.value); });

  button.addEventListener("click", () => play(timer === null));
  slider.addEventListener("input", () => { play(false); show(Number(slider.value)); });
  if (choice) {
    choice.addEventListener("change", choose);
    choose();
  }
  box.querySelector(".controls").hidden = false;
  box.classList.add("ready");
  show(count - 1);
  if (!matchMedia("(prefers-reduced-motion: reduce)").matches) {
    new IntersectionObserver(([entry], observer) => {
      if (entry.isIntersecting) { observer.disconnect(); show(0); play(true); }
    }, { threshold: 0.25 }).observe(box);
  }
}
