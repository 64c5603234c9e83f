//! Idle, slow and excess connections leave the page reachable for others.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up has failed")]

use hydroboom_control::strategy::Strategy;
use hydroboom_dashboard::{Choice, Course, Dashboard, Setup};
use hydroboom_description::Description;
use hydroboom_realtime::control_task::Record;
use hydroboom_realtime::desk::Desk;
use hydroboom_realtime::lockstep::Lockstep;
use hydroboom_realtime::operator::Operator;
use serde_json::{Value, json};
use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tungstenite::client::IntoClientRequest;
use tungstenite::{Message, WebSocket};

/// Time limit for every exchange of the tests.
const PATIENCE: Duration = Duration::from_secs(60);
/// Places for viewers, and how many of them are reserved for viewers with the token.
const PLACES: usize = 32;
const WITH_TOKEN: usize = 8;

/// A dashboard on a free port, and its desk.
struct Served {
    dashboard: Dashboard,
    desk: Arc<Desk>,
    host: String,
    token: String,
}

impl Served {
    fn new() -> Self {
        let model = Description::uia_single_boom().unwrap();
        let strategy = Strategy::BenchmarkClosedLoop;
        let desk = Arc::new(Desk::new(strategy));
        let setup = Setup {
            model: &model,
            scenarios: vec!["reversal".into()],
            speeds_mm_s: 0.1..=240.0,
            first: Choice { strategy, course: Course::Motion { speed_mm_s: 25.0 } },
            is_virtual: true,
            in_real_time: false,
        };
        let listen = "127.0.0.1:0".parse().unwrap();
        let dashboard = Dashboard::open(listen, false, &setup, Arc::clone(&desk)).unwrap();
        let rest = dashboard.address().strip_prefix("http://").unwrap();
        let (host, token) = rest.split_once("/#").unwrap();
        let (host, token) = (host.to_string(), token.to_string());
        Self { dashboard, desk, host, token }
    }

    fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(&self.host).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        stream
    }

    /// Connects a viewer, if there is a place for it.
    fn viewer(&self, has_token: bool) -> Option<Viewer> {
        let token = has_token.then_some(self.token.as_str());
        viewer(self.connect(), &self.host, token)
    }

    fn is_emergency(&self) -> bool {
        let mut operator = Operator::new(1e-3);
        operator.listen(&self.desk);
        operator.emergency
    }

    fn wait_for_emergency(&self) {
        let begun = Instant::now();
        while !self.is_emergency() {
            assert!(begun.elapsed() < PATIENCE, "no emergency stop has come");
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    fn emergency_stop(&self) -> String {
        json!({ "command": "emergency-stop", "token": self.token }).to_string()
    }
}

type Viewer = WebSocket<TcpStream>;

fn viewer(stream: TcpStream, host: &str, token: Option<&str>) -> Option<Viewer> {
    let mut request = format!("ws://{host}/live").into_client_request().unwrap();
    let protocols = token.map_or("hydroboom".into(), |token| format!("hydroboom, {token}"));
    request.headers_mut().insert("Sec-WebSocket-Protocol", protocols.parse().unwrap());
    match tungstenite::client(request, stream) {
        Ok((socket, answer)) => {
            // the server does not send the token back
            assert_eq!(answer.headers()["Sec-WebSocket-Protocol"], "hydroboom");
            Some(socket)
        }
        Err(error) => {
            assert!(error.to_string().contains("503"), "{error}");
            None
        }
    }
}

/// The next text message, unless the connection has ended.
fn next(viewer: &mut Viewer) -> Option<Value> {
    loop {
        match viewer.read() {
            Ok(Message::Text(text)) => return serde_json::from_str(&text).ok(),
            Ok(Message::Close(_)) | Err(_) => return None,
            Ok(_) => {}
        }
    }
}

/// Close code of a connection, where the server has sent one.
fn ending(viewer: &mut Viewer) -> Option<u16> {
    loop {
        match viewer.read() {
            Ok(Message::Close(frame)) => return frame.map(|frame| frame.code.into()),
            Ok(_) => {}
            Err(_) => return None,
        }
    }
}

/// A record, without which there are no frames.
fn record() -> Record {
    let model = Description::uia_single_boom().unwrap();
    let motion = model.motion(model.numbers.fast);
    let strategy = Strategy::BenchmarkClosedLoop;
    let mut run = Lockstep::new(&model, &model, motion, strategy).unwrap();
    run.period(&mut Operator::new(1e-3), strategy).unwrap()
}

#[test]
fn an_incomplete_request_is_closed() {
    let served = Served::new();
    let mut silent = served.connect();
    let mut half = served.connect();
    write!(half, "GET / HTTP/1.1\r\nHost: {}\r\nAcc", served.host).unwrap();
    // single bytes in between do not extend the time limit
    let mut slow = served.connect();
    slow.set_read_timeout(Some(Duration::from_millis(200))).unwrap();
    let begun = Instant::now();
    let mut answer = Vec::new();
    while begun.elapsed() < PATIENCE {
        let _ = slow.write_all(b"G");
        match slow.read_to_end(&mut answer) {
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
            _ => break,
        }
    }
    for stream in [&mut silent, &mut half] {
        // the server closes or resets the connection: this is no time-out of the test
        let end = stream.read_to_end(&mut answer);
        assert!(end.is_ok_and(|count| count == 0));
    }
    assert!(begun.elapsed() >= Duration::from_secs(4), "it was given no time");
    assert!(begun.elapsed() < PATIENCE, "it is not closed");
}

#[test]
fn of_fifty_simultaneous_viewers_as_many_as_places_are_admitted() {
    for (has_token, expected) in [(false, PLACES - WITH_TOKEN), (true, PLACES)] {
        let served = Served::new();
        let (host, token) = (&served.host, has_token.then_some(served.token.as_str()));
        let streams: Vec<TcpStream> = (0..50).map(|_| served.connect()).collect();
        let mut viewers: Vec<Option<Viewer>> = std::thread::scope(|scope| {
            let come = |stream| scope.spawn(move || viewer(stream, host, token));
            let coming: Vec<_> = streams.into_iter().map(come).collect();
            coming.into_iter().map(|viewer| viewer.join().unwrap()).collect()
        });
        // viewers with the token got in; the last of them replaced the first
        let inside = all_at_once(viewers.iter_mut().flatten());
        assert_eq!(inside, expected, "with the token: {has_token}");
        assert_eq!(viewers.iter().flatten().count(), if has_token { 50 } else { expected });
    }
}

/// Number of viewers that were admitted.
fn all_at_once<'a>(viewers: impl Iterator<Item = &'a mut Viewer>) -> usize {
    std::thread::scope(|scope| {
        let looking: Vec<_> = viewers.map(|viewer| scope.spawn(|| is_inside(viewer))).collect();
        looking.into_iter().map(|is| usize::from(is.join().unwrap())).sum()
    })
}

/// Whether a new viewer receives setup and history, and stays connected.
fn is_inside(viewer: &mut Viewer) -> bool {
    next(viewer).is_some() && next(viewer).is_some() && is_open(viewer)
}

/// Whether the connection is open and silent: there are no frames before the first record.
fn is_open(viewer: &mut Viewer) -> bool {
    viewer.get_ref().set_read_timeout(Some(Duration::from_millis(300))).unwrap();
    let begun = Instant::now();
    while begun.elapsed() < Duration::from_millis(300) {
        match viewer.read() {
            Ok(Message::Ping(_)) => {}
            Err(tungstenite::Error::Io(error)) => {
                return matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut);
            }
            _ => return false,
        }
    }
    true
}

#[test]
fn a_full_server_admits_the_token_and_never_drops_the_operator() {
    let served = Served::new();
    // the operator is the oldest viewer
    let mut operator = served.viewer(true).unwrap();
    let take = json!({ "command": "take-role", "token": served.token }).to_string();
    operator.send(Message::text(take)).unwrap();
    let mut lookers: Vec<Viewer> = std::iter::from_fn(|| served.viewer(false)).collect();
    assert_eq!(lookers.len(), PLACES - WITH_TOKEN);
    let mut others: Vec<Viewer> =
        (0..PLACES - lookers.len() - 1).map(|_| served.viewer(true).unwrap()).collect();
    while !served.desk.is_attended() {
        std::thread::sleep(Duration::from_millis(1));
    }
    // one more viewer: the oldest without the token is displaced, with the reason
    others.push(served.viewer(true).unwrap());
    assert_eq!(ending(&mut lookers[0]), Some(4001));
    assert!(served.viewer(false).is_none());
    let mut last = others.pop().unwrap();
    last.send(Message::text(served.emergency_stop())).unwrap();
    served.wait_for_emergency();
    let alive = || Message::text(json!({ "command": "alive" }).to_string());
    operator.send(alive()).unwrap();
    assert_eq!(next(&mut operator).unwrap()["type"], "setup");
    // a released place is free for the next viewer
    drop(lookers);
    let begun = Instant::now();
    while served.viewer(false).is_none() {
        assert!(begun.elapsed() < PATIENCE);
    }
}

#[test]
fn a_viewer_that_reads_no_frames_can_still_stop_the_machine() {
    let mut served = Served::new();
    let mut slow = served.viewer(true).unwrap();
    let mut good = served.viewer(true).unwrap();
    served.dashboard.see(&record());
    // more than the socket buffers hold
    for _ in 0..12 {
        served.dashboard.say(&"x".repeat(1_000_000));
    }
    // a viewer that reads its messages shows that they were sent
    let count = |m: &Value| m["news"]["notices"].as_array().map(Vec::len);
    while next(&mut good).is_none_or(|m| count(&m) != Some(12)) {}
    std::thread::sleep(Duration::from_millis(500));
    slow.send(Message::text(served.emergency_stop())).unwrap();
    let sent = Instant::now();
    served.wait_for_emergency();
    assert!(sent.elapsed() < Duration::from_secs(2), "it waited for what is sent to it");
}

#[test]
fn only_a_viewer_that_answers_no_ping_is_disconnected() {
    let served = Served::new();
    let mut lively = served.viewer(false).unwrap();
    let mut dead = served.viewer(true).unwrap();
    // the test reads nothing, so no ping is answered until the server closes the connection
    let begun = Instant::now();
    lively.get_ref().set_read_timeout(Some(Duration::from_millis(100))).unwrap();
    while begun.elapsed() < Duration::from_secs(13) {
        match lively.read() {
            Ok(_) => {}
            Err(tungstenite::Error::Io(error)) => {
                assert!(matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut));
            }
            Err(error) => panic!("{error}"),
        }
    }
    let end = std::iter::from_fn(|| Some(dead.read())).find_map(Result::err).unwrap();
    // the connection is closed, and not only silent
    let is_silent = |kind| matches!(kind, ErrorKind::WouldBlock | ErrorKind::TimedOut);
    assert!(!matches!(&end, tungstenite::Error::Io(error) if is_silent(error.kind())), "{end}");
    // a closed connection holds no place: all of them can be taken
    drop(lively);
    std::thread::sleep(Duration::from_millis(200));
    let mut all: Vec<Viewer> = (0..PLACES).map(|_| served.viewer(true).unwrap()).collect();
    let inside = all_at_once(all.iter_mut());
    assert_eq!(inside, PLACES, "somebody made room for somebody else");
}
