"""Accessibility of a page: contrast of its texts, clipped content and missing labels."""

from typing import Any

import pytest

#: Colour schemes and widths of a page. Other tests of the level ci see the pages in light colours and wide.
APPEARANCES = [
    pytest.param("light", 1280, marks=pytest.mark.nightly),
    pytest.param("dark", 360, marks=pytest.mark.ci),
    pytest.param("light", 360, marks=pytest.mark.nightly),
    pytest.param("dark", 1280, marks=pytest.mark.nightly),
]

#: Minimum contrast of a text (WCAG 2.2, 1.4.3).
_CONTRAST = 4.5

#: Script that returns the contrast of every text with its background (WCAG 2.2, 1.4.3), lowest first.
_CONTRASTS = """() => {
  const parsed = (text) => text.match(/[\\d.]+/g).map(Number);
  const luminance = (rgb) => {
    const linear = (v) => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;
    const [r, g, b] = rgb.map((v) => linear(v / 255));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const background = (node) => {
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
    const [a, b] = [luminance(parsed(colour).slice(0, 3)), luminance(background(node))];
    return [(Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05), node.textContent.slice(0, 40), node.className];
  }).sort((a, b) => a[0] - b[0]);
}"""

#: Script that returns missing labels, wrong headings and clipped content.
_DEFECTS = """() => {
  const all = (selector) => [...document.querySelectorAll(selector)].filter((node) => node.checkVisibility());
  const name = (node) => (node.ariaLabel ?? node.textContent).trim();
  const levels = all("h1, h2, h3, h4").map((node) => Number(node.tagName[1]));
  return [
    levels.filter((level) => level === 1).length === 1 ? null : `headings of the first level: ${levels}`,
    ...levels.map((level, at) => at && level > levels[at - 1] + 1 ? `a level is missing: ${levels}` : null),
    ...all("button, a").map((node) => name(node) ? null : "a control without a name"),
    ...all("input").map((node) => node.labels.length || node.ariaLabel ? null : "an input without a label"),
    ...all("img").map((node) => node.hasAttribute("alt") ? null : "a picture without alternative text"),
    ...all("table").map((node) => node.caption ? null : "a table without a caption"),
    ...all("progress, [role=slider], [role=region]").map((node) => node.ariaLabel ? null : node.tagName),
    ...all("td, th, dd, h1, h2, h3, .progress").map((node) => node.matches(".visually-hidden")
      || node.scrollWidth <= node.clientWidth + 1 ? null : `clipped: ${node.textContent.slice(0, 40)}`),
    document.documentElement.lang ? null : "the document has no language",
  ].filter(Boolean);
}"""


def unreadable(page: Any) -> list[str]:
    """Return the accessibility defects of a page: clipped content, low contrast and missing labels."""
    page.evaluate("document.fonts.ready")
    width, whole = page.evaluate("[innerWidth, document.documentElement.scrollWidth]")
    cut = [f"the page is {whole} pixels wide, the screen {width}"] if whole > width else []
    contrasts = page.evaluate(_CONTRASTS)
    assert contrasts, "the page has no text"
    pale = [str(each) for each in contrasts if each[0] < _CONTRAST]
    return [*cut, *pale, *page.evaluate(_DEFECTS)]
