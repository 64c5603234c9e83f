//! Results of Dymola and OpenModelica: MAT files of level 4 with the matrices `name`, `dataInfo` and `data_2`, which
//! assign columns to variables.

use super::value::{MOST_NUMBERS, MOST_ROWS, Matrix, Room, Value, Variable};
use crate::heading::Heading;
use crate::sampled::{Column, Samples};

/// The signals of a simulation result; `None` if the file is not one.
///
/// # Errors
///
/// The missing or inconsistent part.
pub(super) fn samples(
    variables: &[Variable],
    remarks: &mut Vec<String>,
) -> Option<Result<Samples, String>> {
    let of = |name: &str| variables.iter().find(|v| v.name == name).map(|v| &v.value);
    let Some(Value::Text(class)) = of("Aclass") else { return None };
    let is_trajectory = class.first().is_some_and(|row| row.trim() == "Atrajectory");
    if !is_trajectory {
        return None;
    }
    // transposed files store each variable as a column, others as a row
    let is_transposed = class.get(3).is_none_or(|row| row.trim() == "binTrans");
    let texts = |name: &str| match of(name) {
        Some(Value::Text(rows)) if is_transposed => Some(columns_of(rows)),
        Some(Value::Text(rows)) => Some(rows.clone()),
        _ => None,
    };
    let (Some(names), Some(info), Some(data)) = (
        texts("name"),
        of("dataInfo").and_then(Value::numbers),
        of("data_2").and_then(Value::numbers),
    ) else {
        return Some(Err(
            "a result of Dymola or OpenModelica without name, dataInfo or data_2".into()
        ));
    };
    let descriptions = texts("description").unwrap_or_default();
    Some(Trajectories { names, descriptions, info, data, is_transposed }.samples(remarks))
}

/// The matrices of a result.
struct Trajectories<'a> {
    names: Vec<String>,
    descriptions: Vec<String>,
    info: &'a Matrix,
    data: &'a Matrix,
    is_transposed: bool,
}

impl Trajectories<'_> {
    fn samples(&self, remarks: &mut Vec<String>) -> Result<Samples, String> {
        // data_2: the time, then the variables
        let (rows, columns) = self.data.shape();
        let (variables, samples) =
            if self.is_transposed { (rows, columns) } else { (columns, rows) };
        let values = |variable: usize, sign: f64| -> Vec<f64> {
            let (first, step) = match self.is_transposed {
                true => (variable, rows),
                false => (variable * rows, 1),
            };
            let all = self.data.values.iter().skip(first).step_by(step);
            all.take(samples).map(|v| sign * v).collect()
        };
        if variables == 0 || samples < 2 {
            return Err(format!("data_2 has {variables} variables of {samples} samples"));
        }
        let time = Column::of("time", self.heading(0, "time"), values(0, 1.0));
        let (mut columns, mut constants, mut aliases) = (Vec::new(), 0, 0);
        let mut is_taken = vec![false; variables];
        let mut room = Room::new();
        for (k, name) in self.names.iter().enumerate().skip(1) {
            let Some((matrix, place)) = self.place(k) else {
                return Err(format!("dataInfo has no entry for {}", name.trim()));
            };
            let variable = place.unsigned_abs() as usize;
            if matrix == 1 {
                constants += 1;
                continue;
            }
            if matrix != 2 || variable == 0 || variable > variables {
                return Err(format!(
                    "dataInfo says that {} is column {variable} of data_{matrix}, which there is not",
                    name.trim()
                ));
            }
            // further names of a variable are kept only while there is room
            let is_alias = std::mem::replace(&mut is_taken[variable - 1], true);
            if is_alias && (columns.len() + 2) * samples > MOST_NUMBERS {
                aliases += 1;
                continue;
            }
            if !room.takes(1) {
                continue;
            }
            let sign = if place < 0 { -1.0 } else { 1.0 };
            let values = values(variable - 1, sign);
            columns.push(Column::of(name.trim(), self.heading(k, name.trim()), values));
        }
        remarks.push("a result of Dymola or OpenModelica".into());
        if constants > 0 {
            remarks.push(format!("{constants} parameters (data_1) are constant and are left out"));
        }
        remarks.extend(room.remark());
        if aliases > 0 {
            remarks.push(format!(
                "{aliases} further names of variables that are there already are left out"
            ));
        }
        Ok(Samples { time, columns })
    }

    /// Number of the data matrix, and signed column in it; a negative one has the opposite sign.
    fn place(&self, name: usize) -> Option<(i64, i64)> {
        let (rows, columns) = self.info.shape();
        let at = |k: usize| match self.is_transposed {
            true => (k < rows && name < columns).then(|| self.info.values[name * rows + k]),
            false => (k < columns && name < rows).then(|| self.info.values[k * rows + name]),
        };
        Some((at(0)? as i64, at(1)? as i64))
    }

    /// The name, with the unit from its description: `Position [m]`, `Angle [rad|deg]`, `Time in [s]`. A second unit
    /// is for display only.
    fn heading(&self, k: usize, name: &str) -> Heading {
        let bracket = |text: &String| {
            let (_, inner) = text.split_once('[')?;
            let (unit, _) = inner.split_once(']')?;
            unit.split('|').next().map(String::from)
        };
        let unit = self.descriptions.get(k).and_then(bracket).unwrap_or_default();
        Heading { name: name.into(), ..Heading::with_unit("", &unit) }
    }
}

/// Columns of a matrix of characters, up to the largest number of variables in a result.
fn columns_of(rows: &[String]) -> Vec<String> {
    let characters: Vec<Vec<char>> = rows.iter().map(|r| r.chars().collect()).collect();
    let count = characters.iter().map(Vec::len).max().unwrap_or(0);
    let column = |k: usize| characters.iter().map(move |row| row.get(k).copied().unwrap_or(' '));
    (0..count.min(MOST_ROWS)).map(|k| column(k).collect()).collect()
}
