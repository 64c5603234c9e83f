// Live charts of the last twenty seconds.
"use strict";

const WINDOW_S = 20;
const COLOURS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#968214"];

// A band of estimates: value and standard deviation.
const around = (name) => ({ about: `estimated_${name}`, deviation: `deviation_${name}` });

class Charts {
  constructor(names, inRealTime) {
    this.names = names;
    this.columns = names.map(() => []);
    const list = [
      ["chart-position", "Position [mm]", [["reference", "reference_mm"], ["machine", "stroke_mm"], ["simulation", "simulated_mm"]]],
      ["chart-error", "Tracking error x - x_ref [mm]", [["error", "error_mm"]]],
      ["chart-pressure", "Pressure [bar]", [["p_PA", "p_PA_bar"], ["p_A", "p_A_bar"], ["p_B", "p_B_bar"], ["p_PB", "p_PB_bar"], ["p_acc", "p_acc_bar"]]],
      ["chart-speed", "Motor speed [rpm]", [["asked for", "command_rpm"], ["read", "motor_rpm"]]],
      // bands of two standard deviations: about estimates, and about zero for innovations
      ["chart-payload", "Estimated payload ± 2σ [kg]", [["payload", "estimated_payload_kg"]], false, around("payload_kg")],
      ["chart-transition", "Transition pressure ± 2σ [bar]", [["transition pressure", "estimated_transition_pressure_bar"]], false, around("transition_pressure_bar")],
      ["chart-disturbance", "Unknown force ± 2σ [bar]", [["unknown force", "estimated_disturbance_bar"]], false, around("disturbance_bar")],
      ["chart-tip", "Estimated height of the tip ± 2σ [mm]", [["tip", "estimated_tip_y_mm"]], false, around("tip_y_mm")],
      ["chart-innovation-position", "Innovation of position, ± 2σ [mm]", [["innovation", "innovation_position_mm"]], false, { about: null, deviation: "deviation_innovation_position_mm" }],
      ["chart-innovation-pressure", "Innovation of load pressure, ± 2σ [bar]", [["innovation", "innovation_load_pressure_bar"]], false, { about: null, deviation: "deviation_innovation_load_pressure_bar" }],
    ];
    if (inRealTime) {
      list.push(
        ["chart-execution", "Execution of a step [us], worst of 10 ms", [["simulation", "simulation_execution_us"], ["control", "control_execution_us"]], true],
        ["chart-late", "Release late by [us], worst of 10 ms", [["simulation", "simulation_late_us"], ["control", "control_late_us"]], true],
      );
    }
    this.list = list.map((chart) => this.make(...chart));
    new ResizeObserver(() => this.resize()).observe(document.getElementById("charts"));
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.list.forEach((c) => c.plot.redraw()));
  }

  make(id, title, lines, logarithmic, band) {
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
        ...(band ? ["+ 2σ", "- 2σ"] : []).map((label) => ({ label, stroke: `${COLOURS[0]}80`, width: 1, points: { show: false }, value: (u, v) => show(v) })),
      ],
      bands: band ? [{ series: [lines.length + 1, lines.length + 2], fill: `${COLOURS[0]}30` }] : [],
    }, [[], ...lines.map(() => []), ...(band ? [[], []] : [])], holder);
    return { plot, holder, columns: [0, ...lines.map(([, name]) => this.names.indexOf(name))], logarithmic, band };
  }

  // Upper and lower edge of a band; none where there is no estimate.
  edges({ about, deviation }) {
    const middle = about ? this.columns[this.names.indexOf(about)] : null;
    const sigma = this.columns[this.names.indexOf(deviation)];
    const edge = (sign) => sigma.map((s, k) => (s == null || (middle && middle[k] == null) ? null : (middle ? middle[k] : 0) + sign * 2 * s));
    return [edge(1), edge(-1)];
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
    for (const { plot, columns, logarithmic, band } of this.list) {
      const data = [...columns.map((k) => this.columns[k]), ...(band ? this.edges(band) : [])];
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
