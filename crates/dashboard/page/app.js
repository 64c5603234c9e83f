// The page: shows the frames of the program and sends the operator's commands.
"use strict";

const $ = (id) => document.getElementById(id);
// anything else cannot be one
const token = location.hash.slice(1).match(/^[0-9a-f]{32}$/)?.[0] ?? "";
// close code of a connection whose place another viewer has taken
const DISPLACED = 4001;
const picture = new CranePicture($("crane"));
const page = { socket: null, viewer: null, charts: null, frame: null, setup: null, isOperator: false, frames: 0 };

function send(command, rest = {}) {
  if (page.socket?.readyState !== WebSocket.OPEN) return refuse("there is no connection: nothing was sent");
  page.socket.send(JSON.stringify({ command, ...(command === "alive" ? {} : { token }), ...rest }));
}

let refusalTimer;
function refuse(reason) {
  $("refusal").textContent = reason;
  $("refusal").hidden = false;
  clearTimeout(refusalTimer);
  refusalTimer = setTimeout(() => { $("refusal").hidden = true; }, 8000);
}

function connect() {
  // the token follows the protocol name: viewers with the token always get a place
  const socket = new WebSocket(`ws://${location.host}/live`, token ? ["hydroboom", token] : ["hydroboom"]);
  page.socket = socket;
  socket.onmessage = (event) => receive(JSON.parse(event.data));
  socket.onclose = (event) => {
    page.isOperator = false;
    badge("no connection", "off");
    $("waits").textContent = "";
    enable();
    if (event.code === DISPLACED) refuse("too many viewers: another one has this page's place; reload it to come back");
    else setTimeout(connect, 1000);
  };
}

function receive(message) {
  if (message.type === "setup") setUp(message);
  else if (message.type === "past") {
    // also after a reconnection: the history fills the gap
    document.querySelectorAll(".chart").forEach((chart) => chart.replaceChildren());
    page.charts = new Charts(message.names, page.setup.real_time);
    page.charts.add(message.samples);
    news(message.news);
  } else if (message.type === "frame") {
    page.frame = message;
    page.frames += 1;
    page.charts?.add(message.samples);
    if (message.news) news(message.news);
  } else if (message.type === "refused") refuse(`refused: ${message.reason}`);
}

function option(value, text = value) {
  const made = document.createElement("option");
  made.value = value;
  made.textContent = text;
  return made;
}

function setUp(setup) {
  page.setup = setup;
  page.viewer = setup.viewer;
  picture.setup(setup);
  $("crane-name").textContent = `${setup.crane_name}${setup.virtual ? ", virtual" : ""}${setup.real_time ? "" : ", simulated time"}`;
  $("strategy").replaceChildren(...setup.strategies.map((name) => option(name)));
  $("motion").replaceChildren(option("", "out and back"), ...setup.scenarios.map((name) => option(name)));
  $("speed").min = setup.least_speed_mm_s;
  $("speed").max = setup.most_speed_mm_s;
  $("speed").value = setup.speed_mm_s;
  $("faults").hidden = setup.faults.length === 0;
  $("fault").replaceChildren(...setup.faults.map((name) => option(name)));
  $("chart-execution").hidden = $("chart-late").hidden = !setup.real_time;
  $("no-token").hidden = setup.has_token;
  choose(setup.chosen);
}

// Shows the selection, in the controls and as text.
function choose(chosen) {
  $("strategy").value = chosen.strategy;
  $("motion").value = chosen.scenario ?? "";
  if (chosen.speed_mm_s != null) $("speed").value = chosen.speed_mm_s;
  $("speed-label").hidden = chosen.scenario != null;
}

function inWords(chosen) {
  return `${chosen.strategy}, ${chosen.scenario ?? `out and back at ${+chosen.speed_mm_s.toFixed(3)} mm/s`}`;
}

// Shows the condition that delays the machine or a start, if any.
function waits(frame) {
  if (frame.oscillation != null) {
    const [amplitude, frequency] = frame.oscillation;
    return `the loop is in sustained oscillation: ${amplitude.toFixed(1)} mm at ${frequency.toFixed(2)} Hz`;
  }
  const since = `since ${(frame.waiting_s ?? 0).toFixed(0)} s`;
  if (frame.start_waits_for != null) {
    const machine = frame.waiting != null ? `; the machine waits for ${frame.waiting}, ${since}` : "";
    return `a start waits for ${frame.start_waits_for}${machine}`;
  }
  return page.isOperator ? "a course can be started" : "a course can be started by the operator";
}

function cell(text, className) {
  const made = document.createElement("td");
  made.textContent = text;
  if (className) made.className = className;
  return made;
}

// in the order of the columns; a machine in another process reports no true errors
function errors(result) {
  return [result.rms_true_mm, result.rms_measured_mm, result.peak_true_mm, result.peak_measured_mm];
}

function news(all) {
  if (all.results.length) {
    $("results").replaceChildren(...all.results.slice().reverse().map((result) => {
      const row = document.createElement("tr");
      const strategy = result.then ? `${result.strategy}, then ${result.then}` : result.strategy;
      const ended = (result.fault ?? "load held") + (result.fallback ? ", benchmark took over" : "");
      row.append(cell(result.course), cell(strategy), ...errors(result).map((mm) => cell(mm === null ? "-" : mm.toFixed(3))), cell(ended));
      return row;
    }));
  }
  const events = [
    ...all.alarms.map((a) => [a.time_s, `${a.code}: ${a.advice}`]),
    ...all.notices.map((n) => [n.time_s, n.text]),
  ].sort((a, b) => b[0] - a[0]);
  if (events.length) {
    $("events").replaceChildren(...events.map(([time, text]) => {
      const item = document.createElement("li");
      item.textContent = `${time.toFixed(1)} s: ${text}`;
      return item;
    }));
  }
  $("report").hidden = !all.has_report;
  $("fault-data").hidden = !all.has_fault_data;
}

// Estimates of the state estimator: name, unit, key of the frame, digits.
const ESTIMATES = [
  ["payload", "kg", "payload_kg", 1],
  ["transition pressure of the oil", "bar", "transition_pressure_bar", 1],
  ["unknown force over the piston's area", "bar", "disturbance_bar", 2],
  ["unknown flow", "rpm", "unknown_flow_rpm", 1],
  ["velocity of the load", "mm/s", "velocity_mm_s", 1],
  ["tip, to the right of the bearing", "mm", "tip_x_mm", 1],
  ["tip, above the bearing", "mm", "tip_y_mm", 1],
  ["lag of the drive", "ms", "drive_lag_ms", 1],
  ["mean NIS", "1", "mean_nis", 2],
];

function estimates(estimated) {
  $("estimates").hidden = estimated == null;
  if (estimated == null) return;
  $("estimated").replaceChildren(...ESTIMATES.map(([name, unit, key, digits]) => {
    const [value, deviation] = [estimated[key]].flat();
    const shown = (number) => (number == null ? "-" : number.toFixed(digits));
    const row = document.createElement("tr");
    row.append(cell(name), cell(unit), cell(shown(value)), cell(deviation == null ? "" : shown(2 * deviation)));
    return row;
  }));
}

function badge(text, kind) {
  if ($("state").textContent !== text) $("state").textContent = text;
  $("state").className = `badge ${kind}`;
}

function enable() {
  const state = page.frame?.state;
  const connected = page.socket?.readyState === WebSocket.OPEN;
  const operates = connected && page.isOperator;
  const hasToken = page.setup?.has_token === true;
  $("commands").disabled = !operates;
  $("emergency").disabled = !connected || !hasToken;
  $("role").disabled = !connected || !hasToken || (!page.isOperator && page.frame?.operator != null);
  $("start").disabled = !(operates && state === "Holding" && page.frame.start_waits_for == null);
  $("stop").disabled = state === "Fault" || state === "Idle";
  $("reset").disabled = state !== "Fault";
}

function draw() {
  requestAnimationFrame(draw);
  const frame = page.frame;
  if (!frame || frame === draw.last || page.socket?.readyState !== WebSocket.OPEN) return;
  draw.last = frame;
  page.isOperator = frame.operator === page.viewer;
  badge(frame.state, frame.state);
  if (!page.isOperator) choose(frame.chosen);
  if ($("waits").textContent !== waits(frame)) $("waits").textContent = waits(frame);
  $("chosen").textContent = `chosen: ${inWords(frame.chosen)}`;
  $("clock").textContent = `${frame.time_s.toFixed(1)} s` + (frame.course_s == null ? "" : `, course ${frame.course_s.toFixed(1)} s`);
  $("strategy-now").textContent = frame.state === "Moving"
    ? frame.strategy + (frame.fallback != null ? ` (took over: ${frame.fallback})` : "") : "";
  $("alarm").hidden = frame.cause == null;
  if (frame.cause != null) {
    $("alarm-code").textContent = frame.cause;
    $("alarm-advice").textContent = frame.advice;
  }
  $("role").textContent = page.isOperator ? "Give the operator's role back" : "Take the operator's role";
  $("role-now").textContent = page.isOperator ? "you operate" : frame.operator == null ? "no operator" : "somebody else operates";
  $("viewers").textContent = `${frame.viewers} viewer${frame.viewers === 1 ? "" : "s"}`;
  estimates(frame.estimated);
  $("missed").textContent = frame.missed ? `releases missed: simulation ${frame.missed[0]}, control ${frame.missed[1]}` : "";
  enable();
  const charts = page.charts;
  if (!charts) return;
  charts.draw();
  const bar = (name) => charts.latest(`${name}_bar`);
  if (frame.crane) {
    $("bending").textContent = `tip bent by ${frame.crane.deflection_mm.toFixed(1)} mm (simulated)`;
    picture.draw(frame.crane, { pa: bar("p_PA"), a: bar("p_A"), b: bar("p_B"), pb: bar("p_PB"), acc: bar("p_acc") });
  }
}

$("emergency").onclick = () => send("emergency-stop");
$("role").onclick = () => send(page.isOperator ? "leave-role" : "take-role");

// The course in the controls; none, with a message, if it is invalid.
function course() {
  if ($("motion").value !== "") return { scenario: $("motion").value };
  const speed = Number($("speed").value);
  if (speed > 0) return { speed_mm_s: speed };
  refuse("the speed is a positive number");
  return null;
}

$("start").onclick = () => {
  const wanted = course();
  if (wanted) send("start", { strategy: $("strategy").value, ...wanted });
};
$("stop").onclick = () => send("stop");
$("reset").onclick = () => {
  send("reset");
  setTimeout(() => {
    if (page.frame?.state === "Fault") refuse("not reset: something is still wrong");
  }, 1200);
};
$("strategy").onchange = () => send("strategy", { strategy: $("strategy").value });
$("motion").onchange = $("speed").onchange = () => {
  $("speed-label").hidden = $("motion").value !== "";
  const wanted = course();
  if (wanted) send("course", wanted);
};
$("inject").onclick = () => send("fault", { fault: $("fault").value });
$("mend").onclick = () => send("mend");
$("magnify").oninput = () => {
  picture.magnify = Number($("magnify").value);
  $("magnified").textContent = picture.magnify;
  draw.last = null;
};
document.addEventListener("keydown", (event) => {
  if (event.key === "Escape") {
    event.preventDefault();
    send("emergency-stop");
  }
});
setInterval(() => { if (page.isOperator) send("alive"); }, 300);
setInterval(() => {
  $("rate").textContent = `${page.frames} frames a second`;
  page.frames = 0;
}, 1000);
connect();
enable();
requestAnimationFrame(draw);
