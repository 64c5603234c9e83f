//! A viewer's connection. Receiving does not depend on sending: a viewer that reads no frames can still stop the
//! machine.

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

/// Close code for a viewer whose place another viewer has taken; the page does not reconnect then.
const DISPLACED: u16 = 4001;
/// Time limit for the last message.
const LAST_MESSAGE: Duration = Duration::from_secs(1);

/// A message to a viewer other than a frame.
enum Answer {
    Refusal(Utf8Bytes),
    Farewell(CloseFrame),
}

/// Serves a viewer from the upgrade to the end of its connection.
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
    let close = tokio::select! {
        biased;
        () = place.displaced() => Some(CloseFrame {
            code: DISPLACED,
            reason: Utf8Bytes::from_static("another viewer with the token has this place"),
        }),
        close = read(stream, state, &place, &answers) => close,
        () = &mut sending => None,
    };
    // the loss of a viewer has no effect on the machine unless it is the operator
    state.role.leave(place.number);
    drop(place);
    if let Some(frame) = close
        && answers.try_send(Answer::Farewell(frame)).is_ok()
    {
        // the connection is closed even if the viewer does not read the last message
        let _ = timeout(LAST_MESSAGE, sending).await;
    }
}

/// Sends setup and history, then frames, answers and pings, until the connection ends or is closed.
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
                // a slow viewer skips frames
                Err(RecvError::Lagged(_)) => continue,
                Err(RecvError::Closed) => return,
            },
        };
        if !put(frame).await {
            return;
        }
    }
}

/// Executes a viewer's messages until its connection ends. Returns the reason if the server closes the connection.
async fn read(
    mut stream: SplitStream<WebSocket>,
    state: &ServerState,
    place: &Place,
    answers: &mpsc::Sender<Answer>,
) -> Option<CloseFrame> {
    let mut count = MessageCount::new();
    loop {
        let message = timeout(state.limits.silence, stream.next()).await.ok()??;
        let heeded = match message {
            Ok(Frame::Text(text)) => count.execute(state, place, text.as_str()),
            Ok(Frame::Ping(_) | Frame::Pong(_)) if count.is_within_rate(&state.limits) => {
                continue;
            }
            // binary message, too long, closed or broken connection
            _ => return None,
        };
        let (reason, is_expelled) = match heeded {
            Outcome::Done => continue,
            Outcome::Refused(reason) => (reason, false),
            Outcome::Expelled(reason) => (reason, true),
        };
        let refusal = json!({ "type": "refused", "reason": reason }).to_string().into();
        // a full queue of answers closes the connection
        answers.try_send(Answer::Refusal(refusal)).ok()?;
        if is_expelled {
            let reason = Utf8Bytes::from_static("see the last message");
            return Some(CloseFrame { code: close_code::POLICY, reason });
        }
    }
}

/// Result of a message.
enum Outcome {
    Done,
    /// Not executed, with the reason.
    Refused(String),
    /// Not executed; the connection is closed, with the reason.
    Expelled(String),
}

/// Counts a viewer's messages and wrong tokens.
struct MessageCount {
    since: Instant,
    messages: u32,
    wrong: u32,
}

impl MessageCount {
    fn new() -> Self {
        Self { since: Instant::now(), messages: 0, wrong: 0 }
    }

    /// Counts a message; whether the rate is within the limit.
    fn is_within_rate(&mut self, limits: &Limits) -> bool {
        if self.since.elapsed() >= Duration::from_secs(1) {
            (self.since, self.messages) = (Instant::now(), 0);
        }
        self.messages += 1;
        self.messages <= limits.messages
    }

    fn execute(&mut self, state: &ServerState, place: &Place, text: &str) -> Outcome {
        let message = Message::parse(text);
        // an emergency stop is executed even when the rate limit is exceeded
        let is_emergency = matches!(message, Ok(Message::EmergencyStop { .. }));
        if !self.is_within_rate(&state.limits) && !is_emergency {
            return Outcome::Expelled("too many messages".into());
        }
        let message = match message {
            Ok(message) => message,
            Err(reason) => return Outcome::Expelled(reason),
        };
        match message.token() {
            Some(token) if state.token.is(token) => place.present_token(),
            Some(_) => {
                self.wrong += 1;
                let reason = "a wrong token: open the address that the program printed".to_string();
                return match self.wrong >= state.limits.wrong_tokens {
                    true => Outcome::Expelled(reason),
                    false => Outcome::Refused(reason),
                };
            }
            None => {}
        }
        match state.carry_out(place.number, message) {
            Ok(()) => Outcome::Done,
            Err(reason) => Outcome::Refused(reason),
        }
    }
}
