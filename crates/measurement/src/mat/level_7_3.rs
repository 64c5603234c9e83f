//! MAT files of level 7.3: HDF5 with reversed dimensions. Structures are groups; arrays of structures hold references
//! into the group `#refs#`.

use super::numbers::{ByteOrder, Storage};
use super::value::{Damage, MOST_NUMBERS, Matrix, Structure, Value, Variable};
use hdf5_reader::group::Group;
use hdf5_reader::{Dataset, Datatype, Hdf5File, OpenOptions, ReferenceType};
use std::collections::HashMap;
use std::path::Path;

/// Largest size of a matrix \[bytes\]: all numbers that are kept, as doubles.
const LARGEST: usize = 8 * MOST_NUMBERS;
/// Largest chunk of a matrix \[bytes\].
const LARGEST_CHUNK: usize = 32 << 20;
/// Deepest nesting of structures.
const DEEPEST: u32 = 16;
/// Largest product of elements and fields of arrays of structures.
const MOST_REFERENCES: usize = 10_000;
/// Largest number of objects in the group `#refs#`, which holds cells too.
const MOST_REFERRED: usize = 50_000;
/// Memory of a value besides its numbers, counted in numbers.
const COST: usize = 16;

/// Reads all variables; an unreadable one is left out, with a remark.
///
/// # Errors
///
/// Description of the damage, or of a limit that the file exceeds.
pub(super) fn read(path: &Path, remarks: &mut Vec<String>) -> Result<Vec<Variable>, Damage> {
    let options = OpenOptions::default()
        .with_chunk_cache_bytes(16 << 20)
        .with_max_chunk_bytes(LARGEST_CHUNK)
        .with_max_read_bytes(LARGEST)
        .with_max_object_header_bytes(1 << 20);
    let damaged =
        |e: hdf5_reader::error::Error| format!("not read as a MAT file of level 7.3: {e}");
    let file = Hdf5File::open_with_options(path, options).map_err(damaged)?;
    let root = file.root_group().map_err(damaged)?;
    let mut reader =
        Reader { root: root.clone(), referred: None, numbers_left: MOST_NUMBERS, references: 0 };
    let (groups, datasets) = root.member_names().map_err(damaged)?;
    let mut variables = Vec::new();
    // in the file's order: by name
    let mut names: Vec<String> = groups.into_iter().chain(datasets).collect();
    names.retain(|name| !name.starts_with('#'));
    names.sort();
    for name in names {
        let value = match root.dataset(&name) {
            Ok(dataset) => reader.dataset(&dataset, 0),
            Err(_) => root.group(&name).map_err(words).and_then(|group| reader.group(&group, 0)),
        };
        match value {
            Ok(value) => variables.push(Variable { name, value }),
            Err(damage) => remarks.push(format!("{name} cannot be read and is left out: {damage}")),
        }
    }
    Ok(variables)
}

fn words(error: hdf5_reader::error::Error) -> Damage {
    error.to_string()
}

/// Target of a reference.
enum Target {
    Dataset(Box<Dataset>),
    Group(Group),
}

/// Opens all possible targets of references, by address.
fn referred(root: &Group) -> Result<HashMap<u64, Target>, Damage> {
    let refs = root.group("#refs#").map_err(words)?;
    let (groups, datasets) = refs.member_names().map_err(words)?;
    let count = groups.len() + datasets.len();
    if count > MOST_REFERRED {
        return Err(format!(
            "#refs# has {count} objects; arrays of structures are read where it has {MOST_REFERRED} at most"
        ));
    }
    let (groups, datasets) = refs.members().map_err(words)?;
    let datasets = datasets.into_iter().map(|d| (d.address(), Target::Dataset(Box::new(d))));
    Ok(groups.into_iter().map(|g| (g.address(), Target::Group(g))).chain(datasets).collect())
}

struct Reader {
    root: Group,
    /// Targets of references, opened at the first reference.
    referred: Option<HashMap<u64, Target>>,
    numbers_left: usize,
    references: usize,
}

impl Reader {
    fn charge(&mut self, numbers: usize) -> Result<(), Damage> {
        let left = self.numbers_left.checked_sub(numbers.saturating_add(COST));
        self.numbers_left = left.ok_or_else(|| {
            format!("MAT files are read whole, up to {} million numbers", MOST_NUMBERS / 1_000_000)
        })?;
        Ok(())
    }

    /// A structure, or an array of them.
    fn group(&mut self, group: &Group, depth: u32) -> Result<Value, Damage> {
        if depth > DEEPEST {
            return Err(format!("structures are nested more than {DEEPEST} deep"));
        }
        self.charge(0)?;
        if let Some(what) = unread(group) {
            return Ok(Value::Unread(what));
        }
        let (groups, datasets) = group.members().map_err(words)?;
        let mut fields: Vec<(String, Vec<Value>)> = Vec::new();
        for inner in groups {
            let value = self.group(&inner, depth + 1)?;
            fields.push((inner.name().into(), vec![value]));
        }
        for dataset in datasets {
            let is_array = is_reference(dataset.dtype()) && class(&dataset).is_none();
            let values = match is_array {
                true => self.elements(&dataset, depth)?,
                false => vec![self.dataset(&dataset, depth)?],
            };
            fields.push((dataset.name().rsplit('/').next().unwrap_or("").into(), values));
        }
        let count = fields.iter().map(|(_, values)| values.len()).max().unwrap_or(0);
        Ok(Value::Structure(Structure { count, fields }))
    }

    /// A field of all elements of an array of structures.
    fn elements(&mut self, dataset: &Dataset, depth: u32) -> Result<Vec<Value>, Damage> {
        let addresses = dataset.read_raw_bytes().map_err(words)?;
        let addresses: Vec<u64> = addresses
            .chunks_exact(8)
            .filter_map(|a| Some(u64::from_le_bytes(*a.first_chunk()?)))
            .collect();
        self.references += addresses.len();
        if self.references > MOST_REFERENCES {
            return Err(format!("more than {MOST_REFERENCES} elements of arrays of structures"));
        }
        if self.referred.is_none() {
            self.referred = Some(referred(&self.root)?);
        }
        let mut values = Vec::new();
        for address in addresses {
            // removed from the map while it is read, so that cyclic references end
            let value = match self.referred.as_mut().and_then(|all| all.remove(&address)) {
                Some(Target::Dataset(dataset)) => {
                    let value = self.dataset(&dataset, depth + 1);
                    self.put_back(address, Target::Dataset(dataset));
                    value?
                }
                Some(Target::Group(group)) => {
                    let value = self.group(&group, depth + 1);
                    self.put_back(address, Target::Group(group));
                    value?
                }
                None => Value::Unread("a dangling reference".into()),
            };
            values.push(value);
        }
        Ok(values)
    }

    fn put_back(&mut self, address: u64, referred: Target) {
        if let Some(all) = &mut self.referred {
            all.insert(address, referred);
        }
    }

    /// A matrix; cell arrays and objects give [`Value::Unread`].
    fn dataset(&mut self, dataset: &Dataset, depth: u32) -> Result<Value, Damage> {
        self.charge(0)?;
        let class = class(dataset);
        if depth > DEEPEST {
            return Err(format!("structures are nested more than {DEEPEST} deep"));
        }
        let is_numeric = |class: &str| {
            let kinds = ["double", "single", "logical", "char"];
            kinds.contains(&class) || class.trim_start_matches('u').starts_with("int")
        };
        match class.as_deref() {
            Some("cell") => return Ok(Value::Unread("a cell array".into())),
            Some(other) if !is_numeric(other) => {
                return Ok(Value::Unread(format!("an object ({other})")));
            }
            _ => {}
        }
        let Some((storage, order)) = storage(dataset.dtype()) else {
            return Ok(Value::Unread("no matrix of real numbers".into()));
        };
        if dataset.attribute("MATLAB_empty").and_then(|a| a.read_as_f64()).is_ok_and(|e| e != 0.0) {
            return Ok(Value::Numbers(Matrix { dimensions: Vec::new(), values: Vec::new() }));
        }
        let count = dataset.num_elements().map_err(words)?;
        self.charge(usize::try_from(count).unwrap_or(usize::MAX))?;
        let values = storage.numbers(&dataset.read_raw_bytes().map_err(words)?, order);
        let dimensions: Vec<usize> = dataset.shape().iter().rev().map(|d| *d as usize).collect();
        if dimensions.iter().product::<usize>() != values.len() {
            return Err("its size is not that of its data".into());
        }
        if class.as_deref() == Some("char") {
            let code = |v: &f64| char::from_u32(*v as u32).unwrap_or('?');
            let characters: Vec<char> = values.iter().map(code).collect();
            return Ok(Value::of_characters(dimensions.first().copied().unwrap_or(0), &characters));
        }
        Ok(Value::Numbers(Matrix { dimensions, values }))
    }
}

/// MATLAB's name for a group that is not a structure.
fn unread(group: &Group) -> Option<String> {
    // a group with rows, columns and numbers is a sparse matrix
    if group.attribute("MATLAB_sparse").is_ok() {
        return Some("a sparse matrix".into());
    }
    let class = group.attribute("MATLAB_class").ok()?.read_string().ok()?;
    match class.trim_end_matches('\0') {
        "struct" => None,
        "function_handle" => Some("a function".into()),
        other => Some(format!("an object ({other})")),
    }
}

/// MATLAB's class name of a variable.
fn class(dataset: &Dataset) -> Option<String> {
    let text = dataset.attribute("MATLAB_class").ok()?.read_string().ok()?;
    Some(text.trim_end_matches('\0').to_string())
}

fn is_reference(kind: &Datatype) -> bool {
    matches!(kind, Datatype::Reference { ref_type: ReferenceType::Object, size: 8 })
}

/// Storage format of a matrix's numbers.
fn storage(kind: &Datatype) -> Option<(Storage, ByteOrder)> {
    use hdf5_reader::ByteOrder::BigEndian;
    let (storage, order) = match kind {
        Datatype::FixedPoint { size, signed, byte_order } => {
            let storage = match (size, signed) {
                (1, true) => Storage::Int8,
                (1, false) => Storage::Uint8,
                (2, true) => Storage::Int16,
                (2, false) => Storage::Uint16,
                (4, true) => Storage::Int32,
                (4, false) => Storage::Uint32,
                (8, true) => Storage::Int64,
                (8, false) => Storage::Uint64,
                _ => return None,
            };
            (storage, *byte_order)
        }
        Datatype::FloatingPoint { size: 4, byte_order } => (Storage::Single, *byte_order),
        Datatype::FloatingPoint { size: 8, byte_order } => (Storage::Double, *byte_order),
        _ => return None,
    };
    Some((storage, if order == BigEndian { ByteOrder::Big } else { ByteOrder::Little }))
}
