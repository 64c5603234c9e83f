//! Parquet files: columns of numbers with a common time column. Only with the feature `parquet`.

use crate::channel::Measurement;
use crate::error::MeasurementError;
use crate::heading::Heading;
use crate::path;
use crate::recording::Recording;
use crate::sampled::Assembly;
use crate::thinning::MOST;
use crate::time_column::TimeColumn;
use crate::time_unit::{FAR, interval, resolve};
use parquet::basic::{ConvertedType, LogicalType, TimeUnit, Type};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::DataType;
use parquet::errors::Result as ParquetResult;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::schema::types::ColumnDescriptor;
use std::fs::File;
use std::path::Path;

/// Number of rows read at once.
const ROWS: usize = 1024;
/// Number of rows from which the time's unit is determined.
const FIRST: usize = 2000;
/// Largest number of columns.
const MOST_COLUMNS: usize = 4000;

/// A column of numbers.
struct Field {
    index: usize,
    heading: String,
    read: Heading,
    /// Logical type of a time, if the schema declares one.
    of_time: Option<OfTime>,
    /// Whether its integers are unsigned.
    is_unsigned: bool,
}

/// A column that the schema declares as a time.
#[derive(Clone, Copy)]
struct OfTime {
    /// Size of one unit of its numbers \[s\].
    factor: f64,
    /// Whether it is a date with a time; otherwise it is a time of day.
    is_stamp: bool,
}

/// Conversion of the time's numbers to seconds.
struct Clock {
    /// Offset subtracted from integers first: a double of nanoseconds since 1970 does not resolve fine fractions of a
    /// second.
    zero: i64,
    factor: f64,
    offset: f64,
}

/// Reads a Parquet file. The time is the column that `time` names, else a column of timestamps, else one named as a
/// time.
///
/// # Errors
///
/// [`MeasurementError`] if the file has no usable signal, with a description of its content.
pub(crate) fn read(
    path: &Path,
    time: Option<&TimeColumn>,
) -> Result<Measurement, MeasurementError> {
    let file = path.display().to_string();
    let format = |reason: String| MeasurementError::Format { file: file.clone(), reason };
    let source =
        File::open(path).map_err(|error| MeasurementError::File { file: file.clone(), error })?;
    let size = source
        .metadata()
        .map_err(|error| MeasurementError::File { file: file.clone(), error })?
        .len();
    let reader = SerializedFileReader::new(source)
        .map_err(|e| format(format!("not read as a Parquet file: {e}")))?;
    if !is_sound(&reader, size) {
        return Err(format("not read as a Parquet file: its columns do not lie within it".into()));
    }
    let mut remarks = Vec::new();
    let mut fields = fields(&reader, &mut remarks);
    if fields.len() > MOST_COLUMNS {
        return Err(format(format!("it has {} columns; {MOST_COLUMNS} are read", fields.len())));
    }
    let of_time = time_field(&fields, time).map_err(|reason| match time {
        Some(TimeColumn { column: Some(_), .. }) => {
            MeasurementError::Mapping { file: file.clone(), reason }
        }
        _ => format(reason),
    })?;
    let of_time = fields.remove(of_time);
    let clock = clock(&reader, &of_time, time, &mut remarks).map_err(format)?;
    let mut recording = Recording::new(fields.len(), MOST);
    let mut timeless = 0;
    let read = rows(&reader, &of_time, &fields, &clock, &mut recording, &mut timeless);
    if let Err(damage) = read {
        remarks.push(format!("it is damaged, and read up to there: {damage}"));
    }
    if timeless > 0 {
        remarks
            .push(format!("{timeless} rows have no time ({}) and are left out", of_time.heading));
    }
    let mut assembly = Assembly::new(&file, None, remarks);
    if clock.zero != 0 {
        assembly.remark("time is counted from the first sample".into());
    }
    let headings = fields.into_iter().map(|f| (f.heading, f.read)).collect();
    assembly.add_recorded(headings, recording.finish(&file, "row")?);
    assembly.finish()
}

/// Whether all column chunks lie within the file, which the library does not check.
fn is_sound(reader: &SerializedFileReader<File>, size: u64) -> bool {
    let within = |from: i64, count: i64| {
        let end = from.checked_add(count).and_then(|end| u64::try_from(end).ok());
        from >= 0 && count >= 0 && end.is_some_and(|end| end <= size)
    };
    let metadata = reader.metadata();
    let count = metadata.file_metadata().schema_descr().num_columns();
    metadata.row_groups().iter().all(|group| {
        group.num_columns() == count
            && group.columns().iter().all(|column| {
                let first = column.dictionary_page_offset().unwrap_or(column.data_page_offset());
                within(first, column.compressed_size()) && within(column.data_page_offset(), 0)
            })
    })
}

/// The numeric columns; other columns are named in a remark.
fn fields(reader: &SerializedFileReader<File>, remarks: &mut Vec<String>) -> Vec<Field> {
    let schema = reader.metadata().file_metadata().schema_descr();
    let (mut fields, mut others) = (Vec::new(), Vec::new());
    for (index, column) in schema.columns().iter().enumerate() {
        let heading = column.path().string();
        let is_number =
            !matches!(column.physical_type(), Type::BYTE_ARRAY | Type::FIXED_LEN_BYTE_ARRAY)
                && !matches!(column.logical_type_ref(), Some(LogicalType::Decimal(_)))
                && column.max_rep_level() == 0;
        match is_number {
            true => {
                let read = path::heading(&heading);
                let (of_time, is_unsigned) = (of_time(column), is_unsigned(column));
                fields.push(Field { index, heading, read, of_time, is_unsigned });
            }
            false => others.push(heading),
        }
    }
    if !others.is_empty() {
        let named: Vec<&str> = others.iter().take(5).map(String::as_str).collect();
        remarks.push(format!(
            "{} columns are no numbers and are left out: {}",
            others.len(),
            named.join(", ")
        ));
    }
    fields
}

/// Logical type of a time column; `None` for other columns.
fn of_time(column: &ColumnDescriptor) -> Option<OfTime> {
    let factor = |unit| match unit {
        TimeUnit::MILLIS => 1e-3,
        TimeUnit::MICROS => 1e-6,
        TimeUnit::NANOS => 1e-9,
    };
    let (factor, is_stamp) =
        match (column.logical_type_ref(), column.converted_type(), column.physical_type()) {
            (Some(LogicalType::Timestamp(of)), ..) => (factor(of.unit), true),
            (Some(LogicalType::Time(of)), ..) => (factor(of.unit), false),
            (_, ConvertedType::TIMESTAMP_MILLIS, _) => (1e-3, true),
            (_, ConvertedType::TIMESTAMP_MICROS, _) => (1e-6, true),
            (_, ConvertedType::TIME_MILLIS, _) => (1e-3, false),
            (_, ConvertedType::TIME_MICROS, _) => (1e-6, false),
            (_, _, Type::INT96) => (1e-9, true),
            _ => return None,
        };
    Some(OfTime { factor, is_stamp })
}

/// Whether a column's integers are unsigned: they are stored like signed ones of the same size.
fn is_unsigned(column: &ColumnDescriptor) -> bool {
    use ConvertedType::{UINT_8, UINT_16, UINT_32, UINT_64};
    match column.logical_type_ref() {
        Some(LogicalType::Integer(of)) => !of.is_signed,
        _ => matches!(column.converted_type(), UINT_8 | UINT_16 | UINT_32 | UINT_64),
    }
}

/// Determines the time column.
fn time_field(fields: &[Field], time: Option<&TimeColumn>) -> Result<usize, String> {
    let all = || fields.iter().map(|f| f.heading.as_str()).collect::<Vec<_>>().join(", ");
    if let Some(wanted) = time.and_then(|t| t.column.as_deref()) {
        let found = fields.iter().position(|f| f.heading == wanted || f.read.name == wanted);
        return found.ok_or_else(|| {
            format!("the mapping names \"{wanted}\" as the time; columns of numbers are: {}", all())
        });
    }
    let stamped = fields.iter().position(|f| f.of_time.is_some_and(|t| t.is_stamp));
    let named = || fields.iter().position(|f| f.read.is_named_as_time());
    let of_the_day = || fields.iter().position(|f| f.of_time.is_some());
    stamped.or_else(named).or_else(of_the_day).ok_or_else(|| {
        format!(
            "no column is a timestamp, a time of the day or named as a time; columns of numbers are: {}. Name one ([log] time = \"...\" in a mapping)",
            all()
        )
    })
}

/// Conversion of the time's numbers to seconds, as stated or determined from the first rows.
fn clock(
    reader: &SerializedFileReader<File>,
    time: &Field,
    stated: Option<&TimeColumn>,
    remarks: &mut Vec<String>,
) -> Result<Clock, String> {
    let mut first = Vec::new();
    for group in 0..reader.num_row_groups() {
        let group = reader.get_row_group(group).map_err(|e| e.to_string())?;
        let mut column = group.get_column_reader(time.index).map_err(|e| e.to_string())?;
        first.extend(numbers(&mut column, FIRST, 0, time.is_unsigned).map_err(|e| e.to_string())?);
        if first.len() >= FIRST {
            break;
        }
    }
    first.retain(|v| v.is_finite());
    let Some(begin) = first.first().copied() else {
        return Err(format!("{} has no numbers: it is no time", time.heading));
    };
    let own = time.of_time.map(|t| t.factor);
    let (unit, remark) = resolve(&time.heading, &time.read, stated, own, begin, interval(&first))?;
    remarks.extend(remark);
    let (scale, offset) = stated.map_or((1.0, 0.0), |s| (s.scale, s.offset));
    let is_far = (scale * begin + offset).abs() * unit > FAR;
    let zero = if is_far && begin.fract() == 0.0 { begin as i64 } else { 0 };
    let offset = if zero == 0 { offset * unit } else { 0.0 };
    Ok(Clock { zero, factor: scale * unit, offset })
}

/// Reads all rows; rows without a time are counted.
fn rows(
    reader: &SerializedFileReader<File>,
    time: &Field,
    fields: &[Field],
    clock: &Clock,
    recording: &mut Recording,
    timeless: &mut u64,
) -> ParquetResult<()> {
    let mut count = 0;
    let mut row = vec![f64::NAN; fields.len() + 1];
    for group in 0..reader.num_row_groups() {
        let group = reader.get_row_group(group)?;
        let mut times = group.get_column_reader(time.index)?;
        let columns = fields.iter().map(|f| group.get_column_reader(f.index));
        let mut columns = columns.collect::<ParquetResult<Vec<ColumnReader>>>()?;
        loop {
            let times = numbers(&mut times, ROWS, clock.zero, time.is_unsigned)?;
            if times.is_empty() {
                break;
            }
            let values = columns.iter_mut().zip(fields);
            let values = values.map(|(c, f)| numbers(c, times.len(), 0, f.is_unsigned));
            let values = values.collect::<ParquetResult<Vec<Vec<f64>>>>()?;
            for (k, number) in times.iter().enumerate() {
                count += 1;
                row[0] = number * clock.factor + clock.offset;
                for (place, column) in row[1..].iter_mut().zip(&values) {
                    *place = column.get(k).copied().unwrap_or(f64::NAN);
                }
                match row[0].is_finite() {
                    true => recording.push(count, &row),
                    false => *timeless += 1,
                }
            }
        }
    }
    Ok(())
}

/// The next numbers of a column, NaN for missing ones; `zero` is subtracted from integers.
fn numbers(
    column: &mut ColumnReader,
    rows: usize,
    zero: i64,
    is_unsigned: bool,
) -> ParquetResult<Vec<f64>> {
    // i128: an unsigned number minus the offset may exceed 64 bits
    let from_zero = |value: i128| (value - i128::from(zero)) as f64;
    match column {
        ColumnReader::BoolColumnReader(c) => typed(c, rows, |v| f64::from(u8::from(*v))),
        ColumnReader::Int32ColumnReader(c) => typed(c, rows, |v| match is_unsigned {
            true => from_zero((*v as u32).into()),
            false => from_zero((*v).into()),
        }),
        ColumnReader::Int64ColumnReader(c) => typed(c, rows, |v| match is_unsigned {
            true => from_zero((*v as u64).into()),
            false => from_zero((*v).into()),
        }),
        ColumnReader::Int96ColumnReader(c) => typed(c, rows, |v| from_zero(v.to_nanos().into())),
        ColumnReader::FloatColumnReader(c) => typed(c, rows, |v| f64::from(*v) - zero as f64),
        ColumnReader::DoubleColumnReader(c) => typed(c, rows, |v| v - zero as f64),
        ColumnReader::ByteArrayColumnReader(_) | ColumnReader::FixedLenByteArrayColumnReader(_) => {
            Ok(Vec::new())
        }
    }
}

fn typed<T: DataType>(
    column: &mut ColumnReaderImpl<T>,
    rows: usize,
    number: impl Fn(&T::T) -> f64,
) -> ParquetResult<Vec<f64>> {
    let (mut values, mut levels) = (Vec::new(), Vec::new());
    let (records, count, _) = column.read_records(rows, Some(&mut levels), None, &mut values)?;
    let finite = |v: &T::T| Some(number(v)).filter(|v| v.is_finite()).unwrap_or(f64::NAN);
    let mut there = values.iter().take(count).map(finite);
    // in a column with missing values, the deepest definition level marks a row with a value
    let deepest = levels.iter().copied().max().unwrap_or(0);
    if levels.len() < records || count == records {
        return Ok(there.collect());
    }
    let cell = |level: &i16| match *level == deepest && count > 0 {
        true => there.next().unwrap_or(f64::NAN),
        false => f64::NAN,
    };
    Ok(levels.iter().take(records).map(cell).collect())
}
