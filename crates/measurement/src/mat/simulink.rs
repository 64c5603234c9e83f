//! Conventions of Simulink and dSPACE in MAT files: structures with time, arrays whose first row is the time, and
//! ControlDesk's structures of X and Y.

use super::value::{Matrix, Room, Structure, Value};
use crate::heading::Heading;
use crate::sampled::{Column, Samples};

/// A structure with time, as To Workspace and scopes write it: `time`, and `signals` with `values` and `label`.
pub(super) fn structure_with_time(
    name: &str,
    structure: &Structure,
    room: &mut Room,
    remarks: &mut Vec<String>,
) -> Option<Samples> {
    let time = structure.field("time")?.numbers()?;
    let signals = structure.field("signals")?.structure()?;
    if time.values.len() < 2 {
        remarks.push(format!(
            "{name} is a structure without times: save it as \"Structure With Time\" in Simulink"
        ));
        return Some(Samples { time: Column::new("time", Vec::new()), columns: Vec::new() });
    }
    let mut columns = Vec::new();
    for k in 0..signals.count {
        // a label, or the block's name without its path
        let text = |field: &str| signals.field_at(k, field).and_then(Value::text);
        let block = || text("blockName").and_then(|path| path.rsplit('/').next());
        let label = text("label").or_else(|| text("title")).or_else(block);
        let label = label.map(|l| l.trim_matches(['<', '>'])).filter(|l| !l.is_empty());
        let label = label.unwrap_or(name);
        let values = signals.field_at(k, "values").and_then(Value::numbers);
        match values.and_then(|v| room.signals(v, time.values.len())) {
            Some(all) => columns.extend(numbered(label, &Heading::parse(label), all)),
            None => remarks.push(format!(
                "{name}.signals({}) ({label}) has other than {} samples and is left out",
                k + 1,
                time.values.len()
            )),
        }
    }
    Some(Samples { time: Column::new(&format!("{name}.time"), time.values.clone()), columns })
}

/// Columns of a matrix with one or several signals and a parsed heading.
pub(super) fn numbered(name: &str, read: &Heading, all: Vec<Vec<f64>>) -> Vec<Column> {
    match <[Vec<f64>; 1]>::try_from(all) {
        Ok([values]) => vec![Column::of(name, read.clone(), values)],
        Err(all) => numbered_from(1, name, read, all),
    }
}

/// Columns with numbers that start at a given one.
pub(super) fn numbered_from(
    first: usize,
    name: &str,
    read: &Heading,
    all: Vec<Vec<f64>>,
) -> Vec<Column> {
    let column = |(k, values): (usize, Vec<f64>)| {
        let short = Heading { name: format!("{}_{k}", read.name), ..read.clone() };
        Column::of(&format!("{name}_{k}"), short, values)
    };
    (first..).zip(all).map(column).collect()
}

/// A recording of dSPACE ControlDesk: `X(k).Data` are times, `Y(k).Data` signals with `Name`, `Unit` and `XIndex`.
pub(super) fn recording(
    name: &str,
    structure: &Structure,
    room: &mut Room,
    remarks: &mut Vec<String>,
) -> Option<Vec<Samples>> {
    let (x, y) = (structure.field("X")?.structure()?, structure.field("Y")?.structure()?);
    let data = |of: &'_ Structure, k| -> Option<Matrix> {
        let matrix = of.field_at(k, "Data")?.numbers()?;
        Some(Matrix { dimensions: matrix.dimensions.clone(), values: matrix.values.clone() })
    };
    let mut rasters = Vec::new();
    for k in 0..x.count {
        let unit = x.field_at(k, "Unit").and_then(Value::text).unwrap_or("");
        let values = data(x, k)?.values;
        let time =
            Column::of(&format!("{name}.X({})", k + 1), Heading::with_unit("time", unit), values);
        rasters.push(Samples { time, columns: Vec::new() });
    }
    for k in 0..y.count {
        let index = y.field_at(k, "XIndex").and_then(Value::numbers);
        let index = index.and_then(|i| i.values.first()).map_or(1, |i| *i as usize);
        let text = |field: &str| y.field_at(k, field).and_then(Value::text);
        let heading = text("Name").map_or_else(|| format!("Y({})", k + 1), |n| n.replace('"', ""));
        let read = Heading::with_unit(block_of(&heading), text("Unit").unwrap_or(""));
        let raster = index.checked_sub(1).and_then(|i| rasters.get_mut(i));
        let signals = match (&raster, data(y, k)) {
            (Some(raster), Some(data)) => room.signals(&data, raster.time.len()),
            _ => None,
        };
        let (Some(raster), Some(signals)) = (raster, signals) else {
            remarks.push(format!("{heading} has other samples than its time and is left out"));
            continue;
        };
        let several = signals.len() > 1;
        for (k, values) in signals.into_iter().enumerate() {
            let ending = if several { format!("_{}", k + 1) } else { String::new() };
            let read = Heading { name: format!("{}{ending}", read.name), ..read.clone() };
            raster.columns.push(Column::of(&format!("{heading}{ending}"), read, values));
        }
    }
    remarks.push(format!("{name} is a recording of dSPACE"));
    Some(rasters)
}

/// Name of the block in a model's path, without its port: `Position [mm]` of `Model Root/Position [mm]/Out1`.
fn block_of(path: &str) -> &str {
    let mut rest = path;
    loop {
        let (before, last) = rest.rsplit_once('/').unwrap_or(("", rest));
        let is_port = ["In", "Out"].iter().any(|port| {
            last.strip_prefix(port).is_some_and(|n| n.chars().all(|c| c.is_ascii_digit()))
        });
        if before.is_empty() || !(is_port || last == "Value") {
            return last;
        }
        rest = before;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_signal_is_named_after_its_block() {
        for (path, block) in [
            ("Model Root/Position [mm]/Out1", "Position [mm]"),
            ("Platform()://Crane/Model Root/p_A/In2", "p_A"),
            ("Model Root/stroke", "stroke"),
            ("Out1", "Out1"),
            ("Value", "Value"),
        ] {
            assert_eq!(block_of(path), block);
        }
    }
}
