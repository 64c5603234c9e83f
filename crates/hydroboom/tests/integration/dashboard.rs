//! Dashboard, as used by programs and people.

use crate::support::browser::Browser;
use crate::support::run::{PATIENCE, Run};
use serde_json::{Value, json};
use std::collections::VecDeque;
use std::io::Write;
use std::net::TcpStream;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use tungstenite::Message;

/// Folder of the screenshots, next to the tests' other products.
fn pictures() -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("dashboard");
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

const FAST: &str = "simulation-feedforward-closed-loop";

#[test]
fn a_course_is_run_from_the_page_and_stopped_in_an_emergency() {
    let run = Run::start();
    let mut page = Browser::open(&run.address(), (1400, 1100), false, false);
    page.wait_for("document.getElementById('state').textContent === 'Ready'");
    assert!(page.value("document.getElementById('commands').disabled").as_bool().unwrap());
    page.click("role");
    page.wait_for("document.getElementById('state').textContent === 'Holding'");
    page.click("start");
    page.wait_for("document.getElementById('state').textContent === 'Moving'");
    let tip = "page.frame.crane.boom[3][1]";
    let low = page.value(tip).as_f64().unwrap();
    // the tip moves in the picture, and the canvas is not empty
    page.wait_for(&format!("{tip} > {low} + 0.3"));
    let inked = "(() => { const c = document.getElementById('crane'); const d = c.getContext('2d')\
                 .getImageData(0, 0, c.width, c.height).data; return d.some((v, k) => k % 4 === 3 && v > 0); })()";
    assert_eq!(page.value(inked), true);
    page.screenshot(&pictures().join("moving-light.png"), true);
    // change of strategy during the course
    page.value(
        "(() => { const s = document.getElementById('strategy'); s.value = 'benchmark-closed-loop'; \
         s.dispatchEvent(new Event('change')); })()",
    );
    page.wait_for("page.frame.strategy === 'benchmark-closed-loop'");
    assert_eq!(page.text("state"), "Moving");
    // the key acts like the button, wherever the focus is
    page.press("Escape");
    page.wait_for("document.getElementById('state').textContent === 'Fault'");
    assert_eq!(page.text("alarm-code"), "emergency-stop");
    page.wait_for("document.getElementById('results').textContent.includes('emergency-stop')");
    page.screenshot(&pictures().join("emergency-light.png"), true);
    let rested = page.value(tip).as_f64().unwrap();
    page.click("reset");
    page.wait_for("document.getElementById('state').textContent === 'Holding'");
    assert!(page.value("document.getElementById('alarm').hidden").as_bool().unwrap());
    // a second start from the present position
    page.click("start");
    page.wait_for(&format!("{tip} < {rested} - 0.2"));
    page.wait_for("page.frame.course_s >= 0");
    let (_, data) = run.get("/fault.csv", "");
    assert!(data.lines().count() > 900, "not a second of data:\n{}", data.len());
    let column = |name: &str| data.lines().next()?.split(',').position(|column| column == name);
    let last = |name: &str| data.lines().last()?.split(',').nth(column(name)?);
    let names = ["state", "cause", "fallback", "fallback_cause"];
    assert_eq!(names.map(last), ["Fault", "emergency-stop", "false", ""].map(Some));
    let (head, report) = run.get("/report", "");
    assert!(head.starts_with("HTTP/1.1 200"), "{head}");
    assert!(report.contains("<svg") && report.contains("Tracking error"));
}

#[test]
fn the_page_works_by_keyboard_on_a_phone_and_in_dark_mode() {
    let run = Run::start();
    let mut page = Browser::open(&run.address(), (390, 844), true, true);
    page.wait_for("document.getElementById('state').textContent === 'Ready'");
    page.tab_to("role");
    page.press("Enter");
    page.wait_for("document.getElementById('state').textContent === 'Holding'");
    page.tab_to("start");
    page.press("Enter");
    page.wait_for("page.frame.course_s > 3");
    // nothing is wider than the phone's screen
    let width = page.value("document.documentElement.scrollWidth").as_f64().unwrap();
    assert!(width <= 390.0, "the page is {width} px wide");
    page.screenshot(&pictures().join("phone-dark.png"), true);
    page.tab_to("stop");
    page.press("Enter");
    page.wait_for("document.getElementById('state').textContent === 'Holding'");
    // the browser ends, and with it the operator's presence: nothing moves, so that there is no fault
    drop(page);
    let mut viewer = run.viewer();
    viewer.wait_for_state("Ready");
}

#[test]
fn a_lost_operator_stops_the_motion_and_a_lost_viewer_does_not() {
    let run = Run::start();
    let mut operator = run.viewer();
    operator.operate();
    operator.wait_for_state("Holding");
    operator.command("start", json!({ "strategy": FAST }));
    operator.wait_for_state("Moving");
    let mut other = run.viewer();
    other.command("take-role", Value::Null);
    let refused = other.wait_for(|m| m["type"] == "refused");
    assert_eq!(refused["reason"], "somebody else operates");
    other.command("stop", Value::Null);
    assert!(
        other.wait_for(|m| m["type"] == "refused")["reason"].as_str().unwrap().contains("operator")
    );
    drop(other);
    let now = operator.wait_for(|m| m["type"] == "frame" && m["viewers"] == 1);
    assert_eq!(now["state"], "Moving");
    // the operator is silent with an open connection, as with a page that hangs
    let mut watcher = run.viewer();
    let silent = Instant::now();
    let fault = watcher.wait_for_state("Fault");
    assert_eq!(fault["cause"], "operator-lost");
    assert!(silent.elapsed() > Duration::from_millis(500), "it was given no time");
    // the silent operator has lost the role; another one resets
    watcher.operate();
    watcher.command("reset", Value::Null);
    watcher.wait_for_state("Holding");
    // a closed connection ends the operator's presence at once
    watcher.command("start", json!({ "scenario": "small-moves", "strategy": FAST }));
    watcher.wait_for_state("Moving");
    drop(watcher);
    let mut last = run.viewer();
    assert_eq!(last.wait_for_state("Fault")["cause"], "operator-lost");
}

#[test]
fn only_viewers_with_the_token_may_stop_in_an_emergency() {
    let run = Run::start();
    let mut operator = run.viewer();
    operator.operate();
    operator.wait_for_state("Holding");
    let mut stranger = run.viewer();
    for _ in 0..4 {
        stranger.send(r#"{"command":"emergency-stop","token":"0123456789abcdef0123456789abcdef"}"#);
        assert!(
            stranger.wait_for(|m| m["type"] == "refused")["reason"]
                .as_str()
                .unwrap()
                .contains("token")
        );
    }
    // repeated guesses close the connection
    stranger.send(r#"{"command":"emergency-stop","token":"x"}"#);
    while stranger.next().is_some() {}
    assert_eq!(operator.wait_for(|m| m["type"] == "frame")["state"], "Holding");
    let mut other = run.viewer();
    other.command("emergency-stop", Value::Null);
    assert_eq!(operator.wait_for_state("Fault")["cause"], "emergency-stop");
}

#[test]
fn a_start_of_a_departed_operator_has_no_effect() {
    let run = Run::start();
    let mut first = run.viewer();
    first.operate();
    first.wait_for_state("Holding");
    first.command("emergency-stop", Value::Null);
    first.wait_for_state("Fault");
    // during a fault, and before the load is held
    first.command("start", json!({ "strategy": FAST }));
    let notice = |m: &Value| m["news"]["notices"].to_string();
    first.wait_for(|m| {
        notice(m).contains("no start: the machine is in Fault and waits for a reset")
    });
    first.command("reset", Value::Null);
    first.wait_for_state("Ready");
    first.command("start", json!({ "strategy": FAST }));
    first.wait_for(|m| notice(m).contains("no start: the machine is in Ready and waits for"));
    drop(first);
    let mut second = run.viewer();
    second.operate();
    second.wait_for_state("Holding");
    let begun = Instant::now();
    second.wait_for(|m| {
        assert!(m["type"] != "frame" || m["state"] == "Holding", "{}", m["state"]);
        for sample in m["samples"].as_array().into_iter().flatten() {
            // the eleventh entry is the commanded speed
            assert!(m["type"] != "frame" || sample[10] == 0.0, "{sample}");
        }
        begun.elapsed() > Duration::from_secs(4)
    });
    // and a request of the second operator is executed
    second.command("start", json!({ "strategy": FAST }));
    second.wait_for_state("Moving");
}

/// Connections that send no request, or an incomplete one.
struct HalfOpen<'a> {
    host: &'a str,
    count: usize,
    open: VecDeque<TcpStream>,
}

impl<'a> HalfOpen<'a> {
    fn new(host: &'a str) -> Self {
        Self { host, count: 0, open: VecDeque::new() }
    }

    fn add(&mut self) {
        let mut stream = TcpStream::connect(self.host).unwrap();
        self.count += 1;
        if self.count.is_multiple_of(2) {
            // the server may have closed it already
            let _ = write!(stream, "GET /live HTTP/1.1\r\nHost: {}\r\n", self.host);
        }
        self.open.push_back(stream);
        // the test itself has a limited number of descriptors
        if self.open.len() > 900 {
            self.open.pop_front();
        }
    }
}

#[test]
fn half_open_connections_do_not_block_new_ones() {
    // the process has fewer descriptors than there are connections
    let run = Run::start_with_descriptors(512);
    let mut operator = run.viewer();
    operator.operate();
    operator.wait_for_state("Holding");
    let mut half_open = HalfOpen::new(&run.host);
    (0..1100).for_each(|_| half_open.add());
    // 128 idle connections, the operator, and the process's own descriptors
    let descriptors = run.descriptors();
    assert!(descriptors < 200, "{descriptors} descriptors");
    // and further connections arrive
    let (is_over, begun) = (AtomicBool::new(false), Instant::now());
    std::thread::scope(|scope| {
        scope.spawn(|| {
            while !is_over.load(Ordering::Relaxed) && begun.elapsed() < PATIENCE {
                half_open.add();
            }
        });
        let mut other = run.viewer();
        other.command("emergency-stop", Value::Null);
        let fault = other.wait_for_state("Fault");
        is_over.store(true, Ordering::Relaxed);
        assert_eq!(fault["cause"], "emergency-stop");
        assert!(begun.elapsed() < Duration::from_secs(2), "after {:?}", begun.elapsed());
    });
    // earlier viewers stay connected, and pages are served
    assert_eq!(operator.wait_for_state("Fault")["cause"], "emergency-stop");
    assert!(run.get("/", "").0.starts_with("HTTP/1.1 200"));
    assert!(!run.printed.lock().unwrap().contains("the dashboard ends"));
}

#[test]
fn the_page_starts_with_the_options_and_shows_all_the_last_choice() {
    let run = Run::start_with(&["--strategy", "scheduled-lqr", "--scenario", "reversal"]);
    let mut page = Browser::open(&run.address(), (1280, 1000), false, false);
    page.wait_for("document.getElementById('chosen').textContent !== ''");
    let controls = "[document.getElementById('strategy').value, document.getElementById('motion').value].join()";
    assert_eq!(page.value(controls), "scheduled-lqr,reversal");
    assert_eq!(page.text("chosen"), "chosen: scheduled-lqr, reversal");
    // without the operator's role no start is possible, and the page states the reason
    assert!(page.value("document.getElementById('start').disabled").as_bool().unwrap());
    page.wait_for(
        "document.getElementById('waits').textContent.startsWith('a start waits for an operator')",
    );
    // the choice of another operator is shown on this page
    let mut operator = run.viewer();
    operator.operate();
    operator.wait_for_state("Holding");
    operator.command("strategy", json!({ "strategy": "benchmark-closed-loop" }));
    operator.command("course", json!({ "speed_mm_s": 33.0 }));
    operator.command("course", json!({ "scenario": "none" }));
    assert!(
        operator.wait_for(|m| m["type"] == "refused")["reason"].to_string().contains("reversal")
    );
    page.wait_for(
        "document.getElementById('chosen').textContent.endsWith('out and back at 33 mm/s')",
    );
    assert_eq!(page.value(controls), "benchmark-closed-loop,");
    assert_eq!(page.value("document.getElementById('speed').value"), "33");
    assert!(page.value("document.getElementById('start').disabled").as_bool().unwrap());
    drop(operator);
    // a later operator continues with this choice, and a later viewer sees it
    page.wait_for("!document.getElementById('role').disabled");
    page.click("role");
    page.wait_for("!document.getElementById('start').disabled");
    assert_eq!(page.text("waits"), "a course can be started");
    assert_eq!(page.value("page.frame.waiting"), "a start");
    assert_eq!(page.value("page.frame.waiting_s >= 0"), true);
    let mut late = run.viewer_from(None).unwrap();
    let seen = late.wait_for(|m| m["type"] == "frame");
    assert_eq!(
        seen["chosen"],
        json!({ "strategy": "benchmark-closed-loop", "speed_mm_s": 33.0, "scenario": null })
    );
    page.screenshot(&pictures().join("ready-light.png"), true);
    page.click("start");
    page.wait_for("page.frame.state === 'Moving'");
    assert_eq!(page.value("page.frame.strategy"), "benchmark-closed-loop");
    // the estimator runs under every strategy: values with standard deviations, and curves with bands
    page.wait_for("page.frame.course_s > 2.5");
    let table = page.text("estimated");
    assert!(table.contains("payload") && table.contains("transition pressure"), "{table}");
    let band = "(() => { const data = page.charts.list.find((c) => c.holder.id === 'chart-payload').plot.data; \
                const k = data[2].length - 1; return [1, 2, 3].map((s) => data[s][k]); })()";
    let band = page.value(band);
    assert!([0, 1, 2].iter().all(|k| band[*k].is_number()), "{band}");
    let [estimated, high, low] = [0, 1, 2].map(|k| band[k].as_f64().unwrap());
    assert!(low < estimated && estimated < high && (low..high).contains(&316.0), "{band}");
    page.screenshot(&pictures().join("estimates-light.png"), true);
    // a frame is drawn with a delay
    page.wait_for(
        "document.getElementById('waits').textContent.startsWith('a start waits for the end of the course')",
    );
}

#[test]
fn faults_are_injected_detected_and_cleared() {
    let run = Run::start();
    let mut operator = run.viewer();
    operator.operate();
    operator.wait_for_state("Holding");
    operator.command("fault", json!({ "fault": "p_A not a number" }));
    assert_eq!(operator.wait_for_state("Fault")["cause"], "not-a-number");
    // while the fault persists, a reset has no effect
    operator.command("reset", Value::Null);
    let begun = Instant::now();
    operator.wait_for(|m| {
        assert!(m["type"] != "frame" || m["state"] == "Fault", "{m}");
        begun.elapsed() > Duration::from_millis(500)
    });
    operator.command("mend", Value::Null);
    std::thread::sleep(Duration::from_millis(300));
    operator.command("reset", Value::Null);
    operator.wait_for_state("Holding");
}

#[test]
fn foreign_pages_and_malformed_messages_are_refused() {
    let run = Run::start();
    assert!(run.viewer_from(Some("http://evil.example")).is_err());
    assert!(run.viewer_from(Some(&format!("http://{}", run.host))).is_ok());
    let (head, _) = run.get("/", "Origin: http://evil.example\r\n");
    assert!(head.starts_with("HTTP/1.1 403"), "{head}");
    let (head, _) = run.get("/", "Host: evil.example\r\n");
    assert!(head.starts_with("HTTP/1.1 403"), "{head}");
    let (head, body) = run.get("/", "");
    assert!(head.starts_with("HTTP/1.1 200") && head.contains("content-security-policy"), "{head}");
    assert!(!body.contains(&run.token) && !body.contains("https://"), "the page needs nobody else");
    let (head, _) = run.get("/../../etc/passwd", "");
    assert!(head.starts_with("HTTP/1.1 404"), "{head}");

    let mut good = run.viewer();
    good.operate();
    good.wait_for_state("Holding");
    let long = format!(r#"{{"command":"start","token":"{}"}}"#, "x".repeat(10_000));
    for text in ["", "{", "[1,2", r#"{"command":"open-sesame"}"#, "\u{0}", &long] {
        let mut bad = run.viewer();
        bad.send(text);
        while bad.next().is_some() {}
    }
    let mut bad = run.viewer();
    bad.socket.send(Message::binary(vec![1, 2, 3])).unwrap();
    while bad.next().is_some() {}
    let mut flood = run.viewer();
    for _ in 0..300 {
        // the connection may be closed before all messages are sent
        if flood.socket.send(Message::text(r#"{"command":"alive"}"#)).is_err() {
            break;
        }
    }
    while flood.next().is_some() {}
    // invalid speeds and names get an answer, and nothing moves
    for (rest, reason) in [
        (json!({ "strategy": "magic" }), "no such strategy"),
        (json!({ "strategy": FAST, "scenario": "none" }), "no scenario"),
        (json!({ "strategy": FAST, "speed_mm_s": 1e9 }), "mm/s: it is"),
    ] {
        good.command("start", rest);
        let answer =
            good.wait_for(|m| m["type"] == "refused" || m["news"]["notices"][0].is_object());
        assert!(answer.to_string().contains(reason), "{answer}");
    }
    assert_eq!(good.wait_for(|m| m["type"] == "frame")["state"], "Holding");
    assert!(!run.printed.lock().unwrap().contains("panicked"));
}
