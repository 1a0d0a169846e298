"""Scripts that look at a canvas of the page."""

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
