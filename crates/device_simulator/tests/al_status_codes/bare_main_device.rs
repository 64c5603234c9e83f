//! A main device as bare as it can be: one datagram a frame, registers written by hand.

use hydroboom_device_simulator::Segment;
use hydroboom_device_simulator::al_status_code::AlStatusCode;
use hydroboom_device_simulator::device::State;

/// Commands of a datagram.
pub const FPRD: u8 = 4;
pub const FPWR: u8 = 5;
pub const BWR: u8 = 8;
pub const LRW: u8 = 12;
pub const FRMW: u8 = 14;

/// Station address of the only device.
pub const STATION: u16 = 0x1001;

/// One device, and who writes its registers.
pub struct BareMainDevice {
    pub segment: Segment,
    pub now: u64,
}

impl BareMainDevice {
    /// With a segment whose first device gets the station address.
    pub fn new(segment: Segment) -> Self {
        let mut main = Self { segment, now: 1_000_000 };
        let (_, count) = main.send(2, [0, 0, 0x10, 0], &STATION.to_le_bytes());
        assert_eq!(count, 1);
        main
    }

    /// Sends a datagram 20 us later; what comes back, and its working counter.
    pub fn send(&mut self, command: u8, address: [u8; 4], data: &[u8]) -> (Vec<u8>, u16) {
        self.now += 20_000;
        let mut frame = vec![0xff; 6];
        frame.extend([0x10; 6]);
        frame.extend([0x88, 0xa4]);
        frame.extend((0x1000 | (data.len() + 12) as u16).to_le_bytes());
        frame.extend([command, 0]);
        frame.extend(address);
        frame.extend((data.len() as u16).to_le_bytes());
        frame.extend([0, 0]);
        frame.extend(data);
        frame.extend([0, 0]);
        if !self.segment.process(&mut frame, self.now) {
            return (Vec::new(), 0);
        }
        let end = frame.len() - 2;
        (frame[26..end].to_vec(), u16::from_le_bytes([frame[end], frame[end + 1]]))
    }

    fn at(register: u16) -> [u8; 4] {
        let ([a, b], [c, d]) = (STATION.to_le_bytes(), register.to_le_bytes());
        [a, b, c, d]
    }

    pub fn write(&mut self, register: u16, data: &[u8]) -> bool {
        self.send(FPWR, Self::at(register), data).1 == 1
    }

    pub fn read(&mut self, register: u16, length: usize) -> Vec<u8> {
        let (data, count) = self.send(FPRD, Self::at(register), &vec![0; length]);
        assert_eq!(count, 1, "0x{register:04x}");
        data
    }

    pub fn wait(&mut self, time: u64) {
        self.now += time;
        self.segment.advance(self.now);
    }

    /// Requests a state, and waits for an answer.
    pub fn request(&mut self, state: u8) -> (State, Option<AlStatusCode>) {
        self.write(0x0120, &[state, 0]);
        self.wait(2_000_000);
        self.state()
    }

    /// State as the registers show it: it is what the device itself says.
    pub fn state(&mut self) -> (State, Option<AlStatusCode>) {
        let (status, code) = (self.read(0x0130, 1)[0], self.read(0x0134, 2));
        let (state, error) = self.segment.devices()[0].state();
        assert_eq!(status, state as u8 | if error.is_some() { 0x10 } else { 0 });
        assert_eq!(u16::from_le_bytes([code[0], code[1]]), error.map_or(0, |e| e as u16));
        (state, error)
    }

    /// A sync manager: start, length, control, enabled.
    pub fn sync_manager(&mut self, number: u16, start: u16, length: u16, control: u8) {
        let ([a, b], [c, d]) = (start.to_le_bytes(), length.to_le_bytes());
        self.write(0x0800 + 8 * number, &[a, b, c, d, control, 0, 1, 0]);
    }

    /// Both mailboxes as the device wants them.
    pub fn mailboxes(&mut self) {
        self.sync_manager(0, 0x1000, 128, 0x26);
        self.sync_manager(1, 0x1080, 128, 0x22);
    }

    /// An SDO of up to four bytes is written. The abort code where it is refused.
    pub fn download(&mut self, index: u16, sub: u8, value: &[u8]) -> Result<(), u32> {
        let [low, high] = index.to_le_bytes();
        let mut data = vec![0x23 | ((4 - value.len()) as u8) << 2, low, high, sub];
        data.extend(value);
        data.resize(8, 0);
        let answer = self.transfer(&data);
        match answer[0] {
            0x60 => Ok(()),
            _ => Err(u32::from_le_bytes([answer[4], answer[5], answer[6], answer[7]])),
        }
    }

    /// An SDO is read.
    pub fn upload(&mut self, index: u16, sub: u8) -> Result<Vec<u8>, u32> {
        let [low, high] = index.to_le_bytes();
        let answer = self.transfer(&[0x40, low, high, sub, 0, 0, 0, 0]);
        match answer[0] {
            0x80 => Err(u32::from_le_bytes([answer[4], answer[5], answer[6], answer[7]])),
            0x41 => Ok(answer[8..8 + usize::from(answer[4])].to_vec()),
            command => Ok(answer[4..8 - usize::from(command >> 2 & 3)].to_vec()),
        }
    }

    /// A request by mailbox and its answer, both SDO.
    pub fn transfer(&mut self, sdo: &[u8]) -> Vec<u8> {
        let mut message = ((sdo.len() + 2) as u16).to_le_bytes().to_vec();
        message.extend([0, 0, 0, 0x13, 0, 0x20]);
        message.extend(sdo);
        message.resize(128, 0);
        assert!(self.write(0x1000, &message), "the mailbox is full");
        self.wait(1_000_000);
        assert_eq!(self.read(0x080d, 1)[0] & 8, 8, "no answer");
        let answer = self.read(0x1080, 128);
        // an abort has the service of a request
        let service = if answer[8] == 0x80 { 2 } else { 3 };
        assert_eq!((answer[5] & 0x0f, answer[7] >> 4), (3, service));
        answer[8..].to_vec()
    }
}
