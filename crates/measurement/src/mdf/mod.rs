//! MDF 4 files (ASAM) of CANape, INCA, vMeasure, asammdf: groups of channels, each with its own time; plain and packed data.
//!
//! ```text
//! file -block-> group, channel (what lies where in a record) -data (blocks, unpacked)-> columns -sampled-> channels
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

/// How a file begins, and how one whose writer was interrupted.
pub(crate) const BEGINS: [&[u8; 8]; 2] = [b"MDF     ", b"UnFinMF "];

/// Where the first block stands.
const FIRST: u64 = 64;

/// Reads an MDF 4 file. Times are those of each group, or the channel that `time` names.
///
/// # Errors
///
/// [`MeasurementError`] when nothing in it can be used, with what is there.
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
    let groups = groups(&mut blocks, time, &mut remarks)
        .map_err(|reason| MeasurementError::Format { file: file.clone(), reason })?;
    if let Some(wanted) = column
        && !groups.iter().any(|g| g.time.as_ref().is_some_and(|t| t.is_named(wanted)))
    {
        let fields = groups.iter().flat_map(|g| g.time.iter().chain(&g.fields));
        let all: Vec<&str> = fields.map(|f| f.heading.as_str()).collect();
        let reason =
            format!("the mapping names \"{wanted}\" as the time; channels are: {}", all.join(", "));
        return Err(MeasurementError::Mapping { file, reason });
    }
    let mut assembly = Assembly::new(&file, None, remarks);
    for group in groups {
        let headings = group.fields.into_iter().map(|f| (f.heading, f.read)).collect();
        let unit = format!("record (of {})", group.name);
        assembly.add_recorded(headings, group.recording.finish(&file, &unit)?);
    }
    assembly.finish()
}

/// All groups with their records.
fn groups<R: Read + Seek>(
    file: &mut Blocks<R>,
    stated: Option<&TimeColumn>,
    remarks: &mut Vec<String>,
) -> Result<Vec<Group>, Damage> {
    let head = file.bytes(0, FIRST)?;
    let is_unfinished = head.starts_with(BEGINS[1]);
    let version =
        head.get(8..16).map_or(String::new(), |v| String::from_utf8_lossy(v).into_owned());
    if !version.starts_with('4') {
        return Err(format!(
            "an MDF file of version {}: 4 is read; convert it, with asammdf say",
            version.trim_matches([' ', '\0'])
        ));
    }
    if is_unfinished {
        remarks.push("its recording was interrupted: it is read as far as it goes".into());
    }
    let header = file.block(FIRST, &[b"##HD"])?;
    let mut all = DataGroup::all(file, header.link(0))?;
    for group in all.iter_mut().flat_map(|d| &mut d.groups) {
        group.choose_time(stated);
        let most = group.most_cycles(file.size.saturating_mul(UNPACKED));
        group.cycles = if is_unfinished { most } else { group.cycles.min(most) };
    }
    let total = all.iter().flat_map(|d| &d.groups).filter(|g| g.is_wanted());
    let total = total.map(Group::numbers).fold(0, u64::saturating_add).max(1);
    for data in &mut all {
        for group in data.groups.iter_mut().filter(|g| g.is_wanted()) {
            // each group's part of all numbers
            let part = match total > MOST as u64 {
                true => (MOST as f64 * group.numbers() as f64 / total as f64) as usize,
                false => usize::MAX,
            };
            group.recording = Recording::new(group.fields.len(), part);
        }
        if let Err(damage) = data.read(file, is_unfinished) {
            remarks.push(format!("it is damaged, and read up to there: {damage}"));
        }
    }
    let groups: Vec<Group> = all.into_iter().flat_map(|d| d.groups).collect();
    for group in &groups {
        group.say(is_unfinished, remarks);
    }
    Ok(groups.into_iter().filter(Group::is_wanted).collect())
}

/// How many times its size a file can unpack to, as far as records are counted ahead.
const UNPACKED: u64 = 1100;
