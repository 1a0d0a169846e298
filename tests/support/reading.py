"""Whether a page can be read: how its texts stand out, and what a screen reader would stumble over."""

from typing import Any

#: The least contrast of a text that everybody can read.
_CONTRAST = 4.5

#: The contrast of every text with what lies behind it (WCAG 2.2, 1.4.3), least first.
_CONTRASTS = """() => {
  const parsed = (text) => text.match(/[\\d.]+/g).map(Number);
  const light = (rgb) => {
    const linear = (v) => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;
    const [r, g, b] = rgb.map((v) => linear(v / 255));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const behind = (node) => {
    for (let at = node; at; at = at.parentElement) {
      const [r, g, b, alpha = 1] = parsed(getComputedStyle(at).backgroundColor);
      if (alpha === 1) return [r, g, b];
    }
    return [255, 255, 255];
  };
  const texts = [...document.querySelectorAll("body *")].filter((node) => node.checkVisibility()
    && [...node.childNodes].some((child) => child.nodeType === 3 && child.data.trim()));
  return texts.map((node) => {
    const style = getComputedStyle(node);
    const colour = node instanceof SVGElement ? style.fill : style.color;
    const [a, b] = [light(parsed(colour).slice(0, 3)), light(behind(node))];
    return [(Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05), node.textContent.slice(0, 40), node.className];
  }).sort((a, b) => a[0] - b[0]);
}"""

#: What a screen reader would stumble over.
_STUMBLES = """() => {
  const all = (selector) => [...document.querySelectorAll(selector)].filter((node) => node.checkVisibility());
  const said = (node) => (node.ariaLabel ?? node.textContent).trim();
  const levels = all("h1, h2, h3, h4").map((node) => Number(node.tagName[1]));
  return [
    levels.filter((level) => level === 1).length === 1 ? null : `headings of the first level: ${levels}`,
    ...levels.map((level, at) => at && level > levels[at - 1] + 1 ? `a level is left out: ${levels}` : null),
    ...all("button, a").map((node) => said(node) ? null : "nameless"),
    ...all("input").map((node) => node.labels.length ? null : "an input without a label"),
    ...all("img").map((node) => node.hasAttribute("alt") ? null : "a picture without words"),
    ...all("table").map((node) => node.caption ? null : "a table without a caption"),
    ...all("progress, [role=slider], [role=region]").map((node) => node.ariaLabel ? null : node.tagName),
    ...all("td, th, dd, h1, h2, h3, .progress").map((node) => node.scrollWidth > node.clientWidth + 1
      ? `it juts out: ${node.textContent.slice(0, 40)}` : null),
    document.documentElement.lang ? null : "no language",
  ].filter(Boolean);
}"""


def unreadable(page: Any) -> list[str]:
    """Say what cannot be read on a page: what is cut off, too pale, or has no words."""
    page.evaluate("document.fonts.ready")
    width, whole = page.evaluate("[innerWidth, document.documentElement.scrollWidth]")
    cut = [f"the page is {whole} pixels wide, and the screen {width}"] if whole > width else []
    contrasts = page.evaluate(_CONTRASTS)
    assert contrasts, "there is no text at all"
    pale = [str(each) for each in contrasts if each[0] < _CONTRAST]
    return [*cut, *pale, *page.evaluate(_STUMBLES)]
