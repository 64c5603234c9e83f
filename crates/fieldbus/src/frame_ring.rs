//! Frames of the last seconds, kept for the case of a fault, and written as a capture that protocol analysers open.
//!
//! Format: pcapng (Tuexen et al., draft-ietf-opsawg-pcapng), with one section, one Ethernet interface, times in
//! nanoseconds, and the direction of each frame.

use crate::table::Table;
use std::time::{SystemTime, UNIX_EPOCH};

/// Time whose frames are captured \[ns\].
const CAPTURE_TIME: u64 = 2_000_000_000;
/// Bytes of a frame beside process data: Ethernet and EtherCAT headers, the clock's datagram, that of the data.
const FRAME_OVERHEAD: usize = 64;
/// Bytes of a frame for each device: a datagram that reads its state.
const STATE_DATAGRAM: usize = 16;

/// Ring of the newest frames, with room for a fixed number of them; recording allocates nothing.
#[derive(Clone, Debug)]
pub struct FrameRing {
    /// Snap length: bytes of a frame that are captured; the rest is cut off.
    snap_length: usize,
    /// Bytes of all frames, `snap_length` each.
    bytes: Vec<u8>,
    /// Time, length and direction of all frames, by the same index.
    headers: Vec<PacketHeader>,
    /// Index of the next frame.
    next: usize,
    /// Number of stored frames.
    count: usize,
    /// Whether recording is stopped.
    is_frozen: bool,
}

/// Time, length and direction of a frame.
#[derive(Clone, Copy, Debug, Default)]
struct PacketHeader {
    /// When it was sent or received \[ns\].
    time: u64,
    /// Length on the wire \[byte\], which may exceed what was captured.
    length: usize,
    /// Whether this computer sent it.
    is_sent: bool,
}

impl FrameRing {
    /// Room for the last two seconds of a table's bus.
    pub(crate) fn of(table: &Table) -> Self {
        let process_data: usize =
            table.devices.iter().map(|row| row.output_bytes() + row.input_bytes()).sum();
        let snap_length = FRAME_OVERHEAD + process_data + STATE_DATAGRAM * table.devices.len();
        // each is sent and comes back
        let frames = 2 * u64::from(table.bus.exchanges) * CAPTURE_TIME / table.bus.period.max(1);
        Self::new(frames as usize, snap_length)
    }

    /// Room for a number of frames, at least one, of `snap_length` bytes each.
    fn new(frames: usize, snap_length: usize) -> Self {
        let frames = frames.max(1);
        Self {
            snap_length,
            bytes: vec![0; frames * snap_length],
            headers: vec![PacketHeader::default(); frames],
            next: 0,
            count: 0,
            is_frozen: false,
        }
    }

    /// Records a frame that was sent or received at a time \[ns\], in place of the oldest one. Allocates nothing.
    pub(crate) fn record(&mut self, time: u64, frame: &[u8], is_sent: bool) {
        if self.is_frozen {
            return;
        }
        let begin = self.next * self.snap_length;
        if let (Some(header), Some(captured)) =
            (self.headers.get_mut(self.next), self.bytes.get_mut(begin..begin + self.snap_length))
        {
            *header = PacketHeader { time, length: frame.len(), is_sent };
            captured.iter_mut().zip(frame).for_each(|(to, from)| *to = *from);
            self.next = (self.next + 1) % self.headers.len();
            self.count = (self.count + 1).min(self.headers.len());
        }
    }

    /// Stops recording, so that the stored frames are not overwritten; or resumes it.
    pub(crate) fn freeze(&mut self, is_frozen: bool) {
        self.is_frozen = is_frozen;
    }

    /// The frames in their order: time \[ns\], bytes that were kept, length, whether it was sent.
    fn frames(&self) -> impl Iterator<Item = (u64, &[u8], usize, bool)> {
        let all = self.headers.len();
        (0..self.count).map(move |k| {
            let place = (self.next + all - self.count + k) % all;
            let header = &self.headers[place];
            let bytes =
                &self.bytes[place * self.snap_length..][..header.length.min(self.snap_length)];
            (header.time, bytes, header.length, header.is_sent)
        })
    }

    /// The capture as the bytes of a pcapng file. `now` is the present time \[ns\] of the clock by which frames were
    /// recorded; their times in the file are those of the calendar. Frames longer than a record are cut, and state
    /// their original length.
    pub fn pcapng(&self, now: u64) -> Vec<u8> {
        let since_epoch = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let epoch = (since_epoch.as_nanos() as u64).saturating_sub(now);
        let mut capture = Vec::new();
        // section header: byte order, version 1.0, length not stated
        let mut section = 0x1a2b_3c4d_u32.to_le_bytes().to_vec();
        section.extend([1, 0, 0, 0]);
        section.extend(u64::MAX.to_le_bytes());
        block(&mut capture, 0x0a0d_0d0a, &section);
        // interface: Ethernet, bytes that are kept; option 9: times in units of 10^-9 s
        let mut interface = 1_u32.to_le_bytes().to_vec();
        interface.extend((self.snap_length as u32).to_le_bytes());
        interface.extend([9, 0, 1, 0, 9, 0, 0, 0, 0, 0, 0, 0]);
        block(&mut capture, 1, &interface);
        for (time, bytes, length, is_sent) in self.frames() {
            let time = epoch.saturating_add(time);
            let mut packet = vec![0; 4];
            packet.extend(((time >> 32) as u32).to_le_bytes());
            packet.extend((time as u32).to_le_bytes());
            packet.extend((bytes.len() as u32).to_le_bytes());
            packet.extend((length as u32).to_le_bytes());
            packet.extend(bytes);
            packet.resize(packet.len().next_multiple_of(4), 0);
            // option 2: direction, 1 in and 2 out
            packet.extend([2, 0, 4, 0, 1 + u8::from(is_sent), 0, 0, 0, 0, 0, 0, 0]);
            block(&mut capture, 6, &packet);
        }
        capture
    }
}

/// Adds a block: type and length around its body.
fn block(capture: &mut Vec<u8>, kind: u32, body: &[u8]) {
    let length = (body.len() as u32 + 12).to_le_bytes();
    capture.extend(kind.to_le_bytes());
    capture.extend(length);
    capture.extend(body);
    capture.extend(length);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Kinds and bodies of the blocks of a capture.
    fn blocks(capture: &[u8]) -> Vec<(u32, &[u8])> {
        let word = |at: usize| u32::from_le_bytes(capture[at..at + 4].try_into().unwrap());
        let (mut at, mut blocks) = (0, Vec::new());
        while at < capture.len() {
            let length = word(at + 4) as usize;
            assert_eq!((word(at + length - 4) as usize, length % 4), (length, 0));
            blocks.push((word(at), &capture[at + 8..at + length - 4]));
            at += length;
        }
        blocks
    }

    #[test]
    fn the_ring_keeps_the_newest_frames_in_order_until_frozen() {
        let mut ring = FrameRing::new(3, 64);
        for k in 0..5_u8 {
            ring.record(1000 * u64::from(k), &vec![k; 60 + 2 * usize::from(k)], k % 2 == 0);
        }
        ring.freeze(true);
        ring.record(9000, &[9; 60], true);
        let capture = ring.pcapng(5000);
        let blocks = blocks(&capture);
        assert_eq!(
            blocks.iter().map(|(kind, _)| *kind).collect::<Vec<_>>(),
            [0x0a0d_0d0a, 1, 6, 6, 6]
        );
        let word =
            |body: &[u8], at: usize| u32::from_le_bytes(body[at..at + 4].try_into().unwrap());
        let mut times = Vec::new();
        for (k, (_, body)) in (2_u8..).zip(&blocks[2..]) {
            times.push(u64::from(word(body, 4)) << 32 | u64::from(word(body, 8)));
            let (captured, length) = (word(body, 12) as usize, word(body, 16) as usize);
            assert_eq!(
                (captured, length),
                (usize::from(60 + 2 * k).min(64), usize::from(60 + 2 * k))
            );
            assert_eq!(body[20..20 + captured], vec![k; captured]);
            let options = 20 + captured.next_multiple_of(4);
            assert_eq!((body[options], body[options + 4]), (2, 1 + u8::from(k % 2 == 0)));
        }
        assert_eq!([times[1] - times[0], times[2] - times[1]], [1000, 1000]);
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_nanos() as u64;
        assert!(times[2] < now && now - times[2] < 60_000_000_000, "{times:?} {now}");
    }
}
