// Live charts of the last twenty seconds.
"use strict";

const WINDOW_S = 20;
const COLOURS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#968214"];

class Charts {
  constructor(names, inRealTime) {
    this.names = names;
    this.columns = names.map(() => []);
    const list = [
      ["chart-position", "Position [mm]", [["reference", "reference_mm"], ["machine", "stroke_mm"], ["simulation", "simulated_mm"]]],
      ["chart-error", "Tracking error x - x_ref [mm]", [["error", "error_mm"]]],
      ["chart-pressure", "Pressure [bar]", [["p_PA", "p_PA_bar"], ["p_A", "p_A_bar"], ["p_B", "p_B_bar"], ["p_PB", "p_PB_bar"], ["p_acc", "p_acc_bar"]]],
      ["chart-speed", "Motor speed [rpm]", [["asked for", "command_rpm"], ["read", "motor_rpm"]]],
    ];
    if (inRealTime) {
      list.push(
        ["chart-execution", "Execution of a step [us], worst of 10 ms", [["simulation", "simulation_execution_us"], ["control", "control_execution_us"]], true],
        ["chart-late", "Release late by [us], worst of 10 ms", [["simulation", "simulation_late_us"], ["control", "control_late_us"]], true],
      );
    }
    this.list = list.map(([id, title, lines, logarithmic]) => this.make(id, title, lines, logarithmic));
    new ResizeObserver(() => this.resize()).observe(document.getElementById("charts"));
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.list.forEach((c) => c.plot.redraw()));
  }

  make(id, title, lines, logarithmic) {
    const holder = document.getElementById(id);
    const css = (name) => () => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
    const axis = { stroke: css("--ink"), grid: { stroke: css("--grid"), width: 1 }, ticks: { stroke: css("--grid"), width: 1 } };
    const show = (value) => (value == null ? "-" : Math.abs(value) >= 100 ? value.toFixed(0) : value.toFixed(2));
    const plot = new uPlot({
      title,
      width: Math.max(holder.clientWidth, 200),
      height: 190,
      legend: { live: true },
      cursor: { drag: { x: false, y: false } },
      scales: { x: { time: false }, y: logarithmic ? { distr: 3, range: (u, low, high) => [0.03, Math.max(high ?? 1, 1000)] } : {} },
      axes: [{ ...axis, values: (u, all) => all.map((v) => `${v} s`) }, { ...axis, size: 58 }],
      series: [
        { label: "t", value: (u, v) => (v == null ? "-" : `${v.toFixed(2)} s`) },
        ...lines.map(([label], k) => ({ label, stroke: COLOURS[k], width: 1.6, points: { show: false }, value: (u, v) => show(v) })),
      ],
    }, [[], ...lines.map(() => [])], holder);
    return { plot, holder, columns: [0, ...lines.map(([, name]) => this.names.indexOf(name))], logarithmic };
  }

  resize() {
    this.list.forEach(({ plot, holder }) => {
      const width = holder.clientWidth;
      if (width > 0 && width !== plot.width) plot.setSize({ width, height: 190 });
    });
  }

  add(samples) {
    for (const sample of samples) sample.forEach((value, k) => this.columns[k].push(value));
    const time = this.columns[0];
    const from = (time[time.length - 1] ?? 0) - WINDOW_S;
    let old = 0;
    while (old < time.length && time[old] < from) old += 1;
    if (old > 0) this.columns.forEach((column) => column.splice(0, old));
  }

  draw() {
    const time = this.columns[0];
    const end = time[time.length - 1] ?? WINDOW_S;
    for (const { plot, columns, logarithmic } of this.list) {
      const data = columns.map((k) => this.columns[k]);
      // a logarithmic axis has no zero
      plot.setData(logarithmic ? data.map((c, k) => (k ? c.map((v) => (v > 0 ? v : null)) : c)) : data, true);
      plot.setScale("x", { min: Math.max(end - WINDOW_S, 0), max: Math.max(end, WINDOW_S) });
    }
  }

  latest(name) {
    const column = this.columns[this.names.indexOf(name)];
    return column[column.length - 1];
  }
}
