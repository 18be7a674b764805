// When the window has another width, and has kept it for a moment.
const QUIET = 80; // ms

export function whenResized(work) {
  let width = innerWidth, waiting = 0;
  addEventListener("resize", () => {
    clearTimeout(waiting);
    waiting = setTimeout(() => {
      if (innerWidth === width) return;
      width = innerWidth;
      work();
    }, QUIET);
  });
}
