"""Accessibility of a page: contrast of its texts, clipped content, and rules of its markup."""

from typing import Any

from support.markup_rules import find_markup_defects

#: Colour schemes and widths of a page.
APPEARANCES = [("light", 1280), ("dark", 360)]

#: Minimum contrast of a text (WCAG 2.2, 1.4.3).
_CONTRAST = 4.5

#: Script that returns the contrast of every text with its background (WCAG 2.2, 1.4.3), lowest first.
_CONTRASTS = """() => {
  const parsed = (text) => text.match(/[\\d.]+/g).map(Number);
  const blend = (over, under, alpha) => over.map((value, at) => alpha * value + (1 - alpha) * under[at]);
  const luminance = (rgb) => {
    const linear = (v) => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;
    const [r, g, b] = rgb.map((v) => linear(v / 255));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const contrast = (one, other) => {
    const [a, b] = [luminance(one), luminance(other)];
    return (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
  };
  const background = (node) => {
    for (let at = node; at; at = at.parentElement) {
      const [r, g, b, alpha = 1] = parsed(getComputedStyle(at).backgroundColor);
      if (alpha === 1) return [r, g, b];
    }
    return [255, 255, 255];
  };
  const opacity = (node) => node ? Number(getComputedStyle(node).opacity) * opacity(node.parentElement) : 1;
  const isDisabled = (node) => node.closest(":disabled, [aria-disabled=true]");
  const texts = [...document.querySelectorAll("body *")].filter((node) => node.checkVisibility()
    && !isDisabled(node) && (node.matches("input:not([type=checkbox], [type=radio]), select, textarea")
    || [...node.childNodes].some((child) => child.nodeType === 3 && child.data.trim())));
  // A button may appear when it is pointed at or has the focus.
  const written = texts.filter((node) => opacity(node) > 0).map((node) => {
    const style = getComputedStyle(node);
    const [r, g, b, alpha = 1] = parsed(node instanceof SVGElement ? style.fill : style.color);
    const behind = background(node);
    const colour = blend([r, g, b], behind, alpha * opacity(node));
    return [contrast(colour, behind), node.textContent.slice(0, 40), String(node.className)];
  });
  // Canvases draw texts in the colours of the style, over the tints of the marked ranges (signal_panels.js).
  const probe = document.createElement("i");
  document.body.append(probe);
  const named = (name) => {
    probe.style.color = `var(--${name})`;
    return parsed(getComputedStyle(probe).color).slice(0, 3);
  };
  const canvases = [...document.querySelectorAll("canvas")].filter((node) => node.checkVisibility());
  const drawn = canvases.flatMap((node) => {
    const behind = background(node);
    const tints = [["accent", 0.13], ["warn", 0.2]].map(([name, alpha]) => blend(named(name), behind, alpha));
    return [
      [contrast(named("soft"), behind), "soft", "canvas"],
      ...[behind, ...tints].flatMap((under, at) =>
        ["ink", "accent", "before"].map((name) =>
          [contrast(named(name), under), `${name} over ${at}`, "canvas"])),
    ];
  });
  probe.remove();
  return [...written, ...drawn].sort((a, b) => a[0] - b[0]);
}"""

#: Script that stops the endless animations in the middle of their course, where a text that fades is palest.
_STOP_ANIMATIONS = """() => {
  for (const animation of document.getAnimations()) {
    const { duration, iterations } = animation.effect.getComputedTiming();
    if (iterations !== Infinity) continue;
    animation.pause();
    animation.currentTime = duration / 2;
  }
}"""

#: Script that continues the animations.
_CONTINUE_ANIMATIONS = """() => document.getAnimations()
  .filter((animation) => animation.playState === "paused").forEach((animation) => animation.play())"""

#: Script that returns missing labels, wrong headings and clipped content.
_DEFECTS = """() => {
  const all = (selector) => [...document.querySelectorAll(selector)].filter((node) => node.checkVisibility());
  const levels = all("h1, h2, h3, h4").map((node) => Number(node.tagName[1]));
  return [
    levels.filter((level) => level === 1).length === 1 ? null : `headings of the first level: ${levels}`,
    ...levels.map((level, at) => at && level > levels[at - 1] + 1 ? `a level is missing: ${levels}` : null),
    ...all("img").map((node) => node.hasAttribute("alt") ? null : "a picture without alternative text"),
    ...all("table").map((node) => node.caption ? null : "a table without a caption"),
    ...all("progress, [role=slider], [role=region]").map((node) => node.ariaLabel ? null : node.tagName),
    ...all("td, th, dd, h1, h2, h3, .progress").map((node) => node.matches(".visually-hidden")
      || node.scrollWidth <= node.clientWidth + 1 ? null : `clipped: ${node.textContent.slice(0, 40)}`),
    document.documentElement.lang ? null : "the document has no language",
  ].filter(Boolean);
}"""


def unreadable(page: Any) -> list[str]:
    """Return the accessibility defects of a page: clipped content, low contrast and broken rules."""
    page.evaluate("document.fonts.ready")
    width, whole = page.evaluate("[innerWidth, document.documentElement.scrollWidth]")
    cut = [f"the page is {whole} pixels wide, the screen {width}"] if whole > width else []
    page.evaluate(_STOP_ANIMATIONS)
    contrasts = page.evaluate(_CONTRASTS)
    page.evaluate(_CONTINUE_ANIMATIONS)
    assert contrasts, "the page has no text"
    pale = [str(each) for each in contrasts if each[0] < _CONTRAST]
    return [*cut, *pale, *page.evaluate(_DEFECTS), *find_markup_defects(page)]
