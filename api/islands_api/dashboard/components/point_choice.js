/** Choice of a point of a chart, by a click or by Enter. */

/** Call `choose(x)` for a chosen point of a line chart; `chooses` says to screen readers what that does. */
export function letChoose(chart, chooses, choose) {
  const plot = chart.node.querySelector(".plot");
  plot.classList.add("choosing");
  plot.setAttribute("aria-description", `Enter ${chooses}.`);
  const chooseNow = () => choose(Number(plot.getAttribute("aria-valuenow")));
  plot.addEventListener("click", ({ clientX }) => {
    // A touch has moved no pointer before.
    plot.dispatchEvent(new PointerEvent("pointermove", { clientX }));
    chooseNow();
  });
  plot.addEventListener("keydown", ({ key }) => {
    if (key === "Enter") chooseNow();
  });
}
