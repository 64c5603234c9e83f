//! Variables of a MAT file, put beside the times that they belong to.

use super::simulink::{numbered, numbered_from, recording, structure_with_time};
use super::value::{Matrix, Value, Variable};
use crate::heading::Heading;
use crate::path;
use crate::sampled::{Column, Samples};

/// What was found in a file.
#[derive(Default)]
pub(super) struct Arranged {
    pub(super) samples: Vec<Samples>,
    pub(super) remarks: Vec<String>,
    /// Paths of all numbers, for messages.
    pub(super) names: Vec<String>,
    /// Whether the time that was asked for by name is there.
    pub(super) has_wanted: bool,
}

/// A time with the path of its variable.
#[derive(Clone)]
struct Time<'a> {
    path: String,
    values: &'a [f64],
}

/// Finds the times, and the signals that are as long. `wanted` is the name or path of the time, where it was given.
pub(super) fn arrange(variables: &[Variable], wanted: Option<&str>) -> Arranged {
    let mut arranged = Arranged::default();
    let entries = variables.iter().map(|v| (v.name.as_str(), &v.value)).collect();
    arranged.scope("", entries, &[], wanted);
    arranged
}

impl Arranged {
    /// The variables of a file, or the fields of a structure; times of what is around are for them too.
    fn scope<'a>(
        &mut self,
        prefix: &str,
        entries: Vec<(&'a str, &'a Value)>,
        around: &[Time<'a>],
        wanted: Option<&str>,
    ) {
        let path = |name: &str| match prefix.is_empty() {
            true => name.to_string(),
            false => format!("{prefix}.{name}"),
        };
        let is_time = |name: &str, matrix: &Matrix| match wanted {
            _ if !matrix.is_vector() => false,
            Some(wanted) => name == wanted || path(name) == wanted,
            None => Heading::parse(name).is_named_as_time() || name.eq_ignore_ascii_case("datenum"),
        };
        let mut times: Vec<Time<'a>> = Vec::new();
        let mut matrices: Vec<(&str, &Matrix)> = Vec::new();
        for (name, value) in &entries {
            match value {
                Value::Numbers(matrix) if is_time(name, matrix) => {
                    times.push(Time { path: path(name), values: &matrix.values });
                }
                Value::Numbers(matrix) => matrices.push((name, matrix)),
                _ => {}
            }
        }
        self.has_wanted |= !times.is_empty();
        times.extend(around.iter().cloned());
        self.names.extend(matrices.iter().map(|(name, _)| path(name)));
        let mut groups: Vec<Samples> = times
            .iter()
            .map(|t| Samples { time: Column::new(&t.path, t.values.to_vec()), columns: Vec::new() })
            .collect();
        let mut others = Vec::new();
        for (name, matrix) in matrices {
            // Time and Data only: the signal is the structure
            let heading = match name.eq_ignore_ascii_case("data") && !prefix.is_empty() {
                true => prefix.to_string(),
                false => path(name),
            };
            let fitting = times.iter().position(|t| t.values.len() > 1).and_then(|_| {
                times
                    .iter()
                    .enumerate()
                    .find_map(|(k, t)| matrix.signals(t.values.len()).map(|signals| (k, signals)))
            });
            match fitting {
                Some((k, signals)) => {
                    groups[k].columns.extend(numbered(&heading, &path::heading(&heading), signals))
                }
                None if times.is_empty() && wanted.is_none() => {
                    match with_own_time(&heading, matrix) {
                        Some(samples) => self.samples.push(samples),
                        None => others.push((heading, matrix)),
                    }
                }
                None => others.push((heading, matrix)),
            }
        }
        self.samples.extend(groups.into_iter().filter(|g| !g.columns.is_empty()));
        self.say_what_is_left_out(&others, &times);
        for (name, value) in entries {
            let path = path(name);
            match value {
                Value::Structure(structure) => {
                    if let Some(samples) = structure_with_time(&path, structure, &mut self.remarks)
                    {
                        self.samples
                            .extend([samples].into_iter().filter(|s| !s.columns.is_empty()));
                    } else if let Some(all) = recording(&path, structure, &mut self.remarks) {
                        self.samples.extend(all.into_iter().filter(|s| !s.columns.is_empty()));
                    } else {
                        for k in 0..structure.count {
                            let prefix = match structure.count {
                                1 => path.clone(),
                                _ => format!("{path}({})", k + 1),
                            };
                            let fields = structure.fields.iter();
                            let fields = fields.filter_map(|(f, v)| Some((f.as_str(), v.get(k)?)));
                            self.scope(&prefix, fields.collect(), &times, wanted);
                        }
                    }
                }
                Value::Unread(what) => {
                    self.remarks.push(format!("{path} is {what}, which is not read"));
                }
                Value::Numbers(_) | Value::Text(_) => {}
            }
        }
    }

    fn say_what_is_left_out(&mut self, others: &[(String, &Matrix)], times: &[Time<'_>]) {
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

/// An array whose first row (To File) or first column is the time: it grows, and nothing else in the scope is a time.
fn with_own_time(name: &str, matrix: &Matrix) -> Option<Samples> {
    let (rows, columns) = matrix.shape();
    let samples = if columns >= rows { [columns, rows] } else { [rows, columns] };
    for samples in samples {
        let several = matrix.values.len() >= 2 * samples && samples > 2;
        let Some(mut signals) = matrix.signals(samples).filter(|_| several) else { continue };
        let time = signals.remove(0);
        let grows = time.windows(2).all(|w| w[1] >= w[0]) && time.first() < time.last();
        if grows {
            return Some(Samples {
                time: Column::new(&format!("{name}_1"), time),
                columns: numbered_from(2, name, &path::heading(name), signals),
            });
        }
    }
    None
}
