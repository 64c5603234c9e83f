//! Scale: counts of a device to SI units and back.

use serde::Deserialize;

/// Basic data type of an object or of an entry of process data (ETG.1000.6): BOOL, UNSIGNED or INTEGER.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum NumberType {
    /// One bit.
    Bool,
    /// 8 bit without a sign.
    U8,
    /// 8 bit with a sign.
    I8,
    /// 16 bit without a sign.
    U16,
    /// 16 bit with a sign.
    I16,
    /// 32 bit without a sign.
    U32,
    /// 32 bit with a sign.
    I32,
}

impl NumberType {
    /// Length \[bit\].
    pub fn bits(self) -> u8 {
        match self {
            Self::Bool => 1,
            Self::U8 | Self::I8 => 8,
            Self::U16 | Self::I16 => 16,
            Self::U32 | Self::I32 => 32,
        }
    }

    /// Whether it has a sign.
    pub fn is_signed(self) -> bool {
        matches!(self, Self::I8 | Self::I16 | Self::I32)
    }

    /// Smallest and largest number, both included.
    pub fn range(self) -> [i64; 2] {
        let values = 1_i64 << self.bits();
        if self.is_signed() { [-values / 2, values / 2 - 1] } else { [0, values - 1] }
    }

    /// Decodes raw bits as a number of this type, in two's complement; higher bits are ignored.
    pub fn number(self, bits: u64) -> i64 {
        let unused = 64 - u32::from(self.bits());
        if self.is_signed() {
            (bits << unused) as i64 >> unused
        } else {
            (bits << unused >> unused) as i64
        }
    }
}

/// Counts to SI units: value = sign · factor · counts + offset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Type of the counts.
    pub kind: NumberType,
    /// SI units per count, with the sign: positive where value and counts grow together.
    pub factor: f64,
    /// Value at zero counts \[SI unit\].
    pub offset: f64,
    /// Lowest and highest value \[SI unit\]; a measured value beyond it is out of range, a commanded one is limited.
    pub range: [f64; 2],
}

impl Scale {
    /// The value of counts \[SI unit\].
    pub fn value(&self, counts: i64) -> f64 {
        self.factor * counts as f64 + self.offset
    }

    /// The counts nearest to a value \[SI unit\]: (value − offset) / factor, rounded. The value is limited to the
    /// range, the counts to what the type can hold; zero counts for NaN.
    pub fn counts(&self, value: f64) -> i64 {
        let [low, high] = self.kind.range();
        let [lowest, highest] = self.range;
        let counts = (value.max(lowest).min(highest) - self.offset) / self.factor;
        if value.is_nan() { 0 } else { (counts.round() as i64).max(low).min(high) }
    }

    /// Whether a value \[SI unit\] lies within the range, ends included; false for NaN.
    pub fn has(&self, value: f64) -> bool {
        (self.range[0]..=self.range[1]).contains(&value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scaling_is_exact_to_half_a_count_and_limited_to_range_and_type() {
        let scale =
            Scale { kind: NumberType::I16, factor: -2e-3, offset: 5.0, range: [-20.0, 40.0] };
        for value in [-20.0, -3.333, 0.0, 4.999, 40.0] {
            let back = scale.value(scale.counts(value));
            assert!((back - value).abs() <= 1e-3 + 1e-12, "{value} became {back}");
        }
        assert_eq!(scale.counts(100.0), scale.counts(40.0));
        let wide = Scale { range: [-1e6, 1e6], ..scale };
        assert_eq!([wide.counts(-1e6), wide.counts(1e6)], [32767, -32768]);
        assert_eq!(wide.counts(f64::NAN), 0);
    }

    #[test]
    fn bits_are_decoded_by_their_number_type() {
        assert_eq!(NumberType::I16.number(0xffff), -1);
        assert_eq!(NumberType::U16.number(0xffff), 65535);
        assert_eq!(NumberType::I8.number(0x1_80), -128);
        assert_eq!(NumberType::Bool.range(), [0, 1]);
        assert_eq!(NumberType::I32.range(), [-2_147_483_648, 2_147_483_647]);
    }
}
