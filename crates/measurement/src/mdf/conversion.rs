//! Conversions of raw numbers to physical ones (`##CC`).

use super::block::{Blocks, Damage};
use std::io::{Read, Seek};

/// Largest number of pairs in a table.
const MOST_PAIRS: usize = 100_000;
/// Deepest nesting of conversions.
const DEEPEST: u32 = 4;

/// Conversion of a raw number to a physical one.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Conversion {
    Same,
    /// Offset and factor.
    Linear(f64, f64),
    /// A quotient of polynomials of second degree.
    Rational([f64; 6]),
    /// Pairs of raw and physical numbers, interpolated linearly or by the nearest pair.
    Table {
        pairs: Vec<(f64, f64)>,
        is_interpolated: bool,
    },
    /// Ranges of raw numbers with a value each, and the value outside all ranges.
    Ranges {
        ranges: Vec<(f64, f64, f64)>,
        otherwise: f64,
        /// Whether raw numbers are real: the upper end belongs to a range of integers only.
        is_real: bool,
    },
    /// Ranges of raw numbers with a text (not available, an error), which is no number, or with a further conversion;
    /// the same for numbers outside all ranges.
    Parts {
        ranges: Vec<(f64, f64, Option<Conversion>)>,
        otherwise: Option<Box<Conversion>>,
        is_real: bool,
    },
}

impl Conversion {
    /// Reads the conversion at a link, for raw numbers that are real or integer.
    ///
    /// # Errors
    ///
    /// Name of a conversion that gives no numbers.
    pub(super) fn at<R: Read + Seek>(
        file: &mut Blocks<R>,
        link: u64,
        is_real: bool,
    ) -> Result<Self, Damage> {
        let conversion = Self::within(file, link, is_real, 0)?;
        // texts for states: the raw numbers are kept
        Ok(if conversion.gives_numbers() { conversion } else { Self::Same })
    }

    fn within<R: Read + Seek>(
        file: &mut Blocks<R>,
        link: u64,
        is_real: bool,
        depth: u32,
    ) -> Result<Self, Damage> {
        if link == 0 {
            return Ok(Self::Same);
        }
        if depth > DEEPEST {
            return Err("conversions within conversions".into());
        }
        let block = file.block(link, &[b"##CC"])?;
        let kind = block.number(0, 1);
        let count = block.number(6, 2) as usize;
        let value = |k: usize| block.real(24 + 8 * k).ok_or("a conversion that is too short");
        let values = |from: usize, step: usize| -> Result<Vec<Vec<f64>>, Damage> {
            let rows = (count.saturating_sub(from) / step).min(MOST_PAIRS);
            let row = |k: usize| (0..step).map(|i| value(from + step * k + i)).collect();
            (0..rows).map(row).collect::<Result<_, &str>>().map_err(Damage::from)
        };
        Ok(match kind {
            0 => Self::Same,
            1 => Self::Linear(value(0)?, value(1)?),
            2 => {
                let mut p = [0.0; 6];
                for (k, p) in p.iter_mut().enumerate() {
                    *p = value(k)?;
                }
                Self::Rational(p)
            }
            4 | 5 => {
                let pairs: Vec<(f64, f64)> = values(0, 2)?.iter().map(|v| (v[0], v[1])).collect();
                if pairs.is_empty() {
                    return Err("a conversion by an empty table".into());
                }
                Self::Table { pairs, is_interpolated: kind == 4 }
            }
            6 => {
                let ranges = values(0, 3)?.iter().map(|v| (v[0], v[1], v[2])).collect();
                Self::Ranges { ranges, otherwise: value(count.saturating_sub(1))?, is_real }
            }
            7 | 8 => {
                let step = if kind == 7 { 1 } else { 2 };
                let ends = values(0, step)?;
                // a text, another conversion, or nothing; the last entry applies outside all ranges
                let mut part = |k: usize| -> Result<Option<Self>, Damage> {
                    let link = block.link(4 + k);
                    if link == 0 || !file.is_conversion(link)? {
                        return Ok(None);
                    }
                    Self::within(file, link, is_real, depth + 1).map(Some)
                };
                let range = |(k, v): (usize, &Vec<f64>)| Ok((v[0], v[step - 1], part(k)?));
                let ranges =
                    ends.iter().enumerate().map(range).collect::<Result<Vec<_>, Damage>>()?;
                let otherwise = part(ranges.len())?.map(Box::new);
                Self::Parts { ranges, otherwise, is_real }
            }
            3 => return Err("converted by a formula".into()),
            9 | 10 => return Err("a text".into()),
            other => return Err(format!("converted in way {other}")),
        })
    }

    /// The physical value of a raw number; NaN for none.
    pub(super) fn of(&self, raw: f64) -> f64 {
        match self {
            Self::Same => raw,
            Self::Linear(offset, factor) => offset + factor * raw,
            Self::Rational([a, b, c, d, e, f]) => {
                (a * raw * raw + b * raw + c) / (d * raw * raw + e * raw + f)
            }
            Self::Table { pairs, is_interpolated } => {
                let next = pairs.partition_point(|(x, _)| *x < raw);
                match (next.checked_sub(1).and_then(|k| pairs.get(k)), pairs.get(next)) {
                    (Some((x0, y0)), Some((x1, y1))) if *is_interpolated => {
                        y0 + (raw - x0) / (x1 - x0) * (y1 - y0)
                    }
                    (Some((x0, y0)), Some((x1, y1))) => {
                        if raw - x0 <= x1 - raw {
                            *y0
                        } else {
                            *y1
                        }
                    }
                    (Some((_, y)), None) | (None, Some((_, y))) => *y,
                    (None, None) => f64::NAN,
                }
            }
            Self::Ranges { ranges, otherwise, is_real } => {
                // an end shared by two ranges belongs to the second
                let within =
                    |(low, high, _): &&(f64, f64, f64)| is_within(raw, *low, *high, *is_real);
                ranges.iter().rfind(within).map_or(*otherwise, |(_, _, value)| *value)
            }
            Self::Parts { ranges, otherwise, is_real } => {
                let range =
                    ranges.iter().rfind(|(low, high, _)| is_within(raw, *low, *high, *is_real));
                let part = range.map_or(otherwise.as_deref(), |(_, _, part)| part.as_ref());
                part.map_or(f64::NAN, |part| part.of(raw))
            }
        }
    }

    /// Whether any raw number has a physical value.
    fn gives_numbers(&self) -> bool {
        match self {
            Self::Parts { ranges, otherwise, .. } => {
                let mut parts = ranges.iter().filter_map(|(_, _, part)| part.as_ref());
                parts.any(Self::gives_numbers)
                    || otherwise.as_deref().is_some_and(Self::gives_numbers)
            }
            _ => true,
        }
    }
}

/// Whether a raw number is in a range. The upper end belongs to ranges of integers, and to a range of a single value.
fn is_within(raw: f64, low: f64, high: f64, is_real: bool) -> bool {
    raw >= low && (raw < high || raw == high && (!is_real || low == high))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn raw_values_are_converted_to_physical_ones() {
        assert_eq!(Conversion::Linear(-40.0, 0.5).of(100.0), 10.0);
        // x = 2 raw / 4
        assert_eq!(Conversion::Rational([0.0, 2.0, 0.0, 0.0, 0.0, 4.0]).of(3.0), 1.5);
        let pairs = vec![(0.0, 10.0), (10.0, 20.0), (20.0, 0.0)];
        let table = |is_interpolated| Conversion::Table { pairs: pairs.clone(), is_interpolated };
        assert_eq!([-5.0, 5.0, 15.0, 99.0].map(|x| table(true).of(x)), [10.0, 15.0, 10.0, 0.0]);
        assert_eq!([4.0, 6.0, 10.0].map(|x| table(false).of(x)), [10.0, 20.0, 20.0]);
        // the upper end belongs to a range of integers; for reals it belongs to the next range
        let ranges = |is_real, upper| Conversion::Ranges {
            ranges: vec![(0.0, upper, 7.0), (2.0, 4.0, 8.0)],
            otherwise: -1.0,
            is_real,
        };
        let inputs = [1.0, 2.0, 4.0, 5.0];
        assert_eq!(inputs.map(|x| ranges(true, 2.0).of(x)), [7.0, 8.0, -1.0, -1.0]);
        assert_eq!(inputs.map(|x| ranges(false, 1.0).of(x)), [7.0, 8.0, 8.0, -1.0]);
        let linear = || Conversion::Linear(0.0, 0.125);
        let parts = |otherwise| Conversion::Parts {
            ranges: vec![(0.0, 64_255.0, Some(linear())), (64_256.0, 65_535.0, None)],
            otherwise,
            is_real: false,
        };
        assert_eq!(parts(None).of(8000.0), 1000.0);
        assert!([64_256.0, 65_535.0, 70_000.0].iter().all(|x| parts(None).of(*x).is_nan()));
        assert_eq!(parts(Some(Box::new(linear()))).of(80_000.0), 10_000.0);
    }
}
