//! MDF 4 files (ASAM) of CANape, INCA, vMeasure, asammdf: groups of channels, each with its own time; compressed or
//! not.
//!
//! ```text
//! file -block-> group, channel (layout of a record) -data (blocks, decompressed)-> columns -sampled-> channels
//! ```

mod block;
mod channel;
mod conversion;
mod data;
mod group;

use crate::channel::Measurement;
use crate::error::MeasurementError;
use crate::recording::Recording;
use crate::sampled::Assembly;
use crate::thinning::MOST;
use crate::time_column::TimeColumn;
use block::{Blocks, Damage};
use group::{DataGroup, Group};
use std::fs::File;
use std::io::{BufReader, Read, Seek};
use std::path::Path;

/// First bytes of a file, and of one whose writer was interrupted.
pub(crate) const BEGINS: [&[u8; 8]; 2] = [b"MDF     ", b"UnFinMF "];

/// Position of the first block.
const FIRST: u64 = 64;

/// Reads an MDF 4 file. The times are those of each group, or the channel that `time` names.
///
/// # Errors
///
/// [`MeasurementError`] if the file has no usable signal, with a description of its content.
pub(crate) fn read(
    path: &Path,
    time: Option<&TimeColumn>,
) -> Result<Measurement, MeasurementError> {
    let file = path.display().to_string();
    let failed = |error| MeasurementError::File { file: file.clone(), error };
    let source = File::open(path).map_err(failed)?;
    let mut blocks = Blocks::new(BufReader::new(source)).map_err(failed)?;
    let mut remarks = Vec::new();
    let column = time.and_then(|t| t.column.as_deref());
    let format = |reason| MeasurementError::Format { file: file.clone(), reason };
    let is_unfinished = is_unfinished(&mut blocks, &mut remarks).map_err(format)?;
    let header = blocks.block(FIRST, &[b"##HD"]).map_err(format)?;
    let mut all = DataGroup::all(&mut blocks, header.link(0)).map_err(format)?;
    let named: Vec<String> = all.iter().flat_map(|d| &d.groups).flat_map(Group::headings).collect();
    all.iter_mut().flat_map(|d| &mut d.groups).for_each(|g| g.choose_time(time));
    let wrong = |reason| MeasurementError::Mapping { file: file.clone(), reason };
    if let Some(wanted) = column
        && all.iter().flat_map(|d| &d.groups).all(Group::lacks_time)
    {
        return Err(wrong(format!(
            "the mapping names \"{wanted}\" as the time; channels are: {}",
            named.join(", ")
        )));
    }
    read_records(&mut blocks, &mut all, is_unfinished, &mut remarks);
    let groups: Vec<Group> = all.into_iter().flat_map(|d| d.groups).collect();
    if let Some(reason) = groups.iter().find_map(|g| g.refused.clone()).filter(|_| column.is_some())
    {
        return Err(wrong(reason));
    }
    groups.iter().for_each(|g| g.add_remarks(is_unfinished, &mut remarks));
    let mut assembly = Assembly::new(&file, None, remarks);
    for group in groups.into_iter().filter(|g| g.is_wanted() && g.refused.is_none()) {
        let headings = group.fields.into_iter().map(|f| (f.heading, f.read)).collect();
        let unit = format!("record (of {})", group.name);
        assembly.add_recorded(headings, group.recording.finish(&file, &unit)?);
    }
    assembly.finish()
}

/// Whether the writer of a file was interrupted.
///
/// # Errors
///
/// Message about an unsupported version.
fn is_unfinished<R: Read + Seek>(
    file: &mut Blocks<R>,
    remarks: &mut Vec<String>,
) -> Result<bool, Damage> {
    let head = file.bytes(0, FIRST)?;
    let version =
        head.get(8..16).map_or(String::new(), |v| String::from_utf8_lossy(v).into_owned());
    if !version.starts_with('4') {
        return Err(format!(
            "an MDF file of version {}: 4 is read; convert it, with asammdf say",
            version.trim_matches([' ', '\0'])
        ));
    }
    let is_unfinished = head.starts_with(BEGINS[1]);
    if is_unfinished {
        remarks.push("its recording was interrupted: it is read as far as it goes".into());
    }
    Ok(is_unfinished)
}

/// Reads the records of all groups up to the first damage.
fn read_records<R: Read + Seek>(
    file: &mut Blocks<R>,
    all: &mut [DataGroup],
    is_unfinished: bool,
    remarks: &mut Vec<String>,
) {
    let bytes = file.size.saturating_mul(UNPACKED);
    all.iter_mut().flat_map(|d| &mut d.groups).for_each(|g| g.expect(bytes, is_unfinished));
    let total = all.iter().flat_map(|d| &d.groups).filter(|g| g.is_wanted());
    let total = total.map(Group::numbers).fold(0, u64::saturating_add).max(1);
    for data in all {
        // each group gets its share of the limit of numbers
        for group in data.groups.iter_mut().filter(|g| g.is_wanted()) {
            let part = (MOST as f64 * group.numbers() as f64 / total as f64) as usize;
            group.recording = Recording::new(group.fields.len(), part);
        }
        match data.is_by_columns(file) {
            Ok(true) => {
                data.groups.clear();
                remarks.push(
                    "records that are stored by columns (LD or DV of MDF 4.2) are not supported and are left out; convert it to version 4.1, with asammdf say".into(),
                );
            }
            Ok(false) => {
                if let Err(damage) = data.read(file, is_unfinished) {
                    remarks.push(format!("it is damaged, and read up to there: {damage}"));
                }
            }
            Err(damage) => remarks.push(format!("it is damaged: {damage}")),
        }
    }
}

/// Largest compression ratio assumed for the expected number of records.
const UNPACKED: u64 = 1100;
