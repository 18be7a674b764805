// When something has another size than it was drawn for: in another window, scene or language, or unfolded. Before the next
// picture is painted.
export function whenResized(boxes, isOff, work) {
  const observer = new ResizeObserver(() => isOff() && work());
  for (const box of boxes) observer.observe(box);
}
