//! SDO server (ETG.1000.6): expedited and normal upload and download, and abort. No segments and no complete access: a
//! value that does not fit the mailbox is refused.

use crate::object_dictionary::{Abort, Key};

/// Bytes before the data of a normal transfer: both headers, command, index, subindex, size.
const UPLOAD_OVERHEAD: usize = super::HEADERS + 8;

/// Answers an SDO request by two functions of the object's key, `read` and `write`; `None` if there is no answer.
/// That is so for an abort by the main device, and for a request of less than four bytes.
///
/// The answer is the SDO part of a response: command, index, subindex, data. `mailbox_length` is that of the mailbox
/// for answers \[byte\].
pub fn answer(
    request: &[u8],
    mailbox_length: usize,
    read: impl FnOnce(Key) -> Result<Vec<u8>, Abort>,
    write: impl FnOnce(Key, &[u8]) -> Result<(), Abort>,
) -> Option<Vec<u8>> {
    let [command, low, high, subindex] = *request.first_chunk::<4>()?;
    let key = (u16::from_le_bytes([low, high]), subindex);
    let head = |command: u8| vec![command, low, high, subindex];
    let has_complete_access = command & 0x10 != 0;
    let result = match command >> 5 {
        _ if has_complete_access && matches!(command >> 5, 1 | 2) => Err(Abort::UnsupportedAccess),
        1 => download_data(request).and_then(|data| write(key, data)).map(|()| {
            let mut response = head(0x60);
            response.extend([0; 4]);
            response
        }),
        2 => read(key).and_then(|value| upload_response(&value, mailbox_length, head)),
        // the client gives up: nothing is answered
        4 => return None,
        _ => Err(Abort::UnknownCommand),
    };
    Some(result.unwrap_or_else(|abort| {
        let mut response = head(0x80);
        response.extend((abort as u32).to_le_bytes());
        response
    }))
}

/// Data of a download request, expedited or normal.
fn download_data(request: &[u8]) -> Result<&[u8], Abort> {
    let command = request[0];
    let (is_expedited, has_size) = (command & 2 != 0, command & 1 != 0);
    if is_expedited {
        let length = if has_size { 4 - usize::from(command >> 2 & 3) } else { 4 };
        return request.get(4..4 + length).ok_or(Abort::TooShort);
    }
    let size = request.get(4..8).and_then(|size| size.first_chunk()).ok_or(Abort::TooShort)?;
    let size = u32::from_le_bytes(*size) as usize;
    request.get(8..8usize.saturating_add(size)).ok_or(Abort::OutOfMemory)
}

/// Response to an upload request: expedited up to 4 bytes, else normal.
fn upload_response(
    value: &[u8],
    mailbox_length: usize,
    head: impl Fn(u8) -> Vec<u8>,
) -> Result<Vec<u8>, Abort> {
    if value.len() <= 4 && !value.is_empty() {
        let mut response = head(0x43 | ((4 - value.len()) as u8) << 2);
        response.extend(value);
        response.resize(8, 0);
        return Ok(response);
    }
    if UPLOAD_OVERHEAD + value.len() > mailbox_length {
        return Err(Abort::OutOfMemory);
    }
    let mut response = head(0x41);
    response.extend((value.len() as u32).to_le_bytes());
    response.extend(value);
    Ok(response)
}
