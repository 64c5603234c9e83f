//! Conversions of raw numbers into physical ones (`##CC`).

use super::block::{Blocks, Damage};
use std::io::{Read, Seek};

/// Pairs of a table, at most.
const MOST_PAIRS: usize = 100_000;
/// Conversions within conversions, at most.
const DEEPEST: u32 = 4;

/// How a raw number becomes a physical one.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Conversion {
    Same,
    /// Offset and factor.
    Linear(f64, f64),
    /// A quotient of polynomials of second degree.
    Rational([f64; 6]),
    /// Pairs of raw and physical numbers; between them it is interpolated or the nearest.
    Table {
        pairs: Vec<(f64, f64)>,
        is_interpolated: bool,
    },
    /// Ranges of raw numbers, and what is outside of all.
    Ranges {
        ranges: Vec<(f64, f64, f64)>,
        otherwise: f64,
    },
    /// Ranges that mean a text (not available, an error): no number. The others are converted in turn.
    Texts {
        ranges: Vec<(f64, f64)>,
        otherwise: Box<Conversion>,
    },
}

impl Conversion {
    /// The conversion at a link, with what it says of the unit.
    ///
    /// # Errors
    ///
    /// What it is, where it gives no numbers.
    pub(super) fn at<R: Read + Seek>(file: &mut Blocks<R>, link: u64) -> Result<Self, Damage> {
        Self::within(file, link, 0)
    }

    fn within<R: Read + Seek>(file: &mut Blocks<R>, link: u64, depth: u32) -> Result<Self, Damage> {
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
                Self::Ranges { ranges, otherwise: value(count.saturating_sub(1))? }
            }
            7 | 8 => {
                let step = if kind == 7 { 1 } else { 2 };
                let ranges: Vec<(f64, f64)> =
                    values(0, step)?.iter().map(|v| (v[0], v[step - 1])).collect();
                // the last reference is for what is in no range
                let otherwise = block.link(4 + ranges.len());
                let is_text = otherwise == 0 || file.head(otherwise)?.id != *b"##CC";
                if is_text {
                    // states without numbers: the raw ones tell them apart
                    return Ok(Self::Same);
                }
                let otherwise = Box::new(Self::within(file, otherwise, depth + 1)?);
                Self::Texts { ranges, otherwise }
            }
            3 => return Err("converted by a formula".into()),
            9 | 10 => return Err("a text".into()),
            other => return Err(format!("converted in way {other}")),
        })
    }

    /// The physical number of a raw one; NaN for none.
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
            Self::Ranges { ranges, otherwise } => {
                // of real numbers the upper end belongs to the next range
                let within = ranges.iter().rfind(|(low, high, _)| (*low..=*high).contains(&raw));
                within.map_or(*otherwise, |(_, _, value)| *value)
            }
            Self::Texts { ranges, otherwise } => {
                match ranges.iter().any(|(low, high)| (*low..=*high).contains(&raw)) {
                    true => f64::NAN,
                    false => otherwise.of(raw),
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn raw_numbers_become_physical_ones() {
        assert_eq!(Conversion::Linear(-40.0, 0.5).of(100.0), 10.0);
        // x = 2 raw / 4
        assert_eq!(Conversion::Rational([0.0, 2.0, 0.0, 0.0, 0.0, 4.0]).of(3.0), 1.5);
        let pairs = vec![(0.0, 10.0), (10.0, 20.0), (20.0, 0.0)];
        let table = |is_interpolated| Conversion::Table { pairs: pairs.clone(), is_interpolated };
        assert_eq!([-5.0, 5.0, 15.0, 99.0].map(|x| table(true).of(x)), [10.0, 15.0, 10.0, 0.0]);
        assert_eq!([4.0, 6.0, 10.0].map(|x| table(false).of(x)), [10.0, 20.0, 20.0]);
        let ranges =
            Conversion::Ranges { ranges: vec![(0.0, 2.0, 7.0), (2.0, 4.0, 8.0)], otherwise: -1.0 };
        assert_eq!([1.0, 2.0, 5.0].map(|x| ranges.of(x)), [7.0, 8.0, -1.0]);
        let linear = Box::new(Conversion::Linear(0.0, 0.1));
        let texts = Conversion::Texts { ranges: vec![(255.0, 255.0)], otherwise: linear };
        assert!(texts.of(255.0).is_nan() && (texts.of(30.0) - 3.0).abs() < 1e-12);
    }
}
