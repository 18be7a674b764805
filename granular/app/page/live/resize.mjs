// When the window has another width, and has kept it for a moment.
const STEADY = 80; // ms

export function whenResized(work) {
  let width = 0, waiting = 0;
  requestAnimationFrame(() => (width = innerWidth)); // to ask before the first picture lays out the page for nothing
  addEventListener("resize", () => {
    clearTimeout(waiting);
    waiting = setTimeout(() => {
      if (innerWidth === width) return;
      width = innerWidth;
      work();
    }, STEADY);
  });
}
