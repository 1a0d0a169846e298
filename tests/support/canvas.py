"""Scripts that look at canvases of the page, and what was drawn on them."""

from typing import Any

#: Returns the number of coloured pixels of a canvas; axes and texts are grey.
DRAWN = """(canvas) => {
  const copy = document.createElement("canvas");
  [copy.width, copy.height] = [canvas.width, canvas.height];
  const pen = copy.getContext("2d", { willReadFrequently: true });
  pen.drawImage(canvas, 0, 0);
  const { data } = pen.getImageData(0, 0, copy.width, copy.height);
  let coloured = 0;
  for (let at = 0; at < data.length; at += 4) {
    const rgb = data.slice(at, at + 3);
    coloured += data[at + 3] > 0 && Math.max(...rgb) - Math.min(...rgb) > 40;
  }
  return coloured;
}"""

#: Lets every canvas have what its pen has drawn since it was cleared, in pixels of the page, as `drawn`, and
#: the number of drawings as `drawings`.
RECORD_DRAWING = """(() => {
  const { prototype } = CanvasRenderingContext2D;
  const note = (name, take) => {
    const original = prototype[name];
    prototype[name] = function (...values) {
      take(this, ...values);
      return original.apply(this, values);
    };
  };
  const getBox = (pen, text, x, y) => {
    const size = pen.measureText(text);
    const [left, right] = [x - size.actualBoundingBoxLeft, x + size.actualBoundingBoxRight];
    const [top, bottom] = [y - size.actualBoundingBoxAscent, y + size.actualBoundingBoxDescent];
    const corners = [[left, top], [right, bottom]].map(([atX, atY]) =>
      pen.getTransform().transformPoint(new DOMPoint(atX, atY)));
    const places = corners.map((corner) => corner.x / devicePixelRatio);
    return { left: Math.min(...places), right: Math.max(...places) };
  };
  note("reset", ({ canvas }) => {
    canvas.drawn = { lines: [], circles: [], bands: [], texts: [] };
    canvas.drawings = (canvas.drawings ?? 0) + 1;
  });
  note("beginPath", (pen) => { [pen.parts, pen.middle] = [[], null]; });
  note("moveTo", (pen, x, y) => pen.parts?.push([[x, y]]));
  note("lineTo", (pen, x, y) => pen.parts?.at(-1).push([x, y]));
  note("arc", (pen, x, y) => { pen.middle = [x, y]; });
  note("fillRect", (pen, x, y, width, height) =>
    pen.canvas.drawn?.bands.push({ colour: pen.fillStyle, x, y, width, height }));
  note("fillText", (pen, text, x, y) =>
    pen.canvas.drawn?.texts.push({
      text, align: pen.textAlign, colour: pen.fillStyle, ...getBox(pen, text, x, y),
    }));
  note("stroke", (pen) => {
    const { drawn } = pen.canvas;
    if (pen.middle) drawn?.circles.push({ colour: pen.fillStyle, at: pen.middle });
    else drawn?.lines.push({
      colour: pen.strokeStyle, alpha: pen.globalAlpha, width: pen.lineWidth, dash: pen.getLineDash(),
      parts: pen.parts,
    });
  });
})()"""

#: Returns the parts of the line of each series in the legend of a chart: those in the style of its swatch.
_LINES = """(figure) => {
  const pen = document.createElement("canvas").getContext("2d");
  const describe = (colour, width, dash) => {
    pen.strokeStyle = colour;
    return `${pen.strokeStyle} ${width.toFixed(2)} ${dash}`;
  };
  const lines = figure.querySelector("canvas").drawn?.lines ?? [];
  return Object.fromEntries([...figure.querySelectorAll(".legend li")].map((item) => {
    const { stroke, strokeWidth, strokeDasharray } = getComputedStyle(item.querySelector("path"));
    const dash = strokeDasharray === "none" ? [] : strokeDasharray.split(",").map(parseFloat);
    const wanted = describe(stroke, parseFloat(strokeWidth), dash);
    const found = lines.filter((each) => describe(each.colour, each.width, each.dash) === wanted);
    return [item.dataset.name, found.flatMap(({ parts }) => parts)];
  }));
}"""

Part = list[tuple[float, float]]


def get_drawn(chart: Any) -> dict[str, Any]:
    """Return the lines, circles, bands and texts on the canvas of a chart."""
    empty = {"lines": [], "circles": [], "bands": [], "texts": []}
    drawn: dict[str, Any] | None = chart.locator("canvas").evaluate("(canvas) => canvas.drawn")
    return drawn or empty


def get_lines(chart: Any) -> dict[str, list[Part]]:
    """Return the uninterrupted parts of the line of each series, as points in pixels, by its name."""
    lines: dict[str, list[Part]] = chart.evaluate(_LINES)
    return lines


def count_segments(parts: list[Part]) -> int:
    return sum(len(part) - 1 for part in parts)
