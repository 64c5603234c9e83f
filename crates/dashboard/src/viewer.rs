//! A viewer's connection. What it sends is read whatever becomes of what is sent to it: a viewer that takes no
//! frames can still stop the machine.

use crate::command::Message;
use crate::limits::Limits;
use crate::server_state::ServerState;
use crate::viewers::Place;
use axum::body::Bytes;
use axum::extract::ws::{CloseFrame, Message as Frame, Utf8Bytes, WebSocket, close_code};
use futures_util::stream::{SplitSink, SplitStream};
use futures_util::{SinkExt, StreamExt};
use serde_json::{Value, json};
use std::pin::pin;
use std::time::{Duration, Instant};
use tokio::sync::broadcast::{self, error::RecvError};
use tokio::sync::mpsc;
use tokio::time::{MissedTickBehavior, interval, timeout};

/// Why a connection is closed whose place another viewer got; the page does not come back by itself then.
const DISPLACED: u16 = 4001;
/// A last message is taken within this time, or not at all.
const FAREWELL: Duration = Duration::from_secs(1);

/// What is to be sent, apart from frames.
enum Answer {
    Refusal(Utf8Bytes),
    Farewell(CloseFrame),
}

/// A viewer's connection, from its beginning to its end.
pub(crate) async fn attend(
    state: &ServerState,
    frames: broadcast::Receiver<Utf8Bytes>,
    socket: WebSocket,
    place: Place,
) {
    let (sink, stream) = socket.split();
    let (answers, waiting) = mpsc::channel(state.limits.answers);
    let first = [state.setup(&place), state.feed().past()];
    let mut sending = pin!(send(sink, first, frames, waiting, &state.limits));
    let farewell = tokio::select! {
        biased;
        () = place.displaced() => Some(CloseFrame {
            code: DISPLACED,
            reason: Utf8Bytes::from_static("another viewer with the token has this place"),
        }),
        farewell = read(stream, state, &place, &answers) => farewell,
        () = &mut sending => None,
    };
    // a viewer that is gone stops nothing, unless it operated
    state.role.leave(place.number);
    drop(place);
    if let Some(frame) = farewell
        && answers.try_send(Answer::Farewell(frame)).is_ok()
    {
        // who does not take it is gone without
        let _ = timeout(FAREWELL, sending).await;
    }
}

/// Sends what a new viewer has to know, then frames, answers and pings, until the viewer is gone or was told to go.
async fn send(
    mut sink: SplitSink<WebSocket, Frame>,
    first: [Value; 2],
    mut frames: broadcast::Receiver<Utf8Bytes>,
    mut answers: mpsc::Receiver<Answer>,
    limits: &Limits,
) {
    let mut put =
        async |frame: Frame| matches!(timeout(limits.sending, sink.send(frame)).await, Ok(Ok(())));
    for value in first {
        if !put(Frame::Text(value.to_string().into())).await {
            return;
        }
    }
    let mut pings = interval(limits.ping);
    pings.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        let frame = tokio::select! {
            biased;
            answer = answers.recv() => match answer {
                Some(Answer::Refusal(text)) => Frame::Text(text),
                Some(Answer::Farewell(reason)) => {
                    put(Frame::Close(Some(reason))).await;
                    return;
                }
                None => return,
            },
            _ = pings.tick() => Frame::Ping(Bytes::new()),
            frame = frames.recv() => match frame {
                Ok(text) => Frame::Text(text),
                // who is behind gets the newer ones
                Err(RecvError::Lagged(_)) => continue,
                Err(RecvError::Closed) => return,
            },
        };
        if !put(frame).await {
            return;
        }
    }
}

/// Does what a viewer asks for, until it is gone; with what words it is to be sent away, if it is.
async fn read(
    mut stream: SplitStream<WebSocket>,
    state: &ServerState,
    place: &Place,
    answers: &mpsc::Sender<Answer>,
) -> Option<CloseFrame> {
    let mut conduct = Conduct::new();
    loop {
        let message = timeout(state.limits.silence, stream.next()).await.ok()??;
        let heeded = match message {
            Ok(Frame::Text(text)) => conduct.heed(state, place, text.as_str()),
            Ok(Frame::Ping(_) | Frame::Pong(_)) if conduct.is_bearable(&state.limits) => continue,
            // binary, too long, too many, closed, broken
            _ => return None,
        };
        let (reason, is_expelled) = match heeded {
            Heeded::Done => continue,
            Heeded::Refused(reason) => (reason, false),
            Heeded::Expelled(reason) => (reason, true),
        };
        let refusal = json!({ "type": "refused", "reason": reason }).to_string().into();
        // who takes no answers asks for nothing more
        answers.try_send(Answer::Refusal(refusal)).ok()?;
        if is_expelled {
            let reason = Utf8Bytes::from_static("see the last message");
            return Some(CloseFrame { code: close_code::POLICY, reason });
        }
    }
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
    fn is_bearable(&mut self, limits: &Limits) -> bool {
        if self.since.elapsed() >= Duration::from_secs(1) {
            (self.since, self.messages) = (Instant::now(), 0);
        }
        self.messages += 1;
        self.messages <= limits.messages
    }

    fn heed(&mut self, state: &ServerState, place: &Place, text: &str) -> Heeded {
        let message = Message::parse(text);
        // an emergency stop counts however much came before it
        let is_emergency = matches!(message, Ok(Message::EmergencyStop { .. }));
        if !self.is_bearable(&state.limits) && !is_emergency {
            return Heeded::Expelled("too many messages".into());
        }
        let message = match message {
            Ok(message) => message,
            Err(reason) => return Heeded::Expelled(reason),
        };
        match message.token() {
            Some(token) if state.token.is(token) => place.present_token(),
            Some(_) => {
                self.wrong += 1;
                let reason = "a wrong token: open the address that the program printed".to_string();
                return match self.wrong >= state.limits.wrong_tokens {
                    true => Heeded::Expelled(reason),
                    false => Heeded::Refused(reason),
                };
            }
            None => {}
        }
        match state.carry_out(place.number, message) {
            Ok(()) => Heeded::Done,
            Err(reason) => Heeded::Refused(reason),
        }
    }
}
