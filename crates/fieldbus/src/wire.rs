//! Exchange of frames: futures of ethercrab's main device are polled by hand; the frames that they queue go over the
//! link.

use crate::frame_ring::FrameRing;
use crate::link::Link;
use crate::time::{forget_timers, next_timer, now};
use ethercrab::error::Error;
use ethercrab::{MainDevice, MainDeviceConfig, PduRx, PduStorage, PduTx, Timeouts};
use std::pin::pin;
use std::task::{Context, Poll, Waker};
use std::time::Duration;

/// Frames that may be under way at once.
const FRAMES: usize = 8;
/// Largest payload of a frame \[byte\]: that of an Ethernet frame, less headers.
const PAYLOAD: usize = PduStorage::element_size(1400);
/// Largest Ethernet frame \[byte\].
const LARGEST_FRAME: usize = 1536;
/// Longest wait for a frame before a future without a timer is polled again \[ns\].
const IDLE: u64 = 1_000_000;

/// Polling interval of a mailbox or an AL state \[us\]: devices answer within milliseconds.
const LOOK: u64 = 500;

/// A main device and its link.
pub(crate) struct Wire<L> {
    pub(crate) main: &'static MainDevice<'static>,
    tx: PduTx<'static>,
    rx: PduRx<'static>,
    pub(crate) link: L,
    buffer: [u8; LARGEST_FRAME],
    /// Received frames that answer no pending exchange: late, repeated, or of another sender.
    pub(crate) unexpected: u64,
    /// The newest frames.
    pub(crate) frames: FrameRing,
}

impl<L: Link> Wire<L> {
    /// A main device on a link. Its storage of 11 kB is not freed until the process ends, as a main device has to
    /// outlive its frames.
    pub(crate) fn new(link: L, config: MainDeviceConfig, frames: FrameRing) -> Result<Self, Error> {
        let storage: &'static PduStorage<FRAMES, PAYLOAD> = Box::leak(Box::new(PduStorage::new()));
        // a new storage has not been split
        let (tx, rx, pdus) = storage.try_split().map_err(|()| Error::Internal)?;
        let timeouts =
            Timeouts { wait_loop_delay: Duration::from_micros(LOOK), ..Timeouts::default() };
        let main = Box::leak(Box::new(MainDevice::new(pdus, timeouts, config)));
        Ok(Self { main, tx, rx, link, buffer: [0; LARGEST_FRAME], unexpected: 0, frames })
    }

    /// Polls a future until it is ready.
    pub(crate) fn run<F: Future>(&mut self, future: F) -> F::Output {
        let mut future = pin!(future);
        loop {
            if let Some(output) = self.step(future.as_mut(), u64::MAX) {
                return output;
            }
        }
    }

    /// Polls a future until it is ready, or until a time \[ns\]; then the exchange is abandoned, and there is no
    /// output.
    pub(crate) fn run_until<F: Future>(&mut self, future: F, end: u64) -> Option<F::Output> {
        let mut future = pin!(future);
        loop {
            if let Some(output) = self.step(future.as_mut(), end) {
                return Some(output);
            }
            if now() >= end {
                return None;
            }
        }
    }

    /// Polls once, sends the queued frames, and waits for a frame.
    fn step<F: Future>(&mut self, future: std::pin::Pin<&mut F>, end: u64) -> Option<F::Output> {
        forget_timers();
        if let Poll::Ready(output) = future.poll(&mut Context::from_waker(Waker::noop())) {
            return Some(output);
        }
        while let Some(frame) = self.tx.next_sendable_frame() {
            let (link, frames) = (&mut self.link, &mut self.frames);
            // one that was not sent is lost like any other: the future's time runs out
            let _ = frame.send_blocking(|bytes| {
                frames.record(now(), bytes, true);
                link.send(bytes);
                Ok(bytes.len())
            });
        }
        let until = next_timer().min(end).min(now().saturating_add(IDLE));
        if let Some(length) = self.link.receive(&mut self.buffer, until) {
            let frame = self.buffer.get(..length).unwrap_or(&self.buffer);
            self.frames.record(now(), frame, false);
            if self.rx.receive_frame(frame).is_err() {
                self.unexpected += 1;
            }
        }
        None
    }
}
