//! Mailbox: a header of six bytes, and CANopen objects over it (CoE).

mod sdo_server;

pub use sdo_server::answer;

/// Bytes of the mailbox header and of the CoE header.
const HEADERS: usize = 8;
/// Type of a mailbox error.
const ERROR: u8 = 0;
/// Type of CANopen over EtherCAT.
const COE: u8 = 3;

/// What came by mailbox.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Request {
    /// An SDO request: command, index, subindex and what follows.
    Sdo(Vec<u8>),
    /// An SDO information request.
    Information,
    /// A protocol or a service that the device does not speak.
    Unsupported,
    /// Too short, or the header states more than is there.
    Malformed,
}

/// Services of CoE.
const EMERGENCY: u8 = 1;
const SDO_REQUEST: u8 = 2;
const SDO_RESPONSE: u8 = 3;
const SDO_INFORMATION: u8 = 8;

/// Reads what came.
pub fn request(bytes: &[u8]) -> Request {
    let Some(header) = bytes.first_chunk::<HEADERS>() else { return Request::Malformed };
    let length = usize::from(u16::from_le_bytes([header[0], header[1]]));
    let Some(data) = bytes.get(HEADERS..6 + length).filter(|_| length >= 2) else {
        return Request::Malformed;
    };
    match (header[5] & 0x0f, header[7] >> 4) {
        (COE, SDO_REQUEST) if data.len() >= 4 => Request::Sdo(data.to_vec()),
        (COE, SDO_INFORMATION) => Request::Information,
        (COE, SDO_REQUEST) => Request::Malformed,
        _ => Request::Unsupported,
    }
}

/// An answer of a service of CoE, with its counter (1 to 7).
fn coe(service: u8, counter: u8, data: &[u8]) -> Vec<u8> {
    let mut bytes = ((data.len() + 2) as u16).to_le_bytes().to_vec();
    bytes.extend([0, 0, 0, COE | counter << 4, 0, service << 4]);
    bytes.extend(data);
    bytes
}

/// An SDO response.
pub fn sdo_response(counter: u8, data: &[u8]) -> Vec<u8> {
    coe(SDO_RESPONSE, counter, data)
}

/// The answer to an SDO information request: an error, as the service is not there.
pub fn no_information(counter: u8) -> Vec<u8> {
    let abort = (crate::object_dictionary::Abort::UnsupportedAccess as u32).to_le_bytes();
    coe(SDO_INFORMATION, counter, &[&[7, 0, 0, 0], &abort[..]].concat())
}

/// An emergency: a code, the error register, five bytes of the manufacturer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Emergency {
    /// Error code, as in 0x603F.
    pub code: u16,
    /// Error register, as in 0x1001.
    pub register: u8,
}

/// An emergency message.
pub fn emergency(counter: u8, message: Emergency) -> Vec<u8> {
    let [low, high] = message.code.to_le_bytes();
    coe(EMERGENCY, counter, &[low, high, message.register, 0, 0, 0, 0, 0])
}

/// A mailbox error: the protocol is not supported (2) or the header is malformed (1: syntax).
pub fn error(counter: u8, detail: u16) -> Vec<u8> {
    let [low, high] = detail.to_le_bytes();
    vec![4, 0, 0, 0, 0, ERROR | counter << 4, 1, 0, low, high]
}
