//! Pages and viewers' connections.

use crate::command::{self, Demand, LONGEST, Message};
use crate::feed::Feed;
use crate::operator_role::OperatorRole;
use crate::scene::Scene;
use crate::token::Token;
use axum::Router;
use axum::body::Body;
use axum::extract::ws::{Message as Frame, Utf8Bytes, WebSocket, WebSocketUpgrade};
use axum::extract::{Request, State};
use axum::http::header::{
    CACHE_CONTROL, CONTENT_DISPOSITION, CONTENT_SECURITY_POLICY, CONTENT_TYPE, HOST, HeaderMap,
    ORIGIN, REFERRER_POLICY, X_CONTENT_TYPE_OPTIONS, X_FRAME_OPTIONS,
};
use axum::http::{HeaderValue, StatusCode};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use hydroboom_realtime::desk::Desk;
use serde_json::{Value, json};
use std::net::SocketAddr;
use std::sync::mpsc::Sender;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::broadcast;

/// Time from frame to frame.
const FRAME: Duration = Duration::from_millis(33);
/// Frames that a viewer may be behind; older ones are left out.
const BEHIND: usize = 8;
/// A viewer that takes longer for a message is gone.
const PATIENCE: Duration = Duration::from_secs(5);
/// More viewers are not let in.
const MOST_VIEWERS: usize = 32;
/// Messages of one viewer in a second, at most.
const MOST_MESSAGES: u32 = 100;
/// Wrong tokens of one viewer, at most.
const MOST_WRONG: u32 = 5;

/// What all connections share.
pub(crate) struct Hall {
    pub(crate) feed: Mutex<Feed>,
    pub(crate) scene: Scene,
    pub(crate) role: OperatorRole,
    pub(crate) desk: Arc<Desk>,
    pub(crate) token: Token,
    pub(crate) demands: Sender<Demand>,
    pub(crate) bound: SocketAddr,
    pub(crate) viewers: Mutex<Viewers>,
}

/// Who is there.
#[derive(Default)]
pub(crate) struct Viewers {
    count: usize,
    /// Number of the newest.
    last: u64,
}

#[derive(Clone)]
struct Served {
    hall: Arc<Hall>,
    frames: broadcast::Sender<Utf8Bytes>,
}

/// Serves until the program ends.
pub(crate) async fn serve(listener: std::net::TcpListener, hall: Arc<Hall>) -> std::io::Result<()> {
    let listener = tokio::net::TcpListener::from_std(listener)?;
    let (frames, _) = broadcast::channel(BEHIND);
    tokio::spawn(send_frames(Arc::clone(&hall), frames.clone()));
    let served = Served { hall, frames };
    let page = |kind: &'static str, text: &'static str| {
        get(move || async move { ([(CONTENT_TYPE, kind)], text) })
    };
    let script = "text/javascript; charset=utf-8";
    let style = "text/css; charset=utf-8";
    let router = Router::new()
        .route("/", page("text/html; charset=utf-8", include_str!("../page/index.html")))
        .route("/app.js", page(script, include_str!("../page/app.js")))
        .route("/crane.js", page(script, include_str!("../page/crane.js")))
        .route("/charts.js", page(script, include_str!("../page/charts.js")))
        .route("/style.css", page(style, include_str!("../page/style.css")))
        .route("/uplot.js", page(script, include_str!("../page/uplot/uPlot.iife.min.js")))
        .route("/uplot.css", page(style, include_str!("../page/uplot/uPlot.min.css")))
        .route("/report", get(report))
        .route("/fault.csv", get(fault_data))
        .route("/live", get(live))
        .layer(from_fn_with_state(served.clone(), guard))
        .with_state(served);
    axum::serve(listener, router).await
}

/// Refuses what comes from another page, or under another name than ours, and tells browsers what
/// our pages may do.
async fn guard(State(served): State<Served>, request: Request, next: Next) -> Response {
    if let Err(reason) = is_ours(request.headers(), &served.hall.bound) {
        return (StatusCode::FORBIDDEN, reason).into_response();
    }
    let is_report = request.uri().path() == "/report";
    let mut response = next.run(request).await;
    let headers = response.headers_mut();
    // the report carries its own style, and no script at all
    let policy = match is_report {
        true => "default-src 'none'; style-src 'unsafe-inline'; frame-ancestors 'none'",
        false => {
            "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; connect-src 'self'; \
             img-src 'self' data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
        }
    };
    headers.insert(CONTENT_SECURITY_POLICY, HeaderValue::from_static(policy));
    headers.insert(X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    headers.insert(X_FRAME_OPTIONS, HeaderValue::from_static("DENY"));
    headers.insert(REFERRER_POLICY, HeaderValue::from_static("no-referrer"));
    headers.insert(CACHE_CONTROL, HeaderValue::from_static("no-store"));
    response
}

/// Whether a request comes from our own page, or from a program that is none.
fn is_ours(headers: &HeaderMap, bound: &SocketAddr) -> Result<(), &'static str> {
    let text = |name| headers.get(name).and_then(|value: &HeaderValue| value.to_str().ok());
    let Some(host) = text(HOST) else { return Err("a request without a host") };
    // a name that somebody else points at this computer is not ours
    let names = [bound.to_string(), format!("localhost:{}", bound.port())];
    if bound.ip().is_loopback() && !names.iter().any(|name| name == host) {
        return Err("another host's name");
    }
    match headers.get(ORIGIN).map(|origin| origin.to_str().unwrap_or("")) {
        None => Ok(()),
        Some(origin) if origin.strip_prefix("http://") == Some(host) => Ok(()),
        Some(_) => Err("a request from another page"),
    }
}

async fn report(State(served): State<Served>) -> Response {
    match served.hall.feed().report.clone() {
        Some(page) => ([(CONTENT_TYPE, "text/html; charset=utf-8")], page).into_response(),
        None => (StatusCode::NOT_FOUND, "no course is over yet").into_response(),
    }
}

async fn fault_data(State(served): State<Served>) -> Response {
    let headers = [
        (CONTENT_TYPE, "text/csv; charset=utf-8"),
        (CONTENT_DISPOSITION, "attachment; filename=\"fault.csv\""),
    ];
    match served.hall.feed().fault_data.clone() {
        Some(data) => (headers, Body::from(data)).into_response(),
        None => (StatusCode::NOT_FOUND, "there was no fault").into_response(),
    }
}

/// Makes frames, and sends them to all viewers.
async fn send_frames(hall: Arc<Hall>, frames: broadcast::Sender<Utf8Bytes>) {
    let mut ticks = tokio::time::interval(FRAME);
    ticks.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Skip);
    loop {
        ticks.tick().await;
        let viewers = hall.viewers().count;
        if viewers == 0 {
            continue;
        }
        let operator = hall.role.viewer();
        let frame = hall.feed().frame(&hall.scene, operator, viewers);
        if let Some(frame) = frame {
            // that all viewers have just gone is no error
            let _ = frames.send(frame.to_string().into());
        }
    }
}

async fn live(State(served): State<Served>, upgrade: WebSocketUpgrade) -> Response {
    if served.hall.viewers().count >= MOST_VIEWERS {
        return (StatusCode::SERVICE_UNAVAILABLE, "too many viewers").into_response();
    }
    upgrade
        .max_message_size(LONGEST)
        .max_frame_size(LONGEST)
        .on_upgrade(move |socket| view(served, socket))
}

/// A viewer's connection, from its beginning to its end.
async fn view(served: Served, mut socket: WebSocket) {
    let hall = &served.hall;
    let viewer = {
        let mut viewers = hall.viewers();
        viewers.count += 1;
        viewers.last += 1;
        viewers.last
    };
    let mut frames = served.frames.subscribe();
    let mut setup = hall.scene.setup().clone();
    setup["viewer"] = json!(viewer);
    let past = hall.feed().past();
    let mut conduct = Conduct::new();
    let mut is_there = send(&mut socket, &setup).await && send(&mut socket, &past).await;
    while is_there {
        is_there = tokio::select! {
            frame = frames.recv() => match frame {
                Ok(text) => send_text(&mut socket, text).await,
                Err(broadcast::error::RecvError::Lagged(_)) => true,
                Err(broadcast::error::RecvError::Closed) => false,
            },
            message = socket.recv() => match message {
                Some(Ok(Frame::Text(text))) => match conduct.heed(hall, viewer, text.as_str()) {
                    Heeded::Done => true,
                    Heeded::Refused(reason) => send(&mut socket, &refusal(&reason)).await,
                    Heeded::Expelled(reason) => {
                        send(&mut socket, &refusal(&reason)).await;
                        false
                    }
                },
                Some(Ok(Frame::Ping(_) | Frame::Pong(_))) => conduct.is_bearable(),
                // binary, too long, closed, broken
                _ => false,
            },
        };
    }
    // a viewer that is gone stops nothing, unless it operated
    hall.role.leave(viewer);
    hall.viewers().count -= 1;
}

fn refusal(reason: &str) -> Value {
    json!({ "type": "refused", "reason": reason })
}

async fn send(socket: &mut WebSocket, value: &Value) -> bool {
    send_text(socket, value.to_string().into()).await
}

async fn send_text(socket: &mut WebSocket, text: Utf8Bytes) -> bool {
    matches!(tokio::time::timeout(PATIENCE, socket.send(Frame::Text(text))).await, Ok(Ok(())))
}

/// What became of a message.
enum Heeded {
    Done,
    /// Not done, and why.
    Refused(String),
    /// Not done, and the viewer has to go.
    Expelled(String),
}

/// How a viewer behaves.
struct Conduct {
    since: Instant,
    messages: u32,
    wrong: u32,
}

impl Conduct {
    fn new() -> Self {
        Self { since: Instant::now(), messages: 0, wrong: 0 }
    }

    /// Whether it has not sent too much.
    fn is_bearable(&mut self) -> bool {
        if self.since.elapsed() >= Duration::from_secs(1) {
            (self.since, self.messages) = (Instant::now(), 0);
        }
        self.messages += 1;
        self.messages <= MOST_MESSAGES
    }

    fn heed(&mut self, hall: &Hall, viewer: u64, text: &str) -> Heeded {
        if !self.is_bearable() {
            return Heeded::Expelled("too many messages".into());
        }
        let message = match Message::parse(text) {
            Ok(message) => message,
            Err(reason) => return Heeded::Expelled(reason),
        };
        if message.token().is_some_and(|token| !hall.token.is(token)) {
            self.wrong += 1;
            let reason = "a wrong token: open the address that the program printed".to_string();
            return match self.wrong >= MOST_WRONG {
                true => Heeded::Expelled(reason),
                false => Heeded::Refused(reason),
            };
        }
        if message.needs_role() && hall.role.viewer() != Some(viewer) {
            return Heeded::Refused("only the operator may: take the role first".into());
        }
        match hall.carry_out(viewer, message) {
            Ok(()) => Heeded::Done,
            Err(reason) => Heeded::Refused(reason),
        }
    }
}

impl Hall {
    pub(crate) fn viewers(&self) -> std::sync::MutexGuard<'_, Viewers> {
        // two numbers are whole whatever happened to the thread that had them
        self.viewers.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn carry_out(&self, viewer: u64, message: Message) -> Result<(), String> {
        let ended = |_| "the session has ended".to_string();
        match message {
            Message::Alive => self.role.hear(viewer),
            Message::TakeRole { .. } if !self.role.take(viewer) => {
                return Err("somebody else operates".into());
            }
            Message::TakeRole { .. } => {}
            Message::LeaveRole { .. } => self.role.leave(viewer),
            Message::Start { speed_mm_s, scenario, strategy, .. } => {
                self.desk.choose(command::strategy(&strategy)?);
                self.demands.send(Demand::Start { speed_mm_s, scenario }).map_err(ended)?;
            }
            Message::Strategy { strategy, .. } => self.desk.choose(command::strategy(&strategy)?),
            Message::Stop { .. } => self.desk.stop(),
            Message::EmergencyStop { .. } => self.desk.emergency_stop(),
            Message::Reset { .. } => self.desk.reset(),
            Message::Fault { fault, .. } => {
                self.demands.send(Demand::Fault(command::fault(&fault)?)).map_err(ended)?;
            }
            Message::Mend { .. } => self.demands.send(Demand::Mend).map_err(ended)?,
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(pairs: &[(axum::http::header::HeaderName, &'static str)]) -> HeaderMap {
        pairs.iter().map(|(name, value)| (name.clone(), HeaderValue::from_static(value))).collect()
    }

    #[test]
    fn other_pages_and_other_names_are_refused() {
        let bound: SocketAddr = "127.0.0.1:8140".parse().unwrap();
        let is = |pairs: &[_]| is_ours(&headers(pairs), &bound).is_ok();
        assert!(is(&[(HOST, "127.0.0.1:8140")]));
        assert!(is(&[(HOST, "localhost:8140"), (ORIGIN, "http://localhost:8140")]));
        assert!(!is(&[]));
        assert!(!is(&[(HOST, "evil.example:8140")]), "a name that was pointed here");
        assert!(!is(&[(HOST, "127.0.0.1:8140"), (ORIGIN, "http://evil.example")]));
        assert!(!is(&[(HOST, "127.0.0.1:8140"), (ORIGIN, "null")]));
        assert!(!is(&[(HOST, "127.0.0.1:8140"), (ORIGIN, "https://127.0.0.1:8140")]));
        assert!(!is(&[(HOST, "127.0.0.1:8140"), (ORIGIN, "http://127.0.0.1:8141")]));
    }
}
