//! Datagrams of a frame: Ethernet header, EtherCAT header, then datagrams with a header of ten bytes, data and a
//! working counter.
//!
//! Source: IEC 61158-4-12 (ETG.1000.4), type 12 PDU structure.

/// EtherType of EtherCAT frames.
pub const ETHERTYPE: u16 = 0x88a4;
/// Bytes of the Ethernet header.
const ETHERNET: usize = 14;
/// Bytes of the EtherCAT header.
const HEADER: usize = 2;
/// Bytes of a datagram's header.
const DATAGRAM: usize = 10;
/// Bytes of a working counter.
const WORKING_COUNTER: usize = 2;

/// Command of a datagram, by addressing mode and direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Command {
    /// No operation (NOP).
    Nop,
    /// Auto-increment addressing by position: APRD, APWR, APRW.
    Position(Access),
    /// Configured station address: FPRD, FPWR, FPRW.
    Station(Access),
    /// Broadcast to all devices, reads are or-ed: BRD, BWR, BRW.
    Broadcast(Access),
    /// Logical address, through FMMUs: LRD, LWR, LRW.
    Logical(Access),
    /// Auto-increment read, multiple write (ARMW): the device at the position reads, all others write what it read.
    PositionReadMultipleWrite,
    /// Configured read, multiple write (FRMW): the device with the station address reads, all others write what it
    /// read.
    StationReadMultipleWrite,
}

/// Direction of an access, from the main device's point of view.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// From the device into the frame.
    Read,
    /// From the frame into the device.
    Write,
    /// Both directions, in one passage.
    ReadWrite,
}

impl Access {
    /// Whether data are read from the device.
    pub fn reads(self) -> bool {
        self != Self::Write
    }

    /// Whether data are written to the device.
    pub fn writes(self) -> bool {
        self != Self::Read
    }
}

impl Command {
    /// Command by its code in a datagram's header; undefined codes give [`Nop`](Self::Nop), which passes unchanged.
    pub fn of(code: u8) -> Self {
        use Access::{Read, ReadWrite, Write};
        match code {
            1 => Self::Position(Read),
            2 => Self::Position(Write),
            3 => Self::Position(ReadWrite),
            4 => Self::Station(Read),
            5 => Self::Station(Write),
            6 => Self::Station(ReadWrite),
            7 => Self::Broadcast(Read),
            8 => Self::Broadcast(Write),
            9 => Self::Broadcast(ReadWrite),
            10 => Self::Logical(Read),
            11 => Self::Logical(Write),
            12 => Self::Logical(ReadWrite),
            13 => Self::PositionReadMultipleWrite,
            14 => Self::StationReadMultipleWrite,
            _ => Self::Nop,
        }
    }
}

/// Datagram within a frame, by mutable references.
#[derive(Debug)]
pub struct Datagram<'a> {
    /// Command of the datagram.
    pub command: Command,
    /// Address field: position or station address, then memory address; or a logical address.
    pub address: &'a mut [u8; 4],
    /// Data of the datagram.
    pub data: &'a mut [u8],
    /// Working counter, little-endian.
    pub working_counter: &'a mut [u8; 2],
}

impl Datagram<'_> {
    /// Position or station address, from the first half of the address field.
    pub fn device(&self) -> u16 {
        u16::from_le_bytes([self.address[0], self.address[1]])
    }

    /// Address in the device's memory, from the second half of the address field.
    pub fn memory(&self) -> u16 {
        u16::from_le_bytes([self.address[2], self.address[3]])
    }

    /// Logical address, from the whole address field.
    pub fn logical(&self) -> u32 {
        u32::from_le_bytes(*self.address)
    }

    /// Increments the position by one, as each device does.
    pub fn increment_position(&mut self) {
        let next = self.device().wrapping_add(1).to_le_bytes();
        self.address[..2].copy_from_slice(&next);
    }

    /// Increments the working counter, modulo 2^16.
    pub fn increment_working_counter(&mut self, by: u16) {
        *self.working_counter =
            u16::from_le_bytes(*self.working_counter).wrapping_add(by).to_le_bytes();
    }
}

/// Calls `each` for every datagram of an Ethernet frame, in order. Returns false for an incomplete EtherCAT frame,
/// after calls for the datagrams before the error.
pub fn for_each_datagram(frame: &mut [u8], mut each: impl FnMut(Datagram<'_>)) -> bool {
    if frame.len() < ETHERNET + HEADER || frame[12..14] != ETHERTYPE.to_be_bytes() {
        return false;
    }
    // bit 1 of the first byte of the source: the frame went through devices
    frame[6] |= 0x02;
    let header = u16::from_le_bytes([frame[14], frame[15]]);
    let (length, kind) = (usize::from(header & 0x7ff), header >> 12);
    let mut rest = &mut frame[ETHERNET + HEADER..];
    if kind != 1 || length > rest.len() {
        return false;
    }
    rest = &mut rest[..length];
    loop {
        let Some((head, tail)) = rest.split_first_chunk_mut::<DATAGRAM>() else { return false };
        let field = u16::from_le_bytes([head[6], head[7]]);
        let (size, more) = (usize::from(field & 0x7ff), field & 0x8000 != 0);
        if tail.len() < size + WORKING_COUNTER {
            return false;
        }
        let (data, tail) = tail.split_at_mut(size);
        let Some((working_counter, tail)) = tail.split_first_chunk_mut::<WORKING_COUNTER>() else {
            return false;
        };
        let command = Command::of(head[0]);
        let Some(address) = head[2..].first_chunk_mut::<4>() else { return false };
        each(Datagram { command, address, data, working_counter });
        if !more {
            return true;
        }
        rest = tail;
    }
}
