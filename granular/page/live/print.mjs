// On paper the film stands at its last picture, where every ball is at its highest point; before a guess at its first.
export function printsWell(page) {
  let before = 0;
  addEventListener("beforeprint", () => {
    before = page.clock.share;
    page.clock.pause();
    page.later.flush();
    page.clock.go(1);
  });
  addEventListener("afterprint", () => page.clock.go(before));
}
