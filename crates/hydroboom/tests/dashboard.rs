//! The dashboard, as programs and people meet it.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up has failed")]

mod support;

use serde_json::{Value, json};
use std::path::PathBuf;
use std::time::{Duration, Instant};
use support::browser::Browser;
use support::run::Run;
use tungstenite::Message;

/// Where pictures go: beside the tests' other products.
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
    // it moves on the picture, and the canvas is drawn on
    page.wait_for(&format!("{tip} > {low} + 0.3"));
    let inked = "(() => { const c = document.getElementById('crane'); const d = c.getContext('2d')\
                 .getImageData(0, 0, c.width, c.height).data; return d.some((v, k) => k % 4 === 3 && v > 0); })()";
    assert_eq!(page.value(inked), true);
    page.screenshot(&pictures().join("moving-light.png"), true);
    // another strategy on the way
    page.value(
        "(() => { const s = document.getElementById('strategy'); s.value = 'benchmark-closed-loop'; \
         s.dispatchEvent(new Event('change')); })()",
    );
    page.wait_for("page.frame.strategy === 'benchmark-closed-loop'");
    assert_eq!(page.text("state"), "Moving");
    // the key does what the button does, wherever the focus is
    page.press("Escape");
    page.wait_for("document.getElementById('state').textContent === 'Fault'");
    assert_eq!(page.text("alarm-code"), "emergency-stop");
    page.wait_for("document.getElementById('results').textContent.includes('emergency-stop')");
    page.screenshot(&pictures().join("emergency-light.png"), true);
    let rested = page.value(tip).as_f64().unwrap();
    page.click("reset");
    page.wait_for("document.getElementById('state').textContent === 'Holding'");
    assert!(page.value("document.getElementById('alarm').hidden").as_bool().unwrap());
    // and again, from where it stands
    page.click("start");
    page.wait_for(&format!("{tip} < {rested} - 0.2"));
    page.wait_for("page.frame.course_s >= 0");
    let (_, data) = run.get("/fault.csv", "");
    assert!(data.lines().count() > 900, "not a second of data:\n{}", data.len());
    assert!(data.trim_end().ends_with("false") && data.contains(",Fault,emergency-stop,"));
    let (head, report) = run.get("/report", "");
    assert!(head.starts_with("HTTP/1.1 200"), "{head}");
    assert!(report.contains("<svg") && report.contains("Tracking error"));
}

#[test]
fn it_can_be_used_by_keyboard_on_a_phone_in_the_dark() {
    let run = Run::start();
    let mut page = Browser::open(&run.address(), (390, 844), true, true);
    page.wait_for("document.getElementById('state').textContent === 'Ready'");
    page.tab_to("role");
    page.press("Enter");
    page.wait_for("document.getElementById('state').textContent === 'Holding'");
    page.tab_to("start");
    page.press("Enter");
    page.wait_for("page.frame.course_s > 3");
    // nothing is wider than the phone
    let width = page.value("document.documentElement.scrollWidth").as_f64().unwrap();
    assert!(width <= 390.0, "the page is {width} px wide");
    page.screenshot(&pictures().join("phone-dark.png"), true);
    page.tab_to("stop");
    page.press("Enter");
    page.wait_for("document.getElementById('state').textContent === 'Holding'");
    // the browser goes, and with it the operator: nothing moves, and so nothing is wrong
    drop(page);
    let mut viewer = run.viewer();
    viewer.wait_for_state("Ready");
}

#[test]
fn a_lost_viewer_stops_nothing_but_a_lost_operator_does() {
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
    // the operator is silent, but has not hung up: a page that hangs
    let mut watcher = run.viewer();
    let silent = Instant::now();
    let fault = watcher.wait_for_state("Fault");
    assert_eq!(fault["cause"], "operator-lost");
    assert!(silent.elapsed() > Duration::from_millis(500), "it was given no time");
    // who was silent operates no more; another one resets
    watcher.operate();
    watcher.command("reset", Value::Null);
    watcher.wait_for_state("Holding");
    // one that hangs up is gone at once
    watcher.command("start", json!({ "scenario": "small-moves", "strategy": FAST }));
    watcher.wait_for_state("Moving");
    drop(watcher);
    let mut last = run.viewer();
    assert_eq!(last.wait_for_state("Fault")["cause"], "operator-lost");
}

#[test]
fn anybody_with_the_token_may_stop_in_an_emergency_and_nobody_else() {
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
    // who guesses on is shown the door
    stranger.send(r#"{"command":"emergency-stop","token":"x"}"#);
    while stranger.next().is_some() {}
    assert_eq!(operator.wait_for(|m| m["type"] == "frame")["state"], "Holding");
    let mut other = run.viewer();
    other.command("emergency-stop", Value::Null);
    assert_eq!(operator.wait_for_state("Fault")["cause"], "emergency-stop");
}

#[test]
fn faults_are_injected_found_and_mended() {
    let run = Run::start();
    let mut operator = run.viewer();
    operator.operate();
    operator.wait_for_state("Holding");
    operator.command("fault", json!({ "fault": "p_A not a number" }));
    assert_eq!(operator.wait_for_state("Fault")["cause"], "not-a-number");
    // as long as it is broken no reset helps
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
fn strangers_pages_and_what_is_no_message_are_refused() {
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
        // it may have been closed before all are sent
        if flood.socket.send(Message::text(r#"{"command":"alive"}"#)).is_err() {
            break;
        }
    }
    while flood.next().is_some() {}
    // wrong speeds and names are answered, and nothing moves
    for (rest, reason) in [
        (json!({ "strategy": "magic" }), "no strategy"),
        (json!({ "strategy": FAST, "scenario": "none" }), "no start"),
        (json!({ "strategy": FAST, "speed_mm_s": 1e9 }), "no start"),
    ] {
        good.command("start", rest);
        let answer =
            good.wait_for(|m| m["type"] == "refused" || m["news"]["notices"][0].is_object());
        assert!(answer.to_string().contains(reason), "{answer}");
    }
    assert_eq!(good.wait_for(|m| m["type"] == "frame")["state"], "Holding");
    assert!(!run.said.lock().unwrap().contains("panicked"));
}
