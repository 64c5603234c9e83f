//! Assignment of a MAT file's variables to the times that they were sampled at.

use super::simulink::{numbered, numbered_from, recording, structure_with_time};
use super::value::{Matrix, Room, Structure, Value, Variable};
use crate::heading::Heading;
use crate::path;
use crate::sampled::{Column, Samples};

/// Signals found in a file.
pub(super) struct Arranged {
    pub(super) samples: Vec<Samples>,
    pub(super) remarks: Vec<String>,
    /// Paths of all numeric variables, for messages.
    pub(super) names: Vec<String>,
    /// Whether the time variable named by the mapping exists.
    pub(super) has_wanted: bool,
    room: Room,
}

/// A time vector with the path of its variable.
#[derive(Clone)]
struct Time<'a> {
    path: String,
    values: &'a [f64],
}

/// Finds times and the signals of equal length. `wanted` is the name or path of the time variable, if given.
pub(super) fn arrange(variables: &[Variable], wanted: Option<&str>) -> Arranged {
    let mut arranged = Arranged {
        samples: Vec::new(),
        remarks: Vec::new(),
        names: Vec::new(),
        has_wanted: false,
        room: Room::new(),
    };
    let entries = variables.iter().map(|v| (v.name.as_str(), &v.value)).collect();
    arranged.scope("", entries, &[], wanted);
    arranged.remarks.extend(arranged.room.remark());
    arranged
}

impl Arranged {
    /// The variables of a file, or the fields of a structure; times of an enclosing scope apply there too.
    fn scope<'a>(
        &mut self,
        prefix: &str,
        entries: Vec<(&'a str, &'a Value)>,
        around: &[Time<'a>],
        wanted: Option<&str>,
    ) {
        let is_time = |name: &str, matrix: &Matrix| match wanted {
            _ if !matrix.is_vector() => false,
            Some(wanted) => name == wanted || within(prefix, name) == wanted,
            None => Heading::parse(name).is_named_as_time() || name.eq_ignore_ascii_case("datenum"),
        };
        let mut times: Vec<Time<'a>> = Vec::new();
        let mut matrices: Vec<(&str, &Matrix)> = Vec::new();
        for (name, value) in &entries {
            match value {
                Value::Numbers(matrix) if is_time(name, matrix) => {
                    times.push(Time { path: within(prefix, name), values: &matrix.values });
                }
                Value::Numbers(matrix) => matrices.push((name, matrix)),
                _ => {}
            }
        }
        self.has_wanted |= !times.is_empty();
        let own = times.len();
        times.extend(around.iter().cloned());
        self.names.extend(matrices.iter().map(|(name, _)| within(prefix, name)));
        let others = self.assign(prefix, matrices, (&times, own), wanted);
        self.remark_on_omitted(&others, &times);
        for (name, value) in entries {
            let path = within(prefix, name);
            match value {
                Value::Structure(structure) => self.structure(&path, structure, &times, wanted),
                Value::Unread(what) => {
                    self.remarks.push(format!("{path} is {what}, which is not read"));
                }
                Value::Numbers(_) | Value::Text(_) => {}
            }
        }
    }

    /// Assigns arrays to the first time of their length; returns those that have none. The first `own` times are those
    /// of the scope itself.
    fn assign<'a>(
        &mut self,
        prefix: &str,
        matrices: Vec<(&str, &'a Matrix)>,
        (times, own): (&[Time<'_>], usize),
        wanted: Option<&str>,
    ) -> Vec<(String, &'a Matrix)> {
        let mut groups: Vec<Vec<Column>> = times.iter().map(|_| Vec::new()).collect();
        let mut same_lengths: Vec<(usize, usize)> = Vec::new();
        let mut others = Vec::new();
        for (name, matrix) in matrices {
            // a structure of only Time and Data is itself the signal
            let heading = match name.eq_ignore_ascii_case("data") && !prefix.is_empty() {
                true => prefix.to_string(),
                false => within(prefix, name),
            };
            let fits = |k: &usize| {
                let samples = times[*k].values.len();
                samples > 1 && matrix.has_signals(samples)
            };
            let mut fitting = (0..times.len()).filter(fits);
            let fitting = (fitting.next(), fitting.find(|k| *k < own));
            if let (Some(taken), Some(other)) = fitting
                && times[taken].values != times[other].values
                && !same_lengths.contains(&(taken, other))
            {
                same_lengths.push((taken, other));
            }
            match fitting.0 {
                Some(k) => {
                    let signals = self.room.signals(matrix, times[k].values.len());
                    let signals = signals.unwrap_or_default();
                    groups[k].extend(numbered(&heading, &path::heading(&heading), signals));
                }
                None if times.is_empty() && wanted.is_none() => {
                    match with_own_time(&heading, matrix, &mut self.room) {
                        Some(samples) => self.samples.push(samples),
                        None => others.push((heading, matrix)),
                    }
                }
                None => others.push((heading, matrix)),
            }
        }
        for (taken, other) in same_lengths {
            let (taken, other) = (&times[taken].path, &times[other].path);
            self.remarks.push(format!(
                "{taken} and {other} are times of one length: signals of that length are taken with {taken}; [log.time] column = \"...\" in a mapping says which"
            ));
        }
        for (time, columns) in times.iter().zip(groups).filter(|(_, columns)| !columns.is_empty()) {
            let time = Column::new(&time.path, time.values.to_vec());
            self.samples.push(Samples { time, columns });
        }
        others
    }

    /// A structure: a Simulink export, or a scope of its own.
    fn structure<'a>(
        &mut self,
        path: &str,
        structure: &'a Structure,
        times: &[Time<'a>],
        wanted: Option<&str>,
    ) {
        let found = structure_with_time(path, structure, &mut self.room, &mut self.remarks);
        if let Some(samples) = found {
            self.samples.extend([samples].into_iter().filter(|s| !s.columns.is_empty()));
            return;
        }
        if let Some(all) = recording(path, structure, &mut self.room, &mut self.remarks) {
            self.samples.extend(all.into_iter().filter(|s| !s.columns.is_empty()));
            return;
        }
        for k in 0..structure.count {
            let prefix = match structure.count {
                1 => path.to_string(),
                _ => format!("{path}({})", k + 1),
            };
            let fields = structure.fields.iter();
            let fields = fields.filter_map(|(f, v)| Some((f.as_str(), v.get(k)?)));
            self.scope(&prefix, fields.collect(), times, wanted);
        }
    }

    fn remark_on_omitted(&mut self, others: &[(String, &Matrix)], times: &[Time<'_>]) {
        let parameters = others.iter().filter(|(_, m)| m.values.len() <= 1).count();
        for (heading, matrix) in others.iter().filter(|(_, m)| m.values.len() > 1) {
            let shape: Vec<String> = matrix.dimensions.iter().map(usize::to_string).collect();
            let shape = shape.join(" x ");
            let lengths: Vec<String> =
                times.iter().map(|t| format!("{} {}", t.path, t.values.len())).collect();
            self.remarks.push(match lengths.is_empty() {
                true => format!("{heading} is {shape} and has no time: it is left out"),
                false => format!(
                    "{heading} is {shape}, the time is another length ({}): it is left out",
                    lengths.join(", ")
                ),
            });
        }
        if parameters > 0 {
            self.remarks
                .push(format!("{parameters} single numbers are no signals and are left out"));
        }
    }
}

/// Path of a variable or field in a scope; the file's own has no name.
fn within(scope: &str, name: &str) -> String {
    match scope.is_empty() {
        true => name.to_string(),
        false => format!("{scope}.{name}"),
    }
}

/// An array whose first row (To File) or first column is the time: it increases, and the scope has no other time.
fn with_own_time(name: &str, matrix: &Matrix, room: &mut Room) -> Option<Samples> {
    let (rows, columns) = matrix.shape();
    let samples = if columns >= rows { [columns, rows] } else { [rows, columns] };
    for samples in samples {
        let several = matrix.values.len() >= 2 * samples && samples > 2;
        if !several || !matrix.has_signals(samples) {
            continue;
        }
        let time = matrix.signal(0, samples);
        let grows = time.windows(2).all(|w| w[1] >= w[0]) && time.first() < time.last();
        if grows {
            let mut signals = room.signals(matrix, samples)?;
            // without room the list is empty
            signals.drain(..signals.len().min(1));
            return Some(Samples {
                time: Column::new(&format!("{name}_1"), time),
                columns: numbered_from(2, name, &path::heading(name), signals),
            });
        }
    }
    None
}
