//! Replay of a log.

use hydroboom_control::strategy::Strategy;
use hydroboom_control::supervision::fault::Cause;
use hydroboom_control::supervision::supervisor::State;
use hydroboom_description::Description;
use hydroboom_realtime::control_task::Record;
use hydroboom_realtime::fault::{Fault, Sensor};
use hydroboom_realtime::lockstep::Lockstep;
use hydroboom_realtime::log::{LogWriter, rows};
use hydroboom_realtime::operator::Operator;
use hydroboom_realtime::replay::replay;
use hydroboom_realtime::trouble::{Tampering, Trouble};

/// Course with its log, an optional fault at a time \[s\], and a press of the stop button at another.
fn logged(
    name: &str,
    wrong: Option<(Fault, f64)>,
    stop: f64,
) -> (Description, Vec<Record>, std::path::PathBuf) {
    let strategy = Strategy::SimulationFeedforwardClosedLoop;
    logged_with(name, strategy, wrong, stop)
}

fn logged_with(
    name: &str,
    strategy: Strategy,
    wrong: Option<(Fault, f64)>,
    stop: f64,
) -> (Description, Vec<Record>, std::path::PathBuf) {
    let model = Description::uia_single_boom().unwrap();
    let crane = Description::uia_virtual().unwrap();
    let motion = crane.motion(crane.numbers.fast);
    let mut run = Lockstep::new(&model, &crane, motion, strategy).unwrap();
    let (mut operator, mut trouble) = (Operator::automatic(1e-3), Trouble::new(&crane));
    let path = std::env::temp_dir().join(format!("hydroboom-{}-{name}.mcap", std::process::id()));
    let mut log = LogWriter::begin(&path).unwrap();
    let mut records = Vec::new();
    for k in 0..20_000 {
        let time = f64::from(k) * 1e-3;
        if let Some((fault, at)) = wrong
            && k == (at * 1e3) as i32
        {
            trouble.tamper(Tampering::Fault(fault));
        }
        operator.stop |= time > stop;
        let record = run.disturbed_period(&mut operator, strategy, &mut trouble).unwrap();
        trouble.pass();
        log.add(&record).unwrap();
        records.push(record);
        if operator.is_done() {
            break;
        }
    }
    log.finish().unwrap();
    (model, records, path)
}

#[test]
fn replayed_readings_lead_to_the_same_commands() {
    let (model, records, path) = logged("whole", None, 13.2);
    let rows = rows(&path).unwrap();
    std::fs::remove_file(path).unwrap();
    let again = replay(&model, &rows, None).unwrap();
    assert_eq!(again.len(), records.len());
    assert!(records.iter().any(|r| r.course_time.is_some_and(|t| t > 8.0)), "it did not move");
    for (then, now) in records.iter().zip(&again) {
        assert_eq!(then.decision.state, now.decision.state, "at {} s", then.time);
    }
    // the flow of a check valve is a square root near its opening point: a rounding error in a unit can
    // shift its opening by a step
    let apart = records.iter().zip(&again);
    let apart = apart.map(|(a, b)| a.decision.command.motor_speed - b.decision.command.motor_speed);
    let apart: Vec<f64> = apart.collect();
    let rms = (apart.iter().map(|d| d * d).sum::<f64>() / apart.len() as f64).sqrt();
    let speeds = records.iter().map(|r| r.decision.command.motor_speed.abs());
    let fastest = speeds.fold(0.0, f64::max);
    assert!(rms < 1e-3 * fastest, "{rms} of {fastest} rev/s");
    assert!(apart.iter().all(|d| d.abs() < 0.2));
    // another strategy decides differently
    let other = replay(&model, &rows, Some(Strategy::VelocityFeedforward)).unwrap();
    let differ = |(a, b): (&Record, &Record)| {
        (a.decision.command.motor_speed - b.decision.command.motor_speed).abs() > 0.1
    };
    assert!(again.iter().zip(&other).any(differ));
}

/// A log is replayed whole or up to its truncation. An empty log, or one damaged in between, is refused.
#[test]
fn an_empty_or_damaged_log_is_refused() {
    let (_, records, path) = logged("damaged", None, 2.0);
    let bytes = std::fs::read(&path).unwrap();
    let read = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        rows(&path).map(|rows| rows.len()).map_err(|e| e.to_string())
    };
    assert_eq!(read(&bytes), Ok(records.len()));
    let cut = read(&bytes[..bytes.len() / 2]).unwrap();
    assert!(cut > 0 && cut < records.len(), "{cut}");
    let message = read(&bytes[..8]).unwrap_err();
    assert!(message.contains("no control period"), "{message}");
    let mut damaged = bytes.clone();
    damaged[bytes.len() / 2] ^= 0x20;
    let message = read(&damaged).unwrap_err();
    assert!(
        message.contains("a replay needs every period") && message.contains("chunk"),
        "{message}"
    );
    // as a table it is read without the damaged part, which is reported
    let table = hydroboom_realtime::log::read(&path).unwrap();
    assert!(table.rows.len() > records.len() / 4 && table.rows.len() < records.len());
    assert!(table.remarks.iter().any(|r| r.contains("damaged")), "{:?}", table.remarks);
    read(&bytes[..bytes.len() / 2]).unwrap();
    let table = hydroboom_realtime::log::read(&path).unwrap();
    assert!(table.remarks.iter().any(|r| r.contains("cut off")), "{:?}", table.remarks);
    assert!(read(b"time,stroke").unwrap_err().contains("does not begin as an MCAP"));
    std::fs::remove_file(path).unwrap();
}

/// The same measurements give the same estimates and commands.
#[test]
fn a_replayed_run_gives_the_same_estimates() {
    let (model, records, path) = logged_with("estimated", Strategy::ScheduledLqr, None, 12.0);
    let rows = rows(&path).unwrap();
    std::fs::remove_file(path).unwrap();
    let again = replay(&model, &rows, None).unwrap();
    // estimated deficit of the pump's flow against the crane file, in motion
    let flow = |r: &Record| r.estimates.map_or(0.0, |e| e.state.unknown_flow);
    let largest = records.iter().map(|r| flow(r).abs()).fold(0.0, f64::max);
    assert!(largest > 0.1, "nothing estimated: {largest} rev/s");
    for (then, now) in records.iter().zip(&again) {
        let [a, b] = [then, now].map(flow);
        assert!((a - b).abs() < 0.02 * largest, "{b} for {a} rev/s at {} s", then.time);
        let [a, b] = [then, now].map(|r| r.decision.command.motor_speed);
        assert!((a - b).abs() < 0.2, "{b} for {a} rev/s at {} s", then.time);
    }
}

#[test]
fn a_replayed_fault_is_found_again() {
    let (model, records, path) =
        logged("fault", Some((Fault::Sensor(1, Sensor::NotANumber), 6.0)), f64::INFINITY);
    let rows = rows(&path).unwrap();
    std::fs::remove_file(path).unwrap();
    let found = |records: &[Record]| {
        let at = records.iter().position(|r| r.decision.state == State::Fault);
        at.map(|k| (k, records[k].decision.cause))
    };
    let then = found(&records);
    assert_eq!(then.and_then(|(_, cause)| cause), Some(Cause::NotANumber));
    assert_eq!(found(&replay(&model, &rows, None).unwrap()), then);
}
