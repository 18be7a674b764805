// On paper time stands still where hard and soft spheres are farthest apart.
export function printsWell(page) {
  let before = 0;
  addEventListener("beforeprint", () => {
    before = page.clock.share;
    page.film.stop();
    page.later.flush();
    page.clock.go(farthest(page.charts));
  });
  addEventListener("afterprint", () => page.clock.go(before));
}

function farthest({ samples: { times, hard, soft }, span: [begin, end] }) {
  const apart = times.map((_, i) => Math.max(...hard[i].map((y, j) => Math.abs(y - soft[i][j]))));
  return (times[apart.indexOf(Math.max(...apart))] - begin) / (end - begin);
}
