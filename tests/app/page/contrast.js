// Texts whose contrast is below what WCAG AA asks for (4.5, large ones 3): [text, contrast].
(() => {
  const channel = (c) => (c / 255 <= 0.04045 ? c / 255 / 12.92 : ((c / 255 + 0.055) / 1.055) ** 2.4);
  const parts = (colour) => colour.match(/[\d.]+/g)?.map(Number) ?? [0, 0, 0, 0];
  const light = (colour) => parts(colour).slice(0, 3).map(channel).reduce((sum, c, i) => sum + c * [0.2126, 0.7152, 0.0722][i], 0);
  const solid = (colour) => parts(colour).length < 4 || parts(colour)[3] > 0.5;
  const behind = (element) => {
    for (let e = element; e; e = e.parentElement) {
      const { backgroundColor } = getComputedStyle(e);
      if (backgroundColor !== "none" && solid(backgroundColor)) return backgroundColor;
    }
    return "rgb(255, 255, 255)";
  };
  const ownText = (e) => [...e.childNodes].some((node) => node.nodeType === 3 && node.textContent.trim());
  const found = [];
  for (const element of document.querySelectorAll("body *")) {
    if (!ownText(element) || !element.checkVisibility({ visibilityProperty: true, opacityProperty: true })) continue;
    if (element.matches("script, style, option, .announced, :disabled, title")) continue;
    const style = getComputedStyle(element), ink = element.namespaceURI.endsWith("svg") ? style.fill : style.color;
    const [a, b] = [light(ink), light(behind(element))].sort((x, y) => y - x), ratio = (a + 0.05) / (b + 0.05);
    const large = parseFloat(style.fontSize) >= 24 || (parseFloat(style.fontSize) >= 18.66 && style.fontWeight >= 600);
    if (ratio < (large ? 3 : 4.5)) found.push([element.textContent.slice(0, 40), Number(ratio.toFixed(2))]);
  }
  return found;
})()
