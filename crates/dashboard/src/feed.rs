//! Data for the viewers: written by the session's thread, sent thirty times a second by the server's.

use crate::choice::Choice;
use crate::scene::{Scene, shorter};
use hydroboom_control::estimation::reduced_model::MachineState;
use hydroboom_control::estimation::tip::TipEstimate;
use hydroboom_realtime::control_task::{Deadlines, Estimates, Fallback, Record};
use hydroboom_realtime::log;
use hydroboom_realtime::readiness::start_waits_for;
use hydroboom_realtime::session::FaultData;
use serde_json::{Value, json};
use std::collections::VecDeque;

/// Records per sample: 10 ms at a control period of 1 ms, the resolution of a chart of twenty seconds.
const EVERY: u32 = 10;
/// Samples sent to a new viewer: thirty seconds.
const HISTORY: usize = 3000;
/// Samples kept for the next frame: at most one second. More arrive only while no frame can be sent.
const WAITING: usize = 100;
/// Number of alarms, results and notices that are kept.
const KEPT: usize = 20;

/// Names of the numbers in a sample, in order.
pub(crate) const SAMPLE: [&str; 28] = [
    "time_s",
    "reference_mm",
    "stroke_mm",
    "simulated_mm",
    "error_mm",
    "p_PA_bar",
    "p_A_bar",
    "p_B_bar",
    "p_PB_bar",
    "p_acc_bar",
    "command_rpm",
    "motor_rpm",
    "simulation_execution_us",
    "control_execution_us",
    "simulation_late_us",
    "control_late_us",
    "estimated_payload_kg",
    "deviation_payload_kg",
    "estimated_transition_pressure_bar",
    "deviation_transition_pressure_bar",
    "estimated_disturbance_bar",
    "deviation_disturbance_bar",
    "estimated_tip_y_mm",
    "deviation_tip_y_mm",
    "innovation_position_mm",
    "deviation_innovation_position_mm",
    "innovation_load_pressure_bar",
    "deviation_innovation_load_pressure_bar",
];

/// Data for the viewers.
pub(crate) struct Feed {
    last: Option<Record>,
    /// Worst execution time and release delay since the last sample.
    worst: Deadlines,
    count: u32,
    history: VecDeque<Value>,
    waiting: Vec<Value>,
    alarms: VecDeque<Value>,
    results: VecDeque<Value>,
    notices: VecDeque<Value>,
    /// Count of alarms, results and notices; a frame carries only those that are new.
    news: u64,
    sent: u64,
    /// Current selection: first the program's arguments, then the operator's.
    pub(crate) chosen: Choice,
    /// HTML report of the last course.
    pub(crate) report: Option<String>,
    /// Records of the last second before the last fault, as CSV.
    pub(crate) fault_data: Option<String>,
}

impl Feed {
    pub(crate) fn new(chosen: Choice) -> Self {
        Self {
            last: None,
            worst: Deadlines::default(),
            count: 0,
            history: VecDeque::with_capacity(HISTORY),
            waiting: Vec::new(),
            alarms: VecDeque::new(),
            results: VecDeque::new(),
            notices: VecDeque::new(),
            news: 0,
            sent: 0,
            chosen,
            report: None,
            fault_data: None,
        }
    }

    pub(crate) fn see(&mut self, record: &Record) {
        if let Some(d) = record.deadlines {
            let w = &mut self.worst;
            w.control_late = w.control_late.max(d.control_late);
            w.control_execution = w.control_execution.max(d.control_execution);
            w.simulation_late = w.simulation_late.max(d.simulation_late);
            w.simulation_execution = w.simulation_execution.max(d.simulation_execution);
        }
        self.last = Some(*record);
        self.count += 1;
        if !self.count.is_multiple_of(EVERY) {
            return;
        }
        let sample = sample(record, &self.worst);
        self.worst = Deadlines::default();
        self.history.push_back(sample.clone());
        if self.history.len() > HISTORY {
            self.history.pop_front();
        }
        if self.waiting.len() < WAITING {
            self.waiting.push(sample);
        }
    }

    fn keep(list: &mut VecDeque<Value>, what: Value) {
        list.push_back(what);
        if list.len() > KEPT {
            list.pop_front();
        }
    }

    fn time(&self) -> f64 {
        self.last.map_or(0.0, |r| shorter(r.time))
    }

    pub(crate) fn alarm(&mut self, fault: &FaultData) {
        self.fault_data = Some(log::csv(&fault.records));
        let alarm = json!({
            "time_s": shorter(fault.time), "code": fault.cause.code(), "advice": fault.cause.advice(),
        });
        Self::keep(&mut self.alarms, alarm);
        self.news += 1;
    }

    pub(crate) fn result(&mut self, result: &Value) {
        Self::keep(&mut self.results, result.clone());
        self.news += 1;
    }

    pub(crate) fn say(&mut self, text: &str) {
        let notice = json!({ "time_s": self.time(), "text": text });
        Self::keep(&mut self.notices, notice);
        self.news += 1;
    }

    /// History for a new viewer.
    pub(crate) fn past(&self) -> Value {
        json!({ "type": "past", "names": SAMPLE, "samples": self.history, "news": self.all_news() })
    }

    fn all_news(&self) -> Value {
        json!({
            "alarms": self.alarms, "results": self.results, "notices": self.notices,
            "has_report": self.report.is_some(), "has_fault_data": self.fault_data.is_some(),
        })
    }

    /// The next frame for all viewers; `None` before the first record.
    pub(crate) fn frame(
        &mut self,
        scene: &Scene,
        operator: Option<u64>,
        viewers: usize,
    ) -> Option<Value> {
        let r = self.last?;
        let cause = r.decision.cause;
        let mut frame = json!({
            "type": "frame", "time_s": self.time(), "state": r.decision.state.name(),
            "cause": cause.map(|c| c.code()), "advice": cause.map(|c| c.advice()),
            "start_waits_for": start_waits_for(&r.decision, operator.is_some()),
            "waiting": r.decision.waiting.text(), "waiting_s": shorter(r.decision.waited),
            "oscillation": r.decision.oscillation.map(|[amplitude, hz]| [shorter(amplitude * 1e3), shorter(hz)]),
            "chosen": self.chosen.json(), "strategy": r.strategy.name(), "fallback": r.fallback.map(Fallback::name),
            "course_s": r.course_time.map(shorter), "valve": r.decision.command.holding_valve,
            "estimated": r.estimates.as_ref().map(estimated),
            "missed": r.deadlines.map(|d| [d.simulation_missed, d.control_missed]),
            "crane": r.simulated.map(|s| scene.drawn(&s.angle, r.signals().stroke)),
            "simulated_failed": r.simulated.is_none_or(|s| s.failed),
            "samples": std::mem::take(&mut self.waiting), "operator": operator, "viewers": viewers,
        });
        if self.sent != self.news {
            self.sent = self.news;
            frame["news"] = self.all_news();
        }
        Some(frame)
    }
}

/// Current estimates, each with its standard deviation.
fn estimated(e: &Estimates) -> Value {
    let both = |of: fn(&MachineState<f64>) -> f64| [of(&e.state), of(&e.deviation)].map(shorter);
    json!({
        "payload_kg": both(|z| z.payload),
        "transition_pressure_bar": both(|z| z.transition_pressure * 1e-5),
        "disturbance_bar": both(|z| z.disturbance * 1e-5),
        "unknown_flow_rpm": both(|z| z.unknown_flow * 60.0),
        "velocity_mm_s": both(|z| z.velocity * 1e3),
        "tip_x_mm": e.tip.map(|tip| [tip.x, tip.deviation_x].map(|m| shorter(m * 1e3))),
        "tip_y_mm": e.tip.map(|tip| [tip.y, tip.deviation_y].map(|m| shorter(m * 1e3))),
        "drive_lag_ms": shorter(e.drive_lag * 1e3), "mean_nis": shorter(e.mean_nis),
    })
}

/// The numbers of a sample in the order of [`SAMPLE`]; null where a value is missing.
fn sample(r: &Record, worst: &Deadlines) -> Value {
    let some = |value: f64| value.is_finite().then(|| (value * 1e3).round() * 1e-3);
    let bar = |pascal: f64| some(pascal * 1e-5);
    let estimates = |of: fn(&Estimates) -> f64| r.estimates.as_ref().and_then(|e| some(of(e)));
    let tip = |of: fn(&TipEstimate<f64>) -> f64| {
        r.estimates.and_then(|e| e.tip).and_then(|tip| some(of(&tip) * 1e3))
    };
    let us = |nanoseconds: u64| r.deadlines.and_then(|_| some(nanoseconds as f64 * 1e-3));
    json!([
        some(r.time),
        r.course_time.and_then(|_| some(r.reference.position * 1e3)),
        some(r.signals().stroke * 1e3),
        r.simulated.and_then(|s| some(s.axis().stroke * 1e3)),
        r.error().and_then(|e| some(e * 1e3)),
        bar(r.signals().pressure_pump_a),
        bar(r.signals().pressure_a),
        bar(r.signals().pressure_b),
        bar(r.signals().pressure_pump_b),
        bar(r.signals().pressure_accumulator),
        some(r.decision.command.motor_speed * 60.0),
        some(r.signals().motor_speed * 60.0),
        us(worst.simulation_execution),
        us(worst.control_execution),
        us(worst.simulation_late),
        us(worst.control_late),
        estimates(|e| e.state.payload),
        estimates(|e| e.deviation.payload),
        estimates(|e| e.state.transition_pressure * 1e-5),
        estimates(|e| e.deviation.transition_pressure * 1e-5),
        estimates(|e| e.state.disturbance * 1e-5),
        estimates(|e| e.deviation.disturbance * 1e-5),
        tip(|tip| tip.y),
        tip(|tip| tip.deviation_y),
        estimates(|e| e.innovation[0] * 1e3),
        estimates(|e| e.innovation_deviation[0] * 1e3),
        estimates(|e| e.innovation[1] * 1e-5),
        estimates(|e| e.innovation_deviation[1] * 1e-5),
    ])
}
