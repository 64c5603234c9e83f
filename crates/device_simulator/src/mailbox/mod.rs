//! Mailbox: a header of six bytes (ETG.1000.4), and CANopen over EtherCAT over it (CoE, ETG.1000.6).

mod sdo_server;

pub use sdo_server::answer;

/// Bytes of the mailbox header and of the CoE header.
const HEADERS: usize = 8;
/// Type of a mailbox error.
const ERROR: u8 = 0;
/// Type of CANopen over EtherCAT.
const COE: u8 = 3;

/// Request received by mailbox.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Request {
    /// SDO request: command, index, subindex and data.
    Sdo(Vec<u8>),
    /// An SDO information request.
    Information,
    /// Protocol or service that the device does not support.
    Unsupported,
    /// Message that is too short, or shorter than its header states.
    Malformed,
}

/// Service of CoE (ETG.1000.6): emergency.
const EMERGENCY: u8 = 1;
/// SDO request; also the service of an abort.
const SDO_REQUEST: u8 = 2;
/// SDO response.
const SDO_RESPONSE: u8 = 3;
/// SDO information.
const SDO_INFORMATION: u8 = 8;

/// Parses a mailbox message. Too short a one, or one shorter than its header states, is [`Request::Malformed`].
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

/// Mailbox message of a CoE service, with its mailbox counter (1 to 7).
fn coe(service: u8, counter: u8, data: &[u8]) -> Vec<u8> {
    let mut bytes = ((data.len() + 2) as u16).to_le_bytes().to_vec();
    bytes.extend([0, 0, 0, COE | counter << 4, 0, service << 4]);
    bytes.extend(data);
    bytes
}

/// Command specifier of an abort, the upper three bits of an SDO.
const ABORT: u8 = 4;

/// Answer to an SDO request with a mailbox counter (1 to 7) and the SDO part of the message. An abort has the service
/// of a request: a main device that looks at the service first (SOEM) reads it as data otherwise.
pub fn sdo_response(counter: u8, data: &[u8]) -> Vec<u8> {
    let is_abort = data.first().is_some_and(|command| command >> 5 == ABORT);
    coe(if is_abort { SDO_REQUEST } else { SDO_RESPONSE }, counter, data)
}

/// Answer to an SDO information request, with a mailbox counter (1 to 7): error with the abort code 0x06010000, as the
/// service is not supported.
pub fn sdo_information_error(counter: u8) -> Vec<u8> {
    let abort = (crate::object_dictionary::Abort::UnsupportedAccess as u32).to_le_bytes();
    coe(SDO_INFORMATION, counter, &[&[7, 0, 0, 0], &abort[..]].concat())
}

/// CoE emergency message; the five bytes of the manufacturer are zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Emergency {
    /// Error code, as in 0x603F.
    pub code: u16,
    /// Error register, as in 0x1001.
    pub register: u8,
}

/// Mailbox message of an emergency, with a mailbox counter (1 to 7).
pub fn emergency(counter: u8, message: Emergency) -> Vec<u8> {
    let [low, high] = message.code.to_le_bytes();
    coe(EMERGENCY, counter, &[low, high, message.register, 0, 0, 0, 0, 0])
}

/// Mailbox error message with a mailbox counter (1 to 7) and a detail code: 1 for a malformed header (syntax), 2 for
/// an unsupported protocol.
pub fn error(counter: u8, detail: u16) -> Vec<u8> {
    let [low, high] = detail.to_le_bytes();
    vec![4, 0, 0, 0, 0, ERROR | counter << 4, 1, 0, low, high]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ETG.1000.6: a response has service 3, an abort that of a request, 2.
    #[test]
    fn an_abort_has_the_service_of_a_request() {
        let service = |command: u8| sdo_response(1, &[command, 0x18, 0x10, 0, 0, 0, 0, 0])[7] >> 4;
        assert_eq!([0x43, 0x60, 0x80].map(service), [3, 3, 2]);
    }
}
