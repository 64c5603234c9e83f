//! Decompression within bounded memory.

use flate2::read::ZlibDecoder;
use std::io::Read;

/// Compression method.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Packing {
    Deflate,
    Zstd,
    Lz4,
}

/// Decompresses data of a stated size. Memory grows with the output, up to the stated size: a corrupt size allocates
/// nothing.
///
/// # Errors
///
/// Description of the damage.
pub(crate) fn unpack(
    packing: Packing,
    packed: &[u8],
    size: u64,
    unpacked: &mut Vec<u8>,
) -> Result<(), String> {
    unpacked.clear();
    let most = size.saturating_add(1);
    match packing {
        Packing::Deflate => ZlibDecoder::new(packed).take(most).read_to_end(unpacked),
        Packing::Zstd => {
            zstd::stream::read::Decoder::with_buffer(packed).and_then(|mut decoder| {
                decoder.window_log_max(27)?;
                decoder.take(most).read_to_end(unpacked)
            })
        }
        Packing::Lz4 => lz4_flex::frame::FrameDecoder::new(packed).take(most).read_to_end(unpacked),
    }
    .map_err(|e| format!("packed data: {e}"))?;
    match unpacked.len() as u64 == size {
        true => Ok(()),
        false => Err(format!("unpacked it has not the {size} bytes that it says")),
    }
}
