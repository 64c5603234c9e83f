//! Process data and clock modes of a device, as its EEPROM (SII) describes them (ETG.1000.6, ETG.2010).

use crate::link::Link;
use crate::table::{Entry, Pdo};
use crate::wire::Wire;
use ethercrab::SubDevice;
use ethercrab::error::Error;

/// Word address of the first category (ETG.1000.6).
const FIRST_CATEGORY: u16 = 0x40;
/// Category type (ETG.2010): inputs (TxPDO).
const TX_PDO: u16 = 50;
/// Outputs (RxPDO).
const RX_PDO: u16 = 51;
/// Distributed clock.
const DISTRIBUTED_CLOCK: u16 = 60;
/// End of the categories.
const END: u16 = 0xffff;
/// Largest number of categories that are read, so that a damaged EEPROM causes no endless loop.
const MOST_CATEGORIES: u32 = 64;

/// The part of the EEPROM that the table is compared with.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Sii {
    /// Outputs (RxPDO).
    pub outputs: Vec<Pdo>,
    /// Inputs (TxPDO).
    pub inputs: Vec<Pdo>,
    /// AssignActivate words (for registers 0x0980 and 0x0981) of the device's clock modes.
    pub activations: Vec<u16>,
}

/// Reads the categories of process data and of the distributed clock; other categories are skipped.
///
/// # Errors
///
/// The error of a read of the EEPROM, as for a device that does not answer.
pub(crate) fn read<L: Link>(wire: &mut Wire<L>, device: &SubDevice) -> Result<Sii, Error> {
    let main = wire.main;
    let mut sii = Sii::default();
    let mut word = FIRST_CATEGORY;
    for _ in 0..MOST_CATEGORIES {
        let mut header = [0; 4];
        wire.run(device.eeprom_read_raw(main, word, &mut header))?;
        let (kind, words) = (u16_at(&header, 0), u16_at(&header, 2));
        if kind == END {
            break;
        }
        if matches!(kind, TX_PDO | RX_PDO | DISTRIBUTED_CLOCK) {
            let mut data = vec![0; 2 * usize::from(words.min(1024))];
            wire.run(device.eeprom_read_raw(main, word.saturating_add(2), &mut data))?;
            match kind {
                TX_PDO => sii.inputs.extend(pdos(&data)),
                RX_PDO => sii.outputs.extend(pdos(&data)),
                _ => sii.activations.extend(data.chunks_exact(24).map(|mode| u16_at(mode, 14))),
            }
        }
        word = word.saturating_add(2).saturating_add(words);
    }
    Ok(sii)
}

/// Little-endian number of 16 bit at an offset \[byte\]; bytes beyond the end are 0.
fn u16_at(bytes: &[u8], at: usize) -> u16 {
    u16::from(bytes.get(at).copied().unwrap_or(0))
        | u16::from(bytes.get(at + 1).copied().unwrap_or(0)) << 8
}

/// PDOs: a header of 8 bytes with index and number of entries, then 8 bytes for each entry. PDOs that are assigned to
/// no sync manager (0xFF) are left out.
fn pdos(mut data: &[u8]) -> Vec<Pdo> {
    let mut pdos = Vec::new();
    while let Some((header, rest)) = data.split_at_checked(8) {
        let count = 8 * usize::from(header[2]);
        let Some((entries, rest)) = rest.split_at_checked(count) else { break };
        let entry = |e: &[u8]| Entry { index: u16_at(e, 0), sub: e[2], bits: e[5] };
        if header[3] != 0xff {
            pdos.push(Pdo {
                list: u16_at(header, 0),
                entries: entries.chunks_exact(8).map(entry).collect(),
            });
        }
        data = rest;
    }
    pdos
}
