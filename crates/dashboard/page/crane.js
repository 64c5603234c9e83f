// The crane, to scale: bearing at the origin, metres, y upwards.
"use strict";

/** Colour of a pressure: blue when low, red when high; the same steps as the scale below the picture. */
function pressureColour(bar, top) {
  const stops = [[59, 111, 182], [109, 106, 156], [176, 87, 107], [213, 67, 12]];
  const at = Math.min(Math.max((bar ?? 0) / top, 0), 1) * (stops.length - 1);
  const low = Math.min(Math.floor(at), stops.length - 2);
  const mix = (k) => Math.round(stops[low][k] + (at - low) * (stops[low + 1][k] - stops[low][k]));
  return `rgb(${mix(0)} ${mix(1)} ${mix(2)})`;
}

class CranePicture {
  constructor(canvas) {
    this.canvas = canvas;
    this.magnify = 10;
    this.topPressure = 100;
  }

  setup(setup) {
    this.fixed = setup;
    const [bx, by] = setup.base_m;
    const tips = setup.reach_m;
    // room for the whole stroke, and for bending drawn large
    this.low = [Math.min(bx, 0) - 0.35, Math.min(by - 0.3, ...tips.map(([, y]) => y - 0.6))];
    this.high = [Math.max(setup.boom_m, ...tips.map(([x]) => x)) + 0.25, Math.max(...tips.map(([, y]) => y)) + 0.5];
  }

  /** Bending drawn larger: every joint moves away from the line that the inner segment points along. */
  bent(boom) {
    const [x1, y1] = boom[1];
    const l = Math.hypot(x1, y1);
    const [ux, uy] = [x1 / l, y1 / l];
    return boom.map(([x, y]) => {
      const along = x * ux + y * uy;
      const across = -x * uy + y * ux;
      const drawn = across * this.magnify;
      return [along * ux - drawn * uy, along * uy + drawn * ux];
    });
  }

  draw(crane, pressures) {
    const { canvas, fixed } = this;
    if (!fixed || !crane) return;
    const ratio = window.devicePixelRatio || 1;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    if (canvas.width !== Math.round(width * ratio)) canvas.width = Math.round(width * ratio);
    if (canvas.height !== Math.round(height * ratio)) canvas.height = Math.round(height * ratio);
    const c = canvas.getContext("2d");
    const style = getComputedStyle(document.documentElement);
    const colour = (name) => style.getPropertyValue(name).trim();
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    c.clearRect(0, 0, width, height);
    const scale = Math.min(width / (this.high[0] - this.low[0]), height / (this.high[1] - this.low[1]));
    const left = (width - scale * (this.high[0] - this.low[0])) / 2;
    const px = ([x, y]) => [left + (x - this.low[0]) * scale, height - (y - this.low[1]) * scale];
    const line = (points, stroke, thick, dash = []) => {
      c.beginPath();
      points.map(px).forEach(([x, y], k) => (k ? c.lineTo(x, y) : c.moveTo(x, y)));
      c.strokeStyle = stroke;
      c.lineWidth = thick;
      c.setLineDash(dash);
      c.lineJoin = c.lineCap = "round";
      c.stroke();
      c.setLineDash([]);
    };
    const dot = (point, radius, fill) => {
      const [x, y] = px(point);
      c.beginPath();
      c.arc(x, y, radius, 0, 2 * Math.PI);
      c.fillStyle = fill;
      c.fill();
    };
    const ink = colour("--ink");
    const base = fixed.base_m;
    line([[0, 0], [0, base[1]], base], colour("--grid"), 8);
    const boom = this.bent(crane.boom);
    line(crane.boom, colour("--soft"), 1.5, [4, 5]);
    line(boom, colour("--accent"), 8);
    boom.slice(1).forEach((joint) => dot(joint, 3.5, colour("--paper")));
    // the lug, from the boom's axis to the cylinder's mount
    const [x1, y1] = crane.boom[1];
    const along = (crane.mount[0] * x1 + crane.mount[1] * y1) / (x1 * x1 + y1 * y1);
    line([[along * x1, along * y1], crane.mount], colour("--accent"), 5);

    // the barrel: rod side and piston side, coloured by their pressures, and the rod
    const mount = crane.mount;
    const length = Math.hypot(mount[0] - base[0], mount[1] - base[1]);
    const at = (share) => [base[0] + (mount[0] - base[0]) * share, base[1] + (mount[1] - base[1]) * share];
    const stroke = Math.max(length - fixed.shortest_m, 0);
    const full = fixed.stroke_mm * 1e-3;
    const tail = (fixed.shortest_m - full) / 2;
    const piston = at((tail + stroke) / length);
    const head = at((tail + full) / length);
    line([at(0), mount], ink, 3);
    line([at(tail / length), head], ink, 15);
    line([at(tail / length), piston], pressureColour(pressures.a, this.topPressure), 11);
    line([piston, head], pressureColour(pressures.b, this.topPressure), 11);
    dot(piston, 4, ink);
    [[0, 0], base, mount].forEach((point) => dot(point, 5, ink));

    const tip = px(boom[boom.length - 1]);
    const side = 24;
    c.fillStyle = colour("--good");
    c.fillRect(tip[0] - side / 2, tip[1], side, side);
    c.fillStyle = ink;
    c.font = "13px system-ui, sans-serif";
    c.textAlign = "center";
    c.fillText(`${fixed.payload_kg.toFixed(0)} kg`, tip[0], tip[1] + side + 15);
    // one metre
    const [x0, y0] = [width - 16 - scale, height - 14];
    c.strokeStyle = ink;
    c.lineWidth = 1;
    c.beginPath();
    c.moveTo(x0, y0 - 5); c.lineTo(x0, y0 + 5); c.moveTo(x0, y0); c.lineTo(x0 + scale, y0);
    c.moveTo(x0 + scale, y0 - 5); c.lineTo(x0 + scale, y0 + 5);
    c.stroke();
    c.textAlign = "center";
    c.fillText("1 m", x0 + scale / 2, y0 - 5);
    c.textAlign = "left";
    [["p_PA", pressures.pa], ["p_A", pressures.a], ["p_B", pressures.b], ["p_PB", pressures.pb], ["p_acc", pressures.acc]]
      .forEach(([name, bar], k) => {
        c.fillStyle = pressureColour(bar, this.topPressure);
        c.fillRect(10, 12 + 18 * k, 11, 11);
        c.fillStyle = ink;
        c.fillText(`${name} ${bar == null ? "no number" : bar.toFixed(1) + " bar"}`, 27, 22 + 18 * k);
      });
  }
}
