//! HTTP routes, and the upgrade of a connection to a viewer.

use crate::command::LONGEST;
use crate::connections::accept;
use crate::server_state::ServerState;
use crate::viewer::attend;
use axum::Router;
use axum::body::Body;
use axum::extract::ws::{Utf8Bytes, WebSocketUpgrade};
use axum::extract::{Request, State};
use axum::http::header::{
    CACHE_CONTROL, CONNECTION, CONTENT_DISPOSITION, CONTENT_SECURITY_POLICY, CONTENT_TYPE, HOST,
    HeaderMap, ORIGIN, REFERRER_POLICY, X_CONTENT_TYPE_OPTIONS, X_FRAME_OPTIONS,
};
use axum::http::{HeaderValue, StatusCode};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::broadcast;

/// Interval between frames.
const FRAME: Duration = Duration::from_millis(33);
/// Frames queued for one viewer; older ones are dropped.
const BEHIND: usize = 8;
/// Sub-protocol of a viewer's WebSocket. The token may follow as a second name: the only other place that a browser
/// allows is the address, which proxies log.
const PROTOCOL: &str = "hydroboom";

#[derive(Clone)]
struct Served {
    state: Arc<ServerState>,
    frames: broadcast::Sender<Utf8Bytes>,
}

/// Runs the server until the program ends.
pub(crate) async fn serve(
    listener: std::net::TcpListener,
    state: Arc<ServerState>,
) -> std::io::Result<()> {
    let listener = tokio::net::TcpListener::from_std(listener)?;
    let (frames, _) = broadcast::channel(BEHIND);
    tokio::spawn(send_frames(Arc::clone(&state), frames.clone()));
    let served = Served { state: Arc::clone(&state), frames };
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
    accept(listener, router, &state.limits).await;
    Ok(())
}

/// Refuses requests of other origins and for other host names, and adds the security headers for
/// our pages.
async fn guard(State(served): State<Served>, request: Request, next: Next) -> Response {
    if let Err(reason) = is_ours(request.headers(), &served.state.bound) {
        return only_one((StatusCode::FORBIDDEN, reason).into_response());
    }
    let is_report = request.uri().path() == "/report";
    let mut response = next.run(request).await;
    let headers = response.headers_mut();
    // the report has inline styles and no script
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
    only_one(response)
}

/// Closes the connection after the answer, unless it is upgraded to a viewer.
fn only_one(mut response: Response) -> Response {
    if response.status() != StatusCode::SWITCHING_PROTOCOLS {
        response.headers_mut().insert(CONNECTION, HeaderValue::from_static("close"));
    }
    response
}

/// Checks that a request comes from our own page or from a program that is not a browser.
fn is_ours(headers: &HeaderMap, bound: &SocketAddr) -> Result<(), &'static str> {
    let text = |name| headers.get(name).and_then(|value: &HeaderValue| value.to_str().ok());
    let Some(host) = text(HOST) else { return Err("a request without a host") };
    // a foreign name that resolves to this computer is refused (DNS rebinding)
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
    match served.state.feed().report.clone() {
        Some(page) => ([(CONTENT_TYPE, "text/html; charset=utf-8")], page).into_response(),
        None => (StatusCode::NOT_FOUND, "no course is over yet").into_response(),
    }
}

async fn fault_data(State(served): State<Served>) -> Response {
    let headers = [
        (CONTENT_TYPE, "text/csv; charset=utf-8"),
        (CONTENT_DISPOSITION, "attachment; filename=\"fault.csv\""),
    ];
    match served.state.feed().fault_data.clone() {
        Some(data) => (headers, Body::from(data)).into_response(),
        None => (StatusCode::NOT_FOUND, "there was no fault").into_response(),
    }
}

/// Computes each frame and sends it to all viewers.
async fn send_frames(state: Arc<ServerState>, frames: broadcast::Sender<Utf8Bytes>) {
    let mut ticks = tokio::time::interval(FRAME);
    ticks.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Skip);
    loop {
        ticks.tick().await;
        // also without viewers: this detects that the operator is absent
        let operator = state.role.viewer();
        let viewers = state.viewers.count();
        if viewers == 0 {
            continue;
        }
        let frame = state.feed().frame(&state.scene, operator, viewers);
        if let Some(frame) = frame {
            // an error says only that all viewers have just left
            let _ = frames.send(frame.to_string().into());
        }
    }
}

/// Upgrades a request to a viewer. Its place is reserved first, so that the limit holds for simultaneous requests.
async fn live(State(served): State<Served>, upgrade: WebSocketUpgrade) -> Response {
    let state = &served.state;
    let is_token = |name: &HeaderValue| name.to_str().is_ok_and(|name| state.token.is(name));
    let has_token = upgrade.requested_protocols().any(is_token);
    let Some(place) = state.viewers.reserve(has_token, state.role.viewer()) else {
        return (StatusCode::SERVICE_UNAVAILABLE, "too many viewers").into_response();
    };
    upgrade.protocols([PROTOCOL]).max_message_size(LONGEST).max_frame_size(LONGEST).on_upgrade(
        async move |socket| {
            attend(&served.state, served.frames.subscribe(), socket, place).await;
        },
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(pairs: &[(axum::http::header::HeaderName, &'static str)]) -> HeaderMap {
        pairs.iter().map(|(name, value)| (name.clone(), HeaderValue::from_static(value))).collect()
    }

    #[test]
    fn foreign_origins_and_host_names_are_refused() {
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
